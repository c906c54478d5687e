"""Arguments of functions that are not what these take: refused in one line that says what to pass."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Real
from typing import Any

import numpy as np

from tuner.types.records import DataError, Record

RECORDS = "records, such as tuner.read(log) returns"
"""What functions of a static log take."""


def expect(value: object, kinds: type | tuple[type, ...], where: str, wanted: str) -> None:
    """Refuse a value that is of none of these types, and an empty text.

    Parameters
    ----------
    value : object
        An argument.
    kinds : type or tuple of type
        What it may be.
    where : str
        Function or argument, as its user knows it.
    wanted : str
        What to pass, in words.

    Raises
    ------
    DataError
        One line: where, expected, found.
    """
    if not isinstance(value, kinds) or (isinstance(value, str) and not value.strip()):
        raise DataError(f"{where}: expected {wanted}, found {described(value)}")


def expect_records(value: object, where: str, wanted: str = RECORDS) -> tuple[Record, ...]:
    """Return a record, or several, as a tuple; refuse all else, and none at all."""
    if isinstance(value, Record):
        return (value,)
    known = isinstance(value, Iterable) and not isinstance(value, str | bytes | dict) and not _is_table(value)
    records: tuple[Any, ...] = tuple(value) if known and isinstance(value, Iterable) else ()
    if not records or not all(isinstance(one, Record) for one in records):
        cure = "; tuner.read makes records of it" if isinstance(value, dict) or _is_table(value) else ""
        raise DataError(f"{where}: expected {wanted}, found {described(value)}{cure}")
    return records


def fault(value: object) -> str:
    """Return why no function can use a result, such as a record without samples, in words; empty where one can."""
    said = getattr(value, "unusable", "")
    return said if isinstance(said, str) else ""


def described(value: object) -> str:
    """Return what a value is, in a few words: a number or short text itself, else its type and size."""
    vast = isinstance(value, int) and value.bit_length() > 128  # Python writes no number of 4300 digits
    plain = value is None or (isinstance(value, str | bytes | Real | np.bool_) and not vast)
    if plain and len(repr(value)) <= 40:
        return repr(value)
    kind = f"{type(value).__module__.partition('.')[0]}.{type(value).__name__}".removeprefix("builtins.")
    if said := fault(value):
        return f"{kind} {said}"
    if shape := getattr(value, "shape", ()):
        return f"{kind} of shape {shape}"
    if isinstance(value, list | tuple | set | dict):
        types = f" ({', '.join(dict.fromkeys(type(one).__name__ for one in value))})" if value else ""
        numbers = (one for one in value if isinstance(one, float))
        return (
            f"{kind} of {len(value)}{types}{'' if all(map(math.isfinite, numbers)) else ', not all finite'}"
        )
    return kind


def _is_table(value: object) -> bool:
    """Whether a value is a pandas DataFrame, by what one has."""
    return all(hasattr(value, name) for name in ("columns", "index", "iloc"))
