"""Rows of a log that hold no measurement: how many count as missing, and from which share on a log is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from models.arrays import FloatArray
from tuner.types.records import DataError


@dataclass(frozen=True)
class LogRows:
    """Which rows of a log are at hand: the number of the first one, from 0 on, and how many the whole log has."""

    first: int
    count: int


@dataclass(frozen=True)
class BadRows:
    """Rows that hold no measurement.

    Attributes
    ----------
    number : int
        How many.
    holding : str
        What they hold, in words.
    place : str
        The first one, in words.
    max_share : float
        Share of the log from which it is refused.
    cure : str
        What to do then.
    off : mapping of str to ndarray
        By axis, how far readings are off, in the unit of the file; none of rows that hold no number.
    """

    number: int
    holding: str
    place: str
    max_share: float
    cure: str
    off: Mapping[str, FloatArray] = field(default_factory=dict)


def expect_few(found: Sequence[BadRows], count: int) -> None:
    """Refuse a log of so many rows with more bad ones of one kind, found in one part of it or several, than allowed.

    Raises
    ------
    DataError
        One line: how many, the first one, and what to do.
    """
    first: dict[str, BadRows] = {}
    for one in found:
        first.setdefault(one.holding, one)
    for holding, one in first.items():
        number = sum(other.number for other in found if other.holding == holding)
        if number > one.max_share * count:
            raise DataError(
                f"{number} of {count} rows hold {holding} ({one.place}); more than {100.0 * one.max_share:g} % cannot "
                f"be repaired: {one.cure}"
            )
