"""Moments, quantiles, robust standard deviation and periodogram of long series, without a sorted or full copy."""

from __future__ import annotations

from typing import Any, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from models.arrays import SAMPLES_AT_ONCE, FloatArray, SingleArray
from tuner.curves.long_transforms import without_tables

Real = TypeVar("Real", np.float32, np.float64)

MAX_RANK_CELLS = 1 << 14
"""Cells of equal width among which numbers are counted to find some by rank: the table stays in the cache."""
NUMBERS_PER_CELL = 2
"""Numbers a cell of a short series: with more, sorting them costs more than the table, with fewer the table does."""
RESIDUAL_CLIP = 5.0
"""Sds at which residuals are cut for tests of the spectrum and of the variance.

Normal samples exceed five with a chance of 6e-7; spikes, which have a test of their own, do not decide these.
"""


def unit_periodogram(e: SingleArray, size: int) -> SingleArray:
    """Return the periodogram of e, followed by zeros up to `size`, at frequencies 1 … size/2, mean 1."""
    wave = rfft(e, size)[1:]
    without_tables(size)
    power: SingleArray = wave.real**2
    power += wave.imag**2
    del wave
    parts = (e[first : first + SAMPLES_AT_ONCE] for first in range(0, len(e), SAMPLES_AT_ONCE))
    power /= np.float32(sum(float(part @ part) for part in parts))
    return power


def moment(e: SingleArray, order: int) -> float:
    """Return the mean of a power of numbers, summed in double precision."""
    total = 0.0
    for first in range(0, len(e), SAMPLES_AT_ONCE):
        part = e[first : first + SAMPLES_AT_ONCE].astype(float)
        product = part.copy()
        for _ in range(order - 1):
            product *= part
        total += float(product.sum())
    return total / len(e)


def robust_sd(e: FloatArray) -> float:
    """Return the standard deviation with squares capped at five deviations."""
    mean = float(e.mean())
    cap = RESIDUAL_CLIP * float(np.sqrt(max(float(e @ e) / len(e) - mean * mean, 0.0)))
    for _ in range(5):
        cap = RESIDUAL_CLIP * float(np.sqrt(_capped_square(e, cap * cap) / len(e)))
    return cap / RESIDUAL_CLIP


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _capped_square(e: FloatArray, cap: float) -> float:
    """Return the sum of the squares, none above `cap`."""
    total = 0.0
    for i in range(e.size):
        total += min(e[i] * e[i], cap)
    return total


def row_medians(rows: NDArray[Real]) -> NDArray[Real]:
    """Return the median of each row, shape (r, w) to (r,), as `numpy.median` gives it."""
    return np.asarray(_row_medians(rows))


def order_statistics(x: FloatArray, ranks: NDArray[np.intp]) -> FloatArray:
    """Return the numbers of these ranks, 0 for the least, rising, among x: of `numpy.sort` without the sorting."""
    return np.asarray(_order_statistics(x, ranks))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _row_medians(rows: NDArray[Any]) -> NDArray[Any]:
    number, width = rows.shape
    out = np.empty(number, rows.dtype)
    ranks = np.array([(width - 1) // 2, width // 2])
    half = out.dtype.type(0.5)
    for row in range(number):
        middle = _order_statistics(rows[row], ranks)
        out[row] = half * (middle[0] + middle[1])
    return out


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _order_statistics(x: NDArray[Any], ranks: NDArray[np.intp]) -> NDArray[Any]:
    """Return numbers by rank: only those in the cells of the ranks are sorted, and all where one cell holds most."""
    low, high = x[0], x[0]
    for i in range(x.size):
        low, high = min(low, x[i]), max(high, x[i])
    cells = min(MAX_RANK_CELLS, 1 + x.size // NUMBERS_PER_CELL)
    over = cells / (float(high) - float(low)) if high > low else 0.0
    if not 0.0 < over < np.inf:
        return np.sort(x)[ranks]
    begin = np.zeros(cells + 2, np.intp)
    for i in range(x.size):
        begin[int((float(x[i]) - float(low)) * over) + 1] += 1
    for cell in range(cells + 1):
        begin[cell + 1] += begin[cell]
    wanted, cell = np.zeros(cells + 1, np.bool_), 0
    for rank in ranks:
        while begin[cell + 1] <= rank:
            cell += 1
        wanted[cell] = True
    place, size = np.zeros(cells + 1, np.intp), 0
    for cell in range(cells + 1):
        place[cell] = size
        if wanted[cell]:
            size += begin[cell + 1] - begin[cell]
    first, some = place.copy(), np.empty(size, x.dtype)
    for i in range(x.size):
        cell = int((float(x[i]) - float(low)) * over)
        if wanted[cell]:
            some[place[cell]] = x[i]
            place[cell] += 1
    out = np.empty(ranks.size, x.dtype)
    cell, ready = 0, -1
    for k in range(ranks.size):
        while begin[cell + 1] <= ranks[k]:
            cell += 1
        if cell != ready:
            some[first[cell] : place[cell]].sort()
            ready = cell
        out[k] = some[first[cell] + ranks[k] - begin[cell]]
    return out
