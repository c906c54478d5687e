"""Expected total and Thêo1 variances of pure noises, and the formulas that paper 2 prints for them.

With the generalised covariance c(t) of the phase (Greenhall and Riley), quantization δ(t), white −|t|, flicker
t² ln|t|, random walk |t|³, a contrast Σ w_i x(t_i) has the expected square ΣΣ w_i w_j c(t_i − t_j). Thêo1 averages
the squares of x(0) − x(h − d) + x(m) − x(h + d), h = m/2, with weights 1/(h − d).

Total variance, by the second differences that reach over an end of the record (a share 2τ/T of all)::

    quantization       1 + (4/3) τ/T        10 Q² instead of 6 Q² there
    white              1
    bias instability   1 − τ/(3 ln 2 T)
    random walk        1 − (3/4) τ/T
    ramp               1 − (14/15) τ/T      ∫ (2u − u²)² du = 8/15 of τ⁴ there

Of a ramp, Thêo1 = Σ (h − d)(h + d)²/(0.75 m²): the ratio of the Allan variance to it tends to 1.125 · 36/11 = 3.68.

References
----------
.. [1] C. A. Greenhall, D. A. Howe, D. B. Percival, Total variance, an estimator of long-term frequency
   stability, IEEE Trans. UFFC 46(5), 1999.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray

PRINTED_TOTAL: Mapping[str, float] = MappingProxyType(
    {"quantization": 0.75, "white": 0.48, "bias_instability": 0.0, "random_walk": 0.0, "ramp": 0.0}
)
"""Paper 2, a of the total variance's bias 1 − a τ/T."""

PRINTED_THEO1: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "quantization": (2.70, -1.53, 0.85),
        "white": (1.87, -1.05, 0.79),
        "bias_instability": (1.0, 0.0, 1.0),
        "random_walk": (0.14, 0.82, 0.30),
        "ramp": (0.09, 0.74, 0.40),
    }
)
"""Paper 2, table 1: a, b, c of the ratio a + b/mᶜ of the Allan variance to Thêo1."""

_TOTAL = MappingProxyType(
    {
        "quantization": 4.0 / 3.0,
        "white": 0.0,
        "bias_instability": -1.0 / (3.0 * np.log(2.0)),
        "random_walk": -0.75,
        "ramp": -14.0 / 15.0,
    }
)


def total_ratio(noise: str, share: float) -> float:
    """Return E total ÷ Allan variance of a noise at τ/T = `share`, up to 1/2."""
    return float(1.0 + _TOTAL[noise] * share)


def theo1_ratio(noise: str, m: int) -> float:
    """Return Allan variance ÷ E Thêo1 of a noise, at τ = 0.75 m samples."""
    half, tau = m // 2, 0.75 * m
    d = np.arange(half)
    if noise == "ramp":
        return float(0.5 * tau**2 / (np.sum((half - d) * (half + d) ** 2.0) / (0.75 * m**2)))
    times = np.stack([np.zeros(half), half - d, np.full(half, m), half + d])
    square = _expected_square(noise, np.array([1.0, -1.0, 1.0, -1.0]), times)
    theo1 = np.sum(square / (half - d)) / (0.75 * m**2)
    allan = _expected_square(noise, np.array([1.0, -2.0, 1.0]), np.array([[0.0], [tau], [2.0 * tau]]))
    return float(allan[0] / (2.0 * tau**2) / theo1)


def _expected_square(noise: str, weights: FloatArray, times: FloatArray) -> FloatArray:
    """Return ΣΣ w_i w_j c(t_i − t_j), times of shape (points, q), shape (q,)."""
    lags = np.abs(times[:, None, :] - times[None, :, :])
    return np.asarray(np.einsum("i,j,ijk->k", weights, weights, _covariance(noise, lags)))


def _covariance(noise: str, lag: ArrayLike) -> FloatArray:
    t = np.asarray(lag, dtype=float)
    if noise == "quantization":
        return np.asarray(t == 0.0, dtype=float)
    if noise == "white":
        return np.asarray(-t)
    if noise == "bias_instability":
        return np.asarray(t**2 * np.log(np.maximum(t, 1e-300)))
    return np.asarray(t**3)
