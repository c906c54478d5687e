"""One number and how far it can be trusted."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from tuner.limits import WIDEST_INTERVAL

TOO_SHORT = "record too short"
"""How the reason begins why there is only a bound, where a longer record would show the number."""
HIDDEN = "the quantizer hides it"
"""How the reason begins why there is only a bound, where rounding rules the samples."""
LEVEL = 0.95
"""Level of every interval and limit that does not say otherwise."""


@dataclass(frozen=True)
class Coefficient:
    """One number and how far it can be trusted.

    Attributes
    ----------
    value : float or None
        Estimate; None where the data only bound it.
    interval : (float, float) or None
        Two-sided 95 % interval.
    upper : float or None
        One-sided 95 % upper limit, where there is no value.
    unit : str
        SI unit.
    reason : str or None
        Why there is only a bound (absent, hidden, masked, record too short: hours needed), or what to know
        of the value.
    """

    value: float | None
    interval: tuple[float, float] | None
    upper: float | None
    unit: str
    reason: str | None = None

    @property
    def determined(self) -> bool:
        """Whether its interval excludes zero and its ends differ by less than `WIDEST_INTERVAL`: only then it names."""
        if self.value is None or self.interval is None:
            return False
        low, high = sorted(map(abs, self.interval))
        return (
            self.interval[0] * self.interval[1] > 0.0
            and math.isfinite(high)
            and high <= WIDEST_INTERVAL * low
        )

    @classmethod
    def known(
        cls, value: float, lower: float, upper: float, unit: str, reason: str | None = None
    ) -> Coefficient:
        """Make an estimate with its interval."""
        return cls(value, (lower, upper), None, unit, reason)

    @classmethod
    def bounded(cls, upper: float, unit: str, reason: str) -> Coefficient:
        """Make an upper limit with its reason."""
        return cls(None, None, upper, unit, reason)


def times(c: Coefficient, size: float, unit: str) -> Coefficient:
    """Return a factor on a size of a unit as a number of that unit, with its interval or limit."""
    low, high = c.interval or (None, None)
    value, low, high, upper = (None if end is None else end * size for end in (c.value, low, high, c.upper))
    return Coefficient(value, None if low is None or high is None else (low, high), upper, unit)


def apart(one: Coefficient | None, other: Coefficient | None) -> bool:
    """Return whether the 95 % intervals of two numbers do not meet."""
    if one is None or other is None or one.interval is None or other.interval is None:
        return False
    return one.interval[1] < other.interval[0] or other.interval[1] < one.interval[0]


def hours_needed(reason: str | None) -> float | None:
    """Return how long a record shows half of a bound, h, by the reason why there is only one; None where none does."""
    found = re.search(rf"{TOO_SHORT}: (\S+) hours", reason or "")
    return float(found[1]) if found else None
