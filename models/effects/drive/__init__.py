"""The causes that a drive can show, by their codes: make one, read one from text, draw one, hide several.

==================  ====================================================================  ==========
code                parameters                                                            module
==================  ====================================================================  ==========
time_offset         delay: p_meas(t) = p(t − delay)                                       receiver
clock_drift         rate: seconds by which the delay grows in one                         receiver
velocity_lag        delay                                                                 receiver
lever_arm           x, y, z                                                               receiver
correlated_gnss     sd, time_constant                                                     receiver
gnss_noise_scale    position_horizontal, position_vertical, velocity_horizontal,          receiver
                    velocity_vertical: true ÷ reported sd
gnss_outliers       fraction                                                              receiver
gnss_velocity       fraction, rms                                                         receiver
gnss_frame          roll, pitch, yaw                                                      receiver
velocity_scale      factor                                                                receiver
vertical_velocity   offset: velocity down less the rate at which heights fall             receiver
imu_noise_scale     gyro, accel: true ÷ assumed density                                   unit
gyro_scale          x, y, z                                                               unit
accel_scale         x, y, z                                                               unit
misalignment        roll, pitch, yaw                                                      unit
g_sensitivity       xx … zz                                                               unit
mounting            roll, pitch, yaw                                                      unit
gravity             offset                                                                unit
bias_jump           time, x, y, z                                                         unit
==================  ====================================================================  ==========

Some have one further parameter that no finding reports: the size of outliers, the sensor that jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from inspect import isabstract
from typing import Any

import numpy as np

from models.effects import parsing as text
from models.effects.drive.base import DriveEffect, DriveSamples
from models.effects.drive.gnss import (
    ClockDrift,
    CorrelatedGnss,
    GnssNoiseScale,
    GnssOutliers,
    LeverArm,
    TimeOffset,
)
from models.effects.drive.gnss_velocity import (
    GnssFrame,
    GnssVelocity,
    VelocityLag,
    VelocityScale,
    VerticalVelocity,
)
from models.effects.drive.imu import (
    AccelScale,
    BiasJump,
    Gravity,
    GSensitivity,
    GyroScale,
    ImuNoiseScale,
    Misalignment,
    Mounting,
)
from models.effects.drive.true_trajectory import Course
from models.registry import Registry

__all__ = ["EFFECTS", "Course", "DriveEffect", "DriveSamples", "draw", "hide", "parse"]


def _effect_of(declared: Any) -> type[DriveEffect] | None:
    """Return the effect of what an entry point names: that of a cause, None where it has none, or an effect."""
    effect: type[DriveEffect] | None = getattr(declared, "effect", declared)
    return effect


def _complete(effect: type[DriveEffect]) -> None:
    """Refuse what is not an effect that can be applied and drawn."""
    if not (isinstance(effect, type) and issubclass(effect, DriveEffect)) or isabstract(effect):
        raise TypeError(
            f"expected a class of effects (models.effects.drive.base.DriveEffect) with apply and draw, got {effect!r}"
        )


EFFECTS: Registry[type[DriveEffect]] = Registry(
    "cause of a drive",
    "tuner.drive_causes",
    name_of=lambda effect: effect.name,
    check=_complete,
    declared_by=_effect_of,
)
"""Class of every effect on a drive, by the code of its cause, in the order in which sensor errors are composed."""
EFFECTS.extend(
    (
        TimeOffset, ClockDrift, VelocityLag, LeverArm, CorrelatedGnss, GnssNoiseScale, GnssOutliers, GnssVelocity,
        GnssFrame, VelocityScale, VerticalVelocity, ImuNoiseScale, GyroScale, AccelScale, Misalignment, GSensitivity,
        Mounting, Gravity, BiasJump,
    )
)  # fmt: skip


def parse(written: str) -> DriveEffect:
    """Read an effect from text such as ``time_offset:delay=0.05`` (see `models.effects.parsing`)."""
    return text.parse(written, EFFECTS)


def draw(code: str, rng: np.random.Generator, drive: DriveSamples) -> DriveEffect:
    """Draw the parameters of a cause at random, in the range that its class states."""
    return text.kind(code, EFFECTS).draw(rng, drive)


def hide(drive: DriveSamples, effects: Sequence[DriveEffect], rng: np.random.Generator) -> DriveSamples:
    """Hide effects in a drive, in the order of their stages; each has a stream of its own from `rng`."""
    for effect, stream in sorted(
        zip(effects, rng.spawn(len(effects)), strict=True), key=lambda pair: pair[0].stage
    ):
        drive = effect.apply(drive, stream)
    return drive
