"""A clock that changes its step: where stamps of a considerable part of a log are further apart than usual.

White noise goes with the square root of the interval. Samples are counted with those that are missing, so that gaps,
losses at random and bursts leave the step as it is; where most steps leave out the same number, that is the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray, IntArray
from tuner.limits import SHOWN_CHANGE

CONSIDERABLE_SHARE = 0.1
"""Share of the rows over which a step is averaged: as many stamps that go back are another clock, not disorder."""
MIN_STEPS = 32
"""Steps from which one is averaged: as many as average the jitter of stamps elsewhere."""
LONGEST_DELAY = 1.0
"""Delay of stamps by a buffer, s, by which a step is wrong that is averaged over a time no longer than this."""


@dataclass(frozen=True)
class StepChange:
    """Time at which a clock changes its step, the step before and after it, s, and the factor by which N is wrong."""

    time: float
    before: float
    after: float
    factor: float


def change_of_step(t: FloatArray, interval: float, at: IntArray, size: IntArray) -> StepChange | None:
    """Return the change of the step if it shows in white noise, and buffers that delay stamps do not explain it.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Stamps in order, s.
    interval : float
        Common interval, s.
    at, size : ndarray, shape (k,)
        Rows behind which samples are missing, and how many.
    """
    rows = max(int(CONSIDERABLE_SHARE * len(t)), MIN_STEPS)
    if len(t) <= 2 * rows:
        return None
    starts = np.append(np.arange(0, len(t) - 1 - rows, rows // 2), len(t) - 1 - rows)
    lost = np.zeros(len(t), np.int64)
    lost[at + 1] = size
    number = np.arange(len(t)) + np.cumsum(lost)
    steps = np.array([_step(t, number, start, start + rows) for start in starts])
    factor = math.sqrt(float(np.maximum(steps / interval, interval / steps).max()))
    span = rows * interval
    if factor <= 1.0 + SHOWN_CHANGE or span < LONGEST_DELAY / (1.0 - factor**-2):
        return None
    change = np.abs(np.diff(np.log(steps)))
    first = starts[max(int(np.argmax(change)) - 1, 0)]
    last = min(first + 3 * rows, len(t) - 1)
    course = t[first : last + 1] - t[first]
    middle = first + int(np.argmax(np.abs(course - np.linspace(0.0, course[-1], len(course)))))
    before = _step(t, number, max(middle - rows, 0), middle)
    after = _step(t, number, middle, min(middle + rows, len(t) - 1))
    return StepChange(float(t[middle]), before, after, factor)


def _step(t: FloatArray, number: IntArray, start: int, stop: int) -> float:
    """Return the usual step between two rows, s: samples that are missing apart, but for those that regularly are."""
    if stop <= start:
        return float(t[min(start + 1, len(t) - 1)] - t[start])
    each = np.diff(number[start : stop + 1])
    usual = int(np.median(each))
    regular = usual if np.mean(each == usual) > 0.5 else 1
    return float(t[stop] - t[start]) / float(number[stop] - number[start]) * regular
