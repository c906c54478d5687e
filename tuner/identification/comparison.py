"""Side by side: the same coefficient of several sources, and which of them differ.

Two estimates with independent errors differ at 95 % where the logarithm of their ratio lies outside its own interval,
|ln(a/b)| > √(h_a² + h_b²) with h the half widths of their logarithmic intervals. Means may have any sign: they are
compared by their difference, and have no ratio.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tuner.types import ChannelIdentification, Coefficient, Identification


@dataclass(frozen=True)
class ComparedCoefficient:
    """One coefficient of one axis over the sources.

    Attributes
    ----------
    name : str
        Such as ``white.density`` or ``sigma_10s``.
    values : tuple of Coefficient or None
        One a source; None where the source does not speak of it.
    ratio : float or None
        Last ÷ first, where both have values.
    ratio_interval : (float, float) or None
        95 % interval of the ratio, where both have intervals.
    differs : bool or None
        Whether the ratio differs from one at 95 %; None where that cannot be said.
    """

    name: str
    values: tuple[Coefficient | None, ...]
    ratio: float | None
    ratio_interval: tuple[float, float] | None
    differs: bool | None


@dataclass(frozen=True)
class Comparison:
    """Every coefficient of every axis that at least one source has, and the sources themselves."""

    names: tuple[str, ...]
    units: Mapping[str, str]
    axes: Mapping[str, tuple[ComparedCoefficient, ...]]
    sources: tuple[Identification, ...] = ()


def compare_identifications(names: Sequence[str], found: Sequence[Identification]) -> Comparison:
    """Compare identifications axis by axis; ratios are of the last source to the first."""
    axes = list(dict.fromkeys(axis for one in found for axis in one.channels))
    units = {axis: next(one.channels[axis].unit for one in found if axis in one.channels) for axis in axes}
    return Comparison(tuple(names), units, {axis: _compare_axis(axis, found) for axis in axes}, tuple(found))


def _compare_axis(axis: str, found: Sequence[Identification]) -> tuple[ComparedCoefficient, ...]:
    tables = [_coefficients(one.channels[axis]) if axis in one.channels else {} for one in found]
    return tuple(
        _compare_coefficient(name, [table.get(name) for table in tables])
        for name in dict.fromkeys(name for table in tables for name in table)
    )


def _coefficients(channel: ChannelIdentification) -> dict[str, Coefficient]:
    table = {f"{e.name}.{field}": c for e in channel.terms for field, c in e.coefficients.items()}
    return table | {
        "mean": channel.mean,
        "sigma_10s": channel.sigma_10s,
        "minimum": channel.minimum,
        "floor": channel.floor,
    }


def _compare_coefficient(name: str, values: list[Coefficient | None]) -> ComparedCoefficient:
    first, last = values[0], values[-1]
    if name == "mean":
        return ComparedCoefficient(name, tuple(values), None, None, _apart(first, last))
    if first is None or last is None or not first.value or not last.value:
        return ComparedCoefficient(name, tuple(values), None, None, None)
    ratio = last.value / first.value
    widths = [_half_widths(first), _half_widths(last)]
    if widths[0] is None or widths[1] is None:
        return ComparedCoefficient(name, tuple(values), ratio, None, None)
    low = math.hypot(widths[1][0], widths[0][1])
    high = math.hypot(widths[1][1], widths[0][0])
    interval = (ratio * math.exp(-low), ratio * math.exp(high))
    return ComparedCoefficient(name, tuple(values), ratio, interval, not interval[0] <= 1.0 <= interval[1])


def _apart(first: Coefficient | None, last: Coefficient | None) -> bool | None:
    """Tell whether two values differ at 95 %; None where one of them has no interval."""
    if first is None or last is None or first.value is None or last.value is None:
        return None
    if first.interval is None or last.interval is None:
        return None
    halves = [0.5 * (high - low) for low, high in (first.interval, last.interval)]
    return abs(last.value - first.value) > math.hypot(*halves)


def _half_widths(c: Coefficient) -> tuple[float, float] | None:
    """Return how far the logarithm reaches below and above the estimate; None without a positive interval."""
    if c.interval is None or c.value is None or c.interval[0] <= 0 or c.value <= 0:
        return None
    return math.log(c.value / c.interval[0]), math.log(c.interval[1] / c.value)


STATED_DIGITS_MARGIN = 1.05
"""Factor on a stated number from which a measured one exceeds it: 1.05 is 1.0 in the two digits of a data sheet."""


@dataclass(frozen=True)
class LimitCheck:
    """A measured source against what a data sheet states.

    Attributes
    ----------
    measured, stated : str
        Names of the sources.
    exceeded : tuple of (str, str, float)
        Axis, coefficient, and measured ÷ stated, where the whole interval lies above what is stated
        by more than the margin.
    within : int
        Number of coefficients that are not shown to exceed what is stated.
    """

    measured: str
    stated: str
    exceeded: tuple[tuple[str, str, float], ...]
    within: int

    @property
    def passes(self) -> bool:
        """Whether nothing exceeds what is stated."""
        return not self.exceeded


def limit_checks(comparison: Comparison) -> tuple[LimitCheck, ...]:
    """Return every measured source against every data sheet or grade, in the coefficients of their noise terms."""
    stated = [i for i, one in enumerate(comparison.sources) if _is_stated(one)]
    checks = []
    for sheet in stated:
        for own in (i for i in range(len(comparison.sources)) if i not in stated):
            exceeded, within = [], 0
            for axis, rows in comparison.axes.items():
                for row in rows:
                    found, limit = row.values[own], row.values[sheet]
                    if "." not in row.name or limit is None or not limit.value or found is None:
                        continue
                    low = 0.0 if found.interval is None else found.interval[0]
                    if found.value is not None and low > STATED_DIGITS_MARGIN * limit.value:
                        exceeded.append((axis, row.name, found.value / limit.value))
                    else:
                        within += 1
            checks.append(LimitCheck(comparison.names[own], comparison.names[sheet], tuple(exceeded), within))
    return tuple(checks)


def _is_stated(source: Identification) -> bool:
    """Return whether the numbers are stated, not measured: no time is covered."""
    return all(channel.span == 0.0 for channel in source.channels.values())
