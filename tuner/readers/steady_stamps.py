"""Stamps that scatter about the instants they stand for: the scatter is estimated and taken out, uneven sampling stays.

A stamp is the instant x of the sample and an error of its own, t = x + n, as by a computer that stamps what arrives;
the instants are apart by the interval p and a random step w, as of a clock that wanders or a logger that is busy.
Differences over m samples have the variance::

    V(m) = 2 var n + m var w

Two of them give both variances. The instants are then those of least squares, a tridiagonal system::

    minimise  Σ (t − x)²/var n + Σ (x_{i+1} − x_i − p)²/var w

Where n is small, or nothing beside w, the stamps stay as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from models.arrays import FloatArray
from models.robust import normal_sd

MIN_STAMPS = 100
"""Stamps from which both variances are known to some 20 %."""
MIN_SCATTER = 5e-4
"""Scatter that is taken out, s: that of stamps rounded to milliseconds, 0.3 ms, is not."""
MIN_SHARE = 0.2
"""Share of the scatter in the variance of one step from which it is taken out: it has none of evenly written stamps,
and less can hardly be distinguished from none in a hundred of them."""
MAX_STEP_ERROR = 0.5
"""Step, less the interval, in intervals, from which a sample may be missing: the sides are then not compared."""
MAX_SCATTERS = 6.0
"""The same in robust sds of the steps, where that is more: scatter alone does not reach it in a million steps."""
LONG_DIFFERENCE = 100
"""Samples of the longer difference, at most a tenth of all: the wandering of a clock shows there."""
MAX_AVERAGED = 1e6
"""Largest ratio of var n to var w: clocks wander over some root of it, a thousand samples."""


def steady_stamps(t: FloatArray) -> tuple[FloatArray, float]:
    """Return stamps without their scatter, and its sd, s; the stamps as they are, and 0, where there is next to none.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Stamps, s, strictly increasing.
    """
    if len(t) < MIN_STAMPS:
        return t, 0.0
    step = np.diff(t)
    interval = float(np.median(step))
    spread = float(normal_sd(step - interval))
    usual = np.abs(step - interval) < max(MAX_STEP_ERROR * interval, MAX_SCATTERS * spread)
    error = np.where(usual, step - _slope(t, usual), 0.0)
    m = min(LONG_DIFFERENCE, len(t) // 10)
    one, many = _variance(error, usual, 1), _variance(error, usual, m)
    if one is None or many is None:
        return t, 0.0
    walk = max((many - one) / (m - 1), 0.0)
    scatter = 0.5 * (one - walk)
    if scatter < 0.5 * MIN_SHARE * one or scatter < MIN_SCATTER**2:
        return t, 0.0
    ratio = min(scatter / walk, MAX_AVERAGED) if walk > 0.0 else MAX_AVERAGED
    joined = ratio * usual
    bands = np.ones((2, len(t)))
    bands[0] = 0.0
    bands[0, 1:] = -joined
    bands[1, :-1] += joined
    bands[1, 1:] += joined
    pull = joined * error
    shift = solveh_banded(bands, np.append(pull, 0.0) - np.append(0.0, pull))
    out = t + shift
    return (out, float(np.sqrt(scatter))) if np.all(np.diff(out) > 0.0) else (t, 0.0)


def _slope(t: FloatArray, joined: NDArray[np.bool_]) -> float:
    """Return the common slope of stamps on their number in the pieces whose steps are joined."""
    piece = np.append(0, np.cumsum(~joined))
    size = np.bincount(piece)
    number, stamp = (
        x - (np.bincount(piece, x) / size)[piece] for x in (np.arange(len(t), dtype=float), t - t[0])
    )
    return float(number @ stamp) / max(float(number @ number), 1.0)


def _variance(error: FloatArray, usual: NDArray[np.bool_], m: int) -> float | None:
    """Return the mean square of sums of m neighbouring step errors, none unusual; None where there are too few."""
    total, count = (np.append(0.0, np.cumsum(x)) for x in (error, usual))
    whole = count[m:] - count[:-m] == m
    if np.count_nonzero(whole) < max(MIN_STAMPS // 2, m):
        return None
    return float(np.mean((total[m:] - total[:-m])[whole] ** 2))
