"""Multitaper estimate of the power spectral density.

With N = n + 1 the K sine tapers [1] v_k(t) = √(2/N) sin(π k t/N), t = 1 … n, give K nearly independent
estimates at every frequency f_j = j/(N dt), all from one transform X of length 2 N::

    S_j = dt/(2 N K) Σ_k |X_{2j-k} - X_{2j+k}|²

They resist leakage (side lobes fall as f⁻⁴ in power), so a random walk does not lift the white floor. The
estimates are then averaged over bands of constant relative width, which turns a record of any length into a
few hundred points.

In locally white noise estimates l frequencies apart have the correlation c(l) = Σ_{k,k'} |Σ_t v_k v_k'
e^{-2πi l t/N}|² / K², so the mean over B neighbours has ν = 2 B² / Σ_{|l|<B} (B - |l|) c(l) degrees of
freedom.

References
----------
.. [1] K. S. Riedel, A. Sidorenko, Minimum bias multiple taper spectral estimation, IEEE Trans. Signal
   Processing 43(1), 1995.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.fft import next_fast_len, rfft

from models.arrays import FloatArray, IntArray
from tuner.curves.long_transforms import without_tables
from tuner.types import Spectrum
from tuner.types.records import DataError, Record

_MIN_TRIMMED_SAMPLES = 10_000
"""Above so many samples the last few are left out where that makes the transform fast (below 1 %)."""
_FREQUENCIES_AT_ONCE = 1 << 15
"""Frequencies treated at a time, so that what is computed from them stays in the cache of a processor."""


def psd(record: Record, *, tapers: int = 5, per_octave: int = 24) -> Spectrum:
    """Return the two-sided power spectral density of a record, mean removed.

    Parameters
    ----------
    record : Record
        Samples; the segments are estimated apart and averaged by their degrees of freedom.
    tapers : int
        Sine tapers K: resolution (K + 1)/T, at least 2 K degrees of freedom.
    per_octave : int
        Bands an octave.

    Returns
    -------
    Spectrum
        From about K/(2T) to half the sampling rate.

    Raises
    ------
    DataError
        If no segment has 4 (K + 1) samples.
    """
    least = 4 * (tapers + 1)
    pieces = [(start, _usable(stop - start)) for start, stop in record.segments if stop - start >= least]
    if not pieces:
        longest = max(stop - start for start, stop in record.segments)
        raise DataError(
            f"spectrum with {tapers} tapers: expected a segment of at least {least} samples, got {longest}"
        )
    finest = max(n for _, n in pieces) + 1
    edges = _edges(finest // 2, tapers, per_octave) / (finest * record.interval)
    weight = np.zeros(edges.size - 1)
    moment = np.zeros(edges.size - 1)
    power = np.zeros((edges.size - 1, len(record.axes)))
    for start, n in pieces:
        frequency = _bins(n, tapers) / ((n + 1) * record.interval)
        bounds = np.searchsorted(frequency, edges)
        count = np.diff(bounds)
        share = _band_dof(count, tapers) / np.maximum(count, 1)
        weight += share * count
        moment += share * _band_sums(frequency, bounds)
        for j in range(len(record.axes)):
            density = multitaper(record.y[start : start + n, j], record.interval, tapers)
            power[:, j] += share * _band_sums(density, bounds)
    kept = weight > 0.0
    centre, density = moment[kept] / weight[kept], power[kept] / weight[kept, None]
    return Spectrum(centre, density, weight[kept], record.unit, record.axes)


def multitaper(y: FloatArray, interval: float, tapers: int) -> FloatArray:
    """Return the mean of the sine-taper spectra of a series, shape (n,), at the `_bins`, unit²/Hz."""
    period = y.size + 1
    padded = np.zeros(2 * period)
    padded[1:period] = y - y.mean()
    transform = rfft(padded)
    del padded
    without_tables(2 * period)
    bins = _bins(y.size, tapers)
    total = np.zeros(bins.size)
    for begin in range(0, bins.size, _FREQUENCIES_AT_ONCE):
        part = total[begin : begin + _FREQUENCIES_AT_ONCE]
        low, high = 2 * int(bins[begin]), 2 * int(bins[begin]) + 2 * part.size
        for k in range(1, tapers + 1):
            difference = transform[low - k : high - k : 2] - transform[low + k : high + k : 2]
            part += difference.real**2
            part += difference.imag**2
    total *= interval / (2.0 * period * tapers)
    return total


def _bins(n: int, tapers: int) -> IntArray:
    """Return the j of f_j = j/((n + 1) dt) whose tapers stay between zero and half the sampling rate."""
    return np.arange(tapers // 2 + 1, (n + 1 - tapers) // 2 + 1)


def _usable(n: int) -> int:
    while n > _MIN_TRIMMED_SAMPLES and next_fast_len(n + 1, real=True) != n + 1:
        n -= 1
    return n


def _edges(last: int, tapers: int, per_octave: int) -> FloatArray:
    """Return band edges in j: single frequencies first, then bands of constant relative width."""
    edges = [tapers // 2 + 0.5]
    while edges[-1] < last:
        edges.append(max(edges[-1] + 1.0, np.floor(edges[-1] * 2.0 ** (1.0 / per_octave)) + 0.5))
    return np.array(edges)


def _band_sums(values: FloatArray, bounds: IntArray) -> FloatArray:
    sums = np.add.reduceat(np.append(values, 0.0), bounds[:-1])
    return np.where(np.diff(bounds) > 0, sums, 0.0)


@lru_cache
def _correlation(tapers: int) -> FloatArray:
    """Return c(l), l = 0 … 4 K, from tapers of 511 points."""
    period = 512
    phase = np.pi * np.outer(np.arange(1, tapers + 1), np.arange(period)) / period
    v = np.sqrt(2.0 / period) * np.sin(phase)
    products = (v[:, None, :] * v[None, :, :]).reshape(-1, period)
    overlap = np.abs(rfft(products, axis=1)[:, : 4 * tapers + 1]) ** 2
    correlation: FloatArray = overlap.sum(axis=0) / tapers**2
    return correlation


def _band_dof(count: IntArray, tapers: int) -> FloatArray:
    """Return the degrees of freedom of means over so many neighbouring frequencies; 0 for none."""
    c = _correlation(tapers)
    lag = np.arange(c.size)
    pairs = np.where(lag == 0, 1.0, 2.0) * np.maximum(count[:, None] - lag, 0)
    dof = np.zeros(count.size)
    np.divide(2.0 * count.astype(float) ** 2, pairs @ c, out=dof, where=count > 0)
    return dof
