"""What settles after a motion, or begins to move before one, is no part of a stand-still.

A mount creeps, a hand lets go, a sensor recovers from acceleration or warms in the hand. Beside a motion the mean of
the first w seconds then differs from that of the next 8 w by more than such means differ elsewhere in the stand-still.
With D_w that difference, and s_w its sd over the ν + 1 = T/w - 9 places behind the first one in T seconds,

    |D_w - mean| > t(p; ν) s_w √(1 + 1/(ν + 1)),    w = 1, 2, 4, … s up to T/24

White noise, flicker noise, random walk and a ramp have stationary normal differences, so that p is the probability of a
false cut, shared among channels and widths. The beginning moves on by the shortest w that differs until none does. What
still differs after the longest time or a quarter of the stand-still is a drift, as of a sensor that warms up: it stays,
for identification and diagnosis to treat.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.arrays import BoolArray, FloatArray
from models.probability import student_quantile
from tuner.types.records import Record

MAX_SETTLING = 30.0
"""Longest time that counts as settling, s: mounts, hands and anti-aliasing filters are done by then; heat is not."""
SETTLING_PROBABILITY = 0.01
"""Probability that an end of a stand-still beside a motion is cut where nothing settles: it costs about a second."""
MAX_SHARE = 0.25
"""Longest settling ÷ stand-still: the rest must tell what is usual."""
SHORTEST_MEAN = 1.0
"""Length of the shortest means, s: that of a movement of a hand."""
FOLLOWING_RATIO = 8
"""Length of the mean that follows ÷ that of the first one: longer ones add less than 1/16 to the information."""
MIN_PLACES = 15
"""Fewest independent differences that tell what is usual."""


def settled_from(records: Sequence[Record], moved: BoolArray, start: int, stop: int, *, back: bool) -> int:
    """Return from which sample on a stand-still has settled; with `back`, up to which it has not begun to move.

    Parameters
    ----------
    records : sequence of Record
        Sensors on one clock.
    moved : ndarray of bool, shape (n,)
        Samples of knocks inside the stand-still: a mean that holds one is replaced by those beside it.
    start, stop : int
        Samples of a stand-still, beside a motion before it (with `back`: behind it).
    back : bool
        Whether its end is judged instead of its beginning.
    """
    shortest = max(1, round(SHORTEST_MEAN * records[0].rate))
    turn = -1 if back else 1
    y = np.hstack([record.y[start:stop][::turn] for record in records])
    means = _without(
        _means(y, shortest), _means(moved[start:stop][::turn, None].astype(float), shortest)[:, 0] > 0.0
    )
    limit = int(min(MAX_SETTLING / (shortest * records[0].interval), MAX_SHARE * len(means)))
    tests = means.shape[1] * max(
        1.0, np.log2(max(len(means) / (FOLLOWING_RATIO + 1 + MIN_PLACES), 1.0)) + 1.0
    )
    cut = 0
    while cut < limit:
        width = _differing(means[cut:], SETTLING_PROBABILITY / tests)
        if width == 0:
            break
        cut += width
    if cut >= limit:
        cut = 0
    return stop - cut * shortest if back else start + cut * shortest


def _means(y: FloatArray, size: int) -> FloatArray:
    count = len(y) // size
    return np.asarray(y[: count * size].reshape(count, size, y.shape[1]).mean(axis=1))


def _without(means: FloatArray, left_out: BoolArray) -> FloatArray:
    """Return means, shape (m, k), with those left out on lines between the others."""
    good, lost = np.flatnonzero(~left_out), np.flatnonzero(left_out)
    if len(good) and len(lost):
        means[lost] = np.column_stack([np.interp(lost, good, column) for column in means[good].T])
    return means


def _differing(means: FloatArray, probability: float) -> int:
    """Return the shortest width, in means, whose first difference is unlike the others on any channel; 0 for none."""
    total = np.vstack([np.zeros(means.shape[1]), np.cumsum(means - means[-1:], axis=0)])
    width = 1
    while len(means) >= width * (FOLLOWING_RATIO + 1 + MIN_PLACES):
        whole = width * (FOLLOWING_RATIO + 1)
        later = (total[whole:] - total[width : len(total) - whole + width]) / (whole - width)
        change = (total[width : width + len(later)] - total[: len(later)]) / width - later
        others = change[width:]
        places = len(means) / width - FOLLOWING_RATIO - 1.0
        sd = others.std(axis=0) * np.sqrt(places / (places - 1.0)) + np.finfo(float).tiny
        quantile = -student_quantile(0.5 * probability, places - 1.0)
        off = np.abs(change[0] - others.mean(axis=0)) / (sd * np.sqrt(1.0 + 1.0 / places))
        if np.any(off > quantile):
            return width
        width *= 2
    return 0
