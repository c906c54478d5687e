"""What a filter is set from in few rows: axes that agree within their intervals share one; customary units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from statistics import fmean

from tuner.formats.customary_units import digits, in_customary, with_interval
from tuner.formats.grouping import grouped
from tuner.report.coefficient_text import coefficients_of
from tuner.types import ChannelIdentification, Coefficient

MAIN_TERMS = ("white.density", "bias_instability.level", "random_walk.density")
"""Coefficients of a row."""
SHOWN_DIGITS = (3, 4, 5, 6)
"""Of a range: the fewest that tell its ends apart."""


@dataclass(frozen=True)
class TermsRow:
    """Coefficients of axes of one sensor that agree.

    Attributes
    ----------
    axes : tuple of str
        Channels.
    unit : str
        SI unit of their samples.
    coefficients : mapping of str to tuple of Coefficient
        By name, of `MAIN_TERMS`, one an axis.
    """

    axes: tuple[str, ...]
    unit: str
    coefficients: Mapping[str, tuple[Coefficient, ...]]

    def cell(self, name: str) -> str:
        """Return a coefficient in its customary unit: mean with the interval over all axes, or the limit."""
        found = self.coefficients.get(name, ())
        values = [in_customary(c.value, name, self.unit) for c in found if c.value is not None]
        limits = [in_customary(c.upper, name, self.unit) for c in found if c.upper is not None]
        ends = [in_customary(end, name, self.unit) for c in found for end in c.interval or ()]
        if not values:
            return f"< {digits(max(limits))}" if limits else "–"
        if ends:
            return with_interval(fmean(values), min(ends), max(ends))
        ranges = ([digits(end, count) for end in (min(values), max(values))] for count in SHOWN_DIGITS)
        return next((f"{low} to {high}" for low, high in ranges if low != high), digits(values[0]))

    def agrees(self, other: TermsRow) -> bool:
        """Whether all numbers of both may be the same."""
        if self.unit != other.unit or self.coefficients.keys() != other.coefficients.keys():
            return False
        return all(
            _agree(a, b)
            for name, own in self.coefficients.items()
            for a in own
            for b in other.coefficients[name]
        )


def channel_row(channel: ChannelIdentification) -> TermsRow:
    """Return the coefficients of one axis."""
    return single_row(
        channel.axis, channel.unit, ((key[0], c) for key, c in coefficients_of(channel).items())
    )


def single_row(axis: str, unit: str, named: Iterable[tuple[str, Coefficient]]) -> TermsRow:
    """Return named coefficients of one axis as a row; those that have no column are left out."""
    return TermsRow((axis,), unit, {name: (one,) for name, one in named if name in MAIN_TERMS})


def joined_rows(singles: Iterable[TermsRow]) -> list[TermsRow]:
    """Return rows of single axes with those that all agree with one another joined, in the order of the axes."""
    groups = grouped(singles, lambda group, single: all(single.agrees(one) for one in group))
    return [_joined(group) for group in groups]


def _joined(rows: Sequence[TermsRow]) -> TermsRow:
    """Return the row of the axes of all."""
    coefficients = {
        name: tuple(one for row in rows for one in row.coefficients[name]) for name in rows[0].coefficients
    }
    return TermsRow(tuple(axis for row in rows for axis in row.axes), rows[0].unit, coefficients)


def _agree(a: Coefficient, b: Coefficient) -> bool:
    low, high = _ends(a)
    lower, higher = _ends(b)
    if a.value is not None and a.value == b.value:
        return True
    return (a.value is None) == (b.value is None) and low <= higher and lower <= high


def _ends(c: Coefficient) -> tuple[float, float]:
    """Return the interval; of a limit all below it, of a stated number itself."""
    if c.interval is not None:
        return c.interval
    return (0.0, inf if c.upper is None else c.upper) if c.value is None else (c.value, c.value)
