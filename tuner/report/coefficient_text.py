"""The noise coefficients of an axis by their names, and the names of levels of its Allan deviation."""

from __future__ import annotations

from collections import Counter

from tuner.types import ChannelIdentification, Coefficient

LEVEL_NAMES = {
    "mean": "mean",
    "sigma_10s": "σ(10 s)",
    "minimum": "smallest Allan deviation",
    "floor": "… ÷ 0.664",
}
"""Heads of the rows that are no coefficient of a term, by the field of `ChannelIdentification`."""
Key = tuple[str, int]
"""Name of a coefficient, such as ``white.density``, and which of several of that name."""


def coefficients_of(channel: ChannelIdentification) -> dict[Key, Coefficient]:
    """Return every coefficient of every term of an axis."""
    seen: Counter[str] = Counter()
    found: dict[Key, Coefficient] = {}
    for term in channel.terms:
        for field, coefficient in term.coefficients.items():
            found[f"{term.name}.{field}", seen[term.name]] = coefficient
        seen[term.name] += 1
    return found


def ends_of(c: Coefficient | None) -> tuple[float | None, float | None, float | None]:
    """Return value and ends of the interval, of a limit its upper end; None for what is unknown."""
    return (None, None, None) if c is None else (c.value, *(c.interval or (None, c.upper)))
