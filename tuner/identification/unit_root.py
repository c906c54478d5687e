"""Does a series wander? Tests of a unit root (Dickey and Fuller) and of a steady level (Kwiatkowski and others).

Dickey and Fuller regress Δx_t on 1, x_(t−1) and Δx_(t−1) … Δx_(t−p); the t value of x_(t−1) is far below zero where
there is no unit root, and its chance is a normal one of MacKinnon's polynomials. Kwiatkowski and others compare the
sums of x − x̄ with what white noise of the same spectrum at zero, by Bartlett's window of p lags, would make of them;
the probability is tabulated between 0.01 and 0.10.

References
----------
.. [1] S. E. Said, D. A. Dickey, Testing for unit roots in ARMA models of unknown order, Biometrika 71, 1984.
.. [2] J. G. MacKinnon, Approximate asymptotic distribution functions for unit-root and cointegration tests,
   J. Business and Economic Statistics 12, 1994, table 3.
.. [3] D. Kwiatkowski et al., Testing the null hypothesis of stationarity, J. Econometrics 54, 1992, table 1.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial.polynomial import polyval

from models.arrays import FloatArray
from models.probability import normal_below

LEAST_STATISTIC, TURN_STATISTIC, MOST_STATISTIC = -18.83, -1.61, 2.74
"""Statistics between which the polynomials hold, and where the second follows the first."""
LOW_POLYNOMIAL = (2.1659, 1.4412, 0.038269)
HIGH_POLYNOMIAL = (1.7339, 0.93202, -0.12745, -0.010368)
"""Normal deviate of a statistic, by rising powers: one series, a constant, no trend."""
LEVEL_STATISTICS = (0.347, 0.463, 0.574, 0.739)
LEVEL_CHANCES = (0.10, 0.05, 0.025, 0.01)
"""Statistics of a steady level and their chances."""


def dickey_fuller(x: FloatArray, lags: int) -> tuple[float, float]:
    """Return statistic and p-value of a series, shape (n,): small where it does not wander."""
    d = np.diff(x)
    past = sliding_window_view(d[:-1], lags)[:, ::-1] if lags else np.empty((len(d), 0))
    rows = np.column_stack((x[lags:-1], past, np.ones(len(d) - lags)))
    basis, triangle = np.linalg.qr(rows)
    size = np.linalg.solve(triangle, basis.T @ d[lags:])
    left = d[lags:] - rows @ size
    variance = float(left @ left) / (len(left) - len(size))
    inverse = np.linalg.inv(triangle)
    statistic = float(size[0] / np.sqrt(variance * (inverse[0] @ inverse[0])))
    if not LEAST_STATISTIC < statistic < MOST_STATISTIC:
        return statistic, float(statistic >= MOST_STATISTIC)
    polynomial = LOW_POLYNOMIAL if statistic <= TURN_STATISTIC else HIGH_POLYNOMIAL
    return statistic, normal_below(float(polyval(statistic, polynomial)))


def steady_level(x: FloatArray, lags: int) -> tuple[float, float]:
    """Return statistic and p-value, 0.01 … 0.10, of a series, shape (n,): small where its level wanders."""
    n, e = len(x), x - x.mean()
    weights = 2.0 * (1.0 - np.arange(1, lags + 1) / (lags + 1.0))
    lagged = np.array([e[k:] @ e[:-k] for k in range(1, lags + 1)])
    statistic = float(np.sum(np.cumsum(e) ** 2)) / n / float(e @ e + weights @ lagged)
    return statistic, float(np.interp(statistic, LEVEL_STATISTICS, LEVEL_CHANCES))
