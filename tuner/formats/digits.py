"""How many digits of a number a document carries: those its interval supports and two more.

The half width h of an interval supports digits down to the place of its first digit, 10^e with e = ⌊lg h⌋; numbers are
rounded to 10^(e−2), so that rounding moves them by less than 1 % of h. Three significant digits always stay. A number
without an interval keeps `DEFAULT_DIGITS`. Rounding again changes nothing: what is read and written again is
the same text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

DEFAULT_DIGITS = 6
"""Significant digits of a number without an interval: a hundred times finer than the best intervals of noise."""
CLOCK_DIGITS = 9
"""Significant digits of a sampling interval: 1 ns a second, finer than the clock of any sensor."""
LEAST_DIGITS = 3
"""Significant digits that stay where an interval supports fewer: a small positive number must not become 0."""
MORE_DIGITS = 2
"""Digits beyond those that the interval supports."""
POLYNOMIALS = "arma"
"""Entry whose numbers stay exact: the roots of a polynomial move far when its coefficients move by little."""
_EXACT_DIGITS = 17
"""Significant digits that give every double back."""

Interval = tuple[float, float]


def rounded(value: float, interval: Interval | None = None, *, digits: int = DEFAULT_DIGITS) -> float:
    """Return a number with the digits that its interval supports and two more, or with so many significant digits."""
    place = None if interval is None else _common_place(value, interval)
    return _rounded_to(value, place, digits)


def rounded_interval(value: float | None, interval: Interval) -> Interval:
    """Return both ends of an interval with the digits that it supports and two more."""
    place = _common_place(value, interval)
    low, high = interval
    return _rounded_to(low, place, DEFAULT_DIGITS), _rounded_to(high, place, DEFAULT_DIGITS)


def rounded_content(content: Any, *, digits: int = DEFAULT_DIGITS) -> Any:
    """Return plain values with every number rounded; an entry ``interval`` decides about the ``value`` beside it."""
    if isinstance(content, Mapping):
        others = {
            key: rounded_content(entry, digits=_EXACT_DIGITS if key == POLYNOMIALS else digits)
            for key, entry in content.items()
        }
        return others | _with_interval(content)
    if isinstance(content, list):
        return [rounded_content(entry, digits=digits) for entry in content]
    return rounded(content, digits=digits) if isinstance(content, float) else content


def _with_interval(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the rounded entries ``value`` and ``interval`` of a mapping that has an interval."""
    interval = content.get("interval")
    if not isinstance(interval, list) or len(interval) != 2:
        return {}
    low, high = interval
    ends = (-math.inf if low is None else float(low), math.inf if high is None else float(high))
    value = content.get("value")
    found: dict[str, Any] = {
        "interval": [end if math.isfinite(end) else None for end in rounded_interval(value, ends)]
    }
    if isinstance(value, int | float):
        found["value"] = rounded(float(value), ends)
    return found


def _common_place(value: float | None, interval: Interval) -> int | None:
    """Return the power of ten to which value and ends are rounded; None where the interval says nothing."""
    place = _supported_place(value, interval)
    if place is None:
        return None
    low, high = (_rounded_to(end, place, DEFAULT_DIGITS) for end in interval)
    again = _supported_place(
        None if value is None else _rounded_to(value, place, DEFAULT_DIGITS), (low, high)
    )
    return place if again is None else max(place, again)


def _supported_place(value: float | None, interval: Interval) -> int | None:
    low, high = interval
    if math.isfinite(low) and math.isfinite(high):
        half = 0.5 * high - 0.5 * low
    elif value is not None and (math.isfinite(low) or math.isfinite(high)):
        half = abs(value - (low if math.isfinite(low) else high))
    else:
        return None
    return Decimal(half).adjusted() - MORE_DIGITS if 0.0 < half < math.inf else None


def _rounded_to(value: float, place: int | None, digits: int) -> float:
    """Return a number rounded to a power of ten, with no fewer than the least digits; to `digits` without a place."""
    if value == 0.0 or not math.isfinite(value):
        return value
    exact = Decimal(repr(float(value)))
    first = exact.adjusted()
    if place is None:
        place = first - digits + 1
    place = max(min(place, first - LEAST_DIGITS + 1), first - _EXACT_DIGITS + 1)
    found = float(exact.quantize(Decimal((0, (1,), place))))
    return found if math.isfinite(found) else value
