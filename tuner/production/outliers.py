"""Units that stand apart from their fleet, quantity by quantity, by robust scores with a threshold for all together.

Of the n values of a quantity (logarithms of amplitudes, means as they are) the median m and the median absolute
deviation give the score |x − m|/s with s = 1.4826 MAD, or the standard deviation of the unit's own estimate where that
is larger. For a sound fleet of normal values a score is nearly Student's t with 0.37 (n − 1) degrees of freedom, 0.37
being the efficiency of the MAD. The threshold is the quantile at which the chance that any of all M scores of the
fleet exceeds it is at most `FALSE_NAMING` (Bonferroni). Simulated with normal values, the chance is at most that for
every n from 6 to 200, and well below it under 40, where the approximation is cautious.

References
----------
.. [1] P. J. Rousseeuw, C. Croux, Alternatives to the median absolute deviation, J. Am. Stat. Assoc. 88, 1993.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.stats import t

from models.robust import normal_sd
from models.units import unit_value
from tuner.formats.customary_units import digits
from tuner.production.quantities import SENSORS, is_logarithmic, scaled
from tuner.types.fleet import Outlier, UnitMeasurement

FALSE_NAMING = 0.01
"""Chance that of a sound fleet any unit is named: one fleet in a hundred."""
LEAST_UNITS = 6
"""Below this the MAD has less than two degrees of freedom, and only absurd values exceed the threshold."""
MAD_EFFICIENCY = 0.37
"""Variance of the sample standard deviation ÷ that of the scaled MAD, for normal values."""
WARMING = "temperature.warm_up"
"""A property of the test, not of the unit: nobody stands apart by it."""
MISTAKEN_UNITS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"gyro": ("deg/s", "deg/h", "mrad/s", "mdeg/s"), "accel": ("g", "mg", "cm/s^2", "ft/s^2")}
)
"""Units in which logs are written that readers may take for SI, and the other way round."""


@dataclass(frozen=True)
class Located:
    """Place and scale of one quantity over the fleet, on its scale, and the threshold of its scores."""

    median: float
    sd: float
    threshold: float


@dataclass(frozen=True)
class Apart:
    """Units that stand apart: outlying quantities and advice by the index of the unit; scores tested."""

    outliers: Mapping[int, tuple[Outlier, ...]]
    advice: Mapping[int, tuple[str, ...]]
    comparisons: int


def units_apart(measurements: Mapping[int, UnitMeasurement]) -> Apart:
    """Return the units that stand apart; a quantity counts where at least half of the units, and six, have it."""
    values: dict[str, dict[int, tuple[float, float]]] = {}
    for index, one in measurements.items():
        for quantity, coefficient in one.quantities.items():
            point = scaled(coefficient, quantity)
            if point is not None and quantity != WARMING:
                values.setdefault(quantity, {})[index] = point
    least = max(LEAST_UNITS, math.ceil(0.5 * len(measurements)))
    judged = {quantity: points for quantity, points in values.items() if len(points) >= least}
    comparisons = sum(map(len, judged.values()))
    places = {quantity: _located([x for x, _ in p.values()], comparisons) for quantity, p in judged.items()}
    outliers: dict[int, list[Outlier]] = {}
    for quantity, points in judged.items():
        place = places[quantity]
        back = math.exp if is_logarithmic(quantity) else float
        for index, (x, own) in points.items():
            score = _score(x, own, place)
            if score > place.threshold:
                outlier = Outlier(quantity, back(x), back(place.median), score, place.threshold)
                outliers.setdefault(index, []).append(outlier)
    advice = {index: _mistaken_units(measurements[index], places) for index in outliers}
    return Apart(
        {index: tuple(sorted(found, key=lambda one: -one.score)) for index, found in outliers.items()},
        {index: lines for index, lines in advice.items() if lines},
        comparisons,
    )


NEAR_UNIT = 6.0
"""Robust sds about the fleet within which a factor is that of a unit.

Of few units the threshold of outliers is dozens of sds, within which other sensors lie: one 3.00 times as noisy is not
one in ft/s², 3.28. The scatter of six units may be half of the true one: 6 of it are 3 of that.
"""


def threshold(count: int, comparisons: int) -> float:
    """Return what a score of `count` units exceeds with the chance `FALSE_NAMING` ÷ `comparisons`, on either side."""
    return float(t.isf(0.5 * FALSE_NAMING / comparisons, MAD_EFFICIENCY * (count - 1)))


def _located(values: Sequence[float], comparisons: int) -> Located:
    x = np.asarray(values)
    median = float(np.median(x))
    sd = float(normal_sd(x - median))
    return Located(median, sd, threshold(len(x), comparisons))


def _score(x: float, own: float, place: Located) -> float:
    distance, sd = abs(x - place.median), max(place.sd, own)
    return 0.0 if distance == 0.0 else math.inf if sd == 0.0 else distance / sd


def _mistaken_units(one: UnitMeasurement, places: Mapping[str, Located]) -> tuple[str, ...]:
    """Return the unit of samples that would explain why the white noise of every axis of a sensor is outlying."""
    lines = []
    for sensor, names in MISTAKEN_UNITS.items():
        si = next(unit for unit, name in SENSORS.items() if name == sensor)
        distances = []
        for quantity, coefficient in one.quantities.items():
            channel, _, symbol = quantity.rpartition(".")
            if symbol != "N" or one.units[channel] != si or quantity not in places:
                continue
            point = scaled(coefficient, quantity)
            if point is not None:
                distances.append((point[0] - places[quantity].median, point[1], places[quantity]))
        if not distances or not all(_score(d + p.median, own, p) > p.threshold for d, own, p in distances):
            continue
        mean = sum(d for d, _, _ in distances) / len(distances)
        cures = {(unit, -math.log(unit_value(unit))) for unit in names}
        cures |= {(f"{si} read as {unit}", math.log(unit_value(unit))) for unit in names}
        unit, factor = min(cures, key=lambda cure: (abs(mean - cure[1]), cure[0]))
        near = (
            _score(d - factor + p.median, own, p) <= min(p.threshold, NEAR_UNIT) for d, own, p in distances
        )
        if all(near):
            right = unit.partition(" ")[0]
            was = unit if " read as " in unit else f"{unit} read as {si}"
            lines.append(
                f"{sensor} noise × {digits(math.exp(mean))} on every axis, as {was} would be: read this log with "
                f"--{sensor}-unit {right}, or correct the unit it states"
            )
    return tuple(lines)
