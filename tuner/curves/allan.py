"""Allan and Hadamard variances of sampled rates.

With the phase x of the samples (see `tuner.curves.allan_kernels`) and m samples a cluster::

    AVAR(m) = <(x_{i+2m} - 2 x_{i+m} + x_i)²> / (2 m²)
    HVAR(m) = <(x_{i+3m} - 3 x_{i+2m} + 3 x_{i+m} - x_i)²> / (6 m²)
    MVAR(m) = <(1/m Σ_{i=j}^{j+m-1} (x_{i+2m} - 2 x_{i+m} + x_i))²> / (2 m²)

The average runs over every position (overlapping) or over every m-th (non-overlapping). Every function takes
samples y, shape (n,) or (n, k), and cluster sizes m, shape (q,), and returns variances in the squared unit of
y, shape (q,) or (q, k). The sampling interval plays no part: it only turns m into τ. Nothing is detrended or
rejected.

References
----------
.. [1] W. J. Riley, Handbook of Frequency Stability Analysis, NIST Special Publication 1065, 2008.
.. [2] IEEE Std 952-1997, Annex C.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray, IntArray
from tuner.curves import allan_kernels as kernels
from tuner.types.records import DataError


def sizes(m: ArrayLike, *, least: int, most: int, samples: int) -> IntArray:
    """Return the cluster sizes as integers, or say which one the record cannot give.

    Raises
    ------
    DataError
        If a size lies outside ``least … most``.
    """
    given = np.atleast_1d(np.asarray(m))
    whole: IntArray = np.where(np.isfinite(given), np.rint(given), -1).astype(np.int64)
    wrong = given[(whole < least) | (whole > most) | (whole != given)]
    if wrong.size:
        bounds = f"whole numbers from {least} to {most}" if most >= least else "a longer record: none fits"
        raise DataError(f"cluster size {wrong[0]:g} of {samples} samples: expected {bounds}")
    return whole


def by_column(y: ArrayLike, variance: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Apply a function of one series (n,) to y, (n,) or (n, k), column by column."""
    samples = np.asarray(y, dtype=float)
    if samples.ndim == 1:
        return variance(np.ascontiguousarray(samples))
    columns = [variance(np.ascontiguousarray(samples[:, j])) for j in range(samples.shape[1])]
    return np.stack(columns, axis=-1)


def allan(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the Allan variance of adjoining clusters.

    At m = 1, 2, 4, … this is the variance of the record halved again and again by pair means.

    Parameters
    ----------
    y : array_like, shape (n,) or (n, k)
        Samples.
    m : array_like of int, shape (q,)
        Cluster sizes, 1 … n/2.

    Returns
    -------
    ndarray, shape (q,) or (q, k)
    """
    return _strided(y, m, order=2)


def hadamard(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the Hadamard variance of adjoining clusters, m = 1 … n/3; shapes as `allan`. A ramp cancels."""
    return _strided(y, m, order=3)


def _strided(y: ArrayLike, m: ArrayLike, *, order: int) -> FloatArray:
    n = len(np.asarray(y))
    clusters = sizes(m, least=1, most=n // order, samples=n)
    norm = {2: 2.0, 3: 6.0}[order]

    def variance(column: FloatArray) -> FloatArray:
        x = kernels.integrate(column)
        return np.array([np.mean(np.diff(x[::k], order) ** 2) / (norm * float(k) ** 2) for k in clusters])

    return by_column(y, variance)


def two_group_allan(y: ArrayLike, m: ArrayLike, *, offset: ArrayLike | None = None) -> FloatArray:
    """Return the mean of two non-overlapping Allan variances, the second begun `offset` samples later.

    The "improved" Allan variance of MEMS papers. It lies between `allan` (offset 0) and `overlapping_allan`,
    and how near to the latter depends wholly on the offset: m/2 is best, 1 gains next to nothing.

    Parameters
    ----------
    y : array_like, shape (n,) or (n, k)
        Samples.
    m : array_like of int, shape (q,)
        Cluster sizes, 1 … (n - offset)/2.
    offset : array_like of int, scalar or shape (q,), optional
        Start of the second grouping, samples; m // 2 by default.

    Returns
    -------
    ndarray, shape (q,) or (q, k)
    """
    samples = np.asarray(y, dtype=float)
    clusters = sizes(m, least=1, most=len(samples) // 2, samples=len(samples))
    starts = np.broadcast_to(
        clusters // 2 if offset is None else np.asarray(offset, dtype=np.int64), clusters.shape
    )
    second = [allan(samples[start:], [k]) for start, k in zip(starts, clusters, strict=True)]
    return 0.5 * (allan(samples, clusters) + np.concatenate(second))


def overlapping_allan(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the Allan variance over all positions of the clusters, m = 1 … n/2; shapes as `allan`."""
    n = len(np.asarray(y))
    clusters = sizes(m, least=1, most=n // 2, samples=n)

    def variance(column: FloatArray) -> FloatArray:
        x = kernels.integrate(column)
        last = x.size - clusters

        def stretch(begin: int, end: int) -> FloatArray:
            return kernels.second_differences(
                x, clusters, clusters, last, begin, end, kernels.BLOCK_POSITIONS
            )

        return kernels.in_threads(stretch, x.size) / (2.0 * clusters.astype(float) ** 2 * (last - clusters))

    return by_column(y, variance)


def overlapping_hadamard(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the Hadamard variance over all positions of the clusters, m = 1 … n/3; shapes as `allan`."""
    n = len(np.asarray(y))
    clusters = sizes(m, least=1, most=n // 3, samples=n)

    def variance(column: FloatArray) -> FloatArray:
        x = kernels.integrate(column)

        def stretch(begin: int, end: int) -> FloatArray:
            return kernels.third_differences(x, clusters, begin, end, kernels.BLOCK_POSITIONS)

        terms = x.size - 3 * clusters
        return kernels.in_threads(stretch, x.size) / (6.0 * clusters.astype(float) ** 2 * terms)

    return by_column(y, variance)


def modified_allan(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the modified Allan variance, m = 1 … (n + 1)/3; shapes as `allan`.

    It distinguishes white phase (quantization), τ⁻³, from flicker phase, τ⁻²; at m = 1 it equals `allan`.
    """
    n = len(np.asarray(y))
    clusters = sizes(m, least=1, most=(n + 1) // 3, samples=n)

    def variance(column: FloatArray) -> FloatArray:
        x = kernels.integrate(column)
        sums = np.array([kernels.averaged_second_differences(x, k) for k in clusters])
        return sums / (2.0 * clusters.astype(float) ** 4 * (x.size - 3 * clusters + 1))

    return by_column(y, variance)
