"""Records without readings that are frozen for long: what is not measured ends a segment, as a gap does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tuner.readers.time_base import MAX_BRIDGED_GAP
from tuner.segments.conditions import MIN_PART_SAMPLES
from tuner.segments.frozen import cut, frozen
from tuner.segments.stationary import Segments
from tuner.types import Finding
from tuner.types.records import Record


def without_long_frozen(record: Record, findings: Sequence[Finding]) -> tuple[Record, ...]:
    """Return a record for each axis, without frozen readings where one stretch is long; the record alone where none is.

    Parameters
    ----------
    record : Record
        Samples of one sensor.
    findings : sequence of Finding
        Of a diagnosis of it. A stretch is long that exceeds `MAX_BRIDGED_GAP`, the longest gap that is bridged; where
        fewer than `MIN_PART_SAMPLES` samples would be left, an axis stays as it is.
    """
    named = {axis for one in findings if one.cause == "duplicates" for axis in one.channels}
    found = {axis: one for axis in record.axes if axis in named and (one := frozen(record, axis))}
    kept = {
        axis: cut(record.segments, one.stretches)
        for axis, one in found.items()
        if one.longest[1] - one.longest[0] > MAX_BRIDGED_GAP
    }
    left = {
        axis: parts
        for axis, parts in kept.items()
        if sum(stop - start for start, stop in parts) >= MIN_PART_SAMPLES
    }
    return tuple(_one_axis(record, axis, left.get(axis)) for axis in record.axes) if left else (record,)


def _one_axis(record: Record, axis: str, parts: Segments | None) -> Record:
    """Return one axis of a record, of which parts are left; None for all."""
    column = record.axes.index(axis)
    return replace(
        record,
        y=record.y[:, column : column + 1],
        axes=(axis,),
        segments=record.segments if parts is None else parts,
        short_clusters=record.short_clusters if parts is None else {},
        limiting_steps={one: step for one, step in record.limiting_steps.items() if one == axis},
    )
