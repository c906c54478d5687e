"""Degrees of freedom of mean squared differences, exact for any sum of noise terms.

A variance estimate V of mean σ² is treated as σ² χ²(ν)/ν with ν = 2 (E V)²/var V. For the mean of M squares
of a stationary Gaussian difference z with autocovariance s(l) that is::

    ν = M² s(0)² / Σ_{|l|<M} (M - |l|) s(l)²

s follows from the generalised covariance c(t) of the phase, s(l) = 6 c(l) - 4 c(l ± m) + c(l ± 2m) for the
second (Allan) difference and 20, -15, 6, -1 for the third (Hadamard), with

============================  =====================================
quantization                  Q² δ(t)
white noise                   -N² |t|/2
flicker (bias instability)    B² t² ln|t| / (2π)
random walk                   K² |t|³/12
Gauss–Markov                  -σ² T² (|t|/T - 1 + e^{-|t|/T})
============================  =====================================

and of any other term `models.noise.base.Term.phase_covariance`. A sum of terms sums c. Where there are many lags s
is a smooth function of l/m, and the sum runs over 32 points a cluster.

References
----------
.. [1] C. A. Greenhall, W. J. Riley, Uncertainty of stability variances based on finite differences, PTTI 2003
   (generalised covariances). The sums were checked against tr(QS)²/tr(QSQS) of the quadratic forms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.noise import NoiseModel, White

MAX_SUMMED_LAGS = 2048
"""Largest number of lags that are summed one by one; beyond, the autocovariance is a smooth function of the lag."""

POINTS_PER_CLUSTER = 32
"""Points per cluster on which a smooth autocovariance is summed where there would be more."""

MAX_LAG_CLUSTERS = 32
"""Longest lag of the sums, clusters: the squares of what is left beyond add less than 1e-4."""

_WEIGHTS = {2: (6.0, -4.0, 1.0), 3: (20.0, -15.0, 6.0, -1.0)}


class Difference:
    """Autocovariance of a difference of the phase of a noise model, against the lag in clusters.

    Ramps and sinusoids do not scatter and are left out; a model without noise counts as white.

    Parameters
    ----------
    model : NoiseModel
        Sum of terms.
    order : int
        2 or 3.
    tau : float
        Length of a cluster, s.
    """

    def __init__(self, model: NoiseModel, order: int, tau: float) -> None:
        self.weights = np.array(_WEIGHTS[order])
        self.tau = tau
        random = [t for t in model.terms if not t.deterministic]
        self.terms = [t for t in random if not t.phase_white_variance()]
        self.jitter = sum(t.phase_white_variance() for t in random)
        if not self.terms and not self.jitter:
            self.terms = [White(1.0)]

    def smooth(self, lag: FloatArray) -> FloatArray:
        """Return the part of all terms but quantization, shape of `lag`."""
        total: FloatArray = self.weights[0] * self._phase(lag)
        for j, weight in enumerate(self.weights[1:], start=1):
            total += weight * (self._phase(lag + j) + self._phase(lag - j))
        return total

    def spikes(self) -> FloatArray:
        """Return the part of quantization at lags 0, 1, 2 (, 3); it is nil anywhere else."""
        return self.jitter * self.weights

    def variance(self) -> float:
        """Return s(0)."""
        return float(self.smooth(np.zeros(1))[0] + self.spikes()[0])

    def _phase(self, lag: FloatArray) -> FloatArray:
        t = np.abs(lag) * self.tau
        total = np.zeros_like(t)
        for term in self.terms:
            total += term.phase_covariance(t, self.tau)
        return total


def overlapping(z: Difference, m: int, terms: int) -> float:
    """Return ν of the mean of z² over so many successive samples, m a cluster."""
    grid, lags, pairs = _lags(m, terms)
    s = z.smooth(lags / grid)
    spikes = z.spikes()
    whole = np.arange(spikes.size)
    smooth = z.smooth(whole.astype(float))
    # quantization is correlated at whole clusters only: single samples, whatever the grid
    single = np.where(whole == 0, 1.0, 2.0) * np.maximum(terms - m * whole, 0)
    total = m / grid * np.sum(pairs * s**2) + np.sum(single * ((smooth + spikes) ** 2 - smooth**2))
    return float((terms * z.variance()) ** 2 / total)


def averaged(z: Difference, m: int, terms: int) -> float:
    """Return ν of the mean of squares of z averaged over m samples, at so many successive samples."""
    grid, lags, pairs = _lags(m, terms)
    reach = np.arange(1 - grid, lags.size + grid - 1)
    s = z.smooth(reach / grid)
    for j, spike in enumerate(z.spikes()):
        s[np.abs(reach) == j * grid] += spike * grid / m
    s = np.convolve(s, grid - np.abs(np.arange(1 - grid, grid)), mode="valid")
    return float((terms * s[0]) ** 2 / (m / grid * np.sum(pairs * s**2)))


def _lags(m: int, terms: int) -> tuple[int, NDArray[np.int64], FloatArray]:
    """Return the grid points a cluster, the lags in grid points, and how many pairs lie at ± each."""
    grid = m if min(terms, MAX_LAG_CLUSTERS * m) <= MAX_SUMMED_LAGS else min(m, POINTS_PER_CLUSTER)
    step = m / grid
    lags = np.arange(min(int(np.ceil(terms / step)), MAX_LAG_CLUSTERS * grid))
    return grid, lags, np.where(lags == 0, 1.0, 2.0) * (terms - step * lags)


def adjoining(z: Difference, terms: int) -> float:
    """Return ν of the mean of z² over so many successive clusters."""
    return 1.0 / _shared(z, terms, terms, 0.0)


def two_groups(z: Difference, first: int, second: int, offset: float) -> float:
    """Return ν of the mean of two means over successive clusters, the second begun `offset` later."""
    own = _shared(z, first, first, 0.0) + _shared(z, second, second, 0.0)
    return 4.0 / (own + 2.0 * _shared(z, first, second, offset))


def _shared(z: Difference, first: int, second: int, offset: float) -> float:
    """Return half the covariance of two means over successive clusters, relative to the squared mean."""
    lags = np.arange(max(1 - second, -MAX_LAG_CLUSTERS), min(first, MAX_LAG_CLUSTERS + 1))
    pairs = np.minimum(first, second + lags) - np.maximum(lags, 0)
    shifted: FloatArray = lags.astype(float) - offset
    s = z.smooth(shifted)
    for j, spike in enumerate(z.spikes()):
        s[np.abs(shifted) == j] += spike
    return float(np.sum(pairs * s**2) / (first * second * z.variance() ** 2))
