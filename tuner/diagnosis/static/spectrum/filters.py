"""Shapes of filtered and of coloured white noise, by name.

Filters have gain 1 at frequency 0 and half power at the cutoff. What reaches the samples is white noise through

- ``pole1 pole2``: a recursion with the poles exp(sΔ) of an analogue Butterworth filter. One pole is the analogue filter
  of first order itself, sampled: correlation exp(−2π cutoff Δ k) at lag k;
- ``sampled1x8`` …: a digital Butterworth filter of that order at m times the rate, every m-th of whose values is kept.
  With f in units of the rate its power is folded:

      Σ_k 1 / (1 + (tan(π(f + k)/m) / tan(π cutoff/m))^(2 order)),    k = 0 … m − 1

  At one time the rate nothing is folded; at many times it is the analogue filter before the converter. How much a
  sensor folds is not known, but shows in its spectrum.
- ``mean1`` …: that many moving means in a row over a width W (a cascaded integrator–comb), whose values are kept at the
  rate. Their covariance at lag k is the B-spline of order 2N at k/W, folding included.

Colours are ARMA processes; partial correlations tanh x keep them stationary.

References
----------
.. [1] G. E. P. Box, G. M. Jenkins, Time Series Analysis, ch. 3, 6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import comb

import numba
import numpy as np

from models.arrays import FloatArray
from models.effects.static.spectral import LowPass
from tuner.identification.arma_whittle import autoregression

Coefficients = tuple[tuple[float, ...], tuple[float, ...]]

LEAST_CUTOFF, LEAST_MEAN_CUTOFF = 0.002, 0.05
"""Least cutoff × interval of a filter, and of moving means: nine samples each at most."""
BELOW_NYQUIST, ABOVE_NYQUIST, FAR_ABOVE = 0.49, 0.52, 1.5
"""Largest cutoff × interval: of what is not folded, of what is, and of a filter of first order, which falls slowly."""
FILTERS = {
    name: (LEAST_MEAN_CUTOFF if name.startswith("mean") else LEAST_CUTOFF, largest)
    for name, largest in {
        "pole1": FAR_ABOVE,
        "sampled1x8": FAR_ABOVE,
        "sampled1x4": 2.0 * BELOW_NYQUIST,
        "sampled1x2": BELOW_NYQUIST,
        "sampled1x1": BELOW_NYQUIST,
        "pole2": 0.6,
        "sampled2x16": ABOVE_NYQUIST,
        "sampled2x8": ABOVE_NYQUIST,
        "sampled2x4": ABOVE_NYQUIST,
        "sampled2x2": ABOVE_NYQUIST,
        "sampled2x1": BELOW_NYQUIST,
        "sampled3x8": ABOVE_NYQUIST,
        "sampled3x1": BELOW_NYQUIST,
        "sampled4x8": ABOVE_NYQUIST,
        "sampled4x1": BELOW_NYQUIST,
        "mean1": 0.44,
        "mean2": 0.4,
        "mean3": 0.33,
        "mean4": 0.28,
    }.items()
}
"""Least and largest cutoff × interval of the filters."""
MEAN_CUTOFFS = {1: 0.44295, 2: 0.31892, 3: 0.26194, 4: 0.22751}
"""Half-power frequency × width of so many moving means in a row: sin(πx)/(πx) to the power of twice that is ½."""
NULL_FLOOR = 1e-6
"""Power, of that at frequency 0, where moving means let nothing pass: what the ends of a record leak there."""
FACTOR_POINTS = 4096
"""Frequencies at which the power of moving means is factored: many more than lags."""
ONE_NUMBER = ((0.1,), (-0.1,), (0.7,), (-0.7,))
"""Where a colour of one free number is sought from."""
COLOURS: dict[str, tuple[int, int, tuple[tuple[float, ...], ...]]] = {
    "ar1": (1, 0, ONE_NUMBER),
    "ma1": (0, 1, ONE_NUMBER),
    "arma11": (1, 1, ((0.5, -0.4), (-0.5, 0.4), (0.2, 0.2))),
    "ar2": (2, 0, ((0.1, 0.1), (-0.1, 0.1), (0.3, -0.3))),
    "ma2": (0, 2, ((0.1, 0.1), (0.1, -0.1))),
    "arma21": (2, 1, ((0.3, -0.1, -0.2), (-0.3, 0.1, 0.2))),
}
"""Orders p, q of the colours and starting points of their free numbers, the simplest first."""
MAX_FREE_NUMBER = 4.0
"""Largest absolute free number: a partial correlation of tanh 4 = 0.9993, the edge of a stationary process."""


def arma_power(ar: Sequence[float], ma: Sequence[float], cycles: FloatArray) -> FloatArray:
    """Return |1 + Σ ma z⁻ʲ|² / |1 − Σ ar z⁻ⁱ|² at frequencies × interval."""
    return np.asarray(_arma_power(np.array(ar, dtype=float), np.array(ma, dtype=float), cycles))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _arma_power(ar: FloatArray, ma: FloatArray, cycles: FloatArray) -> FloatArray:
    out = np.empty(cycles.size)
    for at in range(cycles.size):
        angle = 2.0 * np.pi * cycles[at]
        z = complex(np.cos(angle), -np.sin(angle))
        above, below = 0j, 0j
        for j in range(ma.size - 1, -1, -1):
            above = (above + ma[j]) * z
        for i in range(ar.size - 1, -1, -1):
            below = (below - ar[i]) * z
        above, below = 1.0 + above, 1.0 + below
        out[at] = (above.real**2 + above.imag**2) / (below.real**2 + below.imag**2)
    return out


def filter_arma(name: str, cutoff: float) -> Coefficients:
    """Return AR and MA coefficients of a filter; `cutoff` is its half-power frequency × interval."""
    order, times = filter_kind(name)
    if is_mean(name):
        return (), _mean_factor(order, cutoff)
    if not times:
        a = LowPass(cutoff, order).denominator(1.0)
        return tuple((-a[1:]).tolist()), ()
    s = np.tan(np.pi * cutoff / times) * np.exp(1j * np.pi * (2 * np.arange(order) + order + 1) / (2 * order))
    a = np.asarray(np.poly(((1.0 + s) / (1.0 - s)) ** times).real, dtype=float)
    even = np.arange(16) / 16.0
    end = float(np.tan(np.pi * cutoff / times))
    passed = _folded(order, _tangents(times, even), end) / arma_power(tuple((-a[1:]).tolist()), (), even)
    covariance = np.fft.ifft(passed).real[: order + 1]
    zeros = np.roots(np.concatenate((covariance[::-1], covariance[1:])))
    inside = zeros[np.argsort(np.abs(zeros))][:order]
    return tuple((-a[1:]).tolist()), tuple(np.poly(inside)[1:].real.tolist())


def is_mean(name: str) -> bool:
    """Return whether a filter is one of moving means."""
    return name.startswith("mean")


def _mean_covariance(order: int, cutoff: float) -> FloatArray:
    """Return the covariance of moving means of white noise at lags 0, 1, …; the power at frequency 0 is 1."""
    x = np.arange(int(order * MEAN_CUTOFFS[order] / cutoff) + 1) * cutoff / MEAN_CUTOFFS[order]
    r = sum(
        (-1) ** j * comb(2 * order, j) * np.maximum(x + order - j, 0.0) ** (2 * order - 1)
        for j in range(2 * order + 1)
    )
    return np.asarray(r / (r[0] + 2.0 * r[1:].sum()))


def _mean_powers(order: int, cycles: FloatArray, width: float, least: float) -> Callable[[float], FloatArray]:
    """Return the power of moving means, averaged over a width of frequency × interval, for their nulls are narrow.

    It is a function of the cutoff × interval, from `least` on.
    """
    lag = np.arange(1, len(_mean_covariance(order, least)))
    wave = 2.0 * np.cos(2.0 * np.pi * np.multiply.outer(cycles, lag)) * np.sinc(width * lag)

    def power(cutoff: float) -> FloatArray:
        r = _mean_covariance(order, cutoff)
        return np.asarray(np.maximum(r[0] + wave[:, : len(r) - 1] @ r[1:], NULL_FLOOR))

    return power


def _mean_factor(order: int, cutoff: float) -> tuple[float, ...]:
    """Return the MA coefficients of moving means, by the logarithm of their power (Kolmogorov's factor)."""
    even = np.arange(FACTOR_POINTS) / FACTOR_POINTS
    cepstrum = np.fft.ifft(np.log(_mean_powers(order, even, 0.0, cutoff)(cutoff))).real
    half = FACTOR_POINTS // 2
    cepstrum[0] *= 0.5
    cepstrum[half:] = 0.0
    factor = np.fft.ifft(np.exp(np.fft.fft(cepstrum))).real
    number = len(_mean_covariance(order, cutoff))
    return tuple((factor[1:number] / factor[0]).tolist())


def filter_powers(name: str, cycles: FloatArray, width: float = 0.0) -> Callable[[float], FloatArray]:
    """Return the squared response of a filter, 1 at frequency 0, as a function of the cutoff × interval.

    That of moving means is averaged over a width of frequency × interval.
    """
    order, times = filter_kind(name)
    if is_mean(name):
        return _mean_powers(order, cycles, width, FILTERS[name][0])
    tangents, middle = _tangents(times, cycles), _tangents(times, np.zeros(1))

    def power(cutoff: float) -> FloatArray:
        if times:
            end = float(np.tan(np.pi * cutoff / times))
            return np.asarray(_folded(order, tangents, end) / _folded(order, middle, end))
        ar, ma = filter_arma(name, cutoff)
        return arma_power(ar, ma, cycles) * (1.0 - sum(ar)) ** 2

    return power


def filter_power(name: str, cutoff: float, cycles: FloatArray, width: float = 0.0) -> FloatArray:
    """Return the squared response of a filter, 1 at frequency 0, as `filter_powers` does."""
    return filter_powers(name, cycles, width)(cutoff)


def filter_kind(name: str) -> tuple[int, int]:
    """Return order and oversampling of a filter, 0 for a recursion at the rate."""
    kind, _, times = name.partition("x")
    return int(kind[-1]), int(times or 0)


def _tangents(times: int, cycles: FloatArray) -> FloatArray:
    """Return tan(π(f + k)/m), shape (m, b)."""
    return np.asarray(np.tan(np.pi * (cycles + np.arange(times)[:, None]) / max(times, 1)))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _folded(order: int, tangents: FloatArray, end: float) -> FloatArray:
    """Return the folded power, shape (b,), of tangents, shape (m, b), and that of the cutoff."""
    out = np.zeros(tangents.shape[1])
    for k in range(tangents.shape[0]):
        for at in range(out.size):
            square = (tangents[k, at] / end) ** 2
            out[at] += 1.0 / (1.0 + square**order)
    return out


def colour_arma(name: str, x: FloatArray) -> Coefficients:
    """Return AR and MA coefficients of a colour from its free numbers."""
    p = COLOURS[name][0]
    ar, ma = (autoregression(np.asarray(part, dtype=float))[0].tolist() for part in (x[:p], -x[p:]))
    return tuple(ar), tuple(-b for b in ma)
