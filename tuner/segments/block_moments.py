"""Mean and variance of the samples of many blocks of one channel, without a copy of the samples."""

from __future__ import annotations

import numpy as np
from numba import njit

from models.arrays import FloatArray, IntArray


def block_moments(column: FloatArray, starts: IntArray, stops: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean and the variance (of n − 1) of samples start … stop − 1 of each block, shapes (b,).

    Parameters
    ----------
    column : ndarray, shape (n,)
        Samples of one channel.
    starts, stops : ndarray of int, shape (b,)
        First and last (exclusive) sample of each block, two samples or more; blocks may overlap.
    """
    mean, variance = np.empty(len(starts)), np.empty(len(starts))
    _moments(column, starts, stops, mean, variance)
    return mean, variance


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})  # type: ignore[misc, unused-ignore]
def _moments(
    column: FloatArray, starts: IntArray, stops: IntArray, mean: FloatArray, variance: FloatArray
) -> None:
    """Write mean and variance of each block, the variance about the mean: sums of squares would lose digits."""
    for k in range(starts.size):
        first, count, total, square = column[starts[k]], stops[k] - starts[k], 0.0, 0.0
        for i in range(starts[k], stops[k]):
            total += column[i] - first
        level = first + total / count
        for i in range(starts[k], stops[k]):
            square += (column[i] - level) ** 2
        mean[k], variance[k] = level, square / (count - 1)
