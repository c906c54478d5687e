"""Effects of the inertial unit on a drive, and of gravity.

::

    gravity            f − Cᵀ e_D offset
    mounting           R (ω, f)                     R = Rz(yaw) Ry(pitch) Rx(roll)
    gyro_scale         (I + diag(x, y, z)) ω        accel_scale the same of f
    misalignment       R ω: the gyros are rotated against the accelerometers
    g_sensitivity      ω + G f                      rows of G: xx xy xz, yx yy yz, zx zy zz
    imu_noise_scale    white noise · ratio (true ÷ assumed density)
    bias_jump          (x, y, z) from `time` on, in the gyros or the accelerometers

ω and f are true values where the errors of the unit are known, else measured ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Self

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.effects.drive.base import (
    AXES_STAGE,
    BIAS_STAGE,
    FORCE_STAGE,
    MOUNT_STAGE,
    NOISE_STAGE,
    Correction,
    DriveEffect,
    DriveSamples,
    direction,
)
from models.effects.static.base import log_uniform, require_finite, require_positive, sign
from models.robust import normal_sd

SENSOR_NAMES = ("gyro", "accel")
ANGLE_NAMES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Gravity(DriveEffect):
    """Gravity is larger than the model says.

    Attributes
    ----------
    offset : float
        m/s².
    """

    name: ClassVar[str] = "gravity"
    stage: ClassVar[int] = FORCE_STAGE
    is_constant: ClassVar[bool] = True
    offset: float

    def __post_init__(self) -> None:
        require_finite(offset=self.offset)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Take the excess off the specific force, along the vertical in the middle of each interval."""
        middle = drive.t - 0.5 * np.diff(drive.t, prepend=2.0 * drive.t[0] - drive.t[1])
        down = drive.course.mat_nb(middle)[:, 2, :]
        change = np.zeros_like(drive.rates)
        change[:, 3:] = -self.offset * (down if drive.mounting is None else down @ drive.mounting.T)
        return drive.felt(change)

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return the correction with the excess in the gravity of the filter."""
        return replace(correction, gravity_excess=values.get("offset", 0.0))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of ± 1 … 500 mGal."""
        return cls(sign(rng) * log_uniform(rng, 1e-5, 5e-3))


@dataclass(frozen=True)
class Turn(DriveEffect):
    """A rotation by Euler angles.

    Attributes
    ----------
    roll, pitch, yaw : float
        rad.
    """

    is_constant: ClassVar[bool] = True
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    def __post_init__(self) -> None:
        require_finite(roll=self.roll, pitch=self.pitch, yaw=self.yaw)

    @property
    def matrix(self) -> FloatArray:
        """R, shape (3, 3)."""
        return rotation.mat_from_rpy((self.roll, self.pitch, self.yaw))


@dataclass(frozen=True)
class Mounting(Turn):
    """A unit mounted in the vehicle at unknown angles."""

    name: ClassVar[str] = "mounting"
    stage: ClassVar[int] = MOUNT_STAGE

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that takes out the mounting error, too."""
        return replace(correction, mounting=cls(**values).matrix)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Turn both triads."""
        true = drive.truth
        turned = np.hstack([true[:, :3] @ self.matrix.T, true[:, 3:] @ self.matrix.T])
        return drive.felt(turned - true)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.1 … 5°, about a random axis."""
        return cls(*(np.radians(log_uniform(rng, 0.1, 5.0)) * direction(rng)).tolist())


@dataclass(frozen=True)
class Misalignment(Turn):
    """The gyros are turned against the accelerometers."""

    name: ClassVar[str] = "misalignment"
    stage: ClassVar[int] = AXES_STAGE

    @classmethod
    def sensor_error(cls, name: str) -> FloatArray:
        """Return E (6, 6) of a small rotation of the gyros."""
        error = np.zeros((6, 6))
        error[:3, :3] = rotation.skew(np.eye(3)[ANGLE_NAMES.index(name)])
        return error

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that takes out the misalignment, too, a rotation of any size."""
        matrix = correction.sensor_matrix.copy()
        matrix[:3, :3] = cls(**values).matrix @ matrix[:3, :3]
        return replace(correction, sensor_matrix=matrix)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Turn the gyros."""
        omega = drive.truth[:, :3]
        return drive.felt(np.hstack([omega @ self.matrix.T - omega, np.zeros_like(omega)]))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 0.5 … 20 mrad, about a random axis."""
        return cls(*(log_uniform(rng, 5e-4, 2e-2) * direction(rng)).tolist())


@dataclass(frozen=True)
class _Scale(DriveEffect):
    """Scale factor errors of a triad.

    Attributes
    ----------
    x, y, z : float
        Measured ÷ true, less one.
    """

    first: ClassVar[int]
    stage: ClassVar[int] = AXES_STAGE
    is_constant: ClassVar[bool] = True
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __post_init__(self) -> None:
        require_finite(x=self.x, y=self.y, z=self.z)

    @classmethod
    def sensor_error(cls, name: str) -> FloatArray:
        """Return E (6, 6) of one axis."""
        error, i = np.zeros((6, 6)), cls.first + "xyz".index(name)
        error[i, i] = 1.0
        return error

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Scale the triad."""
        change, own = np.zeros_like(drive.rates), slice(self.first, self.first + 3)
        change[:, own] = drive.truth[:, own] * np.array([self.x, self.y, self.z])
        return drive.felt(change)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 100 … 10 000 ppm, in a random direction."""
        return cls(*(log_uniform(rng, 1e-4, 1e-2) * direction(rng)).tolist())


@dataclass(frozen=True)
class GyroScale(_Scale):
    """Scale factor errors of the gyros."""

    name: ClassVar[str] = "gyro_scale"
    first: ClassVar[int] = 0


@dataclass(frozen=True)
class AccelScale(_Scale):
    """Scale factor errors of the accelerometers."""

    name: ClassVar[str] = "accel_scale"
    first: ClassVar[int] = 3


@dataclass(frozen=True)
class GSensitivity(DriveEffect):
    """Gyros that feel specific force.

    Attributes
    ----------
    xx … zz : float
        Row and column of G, rad/s per m/s².
    """

    name: ClassVar[str] = "g_sensitivity"
    stage: ClassVar[int] = AXES_STAGE
    is_constant: ClassVar[bool] = True
    xx: float = 0.0
    xy: float = 0.0
    xz: float = 0.0
    yx: float = 0.0
    yy: float = 0.0
    yz: float = 0.0
    zx: float = 0.0
    zy: float = 0.0
    zz: float = 0.0

    def __post_init__(self) -> None:
        require_finite(**{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def sensor_error(cls, name: str) -> FloatArray:
        """Return E (6, 6) of one element of G."""
        error = np.zeros((6, 6))
        error["xyz".index(name[0]), 3 + "xyz".index(name[1])] = 1.0
        return error

    @property
    def matrix(self) -> FloatArray:
        """G, shape (3, 3)."""
        return np.array([getattr(self, f.name) for f in fields(self)]).reshape(3, 3)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Add G f to the rates."""
        change = np.zeros_like(drive.rates)
        change[:, :3] = drive.truth[:, 3:] @ self.matrix.T
        return drive.felt(change)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of norm 1e-5 … 1e-3 rad/s per m/s² (0.006 … 0.6 deg/s/g), in a random direction."""
        g = rng.standard_normal(9)
        return cls(*(log_uniform(rng, 1e-5, 1e-3) * g / np.linalg.norm(g)).tolist())


@dataclass(frozen=True)
class ImuNoiseScale(DriveEffect):
    """White noise that is not what the filter assumes.

    Attributes
    ----------
    gyro, accel : float
        True ÷ assumed density.
    """

    name: ClassVar[str] = "imu_noise_scale"
    stage: ClassVar[int] = NOISE_STAGE
    gyro: float = 1.0
    accel: float = 1.0

    def __post_init__(self) -> None:
        require_positive(gyro=self.gyro, accel=self.accel)

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Scale the white noise where it is known; else add as much as is missing, for ratios ≥ 1.

        The noise of a measured unit is then estimated by the median of its second differences.
        """
        ratio = np.repeat([self.gyro, self.accel], 3)
        if drive.white is not None:
            change = (ratio - 1.0) * drive.white
            return drive.erring(change, white=drive.white + change)
        if np.any(ratio < 1.0):
            raise ValueError("'gyro' and 'accel' must be 1 or more where the noise is not known apart")
        second = np.diff(drive.rates, 2, axis=0)
        sd = normal_sd(second, axis=0) / np.sqrt(6.0)
        return drive.erring(np.sqrt(ratio**2 - 1.0) * sd * rng.standard_normal(drive.rates.shape))

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 1.3 … 5 each."""
        return cls(log_uniform(rng, 1.3, 5.0), log_uniform(rng, 1.3, 5.0))


@dataclass(frozen=True)
class BiasJump(DriveEffect):
    """A bias that jumps once.

    Attributes
    ----------
    time : float
        On the clock of the drive, s.
    x, y, z : float
        rad/s or m/s².
    sensor : str
        ``gyro`` or ``accel``.
    """

    name: ClassVar[str] = "bias_jump"
    stage: ClassVar[int] = BIAS_STAGE
    time: float
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    sensor: str = "gyro"

    def __post_init__(self) -> None:
        require_finite(time=self.time, x=self.x, y=self.y, z=self.z)
        if self.sensor not in SENSOR_NAMES:
            raise ValueError(f"'sensor' must be one of {', '.join(SENSOR_NAMES)}; got '{self.sensor}'")

    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Add the jump to the samples whose interval lies after it."""
        jump = np.zeros(6)
        jump[3 * SENSOR_NAMES.index(self.sensor) :][:3] = self.x, self.y, self.z
        return drive.erring(np.where(drive.t[:, None] > self.time, jump, 0.0), white=drive.white)

    @classmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Draw an effect of 5 … 200 deg/h or 0.1 … 5 mg in a random direction, in the middle 60 % of the drive."""
        time = float(drive.t[0] + rng.uniform(0.2, 0.8) * (drive.t[-1] - drive.t[0]))
        sensor = str(rng.choice(SENSOR_NAMES))
        size = log_uniform(rng, 2.5e-5, 1e-3) if sensor == "gyro" else log_uniform(rng, 1e-3, 5e-2)
        x, y, z = (size * direction(rng)).tolist()
        return cls(time, x, y, z, sensor)
