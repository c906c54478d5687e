"""Effects of the velocities of a receiver on a drive.

::

    velocity_lag       v_meas(t) = v(t − delay)
    gnss_velocity      `fraction` of the velocities off by a normal vector of length `rms`
    gnss_frame         v_meas = R v                 R = Rz(yaw) Ry(pitch) Rx(roll) in north-east-down
    velocity_scale     v_meas = (1 + factor) v
    vertical_velocity  down component of v_meas too large by `offset`
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from models.effects.drive.base import (
    ERROR_STAGE,
    FRAME_STAGE,
    LAG_STAGE,
    Correction,
    DriveEffect,
    DriveSamples,
    direction,
)
from models.effects.drive.gnss import MAX_FRACTION
from models.effects.drive.imu import Turn
from models.effects.static.base import (
    log_uniform,
    require_between,
    require_finite,
    require_not_negative,
    sign,
)


@dataclass(frozen=True)
class VelocityLag(DriveEffect):
    """Velocities that lag behind positions, as behind a filter of the receiver.

    Attributes
    ----------
    delay : float
        s.
    """

    name: ClassVar[str] = "velocity_lag"
    stage: ClassVar[int] = LAG_STAGE
    is_constant: ClassVar[bool] = True
    delay: float

    def __post_init__(self) -> None:
        require_finite(delay=self.delay)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that brings velocities to the time of their positions, too."""
        return replace(correction, velocity_lag=values.get("delay", 0.0))

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Give each fix the velocity of an earlier time."""
        _, now = drive.course.antenna(drive.fix_t, drive.lever_arm)
        _, earlier = drive.course.antenna(drive.fix_t - self.delay, drive.lever_arm)
        return drive.moved(np.zeros_like(now), earlier - now)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of ± 0.01 … 0.5 s."""
        return cls(sign(rng) * log_uniform(rng, 0.01, 0.5))


@dataclass(frozen=True)
class GnssVelocity(DriveEffect):
    """Velocities that do not belong to the positions.

    Attributes
    ----------
    fraction : float
        Share of the fixes, at most `MAX_FRACTION`.
    rms : float
        Root mean square length of the error of such a fix, m/s.
    """

    name: ClassVar[str] = "gnss_velocity"
    stage: ClassVar[int] = ERROR_STAGE
    fraction: float
    rms: float

    def __post_init__(self) -> None:
        require_between(0.0, MAX_FRACTION, fraction=self.fraction)
        require_not_negative(rms=self.rms)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Add normal errors to some velocities."""
        hit = rng.random(len(drive.fix_t)) < self.fraction
        error = self.rms / np.sqrt(3.0) * rng.standard_normal(drive.vel_n.shape)
        return drive.moved(np.zeros_like(error), np.where(hit[:, None], error, 0.0))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 1 … 30 %, 0.5 … 10 m/s."""
        return cls(log_uniform(rng, 0.01, 0.3), log_uniform(rng, 0.5, 10.0))


@dataclass(frozen=True)
class GnssFrame(Turn):
    """Velocities in a frame that is turned against north-east-down."""

    name: ClassVar[str] = "gnss_frame"
    stage: ClassVar[int] = FRAME_STAGE

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that turns the velocities back, too."""
        return replace(correction, velocity_rotation=cls(**values).matrix)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Turn the velocities."""
        return replace(drive, vel_n=drive.vel_n @ self.matrix.T)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.05 … 3° about a random axis."""
        return cls(*(np.radians(log_uniform(rng, 0.05, 3.0)) * direction(rng)).tolist())


@dataclass(frozen=True)
class VelocityScale(DriveEffect):
    """Velocities that are too large or too small by a factor: an odometer's radius, a receiver's smoothing.

    Attributes
    ----------
    factor : float
        Reported velocity over the true one, less 1.
    """

    name: ClassVar[str] = "velocity_scale"
    stage: ClassVar[int] = FRAME_STAGE
    is_constant: ClassVar[bool] = True
    factor: float = 0.0

    def __post_init__(self) -> None:
        require_finite(factor=self.factor)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that divides the velocities, too."""
        scale = 1.0 + values.get("factor", 0.0)
        return replace(correction, velocity_rotation=correction.velocity_rotation / scale)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Scale the velocities."""
        return replace(drive, vel_n=(1.0 + self.factor) * drive.vel_n)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of ± 0.3 … 5 %."""
        return cls(sign(rng) * log_uniform(rng, 3e-3, 0.05))


@dataclass(frozen=True)
class VerticalVelocity(DriveEffect):
    """Vertical velocities that contradict the heights by a constant: of a smoother, or of another datum of Doppler.

    Attributes
    ----------
    offset : float
        Reported velocity down less the rate at which the heights fall, m/s.
    """

    name: ClassVar[str] = "vertical_velocity"
    stage: ClassVar[int] = FRAME_STAGE
    is_constant: ClassVar[bool] = True
    offset: float = 0.0

    def __post_init__(self) -> None:
        require_finite(offset=self.offset)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that subtracts it, too."""
        return replace(correction, velocity_offset=np.array([0.0, 0.0, values.get("offset", 0.0)]))

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Add it to the velocities down."""
        return replace(drive, vel_n=drive.vel_n + np.array([0.0, 0.0, self.offset]))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of ± 0.03 … 0.5 m/s."""
        return cls(sign(rng) * log_uniform(rng, 0.03, 0.5))
