"""Covariance of overlapping Allan variances: how far neighbouring points of a curve move together.

With z_i the second differences of the integrated record at m_i samples, c_ij their cross-covariance and M_i
their number, Gaussian noise has::

    Cov(AVAR_i, AVAR_j) = 2 / (M_i M_j) Σ_l n_ij(l) γ_ij(l)²,     γ_ij = c_ij / (2 τ_i τ_j)

n_ij(l) counts the pairs of second differences at lag l. A sum of terms adds in γ, not in its square, so the
covariance is a quadratic form in the amplitudes of the terms. Each term contributes::

    γ_ij(l) = √(AVAR(τ_i) AVAR(τ_j)) ρ_ij(l)
    ρ_ij(l) ∝ Σ_ab w_a w_b g(l + a m_i + b m_j),     a, b ∈ {−1, 0, 1},  w = (1, −2, 1)

where g is the generalised covariance of the summed samples, t in samples: a spike at 0 (quantization), −|t|
(white), t² ln|t| (flicker), |t|³ − |t| (random walk), and the summed exponential (Gauss–Markov). These
closed forms hold down to zero frequency, which a transform of the spectrum does not for a random walk.
c_ij is smooth between the nine knots ±m_i ± m_j, …: the sum over up to 2N lags is taken on a grid that
thins away from them.

References
----------
.. [1] C. A. Greenhall and W. J. Riley, Uncertainty of stability variances based on finite differences,
   PTTI 2003 (generalised covariances, equivalent degrees of freedom).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np
from scipy.special import xlogy

from models.arrays import FloatArray, IntArray
from models.noise import BiasInstability, GaussMarkov, Quantization, Ramp, RandomWalk, Term

_DIFFERENCE_WEIGHTS = np.outer((1.0, -2.0, 1.0), (1.0, -2.0, 1.0)).ravel()
_DIFFERENCE_STEPS = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])
_LAGS_PER_CLUSTER = 12
"""Lags a cluster of the shorter time, and lags an e-fold further out."""
_ASYMPTOTIC_DISTANCE = 30.0
"""Cluster sizes beyond which a kernel has its asymptotic form."""


def allan_covariance(
    terms: Sequence[Term], m: IntArray, lengths: Sequence[int], interval: float
) -> tuple[FloatArray, FloatArray]:
    """Compute mean and covariance of overlapping Allan variances of Gaussian noise.

    Parameters
    ----------
    terms : sequence of Term
        Sum of noise terms. A ramp is taken as deterministic. A stationary term without a kernel of its own is
        correlated like the Gauss–Markov process of its correlation time, any other (sinusoid, ARMA) like white noise;
        the variances are those of the term.
    m : ndarray of int, shape (k,)
        Cluster sizes, samples.
    lengths : sequence of int
        Samples of each gap-free segment; segments are pooled by their numbers of second differences.
    interval : float
        Sampling interval, s.

    Returns
    -------
    mean : ndarray, shape (k,)
        Allan variance of the sum.
    covariance : ndarray, shape (k, k)
        2 mean² / diagonal is the equivalent number of degrees of freedom.
    """
    tau = np.asarray(m, dtype=float) * interval
    parts = [(term, np.sqrt(term.allan_variance(tau, interval=interval))) for term in terms]
    counts = np.maximum(np.asarray(lengths)[:, None] + 1 - 2 * np.asarray(m), 0)
    total = counts.sum(axis=0).astype(float)
    covariance = np.empty((len(m), len(m)))
    for i in range(len(m)):
        for j in range(i, len(m)):
            value = _pair(parts, interval, (int(m[i]), int(m[j])), (i, j), counts)
            covariance[i, j] = covariance[j, i] = value / (total[i] * total[j])
    return np.sum([amplitude**2 for _, amplitude in parts], axis=0), covariance


def _pair(
    parts: list[tuple[Term, FloatArray]],
    interval: float,
    m: tuple[int, int],
    at: tuple[int, int],
    counts: IntArray,
) -> float:
    """Sum 2 n γ² + 4 n δ γ over the lags of one pair of cluster sizes, δ from the ramp."""
    (m1, m2), (i, j) = m, at
    knots = _DIFFERENCE_STEPS @ np.array(m)
    lags = _lags(m1, m2, int((counts[:, i] + counts[:, j]).max()))
    spacing = np.empty(len(lags))
    spacing[1:-1] = 0.5 * (lags[2:] - lags[:-2])
    spacing[[0, -1]] = 0.5
    gamma = np.zeros(len(lags))
    spike = np.zeros(len(lags))
    ramp = 0.0
    for term, amplitude in parts:
        size = float(amplitude[i] * amplitude[j])
        if isinstance(term, Ramp):
            ramp += size
        elif isinstance(term, Quantization):
            np.add.at(spike, np.searchsorted(lags, knots), size * _DIFFERENCE_WEIGHTS / 6.0)
        else:
            kernel = _kernel(term, interval)
            scale = np.sqrt(kernel(_ZERO_LAG, m1, m1)[0] * kernel(_ZERO_LAG, m2, m2)[0])
            gamma += size * kernel(lags, m1, m2) / scale
    pairs = _pairs(lags - m1 + m2, counts[:, i], counts[:, j])
    smooth = np.sum(spacing * pairs * (2.0 * gamma**2 + 4.0 * ramp * gamma))
    return float(smooth + np.sum(pairs * (2.0 * spike**2 + 4.0 * spike * (gamma + ramp))))


_ZERO_LAG = np.zeros(1)


@lru_cache(maxsize=1024)
def _lags(m1: int, m2: int, furthest: int) -> FloatArray:
    """Return the lags between centres where γ is evaluated: dense at the knots, thin away from them."""
    knots = _DIFFERENCE_STEPS @ np.array((m1, m2))
    step = max(1, m1 // _LAGS_PER_CLUSTER)
    near = np.arange(0, 2 * m1 + 1, step)
    outermost = furthest + m1 + m2
    folds = int(_LAGS_PER_CLUSTER * np.log(max(outermost / (2.0 * m1), 1.0))) + 2
    far = np.round(np.geomspace(2.0 * m1, outermost, folds)).astype(np.int64)
    offsets = np.concatenate((near, far))
    centres = np.array([-m2, 0, m2])
    lags = np.unique(np.concatenate((*(centres[:, None] + offsets), *(centres[:, None] - offsets), knots)))
    kept = np.asarray(lags[np.abs(lags) <= outermost], dtype=np.float64)
    kept.setflags(write=False)
    return kept


def _pairs(lag: FloatArray, first: IntArray, second: IntArray) -> FloatArray:
    """Count pairs (s, t), s − t = lag, of second differences of two cluster sizes, over all segments."""
    number = np.zeros(len(lag))
    for n1, n2 in zip(first, second, strict=True):
        number += np.clip(np.minimum(min(n1, n2), np.minimum(n1 - lag, n2 + lag)), 0.0, None)
    return number


Kernel = Callable[[FloatArray, int, int], FloatArray]


def _kernel(term: Term, interval: float) -> Kernel:
    """Return the cross-covariance kernel (lag, m1, m2) of a term up to its scale.

    A stationary term without a kernel of its own has that of the Gauss–Markov process with its correlation time
    S(0)/(2σ²), any other that of white noise: the variances are exact, their correlations are not.
    """
    if isinstance(term, BiasInstability):
        return _flicker
    if isinstance(term, RandomWalk):
        return _random_walk
    if isinstance(term, GaussMarkov):
        return partial(_gauss_markov, samples=term.time_constant / interval)
    if term.exponentials() is None:
        return _white
    correlation_time = float(term.psd(0.0) / (2.0 * term.autocovariance(0.0)))
    return partial(_gauss_markov, samples=correlation_time / interval)


def _differences(lag: FloatArray, m1: int, m2: int, shape: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Apply the second differences of both cluster sizes to a generalised covariance of the distance."""
    distance = np.abs(lag + (_DIFFERENCE_STEPS @ np.array((m1, m2)))[:, None])
    return np.asarray(_DIFFERENCE_WEIGHTS @ shape(distance))


def _white(lag: FloatArray, m1: int, m2: int) -> FloatArray:
    return _differences(lag, m1, m2, np.negative)


def _random_walk(lag: FloatArray, m1: int, m2: int) -> FloatArray:
    scale = np.sqrt(m1 * m2)
    inside = np.clip(lag, -(m1 + m2), m1 + m2)  # nothing is left beyond, but rounding would be
    return _differences(inside, m1, m2, lambda d: (d / scale) ** 3 - d / scale**3)


def _flicker(lag: FloatArray, m1: int, m2: int) -> FloatArray:
    scale = np.sqrt(m1 * m2)
    far = np.abs(lag) > _ASYMPTOTIC_DISTANCE * (m1 + m2)
    value = np.empty(len(lag))
    value[~far] = _differences(lag[~far], m1, m2, lambda d: xlogy((d / scale) ** 2, d / scale))
    value[far] = -2.0 * (scale / lag[far]) ** 2  # fourth derivative
    return value


def _gauss_markov(lag: FloatArray, m1: int, m2: int, *, samples: float) -> FloatArray:
    if samples > _ASYMPTOTIC_DISTANCE * (m1 + m2):
        return _random_walk(lag, m1, m2) * float(np.sqrt(m1 * m2) / samples) ** 3 / 6.0
    rate = min(1.0 / samples, 50.0)
    sampled = rate**3 / 6.0 * (1.0 + rate**2 / 20.0) if rate < 0.1 else float(np.sinh(rate)) - rate
    return _differences(lag, m1, m2, lambda d: _integrated_exponential(d * rate) - d * sampled)


def _integrated_exponential(x: FloatArray) -> FloatArray:
    """Return 1 − x + x²/2 − exp(−x) ≈ x³/6; the parabola drops out of every fourth difference."""
    series = x**3 / 6.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))
    return np.asarray(np.where(x < 0.02, series, 1.0 - x + 0.5 * x**2 - np.exp(-x)))
