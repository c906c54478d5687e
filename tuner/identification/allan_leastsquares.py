"""Least squares on the Allan curve, weighted and generalised.

Both fit the logarithm of overlapping Allan variances V_i at octaves τ_i ≤ T/4::

    Σ_i w_i [ln V_i − b_i − ln Σ_terms AVAR(τ_i; θ)]²,   b_i = ψ(v_i/2) − ln(v_i/2),   1/w_i = ψ'(v_i/2)

b is the mean and ψ' the variance of ln(χ²_v/v); the degrees of freedom v come from the covariance of the
curve under the fitted model (`tuner.identification.allan_covariance`). Neighbouring octaves are correlated by about
one half: the covariance of the estimates is the sandwich H Jᵀ W Σ W J H, H = (Jᵀ W J)⁻¹, which widens naive
intervals by half. Generalised least squares takes W = Σ⁻¹; its χ² judges whether the terms explain the curve.

References
----------
.. [1] M. S. Bartlett and D. G. Kendall, The statistical analysis of variance-heterogeneity and the
   logarithmic transformation, Suppl. J. R. Stat. Soc. 8, 1946 (moments of ln χ²).
.. [2] H. White, Maximum likelihood estimation of misspecified models, Econometrica 50, 1982 (sandwich).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import digamma, polygamma

from models.arrays import LEAST_DIVISOR, FloatArray
from models.noise import NoiseModel
from models.probability import chi2_beyond, chi2_quantile, normal_reach
from tuner.identification.allan_covariance import allan_covariance
from tuner.identification.allan_octaves import CurveProblem, OctaveCurve
from tuner.types import LEVEL

_RELATIVE_PRECISION = 1e-9
"""Relative precision of a computed Allan variance."""

_MAX_SYMMETRIC_SD = 0.05
"""Relative standard error below which an interval is symmetric in the logarithm and needs no profile."""


@dataclass(frozen=True)
class CurveFit:
    """Terms fitted to an Allan curve.

    Attributes
    ----------
    model : NoiseModel
        Fitted sum of terms.
    names : tuple of str
        Parameters, such as ``white.density``; of a second term of a kind ``gauss_markov_2.sd`` …
    estimate : ndarray, shape (p,)
        Natural logarithms of the parameters.
    covariance : ndarray, shape (p, p)
        Covariance of the logarithms; huge where the curve does not hold the parameter.
    intervals : tuple of (float, float)
        95 % interval of each parameter; the lower limit is 0 where the curve does not exclude it.
    statistic, freedom, p_value
        χ² of the residuals under their full covariance, its degrees of freedom, and its upper tail.
    dof : ndarray, shape (k,)
        Equivalent degrees of freedom of each point under the model.
    residual : ndarray, shape (k,)
        Measured ÷ fitted Allan deviation.
    """

    model: NoiseModel
    names: tuple[str, ...]
    estimate: FloatArray
    covariance: FloatArray
    intervals: tuple[tuple[float, float], ...]
    statistic: float
    freedom: int
    p_value: float
    dof: FloatArray
    residual: FloatArray


def fit(curve: OctaveCurve, start: NoiseModel, *, generalised: bool = False) -> CurveFit:
    """Fit a sum of terms to a curve by weighted or generalised least squares of ln AVAR.

    Parameters
    ----------
    curve : OctaveCurve
        What was measured.
    start : NoiseModel
        Terms to fit. Their time constants are where the search begins; amplitudes are found anew.
    generalised : bool
        Weight by the inverse of the full covariance instead of its diagonal.

    Returns
    -------
    CurveFit

    Raises
    ------
    ValueError
        If there are more parameters than points.
    """
    problem = CurveProblem.of(curve, start)
    theta = problem.start()
    freedom = len(curve.m) - len(theta)
    if freedom < 0:
        raise ValueError(f"{len(theta)} parameters need as many points of the curve, got {len(curve.m)}")
    for _ in range(3):
        dof, sigma = log_covariance(problem.model(theta), curve)
        target = np.log(curve.variance) - log_bias(dof)
        weight = np.asarray(np.linalg.inv(sigma if generalised else np.diag(np.diag(sigma))), dtype=float)
        theta, _ = problem.minimise(theta, target, weight)
    log_mean, jacobian = problem(theta)
    covariance, widening = _sandwich(jacobian, weight, sigma)
    intervals = []
    for k, sd in enumerate(np.sqrt(np.diag(covariance)).tolist()):
        if sd < _MAX_SYMMETRIC_SD:
            reach = normal_reach(LEVEL) * sd
            intervals.append((float(np.exp(theta[k] - reach)), float(np.exp(theta[k] + reach))))
        else:
            allowed = chi2_quantile(LEVEL, 1.0) * widening[k]
            intervals.append(problem.interval(k, theta, target, weight, allowed))
    residual = target - log_mean
    statistic = float(residual @ np.linalg.solve(sigma, residual))
    return CurveFit(
        problem.model(theta),
        start.parameters,
        theta,
        covariance,
        tuple(intervals),
        statistic,
        freedom,
        chi2_beyond(statistic, freedom) if freedom else 1.0,
        dof,
        np.exp(0.5 * residual),
    )


def log_covariance(model: NoiseModel, curve: OctaveCurve) -> tuple[FloatArray, FloatArray]:
    """Return the degrees of freedom, shape (k,), and the covariance of ln AVAR, shape (k, k), under a model.

    The correlations are those of the variances; the diagonal is the exact ψ'(v/2).
    """
    mean, covariance = allan_covariance(model.terms, curve.m, curve.lengths, curve.interval)
    covariance += np.diag((_RELATIVE_PRECISION * mean) ** 2)  # a ramp alone has no noise of its own
    covariance += curve.law_variance / np.multiply.outer(curve.tau, curve.tau)
    sd = np.sqrt(np.diag(covariance))
    dof = 2.0 * (mean / sd) ** 2
    log_sd = np.sqrt(polygamma(1, 0.5 * dof))
    return dof, covariance / np.outer(sd, sd) * np.outer(log_sd, log_sd)


@dataclass(frozen=True)
class Misfit:
    """How an Allan curve contradicts a sum of terms.

    Attributes
    ----------
    statistic, freedom, p_value
        χ² of ln(measured/model) under its full covariance, its degrees of freedom (points less parameters, at
        least 1) and its upper tail.
    tau : float
        Cluster time of the point that stands out most, s.
    ratio : float
        Measured ÷ modelled Allan deviation there.
    """

    statistic: float
    freedom: int
    p_value: float
    tau: float
    ratio: float


def misfit(curve: OctaveCurve, model: NoiseModel, *, tolerance: float = 0.0) -> Misfit:
    """Judge a model that was fitted to the same record by other means against the Allan curve.

    Deviations within the relative `tolerance` are granted. The fit need not minimise this χ², so that its
    probability errs to the small side.
    """
    dof, sigma = log_covariance(model, curve)
    mean = model.allan_variance(curve.tau, interval=curve.interval)
    residual = np.log(curve.variance) - log_bias(dof) - np.log(mean)
    sigma = sigma + (2.0 * tolerance) ** 2 * np.eye(len(curve.m))
    statistic = float(residual @ np.linalg.solve(sigma, residual))
    freedom = max(len(curve.m) - len(model.parameters), 1)
    worst = int(np.argmax(np.abs(residual) / np.sqrt(np.diag(sigma))))
    ratio = float(np.exp(0.5 * residual[worst]))
    return Misfit(statistic, freedom, chi2_beyond(statistic, freedom), float(curve.tau[worst]), ratio)


def log_bias(dof: FloatArray) -> FloatArray:
    """Return E ln(χ²_v/v)."""
    return np.asarray(digamma(0.5 * dof) - np.log(0.5 * dof))


def _sandwich(jacobian: FloatArray, weight: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the sandwich covariance of the parameters and, for each, its ratio to the naive variance."""
    scale = np.linalg.norm(jacobian, axis=0) + LEAST_DIVISOR
    scaled = jacobian / scale
    information = scaled.T @ weight @ scaled
    bread = np.linalg.pinv(information, hermitian=True)
    half = bread @ scaled.T @ weight
    covariance = half @ sigma @ half.T
    return covariance / np.outer(scale, scale), np.diag(covariance) / np.diag(bread)
