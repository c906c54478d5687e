"""Thêo1, ThêoBR and ThêoH: Allan-like variances up to three quarters of the record.

With the N phase points x of n = N - 1 samples, m even and the effective cluster time τ = 0.75 m τ0::

    Thêo1(m) = 1/(0.75 (N - m) m²) Σ_{i=1}^{N-m} Σ_{d=0}^{m/2-1} z² / (m/2 - d)
    z = (x_i - x_{i-d+m/2}) + (x_{i+m} - x_{i+d+m/2})

Thêo1 equals the Allan variance for white noise; for others it is biased by a factor of the noise type. ThêoBR
takes that factor from the record itself, as the mean ratio to the overlapping Allan variance at the same τ::

    ThêoBR(m) = Thêo1(m) · 1/(q + 1) Σ_{i=0}^{q} AVAR(9 + 3i) / Thêo1(12 + 4i),    q = ⌊reach N/3 - 3⌋

ThêoH is the overlapping Allan variance below a switch point and ThêoBR from there on. Both are unbiased only
as long as the same noise rules at all τ.

Long records
------------
Up to `MAX_EXACT_SAMPLES` samples everything is exact. Above, Thêo1 with m/2 ≥ 256 reads every s-th phase point
(clusters of s samples), s the power of two that leaves m/2 between 128 and 255 clusters, so m is a multiple of 2 s
(`nearest_theo1_size`). White noise reads the same, random walk 1 % higher in variance, quantization lower by
the ratio of the harmonic numbers of m/(2s) and m/2. The ratio of ThêoBR is taken from averages of ⌈n/MAX_EXACT_SAMPLES⌉
samples. ThêoBR and ThêoH do the same above `MAX_EXACT_HYBRID` samples, where m allows it and m/2 still has 1024
clusters: random walk then reads 0.1 % higher.

References
----------
.. [1] D. A. Howe, ThêoH: a hybrid, high-confidence statistic that improves on the Allan deviation, Metrologia
   43, 2006.
.. [2] J. A. Taylor, D. A. Howe, Fast TheoBR: a method for long data set stability analysis, IEEE Trans. UFFC
   57(9), 2010.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len, rfft

from models.arrays import FloatArray, IntArray
from tuner.curves import allan_kernels as kernels
from tuner.curves.allan import by_column, overlapping_allan, sizes
from tuner.types.records import DataError

MAX_EXACT_SAMPLES = 100_000
"""Longest record, samples, that Thêo1 and the ratio of ThêoBR use as it is."""

MAX_EXACT_HYBRID = 25_000
"""Longest record, samples, of which ThêoBR and ThêoH take every Thêo1 as it is: a quarter of a second for 30 sizes."""

MIN_SIZE = 10
"""Smallest m of Thêo1."""

MIN_SAMPLES = 89
"""Fewest samples from which ThêoBR has a ratio, at the usual reach of a tenth of the record."""

_MIN_CLUSTERS = 128
"""Least m/2 in clusters where a long record is read in clusters of samples."""
_MIN_HYBRID_CLUSTERS = 1024
"""The same for ThêoBR of a record that Thêo1 still takes as it is: 0.1 % of the variance of random walk."""
_FIRST_RECURSIVE = 100
"""m/2 from which the recursion over m replaces the direct sums: below it they are faster."""
_MIN_THREAD_POSITIONS = 1 << 12
"""Fewest positions worth a thread of their own: each takes m/2 differences."""


def stride(n: int, m: IntArray) -> IntArray:
    """Return how many samples make one cluster inside Thêo1 of n samples."""
    if n <= MAX_EXACT_SAMPLES:
        return np.ones_like(m)
    return _clusters(m, _MIN_CLUSTERS)


def _clusters(m: IntArray, least: int) -> IntArray:
    """Return the largest power of two of samples, at least 1, of which m/2 holds so many."""
    doublings = np.log2(np.maximum(m // 2 // least, 1)).astype(np.int64)
    powers: IntArray = np.left_shift(1, doublings)
    return powers


def _hybrid_stride(n: int, m: IntArray) -> IntArray:
    """Return how many samples make one cluster inside ThêoBR: a power of two that divides m/2."""
    if n <= MAX_EXACT_HYBRID or n > MAX_EXACT_SAMPLES:
        return stride(n, m)
    half = m // 2
    divisor: IntArray = half & -half
    return np.minimum(_clusters(m, _MIN_HYBRID_CLUSTERS), divisor)


def averaged(n: int) -> int:
    """Return how many of n samples are averaged to one for the ratio of ThêoBR."""
    return -(-n // MAX_EXACT_SAMPLES)


def nearest_theo1_size(n: int, m: ArrayLike) -> IntArray:
    """Return the sizes nearest to m, shape (q,), up to n, that `theo1` takes, and `theo_br` quickly, of n samples."""
    wanted = np.atleast_1d(np.asarray(m, dtype=float))
    whole = np.rint(wanted).astype(np.int64)
    hybrid = MAX_EXACT_HYBRID < n <= MAX_EXACT_SAMPLES
    pair = 2 * (_clusters(whole, _MIN_HYBRID_CLUSTERS) if hybrid else stride(n, whole))
    size = np.rint(wanted / pair).astype(np.int64) * pair
    return np.maximum(np.where(size > n, size - pair, size), MIN_SIZE)


def theo1(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return Thêo1, uncorrected.

    Parameters
    ----------
    y : array_like, shape (n,) or (n, k)
        Samples.
    m : array_like of int, shape (q,)
        Even sizes, 10 … n; above `MAX_EXACT_SAMPLES` samples those of `nearest_theo1_size`. τ = 0.75 m τ0.

    Returns
    -------
    ndarray, shape (q,) or (q, k)
        Variance, squared unit of y.

    Raises
    ------
    DataError
        If a size cannot be had.
    """
    return _theo1(y, m, stride)


def _theo1(y: ArrayLike, m: ArrayLike, clusters: Callable[[int, IntArray], IntArray]) -> FloatArray:
    """Return Thêo1 with so many samples in a cluster."""
    n = len(np.asarray(y))
    whole = sizes(m, least=MIN_SIZE, most=n, samples=n)
    step = clusters(n, whole)
    wrong = whole[whole % (2 * step) != 0]
    if wrong.size:
        near = nearest_theo1_size(n, wrong)[0]
        raise DataError(f"Thêo1 cannot take size {wrong[0]} of {n} samples; the nearest it takes is {near}")
    return by_column(y, lambda column: _theo1_of_phase(kernels.integrate(column), whole, step))


def _theo1_of_phase(x: FloatArray, m: IntArray, step: IntArray) -> FloatArray:
    variance = np.empty(m.size)
    for s in np.unique(step):
        chosen = step == s
        clusters = np.ascontiguousarray(x[::s])
        half = m[chosen] // (2 * s)

        def stretch(
            begin: int, end: int, clusters: FloatArray = clusters, half: IntArray = half
        ) -> FloatArray:
            return kernels.theo1_sums(clusters, half, begin, end, kernels.THEO_BLOCK_POSITIONS)

        sums = kernels.in_threads(stretch, clusters.size, least=_MIN_THREAD_POSITIONS)
        variance[chosen] = sums / (0.75 * (clusters.size - 2 * half) * m[chosen].astype(float) ** 2)
    return variance


def theo1_all(y: ArrayLike, most: int) -> FloatArray:
    """Return Thêo1 at m = 10, 12, … most of a series, shape (n,), by a recursion over m in O(most²).

    Exact at any length but for rounding: 1e-6 of the variance for random walk, less for other noises.
    """
    x = kernels.integrate(np.ascontiguousarray(y, dtype=float))
    half = np.arange(MIN_SIZE // 2, most // 2 + 1)
    direct = half[half < _FIRST_RECURSIVE]
    sums = kernels.theo1_sums(x, direct, 0, x.size, kernels.THEO_BLOCK_POSITIONS)
    if direct.size < half.size:
        length = next_fast_len(x.size + 2 * int(half[-1]) + 2, real=True)
        lagged = irfft(np.abs(rfft(x, length)) ** 2, length)
        sums = np.concatenate([sums, kernels.theo1_sums_all(x, lagged, _FIRST_RECURSIVE, int(half[-1]) + 1)])
    return sums / (0.75 * (x.size - 2 * half) * (2.0 * half) ** 2)


def bias_ratio(y: ArrayLike, *, reach: float = 0.1) -> float:
    """Return the mean ratio of the overlapping Allan variance to Thêo1 of a series, shape (n,).

    A constant series has the ratio 1.

    Raises
    ------
    DataError
        If the record is too short for one ratio (9 phase points within the reach).
    """
    samples = np.asarray(y, dtype=float)
    width = averaged(samples.size)
    if width > 1:
        samples = samples[: samples.size // width * width].reshape(-1, width).mean(axis=1)
    count = int(np.floor(reach * (samples.size + 1) / 3.0 - 3.0)) + 1
    if count < 1:
        raise DataError(
            f"ThêoBR of {samples.size} samples: expected at least {int(np.ceil(9.0 / reach)) - 1}"
        )
    steps = np.arange(count)
    reference = overlapping_allan(samples, 9 + 3 * steps)
    every = theo1_all(samples, 12 + 4 * (count - 1))
    raw = every[1 + 2 * steps]
    return float(np.mean(np.divide(reference, raw, out=np.ones_like(raw), where=raw > 0.0)))


def theo_br(y: ArrayLike, m: ArrayLike, *, reach: float = 0.1) -> FloatArray:
    """Return ThêoBR: Thêo1 times `bias_ratio`; sizes and shapes as `theo1`."""
    return _theo1(y, m, _hybrid_stride) * _ratios(y, reach)


def _ratios(y: ArrayLike, reach: float) -> FloatArray:
    return by_column(y, lambda column: np.array([bias_ratio(column, reach=reach)]))
