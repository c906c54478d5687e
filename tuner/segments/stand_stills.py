"""Stand-stills between motions: knocks stay inside them, what settles beside a motion does not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.arrays import BoolArray
from tuner.segments.knock_bridges import MAX_BRIDGED_SHARE, MAX_SAMPLES, MAX_SECONDS, same_level
from tuner.segments.settling import settled_from
from tuner.types.records import Record

Segments = tuple[tuple[int, int], ...]


MIN_SECONDS = 1.0
"""Shortest time between motions that counts as rest, s: a hand that turns a sensor pauses for less."""
MIN_PART_SECONDS = 8.0
"""Length of a stand-still between motions from which its own noise tells whether it is at rest, s: that of the fewest
blocks that a record must have. Shorter ones are used where they are most of what is at rest, as among many poses."""
MAX_LEVEL_DIFFERENCE = float(np.log(1.2))
"""Difference of the level of the noise, mean of all channels, from that of the quietest stand-still: stand-stills of
one unit on a table differ by up to 1.1, and a hand, an engine or a road are more."""


def stand_stills(records: Sequence[Record], moving: BoolArray, long: BoolArray) -> tuple[Segments, Segments]:
    """Return the sample ranges of stand-stills, and those of the knocks inside them.

    Parameters
    ----------
    records : sequence of Record
        Sensors on one clock.
    moving : ndarray of bool, shape (n,)
        Samples in motion.
    long : ndarray of bool, shape (n,)
        Those of them that the variance of seconds shows: what is as strong or as long is no knock.
    """
    first = records[0]
    still: list[tuple[int, int]] = []
    knocks: list[tuple[int, int]] = []
    allowed = int(MAX_BRIDGED_SHARE * sum(b - a for a, b in first.segments))
    longest = min(MAX_SAMPLES, int(MAX_SECONDS * first.rate))
    shortest = max(1, round(MIN_SECONDS * first.rate))
    for segment in first.segments:
        before: tuple[int, int] | None = None
        for start, stop in runs(~moving, (segment,)):
            if stop - start < shortest and (start, stop) != segment:
                continue
            if before is not None:
                gap, room = start - before[1], min(stop - start, before[1] - before[0])
                short = 0 < gap <= min(longest, allowed, room) and not long[before[1] : start].any()
                if short and same_level(records, moving, before[1], start, room):
                    knocks.append((before[1], start))
                    allowed -= gap
                    still[-1] = (still[-1][0], stop)
                    before = start, stop
                    continue
            still.append((start, stop))
            before = start, stop
    edges = {edge for segment in first.segments for edge in segment}
    parts = []
    for begin, end in still:
        a = begin if begin in edges else settled_from(records, moving, begin, end, back=False)
        b = end if end in edges else settled_from(records, moving, a, end, back=True)
        parts.append((a, b))
    return tuple(parts), tuple(knocks)


def alike(records: Sequence[Record], still: Segments) -> Segments:
    """Return the stand-stills that are as quiet as the quietest one, less short ones where these are few.

    Between motions a unit may lie on a table, in a hand or in a vehicle: its noise is that of the quietest.
    """
    interval = records[0].interval
    long = tuple((a, b) for a, b in still if (b - a) * interval >= MIN_PART_SECONDS)
    level = {part: _level(records, *part) for part in still}
    quietest = min(level[part] for part in long or still)
    quiet = tuple(part for part in still if level[part] <= quietest + MAX_LEVEL_DIFFERENCE)
    kept = tuple(part for part in quiet if part in long)
    return kept if 2 * sum(b - a for a, b in kept) >= sum(b - a for a, b in quiet) else quiet


def _level(records: Sequence[Record], start: int, stop: int) -> float:
    """Return the mean over channels of ½ ln of the median variance of the seconds of a stand-still.

    Infinite where a channel keeps to one value: a frozen sensor is not quiet.
    """
    size = min(max(2, round(MIN_SECONDS * records[0].rate)), stop - start)
    count = (stop - start) // size
    found = []
    for record in records:
        blocks = record.y[start : start + count * size].reshape(count, size, -1)
        found += np.median(blocks.var(axis=1), axis=0).tolist()
    return float(np.mean(0.5 * np.log(found))) if min(found) > 0.0 else np.inf


def inside(n: int, ranges: Sequence[tuple[int, int]]) -> BoolArray:
    """Return which of n samples lie in ranges, shape (n,)."""
    chosen = np.zeros(n, dtype=bool)
    for start, stop in ranges:
        chosen[start:stop] = True
    return chosen


def runs(chosen: BoolArray, segments: Sequence[tuple[int, int]]) -> Segments:
    """Return the ranges of chosen samples within segments."""
    found = []
    for start, stop in segments:
        change = np.flatnonzero(
            np.diff(np.concatenate(([False], chosen[start:stop], [False])).astype(np.int8))
        )
        found += [(int(a) + start, int(b) + start) for a, b in zip(change[::2], change[1::2], strict=True)]
    return tuple(found)
