"""The fixed-interval smoother: every estimate with all fixes, those before and those after it.

The filter feeds corrections c back, so its predicted errors are zero and the recursion of Rauch, Tung and
Striebel is one for errors alone. With e_k the smoothed error of the filter's estimate after fix k::

    C_k = P_k⁺ Φᵀ (P_{k+1}⁻)⁻¹        e_k = C_k (c_{k+1} + e_{k+1})
    P_k = P_k⁺ + C_k (P_{k+1} − P_{k+1}⁻) C_kᵀ                                    e = 0, P = P⁺ at the end

The difference of filter and smoother has the covariance P⁺ − P: `separation` scores it, a test of the filter
that needs no truth.

References
----------
.. [1] H. E. Rauch, F. Tung, C. T. Striebel, Maximum likelihood estimates of linear dynamic systems,
       AIAA Journal 3 (1965).
.. [2] P. S. Maybeck, Stochastic Models, Estimation, and Control, vol. 2, 1982, ch. 8 (smoothing).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from models.arrays import FloatArray
from models.error_state import corrected
from models.strapdown import NavigationState
from tuner.navigation.data import Solution

if TYPE_CHECKING:
    from tuner.navigation.reference_filter import SmootherStep


@dataclass(frozen=True)
class Smoothed:
    """Estimates that know all fixes.

    Attributes
    ----------
    state : NavigationState
        At every fix, arrays (k, 3), (k, 3), (k, 4).
    parameters : ndarray, shape (k, n)
        The other states.
    error : ndarray, shape (k, n)
        Smoothed minus filtered.
    covariance : ndarray, shape (k, n, n)
        Of the smoothed estimates.
    gained : ndarray, shape (k, n, n)
        P of the filter less that: the covariance of `error`.
    """

    state: NavigationState
    parameters: FloatArray
    error: FloatArray
    covariance: FloatArray
    gained: FloatArray


def smooth(solution: Solution, at_fixes: Sequence[SmootherStep]) -> Smoothed:
    """Smooth what `reference_filter.run_for_smoother` returned.

    Parameters
    ----------
    solution : Solution
        Filtered estimates.
    at_fixes : sequence of SmootherStep
        One for every fix.
    """
    k, n = len(at_fixes), at_fixes[0].after.shape[0]
    error, covariance, gained = np.zeros((k, n)), np.zeros((k, n, n)), np.zeros((k, n, n))
    covariance[-1] = at_fixes[-1].after
    for i in range(k - 2, -1, -1):
        here, there = at_fixes[i], at_fixes[i + 1]
        back = _solve(there.before, there.transition @ here.after).T
        error[i] = back @ (there.correction + error[i + 1])
        covariance[i] = here.after + back @ (covariance[i + 1] - there.before) @ back.T
        covariance[i] = 0.5 * (covariance[i] + covariance[i].T)
        gained[i] = here.after - covariance[i]
    parameters = solution.parameters + error
    parameters[:, :9] = 0.0
    return Smoothed(corrected(solution.state, error[:, :9]), parameters, error, covariance, gained)


def separation(smoothed: Smoothed) -> FloatArray:
    """Return (filtered − smoothed)² of position, velocity, attitude over its expectation, ideally 1; (k − 1, 9)."""
    spread = np.einsum("kii->ki", smoothed.gained)[:-1, :9]
    return np.asarray(smoothed.error[:-1, :9] ** 2 / np.maximum(spread, 1e-300))


def _solve(P: FloatArray, B: FloatArray) -> FloatArray:
    """Return P⁻¹ B of a covariance whose units differ widely: solved as correlations."""
    sd = np.sqrt(np.diag(P))
    sd = np.where(sd > 0.0, sd, 1.0)
    correlation = P / np.outer(sd, sd)
    return np.asarray(np.linalg.lstsq(correlation, B / sd[:, None], rcond=1e-13)[0] / sd[:, None])
