"""Statistics of a sampled series: N-second averages, correlograms and the noise type at each cluster time.

Lag-1 identification [1]: the averages over τ are freed of a linear trend; then, with r the lag-1
autocorrelation and ρ = r/(1 + r), the series is differenced (d times) until ρ < 1/4. The spectrum goes as f^α
with α = -2 (ρ + d): +2 quantization, 0 white noise, -1 bias instability, -2 random walk.

References
----------
.. [1] W. J. Riley, C. A. Greenhall, Power law noise identification using the lag 1 autocorrelation,
   EFTF 2004.
.. [2] G. E. P. Box, G. M. Jenkins, Time Series Analysis: Forecasting and Control (correlograms).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len, rfft

from models.arrays import FloatArray, IntArray
from tuner.curves.allan import by_column, sizes
from tuner.curves.edf import PURE_NOISES
from tuner.types import Correlogram
from tuner.types.records import DataError, Record

_MIN_AVERAGES = 32
"""Averages below which the lag-1 autocorrelation says too little."""

_RELIABLE_AVERAGES = 128
"""Averages from which one α is used alone; between the two limits their mean is."""

_MAX_AVERAGES = 1 << 16
"""Averages used at most: more would not sharpen the decision."""

_ALPHA_EDGES = (-1.5, -0.5, 1.0)
"""α between random walk, bias instability, white noise and quantization."""

_DEFAULT_LAGS = 100
"""Lags of a correlogram by default."""
_MAX_PARTIAL_LAGS = 20_000
"""Largest lag of a partial correlogram: its recursion takes the square of the lag in time."""


def averages(y: ArrayLike, m: int) -> FloatArray:
    """Return the means of adjoining clusters of m samples, shape (n // m, …), without a remainder."""
    samples = np.asarray(y, dtype=float)
    count = len(samples) // m
    means: FloatArray = samples[: count * m].reshape(count, m, *samples.shape[1:]).mean(axis=1)
    return means


def nsec(y: ArrayLike, m: ArrayLike) -> FloatArray:
    """Return the sample variance of averages over m samples (its root is the "N-second" sd).

    Parameters
    ----------
    y : array_like, shape (n,) or (n, k)
        Samples.
    m : array_like of int, shape (q,)
        Cluster sizes, 1 … n/2.

    Returns
    -------
    ndarray, shape (q,) or (q, k)
        For white noise with n // m - 1 degrees of freedom; it grows with the record where there is drift.
    """
    n = len(np.asarray(y))
    clusters = sizes(m, least=1, most=n // 2, samples=n)
    return by_column(
        y, lambda column: np.array([np.var(averages(column, k), ddof=1) for k in clusters.tolist()])
    )


def exponent(y: ArrayLike) -> float:
    """Return α of the spectrum f^α of a series, shape (n,), by its lag-1 autocorrelation."""
    from scipy.signal import detrend  # loaded when used: scipy.signal is slow to import

    z = detrend(np.asarray(y, dtype=float))
    for d in range(3):
        z = z - z.mean()
        power = float(z @ z)
        if power == 0.0:
            return 0.0
        r = float(z[1:] @ z[:-1]) / power
        rho = r / (1.0 + r)
        if rho < 0.25 or d == 2:
            break
        z = np.diff(z)
    return -2.0 * (rho + d)


def noise_types(y: ArrayLike, m: ArrayLike) -> tuple[str, ...]:
    """Return the ruling noise type of a series, shape (n,), at each cluster size.

    α is found at octaves of τ that leave at least 32 averages and read off between them; where there are
    fewer than 128 averages the mean of those octaves counts, and beyond the last octave it stays constant.

    Parameters
    ----------
    y : array_like, shape (n,)
        Samples.
    m : array_like, shape (q,)
        Cluster sizes.

    Returns
    -------
    tuple of str
        ``quantization white bias_instability random_walk``; white where the record is too short.
    """
    samples = np.asarray(y, dtype=float)
    octaves = 2 ** np.arange(max(0, int(np.log2(max(samples.size // _MIN_AVERAGES, 1)))) + 1)
    octaves = octaves[samples.size // octaves >= _MIN_AVERAGES]
    if not octaves.size:
        return ("white",) * np.atleast_1d(np.asarray(m)).size
    alpha = np.array([exponent(averages(samples[: k * _MAX_AVERAGES], k)) for k in octaves.tolist()])
    uncertain = samples.size // octaves < _RELIABLE_AVERAGES
    if uncertain.any():
        alpha[uncertain] = alpha[uncertain].mean()
    found = np.interp(np.log2(np.atleast_1d(np.asarray(m, dtype=float))), np.log2(octaves), alpha)
    names = tuple(reversed(PURE_NOISES))
    return tuple(names[i] for i in np.searchsorted(_ALPHA_EDGES, found))


def acf(record: Record, *, lag: Sequence[float] | None = None) -> Correlogram:
    """Return the autocorrelation of a record, NaN on constant axes; products never reach across a gap.

    Parameters
    ----------
    record : Record
        Samples.
    lag : sequence of float, optional
        Lags in s; by default 0 … 100 samples, or a quarter of the record.

    Raises
    ------
    DataError
        If a lag is negative or exceeds the longest segment.
    """
    steps = _steps(record, lag)
    most = int(steps.max())
    value = np.stack([_autocorrelation(record, axis, most)[steps] for axis in record.axes], axis=-1)
    return Correlogram("acf", _seconds(record, steps), value, _band(record), record.axes)


def pacf(record: Record, *, lag: Sequence[float] | None = None) -> Correlogram:
    """Return the partial autocorrelation of a record (Durbin, Levinson); as `acf`, up to 20 000 samples."""
    steps = _steps(record, lag)
    most = int(steps.max())
    if most > _MAX_PARTIAL_LAGS:
        raise DataError(f"partial autocorrelation at {most} samples: expected at most {_MAX_PARTIAL_LAGS}")
    columns = []
    for axis in record.axes:
        correlation = _autocorrelation(record, axis, most)
        known = most > 0 and np.isfinite(correlation[0])
        columns.append((_partial(correlation) if known else correlation)[steps])
    return Correlogram(
        "pacf", _seconds(record, steps), np.stack(columns, axis=-1), _band(record), record.axes
    )


def _partial(correlation: FloatArray) -> FloatArray:
    """Return the last coefficient of the best linear prediction from 0, 1, 2 … past samples."""
    partial = np.ones(len(correlation))
    weights, error = np.zeros(0), correlation[0]
    for k in range(1, len(correlation)):
        partial[k] = (correlation[k] - weights @ correlation[k - 1 : 0 : -1]) / error
        weights = np.append(weights - partial[k] * weights[::-1], partial[k])
        error *= 1.0 - partial[k] ** 2
    return partial


def _steps(record: Record, lag: Sequence[float] | None) -> IntArray:
    longest = max(stop - start for start, stop in record.segments)
    if lag is None:
        return np.arange(min(_DEFAULT_LAGS, longest // 4) + 1)
    seconds = np.atleast_1d(np.asarray(lag, dtype=float))
    steps = np.rint(seconds / record.interval)
    wrong = seconds[~((steps >= 0) & (steps < longest))]
    if wrong.size:
        raise DataError(f"lag {wrong[0]:g} s: expected 0 to {(longest - 1) * record.interval:g} s")
    return steps.astype(np.int64)


def _seconds(record: Record, steps: IntArray) -> FloatArray:
    return steps.astype(float) * record.interval


def _autocorrelation(record: Record, axis: str, most: int) -> FloatArray:
    pieces = record.pieces(axis)
    mean = sum(float(piece.sum()) for piece in pieces) / sum(piece.size for piece in pieces)
    products = np.zeros(most + 1)
    for piece in pieces:
        reach = min(most, piece.size - 1)
        length = next_fast_len(piece.size + reach, real=True)
        products[: reach + 1] += irfft(np.abs(rfft(piece - mean, length)) ** 2, length)[: reach + 1]
    return products / products[0] if products[0] > 0.0 else np.full(most + 1, np.nan)


def _band(record: Record) -> float:
    return 1.96 / float(np.sqrt(sum(stop - start for start, stop in record.segments)))
