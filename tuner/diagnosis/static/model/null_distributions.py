"""Null distributions and small fits that several causes share.

References
----------
.. [1] R. B. Davies, Hypothesis testing when a nuisance parameter is present only under the alternative,
   Biometrika 64 (1977), 74 (1987): the bound for scans.
.. [2] E. B. Wilson, M. M. Hilferty, The distribution of chi-square, PNAS 17 (1931).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from models.arrays import FloatArray
from models.probability import chi2_beyond
from tuner.types import LEVEL

COST_OUTSIDE = 1e12
"""Cost where free numbers are not allowed, nats: above that of any record."""
SLOW_RATIO_FACTOR = 0.8
"""Factor on likelihood ratios of slow templates, for tests and intervals.

The noise at their frequencies is itself estimated from few coefficients, so that ratios exceed
the quantiles of χ² more often; chosen to allow for that.
"""

REGION_NATS = -float(np.log1p(-LEVEL))
"""Loss of log likelihood at the ends of a 95 % region of two numbers: half of the quantile of χ²₂."""
EDGE_NATS = -float(np.log1p(-np.sqrt(LEVEL)))
"""Nats within which the true place of a change lies, 95 %.

The log likelihood ratio walks away from the true place on either side with a drift; what it reaches there is
exponential, at most, so that P(best − true ≤ x) ≥ (1 − exp(−x))².
"""


def davies(ratio: float, correlation: FloatArray) -> float:
    """Return the bound on the chance that a scan of χ²₁ statistics exceeds `ratio`.

    Parameters
    ----------
    ratio : float
        Largest likelihood ratio of the scan.
    correlation : ndarray
        Correlation of adjacent whitened templates; empty for a single one.
    """
    crossings = float(np.sum(np.arccos(np.clip(correlation, -1.0, 1.0)))) / np.pi
    return float(min(1.0, chi2_beyond(ratio, 1) + crossings * np.exp(-0.5 * ratio)))


def any_of(p_value: float, number: float) -> float:
    """Return the chance that one of `number` independent tests is as extreme as `p_value`."""
    return float(-np.expm1(number * np.log1p(-min(p_value, 1.0 - 1e-16))))


def variance_deviate(mean_square: FloatArray | float, freedom: FloatArray | float) -> FloatArray:
    """Return the normal deviate of a mean square of unit expectation with so many degrees of freedom."""
    spread = 2.0 / (9.0 * np.asarray(freedom))
    return np.asarray((np.cbrt(mean_square) - (1.0 - spread)) / np.sqrt(spread))


def minimum(
    cost: Callable[[FloatArray], float],
    starts: Sequence[Sequence[float]],
    *,
    scale: float = 0.3,
    tolerance: float = 1e-5,
) -> tuple[FloatArray, float]:
    """Minimise a smooth cost of a few parameters.

    Parameters
    ----------
    cost : callable
        (p,) → value.
    starts : sequence
        Starting points.
    scale : float
        Size of the first simplex.
    tolerance : float
        Spread of the parameters and of the cost at which the search ends.

    Returns
    -------
    x, value
        Minimum (p,) and its value.
    """
    ends = []
    for start in starts:
        x0 = np.asarray(start, dtype=float)
        ends.append(_descend(cost, np.vstack([x0, x0 + scale * np.eye(len(x0))]), tolerance))
    value, x = min(ends, key=lambda end: end[0])
    return x, value


def _descend(
    cost: Callable[[FloatArray], float], simplex: FloatArray, tolerance: float
) -> tuple[float, FloatArray]:
    """Return the minimum that a simplex, shape (p + 1, p), walks to, and its place (Nelder and Mead)."""
    corners = sorted(((float(cost(x)), x) for x in simplex), key=_height)
    p = len(simplex) - 1
    for _ in range(200 * p):
        least, best = corners[0]
        worst, x = corners[-1]
        if worst - least <= tolerance and all(
            float(np.abs(x - best).max()) <= tolerance for _, x in corners[1:]
        ):
            break
        middle = sum((x for _, x in corners[1:-1]), best) / p
        away = middle - x
        tried = middle + away
        value = float(cost(tried))
        if value < least:
            further = middle + 2.0 * away
            if (beyond := float(cost(further))) < value:
                value, tried = beyond, further
        elif value >= corners[-2][0]:
            inner = middle + (0.5 if value < worst else -0.5) * away
            within = float(cost(inner))
            if not (within <= value if value < worst else within < worst):
                shrunk = [best + 0.5 * (x - best) for _, x in corners[1:]]
                corners = sorted([corners[0], *((float(cost(x)), x) for x in shrunk)], key=_height)
                continue
            value, tried = within, inner
        corners[-1] = (value, tried)
        corners.sort(key=_height)
    return corners[0]


def _height(corner: tuple[float, FloatArray]) -> float:
    """Return the cost at a corner."""
    return corner[0]


def maximum(
    cost: Callable[[FloatArray], float],
    starts: Sequence[Sequence[float]],
    *,
    scale: float = 0.3,
    tolerance: float = 1e-5,
) -> tuple[FloatArray, FloatArray, float]:
    """Return, for minus a log likelihood in nats, the `minimum`, the inverse of the second derivatives, its value."""
    x, value = minimum(cost, starts, scale=scale, tolerance=tolerance)
    return x, curvature(cost, x), value


def curvature(cost: Callable[[FloatArray], float], x: FloatArray) -> FloatArray:
    """Return the inverse of the second derivatives of a cost, by differences that cost a tenth of a nat."""
    p, middle = len(x), cost(x)
    h = np.empty(p)
    for i in range(p):
        step = 1e-4
        for _ in range(30):
            moved = x.copy()
            moved[i] += step
            if abs(cost(moved) - middle) > 0.1 or step > 0.5:
                break
            step *= 1.7
        h[i] = step
    eye = np.diag(h)
    second = np.empty((p, p))
    for i in range(p):
        for j in range(i + 1):
            corners = [cost(x + s * eye[i] + t * eye[j]) for s, t in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            second[i, j] = second[j, i] = (corners[0] - corners[1] - corners[2] + corners[3]) / (
                4 * h[i] * h[j]
            )
    values, vectors = np.linalg.eigh(np.where(np.isfinite(second), second, 0.0))
    return np.asarray((vectors / np.maximum(values, 1e-8)) @ vectors.T)
