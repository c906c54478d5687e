"""The part of a log that its user wants: seconds from its first sample, everything else is left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from tuner.types.records import DataError, Record

MIN_SAMPLES = 64
"""Fewest samples of a part: an Allan curve of it has two points with eight differences and more."""


def between(records: Sequence[Record], begin: float | None, end: float | None) -> tuple[Record, ...]:
    """Return records of the samples from `begin` to before `end`, s from the first sample of the log.

    Raises
    ------
    DataError
        Outside the log, end before begin, or too few samples: one line with what is possible.
    """
    if begin is None and end is None:
        return tuple(records)
    name = records[0].source or records[0].name
    first = min(float(record.t[0]) for record in records)
    length = max(float(record.t[-1]) + record.interval for record in records) - first
    lower, upper = (0.0 if begin is None else begin), (length if end is None else end)
    for option, value in (("--begin", lower), ("--end", upper)):
        if not math.isfinite(value) or value < 0.0:
            msg = f"{name}: {option} {value:g}: expected seconds from the start of the log, 0 to {length:.6g}"
            raise DataError(msg)
    if lower >= upper:
        msg = f"{name}: --begin {lower:g} --end {upper:.6g}: expected an end after the beginning"
        if end is None:
            msg = f"{name}: --begin {lower:g}: expected less than the {upper:.6g} s of the log"
        raise DataError(msg)
    if upper > length + max(record.interval for record in records):
        msg = f"{name}: --end {upper:g}: the log ends at {length:.6g} s; leave --end out to use it to its end"
        raise DataError(msg)
    note = f"{lower:.6g} to {min(upper, length):.6g} s of {length:.6g} s are used, as stated"
    return tuple(_part(record, first + lower, first + upper, note) for record in records)


def _part(record: Record, begin: float, end: float, note: str) -> Record:
    """Return the samples of one record in a range of its clock."""
    half = 0.5 * record.interval  # stamps have digits of their own
    start, stop = (int(k) for k in record.t.searchsorted((begin - half, end - half)))
    segments = [(max(a, start) - start, min(b, stop) - start) for a, b in record.segments]
    segments = [(a, b) for a, b in segments if b > a]
    count = sum(b - a for a, b in segments)
    if count < MIN_SAMPLES:
        msg = (
            f"{record.source or record.name}: --begin and --end leave {count} samples of {record.name}, "
            f"expected {MIN_SAMPLES} or more: {MIN_SAMPLES * record.interval:.3g} s"
        )
        raise DataError(msg)
    return replace(
        record,
        t=record.t[start:stop],
        y=record.y[start:stop],
        segments=tuple(segments),
        covariates=MappingProxyType({name: x[start:stop] for name, x in record.covariates.items()}),
        notes=(*record.notes, note),
        short_clusters=MappingProxyType({}),
    )
