"""Parts of one log that were recorded under one condition: at rest, or at one temperature.

A coefficient of a whole log is a mean over its conditions. `still_parts` and `temperature_parts` cut the log
where these change, so that the parts can be identified on their own and compared (`tuner.comparison`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tuner.records import DataError, Record
from tuner.stillness import find_motion, keep_still

FloatArray = NDArray[np.float64]

MOST_PARTS = 8
"""Parts that are compared: the longest ones."""
SHORTEST_PART = 1024
"""Samples below which a part says too little."""


@dataclass(frozen=True)
class Part:
    """A part of a log under one condition, which `name` tells."""

    name: str
    records: tuple[Record, ...]


def clocks(records: Sequence[Record]) -> list[list[Record]]:
    """Return the records grouped by the clock they share."""
    groups: list[list[Record]] = []
    for record in records:
        for group in groups:
            first = group[0]
            if first.segments == record.segments and np.array_equal(first.t, record.t):
                group.append(record)
                break
        else:
            groups.append([record])
    return groups


def at_rest(records: Sequence[Record], say: Callable[[str], None] = lambda _: None) -> tuple[Record, ...]:
    """Return the records cut to the parts in which the sensor stood still.

    Parameters
    ----------
    records : sequence of Record
        Sensors of one log; those on one clock are judged together.
    say : callable, optional
        Receives a line about any motion.

    Raises
    ------
    DataError
        Nothing stands still.
    """
    kept: dict[int, Record] = {}
    for group in clocks(records):
        try:
            find_motion(group)
        except DataError:
            still: Sequence[Record] = group
        else:
            still = keep_still(group)
        for before, after in zip(group, still, strict=True):
            kept[id(before)] = after
    answer = tuple(kept[id(record)] for record in records)
    for line in dict.fromkeys(
        note for new, old in zip(answer, records, strict=True) for note in new.notes if note not in old.notes
    ):
        say(line)
    return answer
