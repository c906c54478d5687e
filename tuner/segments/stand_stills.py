"""Stand-stills between motions: knocks stay inside them, what settles beside a motion does not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tuner.segments.knock_bridges import MAX_BRIDGED_SHARE, MAX_SAMPLES, MAX_SECONDS, same_level
from tuner.segments.settling import settled_from
from tuner.types.records import Record

BoolArray = NDArray[np.bool_]
Segments = tuple[tuple[int, int], ...]

SETTLING_PROBABILITY = 0.01
"""Probability that an end of a stand-still beside a motion is cut where nothing settles: it costs about a second."""

MIN_SECONDS = 1.0
"""Shortest time between motions that counts as rest, s: a hand that turns a sensor pauses for less."""


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
        a = (
            begin
            if begin in edges
            else settled_from(records, moving, begin, end, SETTLING_PROBABILITY, back=False)
        )
        b = end if end in edges else settled_from(records, moving, a, end, SETTLING_PROBABILITY, back=True)
        parts.append((a, b))
    return tuple(parts), tuple(knocks)


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
