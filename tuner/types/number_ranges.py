"""Numbers with a range: what a document may state in a field."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated


@dataclass(frozen=True)
class Limits:
    """A range of numbers, and the words in which a message names it; `open_low` leaves out the lower limit."""

    words: str
    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False

    def allow(self, number: float) -> bool:
        """Return whether a number lies in the range."""
        return (self.low < number if self.open_low else self.low <= number) and number <= self.high


@dataclass(frozen=True)
class VectorLimits:
    """Three numbers x, y, z, none of them larger than a limit."""

    largest: float = math.inf


LARGEST_READING: Mapping[str, float] = MappingProxyType({"rad": 1e5, "m": 1e6})
"""Readings that no sensor has, rad/s and m/s², by what is integrated; no sd and no density is larger, either."""
LONGEST_LEVER_ARM = 100.0
"""m: an antenna is not farther from the inertial unit, on ships either; a longer one is in a wrong unit."""


def largest_reading(unit: str) -> float:
    """Return the largest reading of a sensor with this unit, and number of its noise; infinity for other units."""
    return LARGEST_READING.get(unit.partition("/")[0], math.inf)


Finite = Annotated[float, Limits("a number")]
Positive = Annotated[float, Limits("a positive number", 0.0, open_low=True)]
SamplingInterval = Annotated[float, Limits("a number of seconds from 1e-7 to 86400", 1e-7, 86400.0)]
"""s: from the fastest converters to one sample a day; what lies beyond is in another unit or damaged."""
NonNegative = Annotated[float, Limits("a number not below 0", 0.0)]
Share = Annotated[float, Limits("a number from 0 to 1", 0.0, 1.0)]
Vector3 = Annotated[tuple[float, float, float], VectorLimits()]
LeverArm = Annotated[tuple[float, float, float], VectorLimits(LONGEST_LEVER_ARM)]
"""m."""
Whole = Annotated[int, Limits("a whole number from 0 on", 0)]
Count = Annotated[int, Limits("a whole number from 1 on", 1)]
ArmaOrder = Annotated[int, Limits("a whole number from 1 to 5", 1, 5)]
Several = Annotated[int, Limits("a whole number from 2 on", 2)]
"""A number of runs that are compared with one another."""
Latitude = Annotated[float, Limits("degrees from -90 to 90", -90.0, 90.0)]
