"""Score tests of causes that are constants: statistic, gain, estimate, and which causes a drive cannot separate.

With W = S θ + white (`whitened_innovations`), for a cause g with several constants, the accepted ones a fitted
beside::

    b = Sᵀ W          I = Sᵀ S          b_g|a = b_g − I_ga I_aa⁻¹ b_a          I_g|a = I_gg − I_ga I_aa⁻¹ I_ag
    z² = b_gᵀ I_g⁻¹ b_g / c ~ χ²        θ̂ = I⁻¹ b,  covariance c I⁻¹
    gain = ½ b_gᵀ (I_g + Λ⁻¹)⁻¹ b_g / c − ½ ln det(1 + Λ I_g / c)

Λ is the prior variance of a constant (`ConstantCause.prior_sd`): the gain is the log Bayes factor of the cause, so
that causes of one and of nine constants compete fairly. c ≥ 1 is the ratio of the variance of the sums of S W over
blocks to that of white noise: correlation that is left widens every interval (the sandwich form [1]_).

References
----------
.. [1] W. K. Newey, K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation
       consistent covariance matrix, Econometrica 55 (1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from models.arrays import FloatArray
from tuner.diagnosis.drive.causes.base import constant_causes, prior_sds
from tuner.linear_run.whitened_innovations import WhitenedInnovations
from tuner.navigation.determined import determined_by_halves
from tuner.types import Parameter

BLOCK_DURATION = 30.0
"""Length of the blocks whose sums are compared, s: beyond the correlation time of most receiver errors."""
FITTED_SHARE = 0.6
"""Part of the scored time that constants are fitted to where the rest tests them; chosen so that both are long."""
INSEPARABLE_CORRELATION = 0.97
"""Correlation of the effects of two causes on the innovations from which a drive cannot separate them.

Fitted together, their sds grow by 1/√(1 − 0.97²) = 4.
"""


@dataclass(frozen=True)
class ScoreTest:
    """Test of one constant cause.

    Attributes
    ----------
    cause : str
        Its code.
    statistic, p_value, gain : float
        z², its p value, log Bayes factor.
    size : float
        The largest constant, estimated with its prior, SI.
    """

    cause: str
    statistic: float
    p_value: float
    gain: float
    size: float

    @property
    def credible(self) -> bool:
        """Whether constants of this size are met in practice."""
        return self.size < constant_causes()[self.cause].largest


@dataclass(frozen=True)
class ConstantsFit:
    """Estimates of constants fitted together, with their covariance.

    Attributes
    ----------
    columns : tuple of int
        Their columns.
    value, shrunk : ndarray, shape (a,)
        Estimate without and with the prior.
    covariance : ndarray, shape (a, a)
        Of the estimate.
    posterior, posterior_sd : ndarray, shape (a,)
        Estimate with the prior, errors of neighbouring rows taken for alike as they are, and its sds.
    """

    columns: tuple[int, ...]
    value: FloatArray
    shrunk: FloatArray
    covariance: FloatArray
    posterior: FloatArray
    posterior_sd: FloatArray


def columns_of(cause: str, parameters: Sequence[Parameter]) -> tuple[int, ...]:
    """Return the columns of a cause."""
    return tuple(i for i, parameter in enumerate(parameters) if parameter.cause == cause)


def score_tests(
    w: WhitenedInnovations, parameters: Sequence[Parameter], accepted: Sequence[str]
) -> tuple[ScoreTest, ...]:
    """Test every constant cause that is not accepted yet, accepted ones fitted beside it."""
    fitted = _columns(accepted, parameters)
    residual, slope = _projected_out(w, fitted)
    return tuple(
        _score_test(w.t, residual, slope, cause, columns_of(cause, parameters))
        for cause in constant_causes()
        if cause not in accepted
    )


def retest(
    w: WhitenedInnovations,
    parameters: Sequence[Parameter],
    accepted: Sequence[str],
    cause: str,
    values: FloatArray,
) -> ScoreTest:
    """Test a cause whose values are compensated already, as if they were not, the others fitted beside it."""
    own = columns_of(cause, parameters)
    raw = WhitenedInnovations(w.t, w.residual + w.slope[:, list(own)] @ values, w.slope)
    others = _columns([other for other in accepted if other != cause], parameters)
    residual, slope = _projected_out(raw, others)
    return _score_test(w.t, residual, slope, cause, own)


def late_gain(
    w: WhitenedInnovations,
    parameters: Sequence[Parameter],
    accepted: Sequence[str],
    cause: str,
    at: FloatArray,
) -> float:
    """Return the log likelihood that a cause gains in the last part of a drive with constants from the first.

    Parameters
    ----------
    w : WhitenedInnovations
        The rows, compensated.
    parameters : sequence of Parameter
        Constants of the run.
    accepted : sequence of str
        Causes that are accepted, this one among them.
    cause : str
        The cause.
    at : ndarray, shape (p,)
        Values that are compensated.
    """
    early = w.t < w.t[0] + FITTED_SHARE * (w.t[-1] - w.t[0])
    every = list(_columns(accepted, parameters))
    raw = w.residual + w.slope[:, every] @ at[every]

    def left(causes: Sequence[str]) -> FloatArray:
        own = list(_columns(causes, parameters))
        prior = prior_sds(tuple(parameters[i] for i in own))
        s = w.slope[:, own]
        theta = np.linalg.solve(s[early].T @ s[early] + np.diag(prior**-2), s[early].T @ raw[early])
        return np.asarray((raw - s @ theta)[~early], dtype=float)

    named, unnamed = left(accepted), left([other for other in accepted if other != cause])
    level = max(1.0, float(np.mean(named**2))) if len(named) else 1.0
    return 0.5 * float(unnamed @ unnamed - named @ named) / level


def fit_constants(
    w: WhitenedInnovations, parameters: Sequence[Parameter], accepted: Sequence[str], at: FloatArray
) -> ConstantsFit:
    """Fit the constants of accepted causes; `at` (p,) is compensated already, and the answer is the total."""
    fitted = _columns(accepted, parameters)
    own = list(fitted)
    s = w.slope[:, own]
    prior = prior_sds(tuple(parameters[i] for i in own))
    information = s.T @ s
    inverse = np.linalg.pinv(information * np.outer(prior, prior), rcond=1e-10, hermitian=True)
    inverse *= np.outer(prior, prior)
    step = inverse @ (s.T @ w.residual)
    left = w.residual - s @ step
    c = np.array([colour_factor(w.t, left, s[:, [i]]) for i in range(len(own))])
    covariance = inverse * np.sqrt(np.outer(c, c))
    total = np.asarray(at[own] + step, dtype=float)
    shrunk = np.asarray(np.linalg.solve(information + np.diag(prior**-2), information @ total), dtype=float)
    known = information / np.sqrt(np.outer(c, c))
    spread = np.linalg.inv(known + np.diag(prior**-2))
    posterior, posterior_sd = spread @ (known @ total), np.sqrt(np.diag(spread))
    return ConstantsFit(fitted, total, shrunk, np.asarray(covariance, dtype=float), posterior, posterior_sd)


def undetermined(
    w: WhitenedInnovations, parameters: Sequence[Parameter], accepted: Sequence[str], at: FloatArray
) -> tuple[Parameter, ...]:
    """Return the constants of accepted causes that a drive does not determine (`tuner.navigation.determined`).

    Parameters
    ----------
    w, parameters, accepted, at
        As of `fit_constants`.
    """
    if not accepted:
        return ()
    early = w.t < 0.5 * (w.t[0] + w.t[-1])
    whole, first, second = (
        fit_constants(
            WhitenedInnovations(w.t[rows], w.residual[rows], w.slope[rows]), parameters, accepted, at
        )
        for rows in (np.ones(len(w.t), dtype=bool), early, ~early)
    )
    own = tuple(parameters[i] for i in whole.columns)
    shown = determined_by_halves(
        (first.posterior, first.posterior_sd),
        (second.posterior, second.posterior_sd),
        whole.posterior_sd,
        prior_sds(own),
    )
    return tuple(one for one, is_shown in zip(own, shown.tolist(), strict=True) if not is_shown)


def inseparable(
    w: WhitenedInnovations, parameters: Sequence[Parameter], cause: str, accepted: Sequence[str]
) -> tuple[str, ...]:
    """Return causes whose effect on the innovations is nearly that of an accepted one, on this drive."""
    others = _columns([a for a in accepted if a != cause], parameters)
    residual, slope = _projected_out(w, others)
    own = slope[:, list(columns_of(cause, parameters))]
    at = np.linalg.lstsq(own, residual, rcond=None)[0]
    path = own @ at
    names = []
    for other in constant_causes():
        if other in accepted:
            continue
        s = slope[:, list(columns_of(other, parameters))]
        fitted = s @ np.linalg.lstsq(s, path, rcond=None)[0]
        if float(fitted @ fitted) > INSEPARABLE_CORRELATION**2 * float(path @ path):
            names.append(other)
    return tuple(names)


def _columns(causes: Sequence[str], parameters: Sequence[Parameter]) -> tuple[int, ...]:
    return tuple(i for cause in causes for i in columns_of(cause, parameters))


def _projected_out(w: WhitenedInnovations, fitted: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return residuals and slopes with accepted constants projected out."""
    if not fitted:
        return w.residual, w.slope
    q, _ = np.linalg.qr(w.slope[:, list(fitted)])
    return w.residual - q @ (q.T @ w.residual), w.slope - q @ (q.T @ w.slope)


def _score_test(
    t: FloatArray, residual: FloatArray, slope: FloatArray, cause: str, own: tuple[int, ...]
) -> ScoreTest:
    prior_sd = constant_causes()[cause].prior_sd
    s = slope[:, list(own)] * prior_sd
    information, b = s.T @ s, s.T @ residual
    inverse = np.linalg.pinv(information, rcond=1e-9, hermitian=True)
    step = inverse @ b
    c = colour_factor(t, residual - s @ step, s)
    z2 = float(b @ step) / c
    eye = np.eye(len(own))
    shrunk = np.linalg.solve(information / c + eye, b / c)
    gain = 0.5 * float(b @ shrunk) / c - 0.5 * float(np.linalg.slogdet(eye + information / c)[1])
    return ScoreTest(cause, z2, float(chi2.sf(z2, len(own))), gain, prior_sd * float(np.abs(shrunk).max()))


def colour_factor(t: FloatArray, residual: FloatArray, s: FloatArray) -> float:
    """Return the ratio of the variance of the sums of s W over blocks to that of white noise, at least 1."""
    block = ((t - t[0]) // BLOCK_DURATION).astype(int) if len(t) else np.zeros(0, dtype=int)
    sums = np.stack([np.bincount(block, weights=column * residual) for column in s.T], axis=-1)
    inverse = np.linalg.pinv(s.T @ s, rcond=1e-9, hermitian=True)
    rank = max(1, int(np.linalg.matrix_rank(inverse, hermitian=True)))
    return max(1.0, float(np.einsum("mi,ij,mj->", sums, inverse, sums)) / rank)
