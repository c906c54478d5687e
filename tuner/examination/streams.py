"""Streams of readings, each declared by what it measures of a motion."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import metres_per_radian
from tuner.examination.windows import WINDOW_LENGTH, Inertial, Motion
from tuner.types.records import Gnss


@dataclass(frozen=True)
class Stream(ABC):
    """Readings of one quantity.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Stamps, s.
    values : ndarray, shape (k, d)
        Readings; a row with NaN is none.
    sd : ndarray, shape (k, d), or None
        Standard deviations as they are reported.
    name : str
        What a reader calls it.
    arm : tuple of 3 floats
        From the inertial unit to what reads, in the axes of the unit, m.
    log_scale : float or ndarray, shape (k,)
        Logarithm of the Jacobian of the values by the recorded ones, whose density is wanted: values that are made
        smaller have a larger density.
    delay, drift : float
        What was taken out of the stamps, s, and how much it grew in a second.

    A class says what it measures by `seen`, and its `groups` of components that have one noise.
    """

    t: FloatArray
    values: FloatArray
    sd: FloatArray | None = None
    name: str = "readings"
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    log_scale: float | FloatArray = 0.0
    delay: float = 0.0
    drift: float = 0.0
    unit: ClassVar[str] = ""
    groups: ClassVar[tuple[tuple[str, tuple[int, ...]], ...]] = (("", (0, 1)), ("vertical", (2,)))
    usual: ClassVar[tuple[float, float]] = (1.0, 10.0)
    """Sd of a right reading and of a wrong one, from which the estimation begins."""

    @abstractmethod
    def seen(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the readings that a motion predicts, shape (m, d), and their derivatives, shape (m, d, u)."""

    def by_time(self, motion: Motion) -> FloatArray:
        """Return how fast it changes, shape (m, d), a second; zeros where no delay of it is looked for."""
        return np.zeros((len(motion.rate), self.values.shape[1]))

    def by_arm(self, motion: Motion) -> FloatArray:
        """Return the derivatives by its lever arm, shape (m, d, 3); zeros where it has none."""
        return np.zeros((len(motion.rate), self.values.shape[1], 3))

    def local(self, place: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the readings in the coordinates of windows, given the place of each one's, shape (k, 3)."""
        return self.values

    @property
    def readings(self) -> NDArray[np.bool_]:
        """Which rows hold a reading, shape (k,): none that repeats the row before, and none where all are the same."""
        there, repeats = np.isfinite(self.values).all(axis=1), repeated(self.values)
        return np.asarray(there & ~repeats & ~repeats[1:].all())

    @property
    def interval(self) -> float:
        """Usual time from one reading to the next, s; infinite where there are not two."""
        t = self.t[self.readings]
        return float(np.median(np.diff(t))) if len(t) > 1 else math.inf

    def with_values(self, values: FloatArray, log_scale: float | FloatArray = 0.0) -> Self:
        """Return the stream with other values, and the logarithm of their Jacobian by those before."""
        return replace(self, values=values, log_scale=self.log_scale + log_scale)

    def later(self, delay: float, drift: float = 0.0, middle: float = 0.0) -> Self:
        """Return the stream as if its readings had been made so much later, s, and more each second from a time on."""
        t = self.t + delay + drift * (self.t - middle)
        return replace(self, t=t, delay=self.delay - delay, drift=self.drift - drift)


def repeated(values: FloatArray) -> NDArray[np.bool_]:
    """Return which rows repeat the one before exactly."""
    return np.append(False, np.all(np.diff(values, axis=0) == 0.0, axis=1)).astype(bool)


class Positions(Stream):
    """Latitude, longitude, rad, height, m."""

    unit = "m"
    usual = (2.0, 30.0)

    def seen(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the position of the antenna."""
        return motion.position + self.by_arm(motion) @ np.array(self.arm), motion.by_position

    def by_time(self, motion: Motion) -> FloatArray:
        """Return the velocity of the antenna."""
        return np.asarray(motion.velocity + motion.attitude @ rotation.skew(motion.rate) @ np.array(self.arm))

    def by_arm(self, motion: Motion) -> FloatArray:
        """Return the attitude."""
        return motion.attitude

    def with_values(self, values: FloatArray, log_scale: float | FloatArray = 0.0) -> Self:
        """Return the stream with other values.

        Densities are those of metres; longer radians earn nothing, as any length explains a vehicle that stands. One
        reading of a window only says where the window begins: its density is that of no prediction, whatever the unit.
        """
        before, after = (np.abs(metres_per_radian(x)).prod(axis=1) for x in (self.values, values))
        predicted = max(1.0 - self.interval / WINDOW_LENGTH, 0.0)
        return super().with_values(
            values, predicted * (log_scale + np.minimum(np.nan_to_num(np.log(after / before)), 0.0))
        )

    def local(self, place: FloatArray) -> FloatArray:
        """Return north, east, down from the place of each window, m."""
        middle = place.copy()
        middle[:, 0] = 0.5 * (place[:, 0] + self.values[:, 0])
        return (self.values - place) * metres_per_radian(middle)


class Velocities(Stream):
    """North, east, down, m/s."""

    unit = "m/s"
    usual = (0.2, 5.0)

    def seen(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return the velocity of the antenna."""
        turn = motion.attitude @ rotation.skew(motion.rate)
        return self._own(motion.velocity + turn @ np.array(self.arm)), self._own(motion.by_velocity)

    def by_time(self, motion: Motion) -> FloatArray:
        """Return the acceleration of the antenna."""
        turn = rotation.skew(motion.rate)
        swing = turn @ turn + rotation.skew(motion.rate_change)
        return self._own(motion.acceleration + motion.attitude @ swing @ np.array(self.arm))

    def by_arm(self, motion: Motion) -> FloatArray:
        """Return what the rate of turn makes of an arm."""
        return self._own(motion.attitude @ rotation.skew(motion.rate))

    def _own(self, values: FloatArray) -> FloatArray:
        """Return the components that are read."""
        return np.asarray(values[:, : self.values.shape[1]])


class HorizontalVelocities(Velocities):
    """North, east, m/s: all that speed and course say."""

    groups = (("", (0, 1)),)


@dataclass(frozen=True)
class Streams:
    """What was recorded together: an inertial unit and streams of readings, on one clock."""

    imu: Inertial
    positions: Positions
    others: tuple[Stream, ...] = ()

    @property
    def all(self) -> tuple[Stream, ...]:
        """Every stream of readings, the positions first."""
        return (self.positions, *self.others)

    def changed(self, change: Callable[[Stream], Stream], name: str | None = None) -> Streams:
        """Return the same with each stream of readings changed, or that of a name."""
        positions, *others = (change(one) if name in (None, one.name) else one for one in self.all)
        assert isinstance(positions, Positions)
        return Streams(self.imu, positions, tuple(others))


def receiver_streams(
    gnss: Gnss, arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[Positions, tuple[Stream, ...]]:
    """Return the positions of a receiver, and its velocities where it has any; `arm` as of `Stream`."""
    sds = [x if np.isfinite(x).any() else None for x in (gnss.position_sd, gnss.velocity_sd)]
    positions = Positions(gnss.t, gnss.llh, sds[0], "fixes", arm)
    whole = np.isfinite(gnss.vel_n).all(axis=1).sum() > 0.5 * gnss.has_velocity.sum()
    kind, many = (Velocities, 3) if whole else (HorizontalVelocities, 2)
    sd = None if sds[1] is None else sds[1][:, :many]
    velocities = kind(gnss.t, gnss.vel_n[:, :many], sd, "velocities", arm)
    return positions, ((velocities,) if gnss.has_velocity.any() else ())
