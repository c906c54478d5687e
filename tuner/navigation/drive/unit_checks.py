"""Units of a drive against one another: velocities, heights and positions, turns of the gyros and of the course.

Two series of one quantity, a = k s + noise and b = s + noise, hold their factor k between the two regressions, each
of which is pulled one way by the noise of one of them::

    Σ ab / Σ bb  ≤  k  ≤  Σ aa / Σ ab

Where nothing moves, that is all numbers. The slopes Σ ab / Σ bb and Σ ab / Σ aa have errors by what they leave of the
products in blocks of time, Σᵢ (ab − slope · bb)ᵢ² [1]_. A factor is another one only where one of them, at a chance of
`CHANCE`, is above `ALIKE`, by which good sensors and receivers may differ; the units that lie between the ends have
its name.

Mean velocities are held against displacements (`legs`); turns about the vertical, which the mean specific force
tells, against turns of the course.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger, Longitudinal data analysis using generalized linear models, Biometrika 73 (1986).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from models.units import DEG, unit_value
from tuner.navigation.drive.alignment import STANDING, velocities
from tuner.navigation.drive.mean_velocities import WINDOW, Legs, legs, windows
from tuner.types.records import DataError, Drive, Gnss

FloatArray = NDArray[np.float64]

TURN = 4.0
"""Time over which turns are compared, s."""
FEWEST, MOST = 4, 20
"""How few and how many blocks there are; none is shorter than a window."""
CHANCE = 1e-5
"""Chance that one slope is beyond its limit by its scatter alone."""
ALIKE = 1.25
"""Factors up to this are none of units: a receiver that smooths, a sensor with a scale error."""
BIAS = 0.35
"""Mean of the gyros beyond which it is no bias, rad/s."""
TINY = 1e-300
"""Least slope, whose inverse is no limit."""
NEAR, TILTED = 1.03, 1.1
"""Factors by which a unit may lie outside the interval: of velocities, and of turns of a vehicle that leans."""
ANY = 30.0
"""Factors beyond this are refused whatever the unit."""


@dataclass(frozen=True)
class Factor:
    """How many times too large something is.

    Attributes
    ----------
    low, high : float
        The two regressions.
    interval : tuple of 2 floats
        95 % beyond them.
    other : bool
        Whether it is not 1.
    """

    low: float
    high: float
    interval: tuple[float, float]
    other: bool

    @property
    def value(self) -> float:
        """The middle of the two regressions."""
        return float(np.sqrt(self.low * self.high))

    @property
    def likely(self) -> bool:
        """Whether 95 % say that it is not 1."""
        low, high = self.interval
        return low > ALIKE or high < 1.0 / ALIKE

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:#.3g} ({low:#.3g} … {high:#.3g}) times"


@dataclass(frozen=True)
class Series:
    """Something whose unit may be another: its name, unit and judge, how many of others make one, and their room."""

    name: str
    unit: str
    by: str
    others: Mapping[str, float]
    near: float = NEAR

    def named(self, found: Factor) -> str:
        """Return in words the units that lie within the interval of a factor, "" for none."""
        low, high = found.interval
        names = " or ".join(n for n, k in self.others.items() if low / self.near < k < high * self.near)
        return (
            f"{self.name} look to be in {names}: {found} {self.by}; convert them to {self.unit}"
            if names
            else ""
        )


def _per(*units: tuple[str, str]) -> Mapping[str, float]:
    """Return how many make one in SI, for names and units."""
    return {name: 1.0 / unit_value(unit) for name, unit in units}


VELOCITIES = Series(
    "GNSS velocities",
    "m/s",
    "what the positions say",
    _per(("km/h",) * 2, ("knots", "kn"), ("mph",) * 2, ("ft/s",) * 2, ("cm/s",) * 2, ("mm/s",) * 2),
)
HEIGHTS = Series(
    "GNSS heights",
    "m",
    "what the vertical velocities say",
    _per(("ft",) * 2, ("cm",) * 2, ("mm",) * 2, ("km",) * 2),
)
GYROS = Series(
    "gyros",
    "rad/s",
    "what the course of the fixes says",
    {**_per(("deg/s",) * 2, ("mrad/s", "mrad"), ("mdeg/s",) * 2), "rad/s taken for deg/s": DEG},
    TILTED,
)


def factor(a: FloatArray, b: FloatArray, t: FloatArray, window: float) -> Factor | None:
    """Return how many times b series a is, whatever the sign; (w, p) each over windows of a length from t (w,), s."""
    blocks = min(MOST, int((t[-1] - t[0]) / window)) if len(t) else 0
    if blocks < FEWEST:
        return None
    block = np.minimum(((t - t[0]) / (t[-1] - t[0]) * blocks).astype(int), blocks - 1)
    products = np.stack([np.sum(x * y, axis=-1) for x, y in ((a, a), (a, b), (b, b))], axis=-1)
    sums = np.zeros((blocks, 3))
    np.add.at(sums, block, products)
    sums[:, 1] *= np.sign(sums[:, 1].sum())
    low, high = _slope(sums[:, 1], sums[:, 2]), _slope(sums[:, 1], sums[:, 0])
    if min(low[0], high[0]) <= 0.0:
        return None
    usual, far = (float(student.isf(p, blocks - 1)) for p in (0.025, CHANCE))
    return Factor(
        low[0],
        1.0 / high[0],
        (low[0] - usual * low[1], 1.0 / max(high[0] - usual * high[1], TINY)),
        other=max(slope - far * sd for slope, sd in (low, high)) > ALIKE,
    )


def _slope(ab: FloatArray, bb: FloatArray) -> tuple[float, float]:
    """Return a regression from products summed over blocks, and its sd; zeros where there is nothing."""
    n, total = len(bb), float(bb.sum())
    if not total > 0.0:
        return 0.0, 0.0
    slope = float(ab.sum()) / total
    return slope, float(np.sqrt(n / (n - 1.0) * np.sum((ab - slope * bb) ** 2))) / total


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
    doubts = []
    for series, found in _factors(drive, gnss):
        if not found.other:
            continue
        if series is VELOCITIES and _in_degrees(gnss):
            msg = (
                f"{drive.source}: latitude and longitude look to be in rad: only so do they agree with the "
                "velocities; write them in degrees"
            )
            raise DataError(msg)
        named, said = series.named(found), f"{series.name} are {found} {series.by}: check their unit"
        if named:
            msg = f"{drive.source}: {named}"
            raise DataError(msg)
        if not 1.0 / ANY < found.value < ANY:
            msg = f"{drive.source}: {said}, expected {series.unit}"
            raise DataError(msg)
        doubts.append(said)
    return tuple(doubts)


def likely_unit(drive: Drive, gnss: Gnss) -> str | None:
    """Return the unit that something has by 95 %, in words, where a filter failed and a cause is sought."""
    for series, found in _factors(drive, gnss):
        if found.likely and (named := series.named(found)):
            return named
    # On one straight or one circle the course has nothing to compare but the mean.
    course = np.unwrap(np.arctan2(*velocities(gnss)[:, 1::-1].T)) if len(gnss) > 2 else np.zeros(1)
    turning = float(np.abs(course[-1] - course[0])) / max(float(np.ptp(gnss.t)), 1.0)
    mean = float(np.linalg.norm(drive.rates[:, :3].mean(axis=0)))
    if mean < BIAS + 2.0 * turning:
        return None
    return (
        f"gyros read {np.degrees(mean):.3g} deg/s on average, more than any bias of theirs and more than the course "
        "of the fixes turns: check their unit, expected rad/s"
    )


def _factors(drive: Drive, gnss: Gnss) -> list[tuple[Series, Factor]]:
    """Return the factors that the drive tells."""
    told, dt = legs(gnss), float(np.median(np.diff(drive.imu_t)))
    gains = {f"rad in {dt:.4g} s": dt, f"deg in {dt:.4g} s": dt / DEG}
    found = [(replace(GYROS, others={**GYROS.others, **gains}), gyro_factor(drive, gnss))]
    # Errors of a receiver that stands may well go together.
    if len(told) and np.sqrt(np.mean(told.by_velocity[:, :2] ** 2)) > STANDING:
        found = [(VELOCITIES, velocity_factor(told)), (HEIGHTS, height_factor(told)), *found]
    return [(series, one) for series, one in found if one is not None]


def _in_degrees(gnss: Gnss) -> bool:
    """Whether positions agree with the velocities once they are turned into degrees again."""
    turned = np.degrees(gnss.llh[:, :2])
    if np.any(np.abs(turned[:, 0]) > 0.5 * np.pi):
        return False
    found = velocity_factor(legs(replace(gnss, llh=np.hstack([turned, gnss.llh[:, 2:]]))))
    return found is not None and not found.other and found.low / NEAR < 1.0 < found.high * NEAR
