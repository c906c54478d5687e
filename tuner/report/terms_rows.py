"""Noise coefficients in few rows: axes that agree within their intervals share one; customary units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from statistics import fmean

from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, symbol, with_interval
from tuner.types import ChannelIdentification, Coefficient

MAIN_TERMS = ("white.density", "bias_instability.level", "random_walk.density")
"""Coefficients with a column of their own: what a filter is set from."""
SHOWN_DIGITS = (3, 4, 5, 6)
"""Of a range: the fewest that tell its ends apart."""
Key = tuple[str, int]
"""Name of a coefficient, such as ``white.density``, and which of several of that name."""


@dataclass(frozen=True)
class TermsRow:
    """Coefficients of axes of one sensor that agree.

    Attributes
    ----------
    axes : tuple of str
        Channels.
    unit : str
        SI unit of their samples.
    coefficients : mapping of (str, int) to tuple of Coefficient
        By name, one an axis.
    """

    axes: tuple[str, ...]
    unit: str
    coefficients: Mapping[Key, tuple[Coefficient, ...]]

    def cell(self, name: str, which: int = 0) -> str:
        """Return a coefficient in its customary unit: mean with the interval over all axes, or the limit."""
        found = self.coefficients.get((name, which), ())
        values = [in_customary(c.value, name, self.unit) for c in found if c.value is not None]
        limits = [in_customary(c.upper, name, self.unit) for c in found if c.upper is not None]
        if not values:
            return f"< {digits(max(limits))}" if limits else "–"
        value = fmean(values)
        ends = [in_customary(end, name, self.unit) for c in found for end in c.interval or ()]
        if not ends:
            for count in SHOWN_DIGITS:
                low, high = digits(min(values), count), digits(max(values), count)
                if low != high:
                    return f"{low} to {high}"
            return digits(value)
        return with_interval(value, min(ends), max(ends))

    @property
    def further(self) -> str:
        """The coefficients without a column that the data contain, with their units."""
        parts = [
            f"{symbol(name)} {self.cell(name, which)} {pretty(customary_unit(name, self.unit))}".strip()
            for (name, which), found in self.coefficients.items()
            if name not in MAIN_TERMS and any(c.value is not None for c in found)
        ]
        return ", ".join(parts)

    def agrees(self, other: TermsRow) -> bool:
        """Whether all numbers of both may be the same."""
        if self.unit != other.unit or self.coefficients.keys() != other.coefficients.keys():
            return False
        return all(
            _agree(a, b)
            for key, own in self.coefficients.items()
            for a in own
            for b in other.coefficients[key]
        )

    def joined(self, other: TermsRow) -> TermsRow:
        """Return the row of the axes of both."""
        both = {key: own + other.coefficients[key] for key, own in self.coefficients.items()}
        return TermsRow(self.axes + other.axes, self.unit, both)


def channel_row(channel: ChannelIdentification) -> TermsRow:
    """Return the coefficients of one axis; what is only bounded and has no column is left out."""
    named = [(f"{t.name}.{field}", c) for t in channel.terms for field, c in t.coefficients.items()]
    return single_row(channel.axis, channel.unit, named)


def single_row(axis: str, unit: str, named: Iterable[tuple[str, Coefficient]]) -> TermsRow:
    """Return named coefficients of one axis as a row."""
    seen: Counter[str] = Counter()
    found: dict[Key, tuple[Coefficient, ...]] = {}
    for name, coefficient in named:
        if name in MAIN_TERMS or coefficient.value is not None:
            found[name, seen[name]] = (coefficient,)
            seen[name] += 1
    return TermsRow((axis,), unit, found)


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
    if c.value is not None:
        return c.value, c.value
    return 0.0, inf if c.upper is None else c.upper
