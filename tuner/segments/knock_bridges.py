"""Samples in place of a knock, where the sensor rests at the same level after it as before.

A knock of a second in an hour would otherwise part the record, and every part has a mean of its own: what is slower
than the parts would be lost. Where the level differs (the sensor lies otherwise), the parts stay apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from models.arrays import BoolArray
from models.probability import student_quantile
from tuner.readers.gap_bridges import bridged
from tuner.types.records import Record

MAX_SECONDS, MAX_SAMPLES = 4.0, 1024
"""Longest knock that is bridged: a second and its neighbours; the work grows as the cube of the samples."""
MAX_BRIDGED_SHARE = 0.05
"""Share of the samples that may be bridged: what is drawn has the law of its neighbours, and adds nothing to it."""
LEVEL_SECONDS = 1.0
"""Length of the means that are compared, s."""
NEAR_SECONDS = 60.0
"""Time on either side of a knock whose means tell what is usual, s."""
MIN_DIFFERENCES = 8
"""Fewest differences of means that tell whether another one is unusual."""
LEVEL_PROBABILITY = 0.01
"""Probability that a level which has not changed counts as another one: the price is one part more."""


def same_level(records: Sequence[Record], moved: BoolArray, start: int, stop: int, room: int) -> bool:
    """Return whether the mean of no channel differs over a knock by more than it does elsewhere over as long a time.

    Parameters
    ----------
    records : sequence of Record
        Sensors on one clock.
    moved : ndarray of bool, shape (n,)
        Samples in motion.
    start, stop : int
        First and last (exclusive) sample of the knock.
    room : int
        Samples at rest on either side.
    """
    first = records[0]
    begin, end = next((a, b) for a, b in first.segments if a <= start < b)
    near = round(NEAR_SECONDS * first.rate)
    begin, end = max(begin, start - near), min(end, stop + near)
    size = min(max(1, round(LEVEL_SECONDS * first.rate)), room)
    apart = size + stop - start
    total = np.concatenate(([0], np.cumsum(moved[begin:end])))
    places = np.arange(0, end - begin - apart - size + 1, size)
    places = places[total[places + apart + size] == total[places]]
    if len(places) < MIN_DIFFERENCES:
        return False
    y = np.hstack([record.y[begin:end] for record in records])
    sums = np.vstack([np.zeros(y.shape[1]), np.cumsum(y - y[0], axis=0)])
    means = (sums[size:] - sums[:-size]) / size
    usual = means[places + apart] - means[places]
    off = np.abs(means[stop - begin] - means[start - size - begin] - usual.mean(axis=0))
    quantile = -student_quantile(0.5 * LEVEL_PROBABILITY / y.shape[1], len(places) - 1)
    return bool(np.all(off <= quantile * usual.std(axis=0, ddof=1)))


def bridge_knocks(record: Record, knocks: Sequence[tuple[int, int]]) -> Record:
    """Return a record with samples simulated from those beside them in place of knocks inside its segments."""
    y = record.y.copy(order="F")
    for start, stop in record.segments:  # each has a noise of its own: what moved between them is none
        kept = np.ones(stop - start, dtype=bool)
        for a, b in knocks:
            kept[max(a - start, 0) : max(b - start, 0)] = False
        place = np.flatnonzero(kept)
        if len(place) < len(kept):
            for j, column in enumerate(y.T):
                column[start:stop] = bridged(column[start:stop][kept], place, ((0, len(kept)),), j)
    return replace(record, y=y, short_clusters=MappingProxyType({}))
