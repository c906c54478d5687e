"""Base of the effects that a drive can hide: each is a map from a drive to a drive.

The unit measures rates (ω, f) = true + errors, the receiver fixes = truth + errors, as in `models.imu_errors`
and `models.measurements`. An effect acts at one stage: on the true rates, on the axes of the unit, on its noise and
biases, on the antenna, on the errors of the receiver, on its frame, on its stamps. In a simulated drive the
errors are known, so that a factor applies to the truth alone; in a measured one it applies to what was
measured, and noise can only be added.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from models.earth import llh_displaced
from models.effects.drive.true_trajectory import Course
from models.effects.parsing import Written

(
    FORCE_STAGE,
    MOUNT_STAGE,
    AXES_STAGE,
    NOISE_STAGE,
    BIAS_STAGE,
    ANTENNA_STAGE,
    LAG_STAGE,
    ERROR_STAGE,
    FRAME_STAGE,
    STAMP_STAGE,
) = range(10)
"""Stages, in the order in which effects act."""


@dataclass(frozen=True)
class DriveSamples:
    """Inertial samples and fixes on one clock (SI).

    Attributes
    ----------
    t : ndarray, shape (n,)
        Stamps, s; a sample is the mean since the one before.
    rates : ndarray, shape (n, 6)
        Angular rates and specific forces in the axes of the sensor.
    fix_t : ndarray, shape (k,)
        Stamps of the fixes, s.
    llh, vel_n : ndarray, shape (k, 3)
        Fixes; NaN where there is no velocity.
    position_sd, velocity_sd : ndarray, shape (k, 3)
        As the receiver reports them, north, east, down.
    course : Course
        The truth, or the best that is known of it.
    lever_arm : tuple of 3 floats
        From the inertial unit to the antenna, in axes of the vehicle, m.
    mounting : ndarray, shape (3, 3), optional
        Rotates axes of the vehicle into those of the sensor; by default they are the same.
    errors, white : ndarray, shape (n, 6), optional
        Errors of the unit, and the white part of them, where they are known.
    fix_white : ndarray, shape (k, 6), optional
        White errors of the fixes, north, east, down, m and m/s, where they are known.
    """

    t: FloatArray
    rates: FloatArray
    fix_t: FloatArray
    llh: FloatArray
    vel_n: FloatArray
    position_sd: FloatArray
    velocity_sd: FloatArray
    course: Course
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mounting: FloatArray | None = None
    errors: FloatArray | None = None
    white: FloatArray | None = None
    fix_white: FloatArray | None = None

    def __post_init__(self) -> None:
        n, k = len(self.t), len(self.fix_t)
        shapes = {
            "rates": (n, 6),
            "llh": (k, 3),
            "vel_n": (k, 3),
            "position_sd": (k, 3),
            "velocity_sd": (k, 3),
        }
        shapes |= {"errors": (n, 6), "white": (n, 6), "fix_white": (k, 6)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise ValueError(f"'{name}' must have shape {shape}, got {value.shape}")

    @property
    def truth(self) -> FloatArray:
        """Rates less the errors that are known, shape (n, 6)."""
        return self.rates if self.errors is None else self.rates - self.errors

    def felt(self, change: FloatArray) -> DriveSamples:
        """Return the drive with a change, (n, 6), of what the unit feels."""
        return replace(self, rates=self.rates + change)

    def erring(self, change: FloatArray, *, white: FloatArray | None = None) -> DriveSamples:
        """Return the drive with a change, (n, 6), of the errors of the unit, and its new white part."""
        errors = None if self.errors is None else self.errors + change
        return replace(self, rates=self.rates + change, errors=errors, white=white)

    def moved(self, metres: FloatArray, speed: FloatArray) -> DriveSamples:
        """Return the drive with fixes displaced by metres north, east, down, and m/s; shapes (k, 3)."""
        return replace(self, llh=llh_displaced(self.llh, metres), vel_n=self.vel_n + speed)


@dataclass(frozen=True)
class Correction:
    """What has to be changed in a drive, and in its filter, to take known causes out of it.

    Attributes
    ----------
    sensor_matrix : ndarray, shape (6, 6)
        A with measured (ω, f) = A true, in the axes of the sensor.
    fix_delay : float
        Fixes of stamp t are those of t − fix_delay, s.
    fix_delay_rate : float
        Change of that delay in a second, which is `fix_delay` in the middle of the fixes.
    velocity_lag : float
        Velocities are so much later than the positions beside them, s.
    velocity_rotation : ndarray, shape (3, 3)
        R with v_reported = R v.
    velocity_offset : ndarray, shape (3,)
        What v_reported is larger besides, north, east, down, m/s.
    lever_arm : ndarray, shape (3,)
        True lever arm less the stated one, in the axes of the sensor, m.
    mounting : ndarray, shape (3, 3)
        R with true mounting = stated mounting R.
    gravity_excess : float
        Gravity less that of the formula, m/s².
    """

    sensor_matrix: FloatArray = field(default_factory=lambda: np.eye(6))
    fix_delay: float = 0.0
    fix_delay_rate: float = 0.0
    velocity_lag: float = 0.0
    velocity_rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    velocity_offset: FloatArray = field(default_factory=lambda: np.zeros(3))
    lever_arm: FloatArray = field(default_factory=lambda: np.zeros(3))
    mounting: FloatArray = field(default_factory=lambda: np.eye(3))
    gravity_excess: float = 0.0


@dataclass(frozen=True)
class DriveEffect(Written, ABC):
    """One cause with its parameters (the fields), in SI units."""

    stage: ClassVar[int]
    is_constant: ClassVar[bool] = False
    """Whether constants describe the cause, so that it can be taken out of a drive."""

    @classmethod
    def is_parameter_of_compensation(cls, name: str) -> bool:
        """Whether a compensation may have a value of this name: of a constant cause, its fields."""
        return cls.is_constant and name in {f.name for f in fields(cls)}

    @classmethod
    def sensor_error(cls, name: str) -> FloatArray:
        """Return E (6, 6): one unit of a parameter changes measured rates and forces by E (ω, f), to first order."""
        return np.zeros((6, 6))

    @classmethod
    def corrected(cls, correction: Correction, values: Mapping[str, float]) -> Correction:
        """Return a correction of a drive that takes out the cause, too; by default only its errors of the sensors.

        Parameters
        ----------
        correction : Correction
            Of the causes declared before this one.
        values : mapping of str to float
            Parameters of the cause, those that are not 0.
        """
        matrix = correction.sensor_matrix + sum(
            value * cls.sensor_error(name) for name, value in values.items()
        )
        return replace(correction, sensor_matrix=np.asarray(matrix))

    @abstractmethod
    def apply(self, drive: DriveSamples, rng: np.random.Generator) -> DriveSamples:
        """Return the drive with the effect in it."""

    @classmethod
    @abstractmethod
    def draw(cls, rng: np.random.Generator, drive: DriveSamples) -> Self:
        """Return the effect with random parameters, sized by the drive they are meant for."""


def direction(rng: np.random.Generator) -> FloatArray:
    """Return a random unit vector, shape (3,)."""
    vector = rng.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))
