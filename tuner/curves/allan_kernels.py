"""Compiled sums behind the curves of the Allan family.

All work on the phase x of the samples, the running sum of y without its mean, in samples: x_0 = 0,
x_i = Σ_{j<i} (y_j - ȳ). A second difference over m samples is then m times the difference of two neighbouring
cluster averages; the mean and any linear phase fall out.

The sums run block by block over x with all cluster sizes inside a block, so the block is read from memory
once and not once a cluster size. The kernels release the interpreter lock: `in_threads` gives the threads a
few long parts each, as many threads as `tuner.jobs.usable` allows.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from models.arrays import FloatArray, IntArray
from tuner.jobs import usable

BLOCK_POSITIONS = 8192
"""Positions of differences summed for every cluster size before moving on: 64 KiB of x."""

THEO_BLOCK_POSITIONS = 1024
"""The same for Thêo1, where each position needs m others."""

MIN_THREAD_POSITIONS = 1 << 17
"""Fewest positions worth a thread of their own where the work for a position is small."""

MOST_PARTS = 16
"""Parts of a sum: four for each of four threads, so that none waits long for the last."""


def in_threads(
    kernel: Callable[[int, int], FloatArray], count: int, *, least: int = MIN_THREAD_POSITIONS
) -> FloatArray:
    """Add up ``kernel(begin, end)`` over a few equal parts of ``range(count)``, none shorter than `least`.

    The parts, and with them every digit of the sum, are the same for any number of processors.
    """
    parts = max(1, min(MOST_PARTS, count // least))
    bounds = [count * i // parts for i in range(parts + 1)]
    if parts == 1:
        return kernel(0, count)
    with ThreadPoolExecutor(usable()) as pool:
        sums: FloatArray = np.sum(list(pool.map(kernel, bounds[:-1], bounds[1:])), axis=0)
    return sums


def integrate(y: FloatArray) -> FloatArray:
    """Return the phase, shape (n + 1,), of y, shape (n,), without its mean.

    The first sample is taken off before the mean is, so that a constant gives exact zeros.
    """
    x = np.empty(y.size + 1)  # not in the kernel: here large arrays get large pages
    _accumulate(y, _mean_excess(y), x)
    return x


@njit(cache=True, nogil=True, fastmath=True)
def _mean_excess(y: FloatArray) -> float:
    first = y[0]
    total = 0.0
    for i in range(y.shape[0]):
        total += y[i] - first
    return float(total / y.shape[0])


@njit(cache=True, nogil=True)
def _accumulate(y: FloatArray, excess: float, x: FloatArray) -> None:
    first = y[0]
    running = 0.0
    x[0] = 0.0
    for i in range(y.shape[0]):
        running += (y[i] - first) - excess
        x[i + 1] = running


@njit(cache=True, nogil=True, fastmath=True)
def _second(x: FloatArray, begin: int, end: int, m: int) -> float:
    before, centre, after = x[begin - m : end - m], x[begin:end], x[begin + m : end + m]
    total = 0.0
    for i in range(end - begin):
        z = before[i] - 2.0 * centre[i] + after[i]
        total += z * z
    return total


@njit(cache=True, nogil=True, fastmath=True)
def _second_pair(x: FloatArray, begin: int, end: int, m: int, p: int) -> tuple[float, float]:
    before, after = x[begin - m : end - m], x[begin + m : end + m]
    further_before, further_after = x[begin - p : end - p], x[begin + p : end + p]
    centre = x[begin:end]
    total = 0.0
    further = 0.0
    for i in range(end - begin):
        twice = 2.0 * centre[i]
        z = before[i] - twice + after[i]
        w = further_before[i] - twice + further_after[i]
        total += z * z
        further += w * w
    return total, further


@njit(cache=True, nogil=True)
def second_differences(
    x: FloatArray, m: IntArray, first: IntArray, last: IntArray, begin: int, end: int, block: int
) -> FloatArray:
    """Return Σ_c (x_{c-m} - 2 x_c + x_{c+m})² over the centres c in [first, last) and in [begin, end), per m.

    Two cluster sizes share each load of x_c.
    """
    sums = np.zeros(m.shape[0])
    for start in range(begin, end, block):
        stop = min(start + block, end)
        i = 0
        while i < m.shape[0]:
            lo, hi = max(start, first[i]), min(stop, last[i])
            if (
                i + 1 < m.shape[0]
                and lo < hi
                and lo == max(start, first[i + 1])
                and hi == min(stop, last[i + 1])
            ):
                a, b = _second_pair(x, lo, hi, m[i], m[i + 1])
                sums[i] += a
                sums[i + 1] += b
                i += 2
                continue
            if lo < hi:
                sums[i] += _second(x, lo, hi, m[i])
            i += 1
    return sums


@njit(cache=True, nogil=True, fastmath=True)
def _third(x: FloatArray, begin: int, end: int, m: int) -> float:
    a, b = x[begin:end], x[begin + m : end + m]
    c, d = x[begin + 2 * m : end + 2 * m], x[begin + 3 * m : end + 3 * m]
    total = 0.0
    for i in range(end - begin):
        z = d[i] - a[i] - 3.0 * (c[i] - b[i])
        total += z * z
    return total


@njit(cache=True, nogil=True)
def third_differences(x: FloatArray, m: IntArray, begin: int, end: int, block: int) -> FloatArray:
    """Return Σ_i (x_{i+3m} - 3 x_{i+2m} + 3 x_{i+m} - x_i)² over the positions i in [begin, end), per m."""
    sums = np.zeros(m.shape[0])
    for start in range(begin, end, block):
        for i in range(m.shape[0]):
            stop = min(start + block, end, x.shape[0] - 3 * m[i])
            if start < stop:
                sums[i] += _third(x, start, stop, m[i])
    return sums


@njit(cache=True, nogil=True)
def averaged_second_differences(x: FloatArray, m: int) -> float:
    """Return Σ_j (Σ_{i=j}^{j+m-1} (x_{i+2m} - 2 x_{i+m} + x_i))², the inner sum carried from j to j + 1."""
    inner = 0.0
    for i in range(m):
        inner += x[i + 2 * m] - 2.0 * x[i + m] + x[i]
    total = inner * inner
    for j in range(x.shape[0] - 3 * m):
        inner += x[j + 3 * m] - x[j] - 3.0 * (x[j + 2 * m] - x[j + m])
        total += inner * inner
    return total


@njit(cache=True, nogil=True, fastmath=True)
def _theo1_block(x: FloatArray, begin: int, end: int, k: int, outer: FloatArray) -> float:
    size = end - begin
    low, high = x[begin - k : end - k], x[begin + k : end + k]
    for i in range(size):
        outer[i] = low[i] + high[i]
    total = 0.0
    for d in range(k):
        low, high = x[begin - d : end - d], x[begin + d : end + d]
        inner = 0.0
        for i in range(size):
            z = outer[i] - low[i] - high[i]
            inner += z * z
        total += inner / (k - d)
    return total


@njit(cache=True, nogil=True)
def theo1_sums(x: FloatArray, half: IntArray, begin: int, end: int, block: int) -> FloatArray:
    """Return Σ_c Σ_{d<k} (x_{c-k} + x_{c+k} - x_{c-d} - x_{c+d})²/(k - d) over centres c, per k = m/2."""
    sums = np.zeros(half.shape[0])
    outer = np.empty(block)
    for start in range(begin, end, block):
        for i in range(half.shape[0]):
            lo, hi = max(start, half[i]), min(start + block, end, x.shape[0] - half[i])
            if lo < hi:
                sums[i] += _theo1_block(x, lo, hi, half[i], outer)
    return sums


@njit(cache=True, nogil=True, fastmath=True)
def theo1_sums_all(x: FloatArray, lagged: FloatArray, start: int, stop: int) -> FloatArray:
    """Return the sums of `theo1_sums` for every k in [start, stop), in O(stop²) after one correlation of x.

    Written out, the square holds products of x at lags below 2k only, summed over the first n - 2k and the
    last n - 2k positions (`ends`), and about the centres (`centred`). From k to k + 1 each of these sums
    loses a few products, and each new lag starts from the full sum ``lagged[l]`` = Σ_p x_p x_{p+l}, l < 2
    stop, which an FFT gives. The differences cancel for small k: use it for k ≥ 100.
    """
    n = x.shape[0]
    squares = np.zeros(n + 1)
    for i in range(n):
        squares[i + 1] = squares[i] + x[i] * x[i]
    inverse = np.zeros(stop)
    harmonic = 0.0
    for u in range(1, stop):
        inverse[u] = 1.0 / u
    for u in range(1, start):
        harmonic += inverse[u]
    ends = np.zeros(2 * stop)
    centred = np.zeros(stop)
    for lag in range(2 * start):
        total = 2.0 * lagged[lag]
        for p in range(n - 2 * start, n - lag):
            total -= x[p] * x[p + lag]
        for p in range(2 * start - lag):
            total -= x[p] * x[p + lag]
        ends[lag] = total
    for d in range(start):
        total = lagged[2 * d]
        for c in range(d, start):
            total -= x[c - d] * x[c + d] + x[n - 1 - c - d] * x[n - 1 - c + d]
        centred[d] = total
    sums = np.empty(stop - start)
    for k in range(start, stop):
        harmonic += inverse[k]
        outer = squares[n - 2 * k] + squares[n] - squares[2 * k] + 2.0 * lagged[2 * k]
        cross = 0.0
        for u in range(1, k + 1):
            cross += inverse[u] * (ends[u] + ends[2 * k - u])
        inner = 0.0
        for d in range(k):
            low = squares[n - k - d] - squares[k - d]
            high = squares[n - k + d] - squares[k + d]
            inner += inverse[k - d] * (low + high + 2.0 * centred[d])
        sums[k - start] = outer * harmonic - 2.0 * cross + inner
        if k + 1 == stop:
            break
        a, b, c, e = x[n - 2 * k - 1], x[n - 2 * k - 2], x[2 * k], x[2 * k + 1]
        for lag in range(2 * k):
            ends[lag] -= (
                a * x[n - 2 * k - 1 + lag]
                + b * x[n - 2 * k - 2 + lag]
                + c * x[2 * k - lag]
                + e * x[2 * k + 1 - lag]
            )
        ends[2 * k] = 2.0 * lagged[2 * k] - b * x[n - 2] - a * x[n - 1] - x[0] * c - x[1] * e
        ends[2 * k + 1] = 2.0 * lagged[2 * k + 1] - b * x[n - 1] - x[0] * e
        for d in range(k):
            centred[d] -= x[k - d] * x[k + d] + x[n - 1 - k - d] * x[n - 1 - k + d]
        centred[k] = lagged[2 * k] - x[0] * x[2 * k] - x[n - 1 - 2 * k] * x[n - 1]
    return sums
