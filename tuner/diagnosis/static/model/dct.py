"""The cosine domain: where the noise of a channel is diagonal and slow templates are short.

With the orthonormal cosine transform of n samples at interval τ0, a_k = √τ0 DCT-II(y)_k, the expectation
of a_k² is the two-sided spectrum at k/(2 n τ0) (`tuner.identification.periodogram`). A template that is constant over
M blocks of L samples has the coefficients of its block values times a known factor::

    a_k = √(τ0 M/n) sin(πk/2M)/sin(πk/2n) DCT-II(block values)_k

References
----------
.. [1] G. Strang, The discrete cosine transform, SIAM Review 41 (1999).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, dst, idct
from scipy.ndimage import maximum_filter1d

from models.arrays import LEAST_DIVISOR, FloatArray
from models.robust import MEDIAN_OF_CHI2
from tuner.curves.long_transforms import without_tables
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.series_statistics import Real, row_medians
from tuner.identification.periodogram import CosinePeriodogram

MAX_SQUARE = 30.0
"""Largest square of a coefficient that enters the noise fit, in units of its neighbours'; lines are larger.

The square of a normal coefficient exceeds 30 with a chance of 4e-8: noise is not cut.
"""
LINE_REACH = 64
"""Coefficients on either side of a line that are its own: further ones have 2/(64π²), a 300th, of its power."""
UNCAPPED_COEFFICIENTS = 64
"""Lowest coefficients, which are not cut: the spectrum is steep there, so that neighbours do not give their level."""
CELL_RESOLUTION = 0.02
"""Relative width of the cells above the single coefficients.

Within 2 % of frequency the spectra of the terms are flat.
"""


def transform(y: FloatArray, interval: float) -> FloatArray:
    """Return the coefficients a_0 … a_{n-1} of n samples."""
    a: FloatArray = dct(y, norm="ortho")
    without_tables(len(a))
    a *= np.sqrt(interval)
    return a


def inverse(a: FloatArray, interval: float) -> FloatArray:
    """Return the samples of n coefficients, which may be written over."""
    y: FloatArray = idct(a, norm="ortho", overwrite_x=True)
    without_tables(len(y))
    y /= np.sqrt(interval)
    return y


def block_transform(columns: FloatArray, channel: Channel, singles: int) -> FloatArray:
    """Return coefficients 1 … K of templates given on the blocks: (M, p) to (K, p).

    Where a channel has no samples it is filled with a straight line; so is every template there, between means of
    the same length, or the line would count as evidence against it.
    """
    columns = channel.bridged(columns)
    out: FloatArray = (
        dct(columns, norm="ortho", axis=0)[1 : singles + 1] * _block_factor(channel, singles)[:, None]
    )
    return out


def _block_factor(channel: Channel, singles: int) -> FloatArray:
    """Return the coefficients 1 … K of samples ÷ those of their blocks, for templates constant over a block."""
    n, m, k = len(channel), channel.blocks, np.arange(1, singles + 1)
    return np.asarray(
        np.sqrt(channel.interval * m / n) * np.sin(0.5 * np.pi * k / m) / np.sin(0.5 * np.pi * k / n)
    )


def block_sums(weights: FloatArray, channel: Channel) -> FloatArray:
    """Return, for a template that is 1 on one block alone, the sum of its coefficients times `weights` (K,); (M,)."""
    values = np.zeros(channel.blocks)
    values[1 : len(weights) + 1] = weights * _block_factor(channel, len(weights))
    return np.asarray(idct(values, norm="ortho"))


def grid(a: FloatArray, interval: float, singles: int) -> CosinePeriodogram:
    """Summarise n coefficients for a fit of the noise: K single ones, then cells, both robust to lines.

    Parameters
    ----------
    a : ndarray, shape (n,)
        Coefficients, a_0 included.
    interval : float
        Sampling interval, s.
    singles : int
        K.
    """
    n = len(a)
    span = n * interval
    square = a[1:] ** 2
    most = _level(square)
    most *= MAX_SQUARE
    most[:UNCAPPED_COEFFICIENTS] = np.inf
    np.minimum(square, most, out=square)
    low = min(singles, n - 1)
    order = np.arange(1.0, low + 1.0)
    edges = np.unique(
        np.geomspace(low, n - 1, max(2, int(np.log((n - 1) / low) / CELL_RESOLUTION))).astype(int)
    )
    count = np.diff(edges).astype(float)
    cells = len(count)
    power = np.add.reduceat(square[: edges[-1]], edges[:-1]) / count if cells else np.empty(0)
    mean_order = 0.5 * (edges[:-1] + edges[1:] + 1.0)
    orders = np.concatenate((order, mean_order))
    return CosinePeriodogram(
        interval=interval,
        frequency=orders / (2.0 * span),
        amplitude=np.concatenate((np.copysign(np.sqrt(square[:low]), a[1 : low + 1]), np.sqrt(power))),
        count=np.concatenate((np.ones(low), count)),
        order=orders,
        parity=np.concatenate(((-1.0) ** order, np.zeros(cells))),
        span=np.full(low + cells, span),
        line=np.zeros(low + cells),
    )


def _level(power: FloatArray) -> FloatArray:
    """Return the level of χ²₁ powers by running medians over 128 neighbours, shape (n,)."""
    width = 128
    n = len(power) // width * width
    if n == 0:
        return np.full(len(power), np.median(power) / MEDIAN_OF_CHI2)
    median = row_medians(power[:n].reshape(-1, width)) / MEDIAN_OF_CHI2
    level = between_middles(np.log(np.maximum(median, LEAST_DIVISOR)), width, len(power))
    return np.asarray(np.exp(level, out=level))


def lines(square: FloatArray) -> NDArray[np.bool_]:
    """Return which squared coefficients of unit expectation are those of lines, shape (n,)."""
    high = square > MAX_SQUARE * np.maximum(_level(square), 1.0)
    return np.asarray(maximum_filter1d(high.view(np.uint8), 2 * LINE_REACH + 1), dtype=bool)


def between_middles(values: NDArray[Real], width: int, n: int) -> NDArray[Real]:
    """Return n numbers on straight lines between values at the middles of stretches of `width`; level beyond them."""
    out = np.empty(n, values.dtype)
    first = (width + 1) // 2
    share = ((np.arange(width) + 0.5 * (width % 2)) / width).astype(values.dtype)
    last = first + (len(values) - 1) * width
    out[:first], out[last:] = values[0], values[-1]
    lines = out[first:last].reshape(-1, width)
    np.multiply(np.diff(values)[:, None], share, out=lines)
    lines += values[:-1, None]
    return out


def step_sums(weights: FloatArray, channel: Channel) -> FloatArray:
    """Return, for a step at each block boundary m = 1 … M-1, the sum of its coefficients times `weights` (K,).

    A step of size 1 at boundary m has a_k = -√(2τ0/n) sin(πkm/M) / (2 sin(πk/2n)).
    """
    values = np.zeros(channel.blocks - 1)
    values[: len(weights)] = -step_scale(channel, len(weights)) * weights
    return np.asarray(0.5 * dst(values, type=1))


def step_scale(channel: Channel, singles: int) -> FloatArray:
    """Return √(2τ0/n) / (2 sin(πk/2n)) for k = 1 … K."""
    n = len(channel)
    k = np.arange(1, singles + 1)
    scale: FloatArray = np.sqrt(2.0 * channel.interval / n) / (2.0 * np.sin(0.5 * np.pi * k / n))
    return scale
