"""Effects of positions, noise, stamps and antenna of a receiver on a drive; of its velocities: `gnss_velocity`.

::

    lever_arm          the antenna is (x, y, z) from its stated place
    gnss_noise_scale   white errors · ratio (true ÷ reported sd)
    correlated_gnss    position + g: Gauss–Markov of `sd` and `time_constant`, each of north, east, down
    gnss_outliers      `fraction` of the positions off by `size` sds in a random direction, in runs
    time_offset        p_meas(t) = p(t − delay), v_meas(t) = v(t − delay): stamps are late by `delay`
    clock_drift        that delay changes by `rate` a second, and is 0 in the middle of the fixes
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from models.earth import ned_between
from models.effects.drive.base import (
    ANTENNA_STAGE,
    ERROR_STAGE,
    NOISE_STAGE,
    STAMP_STAGE,
    Correction,
    DriveEffect,
    DriveSamples,
    direction,
)
from models.effects.static.base import (
    log_uniform,
    require_between,
    require_finite,
    require_not_negative,
    require_positive,
    sign,
)

MAX_FRACTION = 0.95
"""Largest share of fixes that may be wrong."""
SD_MODEL_PARAMETER = re.compile(
    r"(position|velocity)_((horizontal|vertical)(_class_\d+)?|edge_[1-9]\d*|solution_\d+|exponent|typical)"
)
"""Names of the numbers by which true sds follow from reported ones (`tuner.navigation.fix_sd_model`)."""


@dataclass(frozen=True)
class LeverArm(DriveEffect):
    """An antenna away from its stated place.

    Attributes
    ----------
    x, y, z : float
        Forward, right, down, m.
    """

    name: ClassVar[str] = "lever_arm"
    stage: ClassVar[int] = ANTENNA_STAGE
    is_constant: ClassVar[bool] = True
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __post_init__(self) -> None:
        require_finite(x=self.x, y=self.y, z=self.z)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that moves the antenna, too."""
        return replace(correction, lever_arm=np.array([values.get(axis, 0.0) for axis in "xyz"]))

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Move the antenna; the errors of the fixes stay."""
        a = drive.lever_arm
        arm = (a[0] + self.x, a[1] + self.y, a[2] + self.z)
        llh, vel = drive.course.antenna(drive.fix_t, a)
        there, faster = drive.course.antenna(drive.fix_t, arm)
        return replace(drive.moved(ned_between(there, llh), faster - vel), lever_arm=arm)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.05 … 3 m in a random direction."""
        return cls(*(log_uniform(rng, 0.05, 3.0) * direction(rng)).tolist())


@dataclass(frozen=True)
class GnssNoiseScale(DriveEffect):
    """Fixes whose errors differ from the reported sds by factors.

    Attributes
    ----------
    position_horizontal, position_vertical, velocity_horizontal, velocity_vertical : float
        True ÷ reported sd.
    """

    name: ClassVar[str] = "gnss_noise_scale"
    stage: ClassVar[int] = NOISE_STAGE
    position_horizontal: float = 1.0
    position_vertical: float = 1.0
    velocity_horizontal: float = 1.0
    velocity_vertical: float = 1.0

    @classmethod
    def is_parameter_of_compensation(cls, name: str) -> bool:
        """Whether a compensation may have a value of this name: a factor, or a number of a model of the sds."""
        return bool(SD_MODEL_PARAMETER.fullmatch(name))

    def __post_init__(self) -> None:
        require_positive(**{f.name: getattr(self, f.name) for f in fields(self)})

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Scale the white errors where they are known.

        Else errors are added where a ratio exceeds 1, and the reported sd is raised where it is below.
        """
        p, v = self.position_horizontal, self.velocity_horizontal
        ratio = np.array([p, p, self.position_vertical, v, v, self.velocity_vertical])
        if drive.fix_white is not None:
            change = (ratio - 1.0) * drive.fix_white
            return replace(drive.moved(change[:, :3], change[:, 3:]), fix_white=drive.fix_white + change)
        sd = np.hstack([drive.position_sd, drive.velocity_sd])
        more = np.sqrt(np.maximum(ratio**2 - 1.0, 0.0)) * np.nan_to_num(sd)
        change = more * rng.standard_normal(sd.shape)
        reported_sd = sd / np.minimum(ratio, 1.0)
        return replace(
            drive.moved(change[:, :3], change[:, 3:]),
            position_sd=reported_sd[:, :3],
            velocity_sd=reported_sd[:, 3:],
        )

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.3 … 3, one ratio for position and one for velocity."""
        position, velocity = log_uniform(rng, 0.3, 3.0), log_uniform(rng, 0.3, 3.0)
        return cls(position, position, velocity, velocity)


@dataclass(frozen=True)
class CorrelatedGnss(DriveEffect):
    """Position errors that are correlated in time.

    Attributes
    ----------
    sd : float
        Stationary standard deviation along each of north, east, down, m.
    time_constant : float
        s.
    """

    name: ClassVar[str] = "correlated_gnss"
    stage: ClassVar[int] = ERROR_STAGE
    sd: float
    time_constant: float

    def __post_init__(self) -> None:
        require_not_negative(sd=self.sd)
        require_positive(time_constant=self.time_constant)

    def signal(self, t: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return stationary paths at increasing times t, shape (k, 3), m."""
        decay = np.exp(-np.diff(t) / self.time_constant)
        drive = np.sqrt(1.0 - decay**2)
        paths = rng.standard_normal((len(t), 3))
        for i in range(1, len(t)):
            paths[i] = decay[i - 1] * paths[i - 1] + drive[i - 1] * paths[i]
        return np.asarray(self.sd * paths)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Add a path to the positions."""
        return drive.moved(self.signal(drive.fix_t, rng), np.zeros_like(drive.vel_n))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.2 … 3 reported sds (of 1 m where there are none), 5 … 300 s."""
        reported = drive.position_sd[np.isfinite(drive.position_sd)]
        unit = float(np.median(reported)) if len(reported) else 1.0
        return cls(unit * log_uniform(rng, 0.2, 3.0), log_uniform(rng, 5.0, 300.0))


@dataclass(frozen=True)
class GnssOutliers(DriveEffect):
    """Positions that are wrong, one or some in a row.

    Attributes
    ----------
    fraction : float
        Share of the fixes, at most `MAX_FRACTION`.
    size : float
        Length of the error, in reported sds.
    run : int
        Fixes in a row.
    """

    name: ClassVar[str] = "gnss_outliers"
    stage: ClassVar[int] = ERROR_STAGE
    fraction: float
    size: float = 10.0
    run: int = 1

    def __post_init__(self) -> None:
        require_between(0.0, MAX_FRACTION, fraction=self.fraction)
        require_not_negative(size=self.size)
        require_positive(run=self.run)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Displace runs of fixes, each run in a direction of its own."""
        if not np.isfinite(drive.position_sd).all():
            raise ValueError("'size' is in reported sds; the receiver reports none")
        k = len(drive.fix_t)
        hit = rng.random(-(-k // self.run)) < self.fraction
        ways = np.array([direction(rng) for _ in hit]).reshape(-1, 3)
        off = np.repeat(np.where(hit[:, None], self.size * ways, 0.0), self.run, axis=0)[:k]
        return drive.moved(off * drive.position_sd, np.zeros_like(drive.vel_n))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.1 … 5 %, 4 … 50 sds, 1 … 10 in a row."""
        return cls(log_uniform(rng, 1e-3, 5e-2), log_uniform(rng, 4.0, 50.0), int(rng.integers(1, 11)))


@dataclass(frozen=True)
class TimeOffset(DriveEffect):
    """Stamps of the fixes that are late.

    Attributes
    ----------
    delay : float
        s.
    """

    name: ClassVar[str] = "time_offset"
    stage: ClassVar[int] = STAMP_STAGE
    is_constant: ClassVar[bool] = True
    delay: float

    def __post_init__(self) -> None:
        require_finite(delay=self.delay)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that shifts the stamps of the fixes, too."""
        return replace(correction, fix_delay=values.get("delay", 0.0))

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Stamp every fix later; those outside the inertial record are lost."""
        return _stamped(drive, drive.fix_t + self.delay, "delay", self.delay)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of ± 3 … 300 ms."""
        return cls(sign(rng) * log_uniform(rng, 3e-3, 0.3))


@dataclass(frozen=True)
class ClockDrift(DriveEffect):
    """A clock of the receiver that runs faster than that of the inertial unit.

    Attributes
    ----------
    rate : float
        Seconds that the stamps of the fixes gain in a second; above −1.
    """

    name: ClassVar[str] = "clock_drift"
    stage: ClassVar[int] = STAMP_STAGE
    is_constant: ClassVar[bool] = True
    rate: float

    def __post_init__(self) -> None:
        require_between(-1.0, 1.0, rate=self.rate)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that stretches the stamps of the fixes, too."""
        return replace(correction, fix_delay_rate=values.get("rate", 0.0))

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Stamp fixes later and later; those outside the inertial record are lost."""
        t = drive.fix_t + self.rate * (drive.fix_t - middle_of(drive.fix_t))
        return _stamped(drive, t, "rate", self.rate)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of ± 10 … 1000 ppm: crystals to clocks of operating systems."""
        return cls(sign(rng) * log_uniform(rng, 1e-5, 1e-3))


def middle_of(t: FloatArray) -> float:
    """Return the time halfway between the first and the last of rising stamps, 0 where there is none."""
    return 0.5 * float(t[0] + t[-1]) if len(t) else 0.0


def without_drift(t: FloatArray, rate: float) -> FloatArray:
    """Return stamps t (k,) of a clock whose delay grows by `rate` a second, without that; s."""
    return np.asarray(t - rate * (t - middle_of(t)))


def _stamped(drive: DriveSamples, t: FloatArray, name: str, value: float) -> DriveSamples:
    """Return a drive with other stamps of its fixes, without those outside the inertial record."""
    kept = (t >= drive.t[0]) & (t <= drive.t[-1])
    if not kept.any():
        raise ValueError(
            f"'{name}' must leave fixes within the record, {drive.t[-1] - drive.t[0]:.6g} s, got {value}"
        )
    columns = {name: getattr(drive, name)[kept] for name in ("llh", "vel_n", "position_sd", "velocity_sd")}
    white = None if drive.fix_white is None else drive.fix_white[kept]
    return replace(drive, fix_t=t[kept], fix_white=white, **columns)
