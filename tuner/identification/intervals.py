"""Intervals and upper limits by inversion of a score test with the exact law of the score.

A value t of the log of parameter j is accepted unless the score there is too unlikely. With the other
parameters at their best for that t, g the derivative of ln E by it made orthogonal to those by the
others, and a_k ~ N(0, E_k)::

    s = Σ c g a²/E  ~  Σ g χ²(c)

a weighted sum of χ² variables, whose tail probability follows from its saddle point within a few per cent.
That keeps the stated coverage where a random walk lives in three coefficients, and at θ_j = 0,
where the likelihood ratio is optimistic and a Hessian fails. Where the samples have heavier tails than normal ones,
ends lie at larger deviates, in the ratio of the two standard errors (`tuner.identification.law_of_samples`).

Where the low frequencies happen to be quieter than the other terms alone would make them, every amplitude is
unlikely. There the tail at the upper end of an amplitude is counted relative to the tail at zero,
P_t(s) / 2P_0(s) [3]_: the limit then never falls below what the record could have shown.

References
----------
.. [1] C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters (1948).
.. [2] R. Lugannani, S. Rice, Saddle point approximation for the distribution of the sum of independent random
   variables, Adv. Appl. Prob. 12 (1980), in the normal form of O. E. Barndorff-Nielsen.
.. [3] A. L. Read, Presentation of search results: the CLs technique, J. Phys. G 28 (2002).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, ndtri

from models.arrays import FloatArray
from tuner.identification.objective import Objective

_MAX_NORMAL_DEVIATE = 1000.0
"""Normal deviate beyond which none is computed: samples of far heavier tails than normal ones widen tens of times."""

_WELL_KNOWN = 0.1
"""Relative standard error below which an amplitude is too far from zero for zero to matter."""


def interval(objective: Objective, theta: FloatArray, j: int, *, level: float = 0.95) -> tuple[float, float]:
    """Return the two-sided interval of parameter j (not its log).

    Parameters
    ----------
    objective : Objective
        Terms and data.
    theta : ndarray, shape (p,)
        Logs of the parameters at the maximum.
    j : int
        Number of the parameter.
    level : float
        Probability of the interval.

    Returns
    -------
    (float, float)
        Lower and upper end: 0 where the data allow the term to be absent, inf where they set no limit.
    """
    reach = float(ndtri(0.5 + 0.5 * level))
    return end(objective, theta, j, -reach)[0], end(objective, theta, j, reach)[0]


def normal_score(objective: Objective, theta: FloatArray, j: int) -> float:
    """Return the score of parameter j as a standard normal deviate: positive where the data ask for more."""
    expected, gradient = objective.expected(theta)
    squares, freedom = objective.excess(expected)
    relative = gradient / expected
    free = (np.arange(len(theta)) != j) & (theta > objective.lower) & (theta < objective.upper)
    g = relative[j]
    if free.any():
        others = relative[free] * np.sqrt(freedom)
        g = g - np.linalg.lstsq(others.T, g * np.sqrt(freedom), rcond=1e-8)[0] @ relative[free]
    g = g / np.abs(g).max()
    return _deviate(g, freedom, float(g @ squares))


def _deviate(weight: FloatArray, freedom: FloatArray, x: float) -> float:
    """Return the normal deviate with the tail probability of Σ weight·χ²(freedom) at x (saddle point)."""
    mean, variance = weight @ freedom, 2.0 * freedom @ weight**2
    least = 0.5 / min(float(np.min(weight)), -1e-12)
    most = 0.5 / max(float(np.max(weight)), 1e-12)
    t = 0.0
    for _ in range(60):
        shrink = weight / (1.0 - 2.0 * t * weight)
        miss, curvature = x - shrink @ freedom, 2.0 * freedom @ shrink**2
        if abs(miss) < 1e-9 * np.sqrt(variance):
            break
        t = float(np.clip(t + miss / curvature, t + 0.9 * (least - t), t + 0.9 * (most - t)))
    power = float(t * x + 0.5 * freedom @ np.log1p(-2.0 * t * weight))
    r = float(np.sign(t) * np.sqrt(2.0 * max(power, 0.0)))
    if abs(r) < 1e-3:
        skew = 8.0 * (freedom @ weight**3) / variance**1.5
        return float((x - mean) / np.sqrt(variance) + skew / 6.0)
    return float(
        np.clip(r + np.log(t * np.sqrt(curvature) / r) / r, -_MAX_NORMAL_DEVIATE, _MAX_NORMAL_DEVIATE)
    )


def end(objective: Objective, theta: FloatArray, j: int, reach: float) -> tuple[float, FloatArray]:
    """Return one end of an interval, and the logs of all parameters there.

    Parameters
    ----------
    objective, theta, j
        As in `interval`.
    reach : float
        Normal deviate of the end, positive for the upper one.
    """
    side = np.sign(reach)
    bound = objective.upper[j] if side > 0 else objective.lower[j]
    normal, by_law = objective.covariances(theta)
    spread = float(np.sqrt(normal[j, j]))
    widening = float(np.sqrt(1.0 + by_law[j, j] / normal[j, j]))
    goal = abs(reach)
    if side > 0 and objective.is_amplitude(j) and spread > _WELL_KNOWN:
        nothing = normal_score(objective, _at(objective, theta, j, objective.lower[j]), j)
        goal = -float(ndtri(ndtr(-goal) * min(1.0, 2.0 * ndtr(nothing / widening))))
    goal *= widening
    step = float(np.clip(goal * spread, 1e-4, 1.0))
    inside, low, outside, high = theta, -goal, np.nan, np.nan
    for _ in range(60):
        if np.isnan(outside):
            at, step = float(inside[j] + side * step), 1.5 * step
            at = min(at, bound) if side > 0 else max(at, bound)
        else:
            at = float(inside[j] + np.clip(-low / (high - low), 0.1, 0.9) * (outside - inside[j]))
        point = _at(objective, inside, j, at)
        beyond = -side * normal_score(objective, point, j) - goal
        if beyond < 0 and at == bound:
            return (np.inf if side > 0 else 0.0), point
        if beyond >= 0:
            outside, high = at, beyond
        else:
            inside, low = point, beyond
        if abs(beyond) < 2e-3 or abs(outside - inside[j]) < 1e-4 * goal:
            break
    return float(np.exp(at)), point


def _at(objective: Objective, theta: FloatArray, j: int, value: float) -> FloatArray:
    """Return the logs of the parameters of greatest likelihood with number j at a value."""
    start = theta.copy()
    start[j] = value
    return objective.minimise(start, kept=j)[0]
