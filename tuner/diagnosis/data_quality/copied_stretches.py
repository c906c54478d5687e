"""Stretches of a log that stand in it twice, as from a buffer that was written again: noise never repeats itself.

Every window of 32 rows of samples is given a number by a hash of its bits, built by doubling; those whose number is a
multiple of 64 are sorted, and equal ones compared. Where two are equal in fact, the stretch is followed to both sides.
Two windows are equal by chance in q³² of n² cases, q the share of rows that equal a row far away: where a coarse
quantizer makes that likely, nothing is tested.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.diagnosis.data_quality.copied_samples import Packets

WINDOW_DOUBLINGS = 5
"""Doublings of a window: 2⁵ rows."""
ANCHOR_MASK = np.uint64(63)
"""Bits of a number that are zero in the windows that are compared: one in 64, five in a stretch of 350 rows."""
MAX_CHANCE = 1e-9
"""Largest expected number of equal windows by chance with which anything is tested."""
MIN_MOVES = 16
"""Least number of rows of a window that differ from the one before: a frozen or repeated reading is no copy."""
FACTORS = np.array(
    [0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93], dtype=np.uint64
)
"""Odd numbers of random bits, by which words are multiplied."""

ROWS_AT_ONCE = 1 << 15
"""Rows treated at a time, so that what is computed from them stays in the cache of a processor."""


def find_copied_stretches(y: FloatArray) -> Packets:
    """Search the rows of samples, shape (n, k), for stretches that come again."""
    none = Packets(0, 0, 1.0, np.zeros(len(y), dtype=bool))
    window, n = 2**WINDOW_DOUBLINGS, len(y)
    if n < 4 * window:
        return none
    usual = float(np.max([np.mean(np.all(y[lag:] == y[:-lag], axis=1)) for lag in (n // 3, n // 2)]))
    chance = float(n) ** 2 * max(usual, 1.0 / n) ** window
    if chance > MAX_CHANCE:
        return none
    place, number = _anchors(y, window)
    order = np.argsort(number, kind="stable")
    place = place[order]
    again = np.flatnonzero(np.diff(number[order]) == 0)
    copies, lengths = np.zeros(n, dtype=bool), []
    for first, second in zip(place[again].tolist(), place[again + 1].tolist(), strict=True):
        if copies[second]:
            continue
        begin, end = _followed(y, first, second)
        moves = np.count_nonzero(np.any(np.diff(y[begin:end], axis=0) != 0.0, axis=1))
        if end - begin >= window and moves >= MIN_MOVES and end - begin <= second - first:
            copies[begin:end] = True
            lengths.append(end - begin)
    return Packets(max(lengths), len(lengths), chance, copies) if lengths else none


def _anchors(y: FloatArray, window: int) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
    """Return which windows of rows are compared, and their numbers, shapes (m,)."""
    places, numbers = [], []
    for first in range(0, len(y) - window + 1, ROWS_AT_ONCE):
        number = _numbers(y[first : first + ROWS_AT_ONCE + window - 1])
        at = np.flatnonzero(number & ANCHOR_MASK == 0)
        places.append(first + at)
        numbers.append(number[at])
    return np.concatenate(places), np.concatenate(numbers)


def _numbers(y: FloatArray) -> NDArray[np.uint64]:
    """Return a number for each window of rows, shape (n − window + 1,)."""
    bits = np.ascontiguousarray(y, dtype=float).view(np.uint64)
    number = np.zeros(len(y), dtype=np.uint64)
    for column in bits.T:
        number = (number ^ column) * FACTORS[0]
        number ^= number >> np.uint64(29)
    for step in range(WINDOW_DOUBLINGS):
        width = 2**step
        number = number[:-width] * FACTORS[1 + step % 3] + number[width:]
        number ^= number >> np.uint64(31)
    return number


def _followed(y: FloatArray, first: int, second: int) -> tuple[int, int]:
    """Return where the later one of two equal stretches begins and ends, given two rows of them."""
    ahead = np.all(y[second:] == y[first : first + len(y) - second], axis=1)
    length = len(ahead) if ahead.all() else int(np.argmin(ahead))
    behind = np.all(y[:second][::-1][:first] == y[:first][::-1][: min(first, second)], axis=1)
    before = len(behind) if behind.all() else int(np.argmin(behind))
    return second - before, second + length
