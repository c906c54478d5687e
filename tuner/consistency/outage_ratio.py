"""How well a few outages tell true ÷ predicted error: the interval of the ratio.

With qᵢ = eᵀe/tr S of w independent windows, their mean q and variance v, quantiles t of Student (w − 1) and z of the
normal law,

    ratio²                   q
    interval of ratio²       q ν/χ²_{1−α/2}(ν) … q ν/χ²_{α/2}(ν)
    ν                        min(Σ (tr S)²/tr S², 2 q²/(v/w), max(2 q²/(v/w) (z/t)², w))

The first is the number of independent components where only the size of S is wrong; the second, Satterthwaite's, is
that of errors whose size differs from window to window beyond it; the third says that the scatter of few windows is
itself hardly known, and that each has one component at least. Of normal errors of constant size the interval at 95 %
covers 95 to 99 % from two windows on; where sizes differ by a factor of 1.6 (1 sd), 85 to 95 %
(`tests/tuner/consistency/test_outage_ratio.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.probability import chi2_quantile, normal_reach, student_quantile
from tuner.types.coefficient import LEVEL


def components(covariance: FloatArray) -> FloatArray:
    """Return how many independent components errors with covariances (..., n, n) count for, 1 to n; shape (...)."""
    total, square = np.trace(covariance, axis1=-2, axis2=-1), np.nansum(covariance**2, axis=(-2, -1))
    return np.where(square > 0.0, total**2 / np.where(square > 0.0, square, 1.0), 1.0)


def ratio_interval(
    groups: Sequence[ArrayLike], freedom: float, independent: float = 1.0
) -> tuple[float, float]:
    """Return the interval that holds a root mean square ratio with the chance `LEVEL`.

    Parameters
    ----------
    groups : sequence of array_like
        Squared errors over their predictions, in groups that are independent of one another.
    freedom : float
        Components behind each square, in the mean (`components`).
    independent : float
        Share of the groups that counts as independent.
    """
    means, weights = means_and_weights(groups)
    mean = float(weights @ means) if len(means) else 0.0
    if mean <= 0.0:
        return 0.0, math.inf
    nu = freedom * sum(np.size(group) for group in groups)
    count = len(means)
    if count > 1:
        own = scatter_freedom(means, weights)
        tail = 0.5 * (1.0 - LEVEL)
        sure = own * (normal_reach(LEVEL) / student_quantile(1.0 - tail, count - 1)) ** 2
        nu = min(nu, own, max(sure, count))
    nu *= independent
    low, high = (nu / chi2_quantile(p, nu) for p in (0.5 * (1.0 + LEVEL), 0.5 * (1.0 - LEVEL)))
    return math.sqrt(mean * low), math.sqrt(mean * high)


def means_and_weights(groups: Sequence[ArrayLike]) -> tuple[FloatArray, FloatArray]:
    """Return the means of groups that are not empty, and their shares of all numbers."""
    runs = [run for run in (np.asarray(group, dtype=float).ravel() for group in groups) if run.size]
    sizes = np.array([run.size for run in runs], dtype=float)
    return np.array([run.mean() for run in runs]), sizes / max(float(sizes.sum()), 1.0)


def scatter_freedom(means: FloatArray, shares: FloatArray) -> float:
    """Return the degrees of freedom of a weighted mean of squares by the scatter of its groups, ∞ without any."""
    mean = float(shares @ means)
    variance = float(np.sum(shares**2 * (means - mean) ** 2)) * len(means) / (len(means) - 1)
    return 2.0 * mean**2 / variance if variance > 0.0 else math.inf
