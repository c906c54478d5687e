"""Units of a drive against one another: velocities, heights and positions, turns of the gyros and of the course.

Two series of one quantity, a = k s + noise and b = s + noise, hold their factor k between the two regressions, each
of which is pulled one way by the noise of one of them::

    Σ ab / Σ bb  ≤  k  ≤  Σ aa / Σ ab

Where nothing moves, that is all numbers. Each end has its own error by leaving out one block of time after another
(jackknife [1]_). A factor is another one only where both ends, at a chance of `CHANCE` each, are further from 1 than
`ALIKE`, by which good sensors and receivers may differ; the units that lie between the ends have its name.

Mean velocities are held against displacements (`legs`); turns about the vertical, which the mean specific force
tells, against turns of the course.

References
----------
.. [1] B. Efron, The Jackknife, the Bootstrap and Other Resampling Plans, SIAM, 1982.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from models.units import DEG, unit_value
from tuner.navigation.initial import STANDING, velocities
from tuner.navigation.legs import WINDOW, Legs, legs, windows
from tuner.records import DataError, Drive, Gnss

FloatArray = NDArray[np.float64]

TURN = 4.0
"""Time over which turns are compared, s."""
BLOCK, FEWEST, MOST = 2.0, 4, 20
"""Least length of a block, in windows, and how few and how many there are."""
CHANCE = 1e-6
"""Chance that one end of a factor is beyond its limit by its scatter alone."""
ALIKE = 1.25
"""Factors up to this are none of units: a receiver that smooths, a sensor with a scale error."""
NEAR = 1.03
"""A unit may lie outside the interval by this factor."""
ANY = 30.0
"""Factors beyond this are refused whatever the unit."""

VELOCITY_UNITS = {
    unit: 1.0 / unit_value(key)
    for unit, key in (
        ("km/h", "km/h"),
        ("knots", "kn"),
        ("mph", "mph"),
        ("ft/s", "ft/s"),
        ("cm/s", "cm/s"),
        ("mm/s", "mm/s"),
    )
}
HEIGHT_UNITS = {unit: 1.0 / unit_value(unit) for unit in ("ft", "cm", "mm", "km")}
RATE_UNITS: Mapping[str, float] = {
    "deg/s": 1.0 / DEG,
    "mrad/s": 1e3,
    "mdeg/s": 1e3 / DEG,
    "rad/s taken for deg/s": DEG,
}
"""How many make 1 m/s, 1 m, 1 rad/s."""


@dataclass(frozen=True)
class Factor:
    """How many times too large something is.

    Attributes
    ----------
    low, high : float
        The two regressions.
    interval : tuple of 2 floats
        95 % beyond them.
    least, most : float
        `CHANCE` beyond them.
    """

    low: float
    high: float
    interval: tuple[float, float]
    least: float
    most: float

    @property
    def other(self) -> bool:
        """Whether it is not 1."""
        return self.least > ALIKE or self.most < 1.0 / ALIKE

    @property
    def value(self) -> float:
        """The middle of the two regressions."""
        return float(np.sqrt(self.low * self.high))

    def among(self, units: Mapping[str, float]) -> str:
        """Return the units that it may be, "" for none."""
        low, high = self.interval
        return " or ".join(u for u, k in units.items() if low / NEAR < k < high * NEAR)

    def inverse(self) -> Factor:
        """Return how many times too large the other is."""
        low, high = self.interval
        return Factor(
            1.0 / self.high, 1.0 / self.low, (1.0 / high, 1.0 / low), 1.0 / self.most, 1.0 / self.least
        )

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:#.3g} ({low:#.3g} … {high:#.3g}) times"


def factor(a: FloatArray, b: FloatArray, t: FloatArray, window: float) -> Factor | None:
    """Return how many times b series a is, whatever the sign; (w, p) each over windows of a length from t (w,), s."""
    blocks = min(MOST, int((t[-1] - t[0]) / (BLOCK * window))) if len(t) else 0
    if blocks < FEWEST:
        return None
    block = np.minimum(((t - t[0]) / (t[-1] - t[0]) * blocks).astype(int), blocks - 1)
    products = np.stack([np.sum(x * y, axis=-1) for x, y in ((a, a), (a, b), (b, b))], axis=-1)
    sums = np.zeros((blocks, 3))
    np.add.at(sums, block, products)
    sums *= np.array([1.0, np.sign(sums[:, 1].sum()), 1.0])
    without = sums.sum(axis=0) - sums
    if not (without > 0.0).all():
        return None
    logs = np.log(np.vstack([sums.sum(axis=0), without]))
    ends = np.stack([logs[:, 1] - logs[:, 2], logs[:, 0] - logs[:, 1]], axis=-1)
    low, high = ends[0]
    sd = np.sqrt((blocks - 1.0) / blocks * np.sum((ends[1:] - ends[1:].mean(axis=0)) ** 2, axis=0))
    usual, far = (float(student.isf(p, blocks - 1)) * sd for p in (0.025, CHANCE))
    end = np.exp(
        [low, high, low - usual[0], high + usual[1], *np.clip([low - far[0], high + far[1]], -700.0, 700.0)]
    )
    return Factor(float(end[0]), float(end[1]), (float(end[2]), float(end[3])), float(end[4]), float(end[5]))


def velocity_factor(legs: Legs) -> Factor | None:
    """Return how many times too large the velocities are by the positions, north and east in either order."""
    by = legs.by_position[:, :2]
    orders = (legs.by_velocity[:, :2], legs.by_velocity[:, 1::-1])
    return factor(max(orders, key=lambda vel: abs(float(np.sum(vel * by)))), by, legs.t, WINDOW)


def height_factor(legs: Legs) -> Factor | None:
    """Return how many times too large the heights are by the vertical velocities."""
    return factor(legs.by_position[:, 2:], legs.by_velocity[:, 2:], legs.t, WINDOW)


def gyro_factor(drive: Drive, gnss: Gnss) -> Factor | None:
    """Return how many times too large the gyros are by the course of the fixes."""
    vel = velocities(gnss) if len(gnss) > 2 else np.zeros((len(gnss), 3))
    first, last = windows(gnss.t, TURN)
    usable = np.hypot(vel[:, 0], vel[:, 1]) > STANDING
    good = usable[first] & usable[last]
    first, last = first[good], last[good]
    if not len(first):
        return None
    course = np.arctan2(vel[:, 1], vel[:, 0])
    turn = np.remainder(course[last] - course[first] + np.pi, 2.0 * np.pi) - np.pi
    down = drive.rates[:, 3:].mean(axis=0)
    steps = (drive.rates[1:, :3] @ down) / np.linalg.norm(down) * np.diff(drive.imu_t)
    angle = np.interp(gnss.t, drive.imu_t, np.concatenate([[0.0], np.cumsum(steps)]))
    felt = angle[last] - angle[first]
    # Without what is common to all: the bias of the gyros.
    return factor((felt - felt.mean())[:, None], (turn - turn.mean())[:, None], gnss.t[first], TURN)


def refuse_wrong_units(drive: Drive, gnss: Gnss) -> tuple[str, ...]:
    """Refuse velocities, heights or gyros in another unit than the positions speak of; return doubts.

    Raises
    ------
    DataError
        With the unit, the factor and its interval.
    """
    told = legs(gnss)
    doubts = []
    found = velocity_factor(told)
    if found is not None and found.other:
        in_degrees = np.degrees(gnss.llh[:, :2])
        if np.all(np.abs(in_degrees[:, 0]) < 0.5 * np.pi):
            turned = velocity_factor(legs(replace(gnss, llh=np.hstack([in_degrees, gnss.llh[:, 2:]]))))
            if turned is not None and not turned.other and turned.among({"rad": 1.0}):
                msg = (
                    f"{drive.source}: latitude and longitude look to be in rad: only so do they agree with the "
                    "velocities; write them in degrees"
                )
                raise DataError(msg)
        doubts.append(
            _doubt(drive.source, found, VELOCITY_UNITS, "GNSS velocities", "m/s", "what the positions say")
        )
    found = height_factor(told)
    if found is not None and found.other:
        doubts.append(
            _doubt(drive.source, found, HEIGHT_UNITS, "GNSS heights", "m", "what the vertical velocities say")
        )
    found = gyro_factor(drive, gnss)
    if found is not None and found.other:
        dt = float(np.median(np.diff(drive.imu_t)))
        units = {**RATE_UNITS, f"rad in {dt:.4g} s": dt, f"deg in {dt:.4g} s": dt / DEG}
        doubts.append(
            _doubt(drive.source, found, units, "gyros", "rad/s", "what the course of the fixes says")
        )
    return tuple(doubts)


def _doubt(source: str, found: Factor, units: Mapping[str, float], what: str, unit: str, by: str) -> str:
    """Return a doubt where no unit is so far from the one expected; refuse one that is, or one beyond all.

    Raises
    ------
    DataError
        With the unit, the factor and its interval.
    """
    names = found.among(units)
    if names:
        msg = f"{source}: {what} look to be in {names}: {found} {by}; convert them to {unit}"
        raise DataError(msg)
    said = f"{what} are {found} {by}: check their unit"
    if not 1.0 / ANY < found.value < ANY:
        msg = f"{source}: {said}, expected {unit}"
        raise DataError(msg)
    return said
