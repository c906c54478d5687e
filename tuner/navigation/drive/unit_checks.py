"""Checks of the units of a drive: velocities, heights and positions, gyro rates and course against one another.

Two series of one quantity, a = k s + noise and b = s + noise, determine their factor k between the two regressions,
each of which is biased by the noise of one of them::

    Σ ab / Σ bb  ≤  k  ≤  Σ aa / Σ ab

Where nothing moves, that is all numbers. The sds of the slopes Σ ab / Σ bb and Σ ab / Σ aa follow from the residuals
of the products in blocks of time, Σᵢ (ab − slope · bb)ᵢ² [1]_. A factor differs from 1 only where one of them, at the
p value `P_VALUE`, is above `MAX_COMMON_FACTOR`, by which good sensors and receivers may differ; units whose factor
lies between the ends are named.

Mean velocities are compared with displacements (`mean_velocities`); rotations about the vertical, which the mean
specific force gives, with turns of the course.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger, Longitudinal data analysis using generalized linear models, Biometrika 73 (1986).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.probability import student_quantile
from models.units import DEG, unit_value
from tuner.navigation.drive.alignment import STATIONARY_SPEED, velocities
from tuner.navigation.drive.mean_velocities import WINDOW_DURATION, MeanVelocities, mean_velocities, windows
from tuner.types.records import DataError, Drive, Gnss

TURN_DURATION = 4.0
"""Time over which turns are compared, s."""
MIN_BLOCKS, MAX_BLOCKS = 4, 20
"""Least and largest number of blocks; none is shorter than a window."""
P_VALUE = 1e-5
"""p value at which one slope is beyond its limit."""
MAX_COMMON_FACTOR = 1.25
"""Factors up to this have other causes than units: a receiver that smooths, a sensor with a scale error."""
MAX_MEAN_RATE = 0.35
"""Mean of the gyros beyond which it is no bias, rad/s."""
MIN_SLOPE = 1e-300
"""Least slope, whose inverse is no limit."""
VELOCITY_TOLERANCE, TURN_TOLERANCE = 1.03, 1.1
"""Factors by which a unit may lie outside the interval: of velocities, and of turns of a vehicle that rolls."""
MAX_FACTOR = 30.0
"""Factors beyond this are refused whatever the unit."""


@dataclass(frozen=True)
class UnitFactor:
    """Ratio of a series to another one of the same quantity.

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
        """Whether the 95 % interval of the factor excludes 1."""
        low, high = self.interval
        return low > MAX_COMMON_FACTOR or high < 1.0 / MAX_COMMON_FACTOR

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:#.3g} ({low:#.3g} … {high:#.3g}) times"


@dataclass(frozen=True)
class CheckedUnit:
    """A quantity whose unit is checked: name, unit, reference, numbers of other units in one, and tolerance."""

    name: str
    unit: str
    by: str
    others: Mapping[str, float]
    near: float = VELOCITY_TOLERANCE

    def named(self, found: UnitFactor) -> str:
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


VELOCITY_UNITS = CheckedUnit(
    "GNSS velocities",
    "m/s",
    "what the positions say",
    _per(("km/h",) * 2, ("knots", "kn"), ("mph",) * 2, ("ft/s",) * 2, ("cm/s",) * 2, ("mm/s",) * 2),
)
HEIGHT_UNITS = CheckedUnit(
    "GNSS heights",
    "m",
    "what the vertical velocities say",
    _per(("ft",) * 2, ("cm",) * 2, ("mm",) * 2, ("km",) * 2),
)
GYRO_UNITS = CheckedUnit(
    "gyros",
    "rad/s",
    "what the course of the fixes says",
    {**_per(("deg/s",) * 2, ("mrad/s", "mrad"), ("mdeg/s",) * 2), "rad/s taken for deg/s": DEG},
    TURN_TOLERANCE,
)


def unit_factor(a: FloatArray, b: FloatArray, t: FloatArray, window: float) -> UnitFactor | None:
    """Return how many times b series a is, whatever the sign; (w, p) each over windows of a length from t (w,), s."""
    blocks = min(MAX_BLOCKS, int((t[-1] - t[0]) / window)) if len(t) else 0
    if blocks < MIN_BLOCKS:
        return None
    block = np.minimum(((t - t[0]) / (t[-1] - t[0]) * blocks).astype(int), blocks - 1)
    products = np.stack([np.sum(x * y, axis=-1) for x, y in ((a, a), (a, b), (b, b))], axis=-1)
    sums = np.zeros((blocks, 3))
    np.add.at(sums, block, products)
    sums[:, 1] *= np.sign(sums[:, 1].sum())
    low, high = _slope(sums[:, 1], sums[:, 2]), _slope(sums[:, 1], sums[:, 0])
    if min(low[0], high[0]) <= 0.0:
        return None
    usual, far = (-student_quantile(p, blocks - 1) for p in (0.025, P_VALUE))
    return UnitFactor(
        low[0],
        1.0 / high[0],
        (low[0] - usual * low[1], 1.0 / max(high[0] - usual * high[1], MIN_SLOPE)),
        other=max(slope - far * sd for slope, sd in (low, high)) > MAX_COMMON_FACTOR,
    )


def _slope(ab: FloatArray, bb: FloatArray) -> tuple[float, float]:
    """Return a regression from products summed over blocks, and its sd; zeros where there is nothing."""
    n, total = len(bb), float(bb.sum())
    if not total > 0.0:
        return 0.0, 0.0
    slope = float(ab.sum()) / total
    return slope, float(np.sqrt(n / (n - 1.0) * np.sum((ab - slope * bb) ** 2))) / total


def velocity_factor(mean_velocities: MeanVelocities) -> UnitFactor | None:
    """Return how many times too large the velocities are by the positions, north and east in either order."""
    by = mean_velocities.by_position[:, :2]
    orders = (mean_velocities.by_velocity[:, :2], mean_velocities.by_velocity[:, 1::-1])
    return unit_factor(
        max(orders, key=lambda vel: abs(float(np.sum(vel * by)))), by, mean_velocities.t, WINDOW_DURATION
    )


def height_factor(mean_velocities: MeanVelocities) -> UnitFactor | None:
    """Return how many times too large the heights are by the vertical velocities."""
    return unit_factor(
        mean_velocities.by_position[:, 2:],
        mean_velocities.by_velocity[:, 2:],
        mean_velocities.t,
        WINDOW_DURATION,
    )


def gyro_factor(drive: Drive, gnss: Gnss) -> UnitFactor | None:
    """Return how many times too large the gyros are by the course of the fixes."""
    vel = velocities(gnss) if len(gnss) > 2 else np.zeros((len(gnss), 3))
    first, last = windows(gnss.t, TURN_DURATION)
    usable = np.hypot(vel[:, 0], vel[:, 1]) > STATIONARY_SPEED
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
    return unit_factor(
        (felt - felt.mean())[:, None], (turn - turn.mean())[:, None], gnss.t[first], TURN_DURATION
    )


def refuse_wrong_units(drive: Drive, gnss: Gnss) -> tuple[str, ...]:
    """Refuse velocities, heights or gyros in another unit than the positions imply; return warnings.

    Raises
    ------
    DataError
        With the unit, the factor and its interval.
    """
    warnings = []
    for series, found in _factors(drive, gnss):
        if not found.other:
            continue
        if series is VELOCITY_UNITS and _are_positions_in_radians(gnss):
            raise DataError(
                f"{drive.source}: latitude and longitude look to be in rad: only so do they agree with the "
                "velocities; write them in degrees"
            )
        named, message = series.named(found), f"{series.name} are {found} {series.by}: check their unit"
        if named:
            raise DataError(f"{drive.source}: {named}")
        if not 1.0 / MAX_FACTOR < found.value < MAX_FACTOR:
            raise DataError(f"{drive.source}: {message}, expected {series.unit}")
        warnings.append(message)
    return tuple(warnings)


def suspected_unit(drive: Drive, gnss: Gnss) -> str | None:
    """Return the unit that something has by 95 %, in words, where a filter failed and a cause is sought."""
    for series, found in _factors(drive, gnss):
        if found.likely and (named := series.named(found)):
            return named
    # On one straight or one circle the course has nothing to compare but the mean.
    course = np.unwrap(np.arctan2(*velocities(gnss)[:, 1::-1].T)) if len(gnss) > 2 else np.zeros(1)
    turning = float(np.abs(course[-1] - course[0])) / max(float(np.ptp(gnss.t)), 1.0)
    mean = float(np.linalg.norm(drive.rates[:, :3].mean(axis=0)))
    if mean < MAX_MEAN_RATE + 2.0 * turning:
        return None
    return (
        f"gyros read {np.degrees(mean):.3g} deg/s on average, more than any bias of theirs and more than the course "
        "of the fixes turns: check their unit, expected rad/s"
    )


def _factors(drive: Drive, gnss: Gnss) -> list[tuple[CheckedUnit, UnitFactor]]:
    """Return the factors that the drive tells."""
    means, dt = mean_velocities(gnss), float(np.median(np.diff(drive.imu_t)))
    gains = {f"rad in {dt:.4g} s": dt, f"deg in {dt:.4g} s": dt / DEG}
    found = [(replace(GYRO_UNITS, others={**GYRO_UNITS.others, **gains}), gyro_factor(drive, gnss))]
    # Errors of a receiver that stands may well go together.
    if len(means) and np.sqrt(np.mean(means.by_velocity[:, :2] ** 2)) > STATIONARY_SPEED:
        found = [(VELOCITY_UNITS, velocity_factor(means)), (HEIGHT_UNITS, height_factor(means)), *found]
    return [(series, one) for series, one in found if one is not None]


def _are_positions_in_radians(gnss: Gnss) -> bool:
    """Whether positions agree with the velocities once they are turned into degrees again."""
    turned = np.degrees(gnss.llh[:, :2])
    if np.any(np.abs(turned[:, 0]) > 0.5 * np.pi):
        return False
    found = velocity_factor(mean_velocities(replace(gnss, llh=np.hstack([turned, gnss.llh[:, 2:]]))))
    return (
        found is not None
        and not found.other
        and found.low / VELOCITY_TOLERANCE < 1.0 < found.high * VELOCITY_TOLERANCE
    )
