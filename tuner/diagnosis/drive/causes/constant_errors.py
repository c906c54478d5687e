"""Causes that are constants of the receiver or of the sensors: sensitivities, priors and words.

Priors are about what units and installations differ by in practice (`prior_sd`); `largest` is beyond what the linear
model describes or any product shows.
"""

from __future__ import annotations

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.effects.drive import gnss, gnss_velocity, imu
from tuner.diagnosis.drive.causes.base import ConstantCause, FixGeometry

AXIS_NAMES, ANGLE_NAMES = ("x", "y", "z"), ("roll", "pitch", "yaw")


def _columns(position: FloatArray | None, velocity: FloatArray) -> FloatArray:
    """Return D (k, 6, p) from the shifts of positions and velocities, (k, 3, p) each; no positions where None."""
    return np.concatenate([np.zeros_like(velocity) if position is None else position, velocity], axis=1)


class TimeOffset(ConstantCause):
    """Stamps of the fixes that are late: δp = −v, δv = −a for each second."""

    cause = "time_offset"
    effect = gnss.TimeOffset
    channels = ("gnss",)
    meaning = "stamps of positions and velocities are {late|early}, by {delay}, {}"
    consequence = "shift the stamps of the recording, or give the filter a state for the delay, not both"
    units = dict.fromkeys(("delay",), "s")
    prior_sd, largest = 0.1, 3.0

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 1)."""
        return _columns(-geometry.velocity[:, :, None], -geometry.acceleration[:, :, None])


class ClockDrift(ConstantCause):
    """Stamps of the fixes that get later and later: δp = −v (t − t₀), δv = −a (t − t₀) for each second a second."""

    cause = "clock_drift"
    effect = gnss.ClockDrift
    channels = ("gnss",)
    meaning = "the clock of the fixes runs at another rate, their delay {grows|shrinks} by {rate} s a second"
    consequence = "stretch the stamps, or take both from one clock"
    units = dict.fromkeys(("rate",), "1")
    prior_sd, largest = 1e-4, 0.01

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 1)."""
        return TimeOffset.fix_sensitivity(geometry) * geometry.since[:, None, None]


class VelocityLag(ConstantCause):
    """Velocities later than the positions beside them: δv = −a for each second."""

    cause = "velocity_lag"
    effect = gnss_velocity.VelocityLag
    channels = ("gnss",)
    meaning = (
        "velocities are {later|earlier} than the positions beside them, by {delay}, "
        "as behind a filter of the receiver"
    )
    consequence = "use each velocity at its own time"
    units = dict.fromkeys(("delay",), "s")
    prior_sd, largest = 0.1, 1.5

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 1)."""
        return _columns(None, -geometry.acceleration[:, :, None])


class LeverArm(ConstantCause):
    """An antenna away from its stated place: δp = C, δv = [ω ×] C for each metre."""

    cause = "lever_arm"
    effect = gnss.LeverArm
    channels = ("gnss",)
    meaning = "the antenna is not where the settings have it, off by {}"
    consequence = "correct the lever arm by this much, or give the filter states for it"
    units = dict.fromkeys(AXIS_NAMES, "m")
    prior_sd, largest = 1.0, 10.0

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 3)."""
        return _columns(geometry.mat_nb, rotation.skew(geometry.rate) @ geometry.mat_nb)


class GnssFrame(ConstantCause):
    """Velocities in axes turned against north-east-down: δv = −[v ×] for each radian."""

    cause = "gnss_frame"
    effect = gnss_velocity.GnssFrame
    channels = ("gnss",)
    meaning = "velocities are given in axes turned against north-east-down, by {}"
    consequence = "turn the velocities back"
    units = dict.fromkeys(ANGLE_NAMES, "rad")
    prior_sd, largest = 0.02, 3.2

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 3)."""
        return _columns(None, -rotation.skew(geometry.velocity))


class VelocityScale(ConstantCause):
    """Velocities too large by a factor: δv = v for each unit."""

    cause = "velocity_scale"
    effect = gnss_velocity.VelocityScale
    channels = ("gnss",)
    meaning = "velocities are not to scale, too {large|small} by {factor} of them"
    consequence = "scale the velocities"
    units = dict.fromkeys(("factor",), "1")
    prior_sd, largest = 0.02, 0.2

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 1)."""
        return _columns(None, geometry.velocity[:, :, None])


class VerticalVelocity(ConstantCause):
    """Vertical velocities that contradict the heights by a constant: δv_D = 1 for each unit."""

    cause = "vertical_velocity"
    effect = gnss_velocity.VerticalVelocity
    channels = ("gnss",)
    meaning = "velocities down exceed the rate at which the heights fall, by {offset}"
    consequence = "subtract it from the vertical velocities, or do not use them"
    units = dict.fromkeys(("offset",), "m/s")
    prior_sd, largest = 0.1, 2.0

    @classmethod
    def fix_sensitivity(cls, geometry: FixGeometry) -> FloatArray:
        """Return D (k, 6, 1)."""
        down = np.zeros((*geometry.velocity.shape, 1))
        down[:, 2] = 1.0
        return _columns(None, down)


class GyroScale(ConstantCause):
    """Scale factor errors of the gyros."""

    cause = "gyro_scale"
    effect = imu.GyroScale
    channels = ("gyro",)
    meaning = "scale factors of the gyros are off, by {}"
    consequence = "calibrate, or three states"
    units = dict.fromkeys(AXIS_NAMES, "1")
    prior_sd, largest = 5e-3, 0.1


class AccelScale(ConstantCause):
    """Scale factor errors of the accelerometers."""

    cause = "accel_scale"
    effect = imu.AccelScale
    channels = ("accel",)
    meaning = "scale factors of the accelerometers are off, by {}"
    consequence = "calibrate, or three states"
    units = dict.fromkeys(AXIS_NAMES, "1")
    prior_sd, largest = 5e-3, 0.1


class Misalignment(ConstantCause):
    """Gyros whose axes are turned against those of the accelerometers."""

    cause = "misalignment"
    effect = imu.Misalignment
    channels = ("gyro",)
    meaning = "the axes of the gyros are turned against those of the accelerometers, by {}"
    consequence = "calibrate, or give the filter states for the misalignment"
    units = dict.fromkeys(ANGLE_NAMES, "rad")
    prior_sd, largest = 1e-2, 0.2


class GSensitivity(ConstantCause):
    """Gyros that respond to specific force (g-sensitivity)."""

    cause = "g_sensitivity"
    effect = imu.GSensitivity
    channels = ("gyro",)
    meaning = "the gyros feel specific force, by {}"
    consequence = "calibrate, or nine states"
    units = dict.fromkeys([a + b for a in AXIS_NAMES for b in AXIS_NAMES], "rad/s/(m/s^2)")
    prior_sd, largest = 2e-4, 0.01


class Gravity(ConstantCause):
    """Gravity that differs from the model."""

    cause = "gravity"
    effect = imu.Gravity
    channels = ("imu",)
    meaning = "gravity differs from the model, by {offset}"
    consequence = "a better model of gravity, or a state"
    units = dict.fromkeys(("offset",), "m/s^2")
    prior_sd, largest = 1e-3, 0.02
    down_acceleration = 1.0
