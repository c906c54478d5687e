"""Maximum-likelihood fit of the noise of a linearised run, with intervals and identifiability.

::

    x̂ = argmax ln L(x) − ½ Σ (x_j/σ_j)²          logs of factors; σ_j the prior, wide where nothing is known
    covariance = (−∂²/∂x²)⁻¹                      by differences of the analytic gradient

A parameter is *identifiable* where the drive alone, the others being free, determines it better than a factor e
either way (1/C_jj − 1/σ_j² > 1). Its interval is that of the quadratic where it is narrow, else where the likelihood,
along the ridge of the others and with one more step of theirs, has fallen by 1.92; without a lower end there is only
an upper limit (1.35). A wide prior bounds the search and does not enter intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from models.arrays import FloatArray
from models.interval_ends import reach
from tuner.diagnosis.drive.linear_model.noise_parameters import NoiseParameters
from tuner.linear_run.likelihood import (
    NoiseHypothesis,
    evaluate_with_gradient,
    with_constants_fixed,
)
from tuner.types import Coefficient

Cost = Callable[[FloatArray], tuple[float, FloatArray]]
"""(parameters (q,)) → cost and its gradient."""

VAGUE_PRIOR_SD = 2.0
"""Prior sd of the log of a factor of which nothing is known: a factor of 7 either way."""
MAX_LOG = 5.0
"""Largest absolute log of a factor that is searched: a factor of 150."""
QUADRATIC_SD = 0.15
"""Sd of a log below which the likelihood is taken as quadratic, for a symmetric interval.

The skewness of the log of a variance is of the order of its sd; chosen to keep that below 15 %.
"""
MIN_STEP_GAIN = 0.01
"""Gain of a step, nats, below which a search ends: it moves no parameter by more than 0.14 sd."""
MIN_VARIANCE_RATIO = 1e-9
"""Least ratio of the variance of a guess to that of the prior: keeps it positive in rounding."""
MIN_STEP_GAIN_SHARE = 1e-3
"""The same as a share of all that was gained: a fit far from its start is repeated once it is accepted."""
MAX_ALTERNATIONS = 3
"""Most fits of the noise with the constants fixed at their values under the noise before; chosen to bound the time."""
MIN_ALTERNATION_GAIN = 0.1
"""Gain by other constants, nats, from which the noise is fitted once more; chosen far below what decisions need."""
MIN_PART_FIXES, MIN_PART_SHARE = 200, 5
"""Fixes of the part of a run, and one over its share, from which a search gets its first guess.

The guess of a fifth is within some two sds of the whole, which a fit reaches in a few steps instead of some twenty.
"""
LOST_IN_ROUNDING_COST = 1e12
"""Cost, nats, of noise so far from the run's that its likelihood is lost in rounding."""
REMEMBERED_COSTS = 4
"""Answers that a cost remembers: the end of one search is the beginning of the next, and of a curvature."""
NO_PRIOR: Mapping[str, float] = MappingProxyType({})
"""Prior sds by parameter where nothing is known of any."""
_LOG_STEP = 0.02
"""Step of the log for numerical second derivatives: small against the sd of a log, large against rounding."""
_TWO_SIDED_DROP, _ONE_SIDED_DROP = 1.9207, 1.3528
"""Drops of ln L, nats, at the ends of a 95 % interval and at a 95 % bound.

Half the 95 % and the 90 % quantile of χ²₁.
"""


@dataclass(frozen=True)
class NoiseFit:
    """Noise fitted to a linearised run.

    Attributes
    ----------
    parameters : NoiseParameters
        The parameters.
    start : NoiseHypothesis
        Where they are 0, constants fixed.
    estimate, prior_sd : ndarray, shape (q,)
        Parameters and their prior sds.
    cost : callable
        −ln L and the prior, with its gradient.
    log_likelihood, objective : float
        ln L there, without and with the prior.
    """

    parameters: NoiseParameters
    start: NoiseHypothesis
    estimate: FloatArray
    prior_sd: FloatArray
    cost: Cost
    log_likelihood: float
    objective: float

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the estimate, with the prior; shape (q, q)."""
        return curvature(self.cost, self.estimate, self.prior_sd)

    @property
    def noise(self) -> NoiseHypothesis:
        """Noise after the fit."""
        return self.parameters.change(self.start, self.estimate)

    def number(self, name: str) -> int:
        """Return the number of a parameter."""
        return self.parameters.names.index(name)

    def factor(self, name: str) -> float:
        """Return the exponential of a parameter."""
        return float(np.exp(self.estimate[self.number(name)]))

    def identifiable(self, name: str) -> bool:
        """Whether the drive alone determines a parameter better than a factor e either way."""
        j = self.number(name)
        return bool(1.0 / self.covariance[j, j] - 1.0 / self.prior_sd[j] ** 2 > 1.0)

    def coefficient(self, name: str, *, unit: str = "1", scale: float = 1.0) -> Coefficient:
        """Return `scale` times the exponential of a parameter, with its 95 % interval.

        Parameters
        ----------
        name, unit : str
            Parameter; unit of the answer.
        scale : float
            What the exponential is multiplied by.
        """
        j = self.number(name)
        sd, x = float(np.sqrt(self.covariance[j, j])), float(self.estimate[j])
        value = scale * float(np.exp(x))
        if sd < QUADRATIC_SD:
            low, high = scale * np.exp(x - 1.96 * sd), scale * np.exp(x + 1.96 * sd)
            return Coefficient.known(value, float(low), float(high), unit)
        reason = None
        if not self.identifiable(name):
            reason = (
                f"the drive determines it no better than to a factor {np.exp(min(sd, VAGUE_PRIOR_SD)):.1f}"
            )
        low = self._reach(j, -1.0, _TWO_SIDED_DROP)
        if low <= -MAX_LOG:
            upper = scale * float(np.exp(self._reach(j, 1.0, _ONE_SIDED_DROP)))
            return Coefficient.bounded(upper, unit, reason or "indistinguishable from none on this drive")
        high = self._reach(j, 1.0, _TWO_SIDED_DROP)
        return Coefficient.known(value, scale * float(np.exp(low)), scale * float(np.exp(high)), unit, reason)

    def _reach(self, j: int, side: float, drop: float) -> float:
        """Return the value of a parameter where the objective, along the ridge, has fallen by `drop`."""
        ridge = self.covariance[:, j] / self.covariance[j, j]
        sd = float(np.sqrt(self.covariance[j, j]))
        others = self.covariance - np.outer(ridge, self.covariance[j])
        known = np.where(self.prior_sd < VAGUE_PRIOR_SD, self.prior_sd, np.inf)
        top = self.log_likelihood - 0.5 * float(np.sum((self.estimate / known) ** 2))

        def fallen(distance: float) -> bool:
            x = np.clip(self.estimate + side * distance * ridge, -MAX_LOG, MAX_LOG)
            noise = self.parameters.change(self.start, x)
            likelihood, gradient = evaluate_with_gradient(noise)
            slopes = self.parameters.slopes(self.start, x, gradient) - x / self.prior_sd**2
            value = likelihood.value + 0.5 * float(slopes @ others @ slopes)
            return top - value + 0.5 * float(np.sum((x / known) ** 2)) > drop

        most = MAX_LOG - side * float(self.estimate[j])
        near, far = reach(fallen, float(np.sqrt(2.0 * drop) * sd), most)
        return side * MAX_LOG if near >= most else float(self.estimate[j] + side * 0.5 * (near + far))


def maximize_likelihood(
    noise: NoiseHypothesis,
    parameters: NoiseParameters,
    *,
    prior_sd: Mapping[str, float] = NO_PRIOR,
    start: FloatArray | None = None,
) -> NoiseFit:
    """Fit noise to a linearised run by maximum likelihood.

    Parameters
    ----------
    noise : NoiseHypothesis
        Where all parameters are 0.
    parameters : NoiseParameters
        The parameters.
    prior_sd : mapping of str to float
        Prior sd of a log by name, about 0; `VAGUE_PRIOR_SD` where it is not given.
    start : ndarray, shape (q,), optional
        Where to begin.
    """
    sd = np.array([prior_sd.get(name, VAGUE_PRIOR_SD) for name in parameters.names])
    x = np.zeros(len(parameters.names)) if start is None else start
    fixed, cost = _cost_at_fixed_constants(noise, parameters, x, sd)
    last = -np.inf
    first = cost(x)[0]
    x, inverse = _first_guess(fixed, parameters, x, sd, cost, first)
    for _ in range(MAX_ALTERNATIONS):
        x, last, inverse = _minimized(cost, x, inverse, first)
        if not noise.columns:
            break
        fixed, cost = _cost_at_fixed_constants(noise, parameters, x, sd)
        was, last = last, -cost(x)[0]
        if last - was < MIN_ALTERNATION_GAIN:
            break
    prior = 0.5 * float(np.sum((x / sd) ** 2))
    return NoiseFit(parameters, fixed, x, sd, cost, prior + last, last)


def _first_guess(
    noise: NoiseHypothesis,
    parameters: NoiseParameters,
    x: FloatArray,
    sd: FloatArray,
    cost: Cost,
    first: float,
) -> tuple[FloatArray, FloatArray]:
    """Return where a search begins, and the inverse of the curvature there, from a part of a long run."""
    k = len(noise.linearized)
    if k < MIN_PART_SHARE * MIN_PART_FIXES:
        return x, curvature(cost, x, sd)
    middle = slice(k // 2, k // 2 + max(MIN_PART_FIXES, k // MIN_PART_SHARE))
    part, own = noise.part(middle, MIN_PART_FIXES // MIN_PART_SHARE), parameters.of_part(middle)
    if np.any(noise.counted.any(axis=0) & ~part.counted.any(axis=0)):
        return x, curvature(cost, x, sd)
    of_part = _cost(part, own, sd)
    there, _, _ = _minimized(of_part, x, curvature(of_part, x, sd), of_part(x)[0])
    if cost(there)[0] > first:
        return x, curvature(cost, x, sd)
    # The information of the part beyond the prior grows with the number of rows; eigenvalues by the prior's.
    values, vectors = np.linalg.eigh(curvature(of_part, there, sd) / np.outer(sd, sd))
    values = np.clip(values, MIN_VARIANCE_RATIO, 1.0)
    more = 1.0 / (1.0 + noise.count / part.count * (1.0 / values - 1.0))
    inverse = (vectors * more) @ vectors.T * np.outer(sd, sd)
    return there, 0.5 * (inverse + inverse.T)


def _cost_at_fixed_constants(
    noise: NoiseHypothesis, parameters: NoiseParameters, x: FloatArray, sd: FloatArray
) -> tuple[NoiseHypothesis, Cost]:
    """Return the hypothesis with constants fixed at their best for some noise, and the cost of other noise."""
    fixed = replace(
        noise, linearized=with_constants_fixed(parameters.change(noise, x)).linearized, columns=()
    )
    return fixed, _cost(fixed, parameters, sd)


def _cost(noise: NoiseHypothesis, parameters: NoiseParameters, sd: FloatArray) -> Cost:
    """Return the cost to minimise, −ln L and the prior, with its gradient; the last answers are remembered."""

    @lru_cache(maxsize=REMEMBERED_COSTS)
    def remembered(at: tuple[float, ...]) -> tuple[float, FloatArray]:
        return computed(np.array(at))

    def cost(at: FloatArray) -> tuple[float, FloatArray]:
        value, slope = remembered(tuple(at.tolist()))
        return value, slope.copy()

    def computed(at: FloatArray) -> tuple[float, FloatArray]:
        x = np.clip(at, -MAX_LOG, MAX_LOG)
        with np.errstate(invalid="ignore", divide="ignore"):
            likelihood, gradient = evaluate_with_gradient(parameters.change(noise, x))
            slopes = parameters.slopes(noise, x, gradient)
        if not (np.isfinite(likelihood.value) and np.isfinite(slopes).all()):
            return LOST_IN_ROUNDING_COST, x / sd**2
        slope = x / sd**2 - slopes
        # Beyond the bound the cost is that at the bound: what still points outwards ends there.
        slope[(np.abs(at) >= MAX_LOG) & (slope * at < 0.0)] = 0.0
        return 0.5 * float(np.sum((x / sd) ** 2)) - likelihood.value, slope

    return cost


def _minimized(
    cost: Cost, x: FloatArray, inverse: FloatArray, first: float
) -> tuple[FloatArray, float, FloatArray]:
    """Return where a search from x ends, the objective, and the inverse of the curvature, given that at x.

    `first` is the cost from which all that is gained counts.
    """
    options = {"hess_inv0": inverse, "gtol": 0.03, "maxiter": 60}
    last = cost(x)[0]

    def enough(intermediate_result: OptimizeResult) -> None:
        nonlocal last
        gained, last = last - float(intermediate_result.fun), float(intermediate_result.fun)
        if gained < max(MIN_STEP_GAIN, MIN_STEP_GAIN_SHARE * (first - last)):
            raise StopIteration

    answer = minimize(cost, x, method="BFGS", jac=True, options=options, callback=enough)
    after = 0.5 * (answer.hess_inv + answer.hess_inv.T)
    safe = after if np.linalg.eigvalsh(after).min() > 0.0 else inverse
    return np.clip(answer.x, -MAX_LOG, MAX_LOG), -float(answer.fun), safe


def curvature(cost: Cost, x: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the inverse of the second derivatives of a cost with gradient, by differences of the gradient.

    Directions in which the cost is not convex are given the prior's variance.
    """
    middle = cost(x)[1]
    second = np.empty((len(x), len(x)))
    for j in range(len(x)):
        moved = x.copy()
        moved[j] += _LOG_STEP
        second[j] = (cost(moved)[1] - middle) / _LOG_STEP
    second = np.where(np.abs(second) < LOST_IN_ROUNDING_COST, second, 0.0)
    second = 0.5 * (second + second.T) * np.outer(sd, sd)
    values, vectors = np.linalg.eigh(second)
    inverse = (vectors / np.maximum(values, 1.0)) @ vectors.T * np.outer(sd, sd)
    return np.asarray(0.5 * (inverse + inverse.T))
