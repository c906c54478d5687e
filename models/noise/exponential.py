"""Spectrum and variances of a stationary process with autocovariance Re[c exp(−p |t|)].

With p = 1/T, c = σ² it is a Gauss–Markov process; a complex pair (c, p) makes second-order filters. For
samples dt apart, a = p dt and φ = exp(−a)::

    S(f)   = Re[2 c p / (p² + (2πf)²)]
    S_d(f) = dt Re[c (1 − φ²) / ((1 − φ)² + 4 φ sin²(πf dt))]

With x = p τ, the contrasts of the integral are ::

    A(x) = 2x − 3 + 4e^{−x} − e^{−2x}                 AVAR = Re[c A(x)] / x²
    D(x) = 6x − 10 + 15e^{−x} − 6e^{−2x} + e^{−3x}     HVAR = Re[c D(x)] / (3x²)

and for samples A, D become h (A + 2x s), h (D + 6x s) with h = (a/2)²/sinh²(a/2), s = sinh(a)/a − 1. For
small arguments A, D and s are summed as power series, because the closed forms cancel.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.noise.base import as_array

ComplexArray = NDArray[np.complexfloating]

_ALLAN_WEIGHTS = (4.0, -1.0, 0.0)
"""Weights of exp(−x), exp(−2x), exp(−3x) in A."""
_HADAMARD_WEIGHTS = (15.0, -6.0, 1.0)
"""Weights of exp(−x), exp(−2x), exp(−3x) in D."""
_SERIES_LIMIT = 0.3
"""|x| below which the power series is summed: the closed form has lost two digits there."""
_SERIES_ORDERS = range(3, 24)
"""Orders of that series: the next term, (3 · 0.3)²⁴/24!, is below 1e-24."""


def spectrum(c: complex, p: complex, f: FloatArray, interval: float | None) -> FloatArray:
    """Return the two-sided spectral density at frequencies f, Hz."""
    if interval is None:
        return as_array(np.real(2.0 * c * p / (p**2 + (2.0 * np.pi * f) ** 2)))
    denominator, _ = _sampled_denominator(p * interval, f * interval)
    return as_array(interval * np.real(-c * np.expm1(-2.0 * p * interval) / denominator))


def rate_derivative(c: complex, p: complex, f: FloatArray, interval: float | None) -> FloatArray:
    """Return the derivative of `spectrum` by ln |p|, at constant angle of p."""
    if interval is None:
        square = (2.0 * np.pi * f) ** 2
        return as_array(np.real(2.0 * c * p * (square - p**2) / (p**2 + square) ** 2))
    a = p * interval
    denominator, sine_square = _sampled_denominator(a, f * interval)
    phi = np.exp(-a)
    slope = 2.0 * np.expm1(-a) ** 2 - 4.0 * sine_square * (1.0 + phi**2)
    return as_array(interval * np.real(-c * a * phi * slope / denominator**2))


def allan_variance(c: complex, p: complex, tau: FloatArray, interval: float | None) -> FloatArray:
    """Return the Allan variance at cluster times τ, s."""
    return _variance(_ALLAN_WEIGHTS, 1.0, c, p, tau, interval)


def hadamard_variance(c: complex, p: complex, tau: FloatArray, interval: float | None) -> FloatArray:
    """Return the Hadamard variance at cluster times τ, s."""
    return _variance(_HADAMARD_WEIGHTS, 1.0 / 3.0, c, p, tau, interval)


def _sampled_denominator(a: complex, cycles: FloatArray) -> tuple[ComplexArray, FloatArray]:
    sine_square = np.sin(np.pi * cycles) ** 2
    return np.expm1(-a) ** 2 + 4.0 * np.exp(-a) * sine_square, sine_square


def _variance(
    weights: tuple[float, float, float],
    factor: float,
    c: complex,
    p: complex,
    tau: FloatArray,
    interval: float | None,
) -> FloatArray:
    x = p * tau
    contrast, linear = _contrast(weights, x)
    if interval is not None:
        ratio, excess = _sampling(p * interval)
        contrast = ratio * contrast + linear * excess * x
    return as_array(factor * np.real(c * contrast / x**2))


def _contrast(weights: tuple[float, float, float], x: ComplexArray) -> tuple[ComplexArray, float]:
    """Return Σ w_k (exp(−kx) − 1 + k x), and its coefficient of x."""
    linear = sum(k * w for k, w in enumerate(weights, 1))
    small = np.abs(x) < _SERIES_LIMIT
    z = np.where(small, 1.0, x)
    closed = linear * z + sum(w * np.expm1(-k * z) for k, w in enumerate(weights, 1))
    coefficients = [
        sum(w * k**n for k, w in enumerate(weights, 1)) * (-1.0) ** n / factorial(n) for n in _SERIES_ORDERS
    ]
    y = np.where(small, x, 0.0)
    series = y**3 * np.polynomial.polynomial.polyval(y, coefficients)
    return np.where(small, series, closed), linear


def _sampling(a: complex) -> tuple[complex, complex]:
    """Return h = (a/2)²/sinh²(a/2) and h (sinh(a)/a − 1)."""
    lost = -np.expm1(-a)
    ratio = complex(a**2 * np.exp(-a) / lost**2)
    if abs(a) < 1.0:
        return ratio, ratio * complex(sum(a ** (2 * k) / factorial(2 * k + 1) for k in range(1, 12)))
    return ratio, complex(0.5 * a * (2.0 - lost) / lost) - ratio
