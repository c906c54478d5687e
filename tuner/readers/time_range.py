"""The part of a log that its user wants, by the times of its clock: everything else is left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from tuner.formats.customary_units import stamp
from tuner.types.records import DataError, Record

MIN_SAMPLES = 64
"""Fewest samples of a part: an Allan curve of it has two points with eight differences and more."""


def between(
    records: Sequence[Record],
    begin: float | None,
    end: float | None,
    extent: tuple[float, float] | None = None,
) -> tuple[Record, ...]:
    """Return records of the samples from `begin` to before `end`, s on the clock of the log: the times of answers.

    `extent` is where the log begins and ends, s, if the records are a part of it already.

    Raises
    ------
    DataError
        Outside the log, end before begin, or too few samples: one line with what is possible.
    """
    if begin is None and end is None:
        return tuple(records)
    first, last = extent or (
        min(float(record.t[0]) for record in records),
        max(float(record.t[-1]) + record.interval for record in records),
    )
    lower, upper = expect_within(records, (first, last), begin, end)
    note = f"{stamp(lower)} to {stamp(upper)} s are used, as stated, of {stamp(first)} to {stamp(last)} s"
    return tuple(_part(record, lower, upper, note) for record in records)


def expect_within(
    records: Sequence[Record], extent: tuple[float, float], begin: float | None, end: float | None
) -> tuple[float, float]:
    """Return begin and end of what is used, s; raise DataError unless they are in order and in the extent of a log."""
    first, last = extent
    name = records[0].source or records[0].name
    lower, upper = (first if begin is None else begin), (last if end is None else end)
    log = f"the clock of the log goes from {stamp(first)} to {stamp(last)} s"
    near = max(record.interval for record in records)
    for option, value in (("begin", lower), ("end", upper)):
        if not first - near <= value <= last + near:
            raise DataError(f"{name}: {option} {stamp(value)}: {log}; leave it out to use all")
    if lower >= upper:
        raise DataError(
            f"{name}: begin {stamp(lower)}, end {stamp(upper)}: expected an end after the beginning; {log}"
        )
    return lower, upper


def _part(record: Record, begin: float, end: float, note: str) -> Record:
    """Return the samples of one record in a range of its clock."""
    half = 0.5 * record.interval  # stamps have digits of their own
    start, stop = (int(k) for k in record.t.searchsorted((begin - half, end - half)))
    segments = [(max(a, start) - start, min(b, stop) - start) for a, b in record.segments]
    segments = [(a, b) for a, b in segments if b > a]
    count = sum(b - a for a, b in segments)
    if count < MIN_SAMPLES:
        raise DataError(
            f"{record.source or record.name}: --begin and --end leave {count} samples of {record.name}, "
            f"expected {MIN_SAMPLES} or more: {MIN_SAMPLES * record.interval:.3g} s"
        )
    return replace(
        record,
        t=record.t[start:stop],
        y=record.y[start:stop],
        segments=tuple(segments),
        covariates=MappingProxyType({name: x[start:stop] for name, x in record.covariates.items()}),
        notes=(*record.notes, note),
        short_clusters=MappingProxyType({}),
    )
