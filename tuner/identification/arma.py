"""ARMA model of a channel: order, coefficients with intervals, tests of what is left, and the answer "white".

The series is prepared as the MEMS papers do (`tuner.identification.arma_preprocess`); its correlograms
suggest a class; orders up to (3, 3) are compared by BIC = −2 ln L + k ln n or AIC = −2 ln L + 2k, L the fast
likelihood of the log-binned periodogram or, `exact`, the innovations likelihood of statsmodels on a shorter
block.

A record of white noise often "chooses" an ARMA(1,1) whose roots nearly cancel, with coefficients that
mean nothing (their standard error is 33/√n for the model of the third paper). The model is called white
where BIC prefers order (0, 0), or where a likelihood ratio against white noise is not
significant.

The covariance of the coefficients is that of the Whittle likelihood::

    cov⁻¹ = n/(4π) ∫_{-π}^{π} (∂ ln S/∂θ) (∂ ln S/∂θ)ᵀ dω

References
----------
.. [1] P. J. Brockwell, R. A. Davis, Time Series: Theory and Methods, 2nd ed., ch. 8, 9 and 10.8.
.. [2] G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models, Biometrika 65, 1978.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Literal

import numba
import numpy as np
from scipy.linalg import solve_toeplitz

from models.arrays import FloatArray
from models.probability import chi2_beyond, normal_reach, normality
from tuner.curves import acf
from tuner.identification.arma_preprocess import prepare
from tuner.identification.arma_whittle import WhittleArma, fit_orders
from tuner.types import LEVEL, ArmaFit, Coefficient
from tuner.types.records import Record

Order = tuple[int, int]
Likelihood = Literal["fast", "exact"]

MAX_ORDER = 3
"""Highest order on either side."""

MIN_SAMPLES = 100
"""Samples below which no model is tried."""

WHITTLE_SAMPLES = 1 << 20
EXACT_SAMPLES = 20_000
"""Samples that the exact likelihood looks at; its cost grows with them and with the order."""

SIGNIFICANCE_LEVEL = 0.01
"""Size of the tests that separate an ARMA model from white noise."""

START_LEFT = 1e-6
"""Share of the errors of a start from rest that residuals may keep."""

_TESTED_LAGS = 20
"""Lags of the portmanteau test, the number usual for it; a quarter of a shorter record."""


def one_step(y: FloatArray, ar: tuple[float, ...], ma: tuple[float, ...]) -> FloatArray:
    """Return the prediction of each sample from those before it, shape (n,), starting from rest.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Prepared samples (mean 0).
    ar, ma : tuple of float
        x_k = Σ ar_i x_{k−i} + e_k + Σ ma_j e_{k−j}.
    """
    return np.asarray(_one_step(np.asarray(y, float), np.array(ar, float), np.array(ma, float)))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _one_step(y: FloatArray, ar: FloatArray, ma: FloatArray) -> FloatArray:
    """Return the predictions by a loop: `scipy.signal`, which has it too, is slow to import."""
    out = np.zeros_like(y)
    for k in range(y.size):
        for i in range(min(ar.size, k)):
            out[k] += ar[i] * y[k - 1 - i]
        for j in range(min(ma.size, k)):
            out[k] += ma[j] * (y[k - 1 - j] - out[k - 1 - j])
    return out


def coefficient_covariance(ar: tuple[float, ...], ma: tuple[float, ...], n: int) -> FloatArray:
    """Return the asymptotic covariance of (ar, ma), shape (p + q, p + q), from n samples."""
    omega = 2.0 * np.pi * (np.arange(8192) + 0.5) / 8192
    shift = np.exp(-1j * np.outer(np.arange(1, max(len(ar), len(ma)) + 1), omega))
    poles = 1.0 - np.asarray(ar) @ shift[: len(ar)]
    zeros = 1.0 + np.asarray(ma) @ shift[: len(ma)]
    slopes = np.concatenate((2.0 * (shift[: len(ar)] / poles).real, 2.0 * (shift[: len(ma)] / zeros).real))
    return np.asarray(np.linalg.pinv(0.5 * n * (slopes @ slopes.T) / len(omega), hermitian=True))


def suggested_class(correlation: FloatArray, partial: FloatArray, n: int) -> str:
    """Return the class of model that the correlograms suggest: ``white``, ``AR``, ``MA`` or ``ARMA``.

    Parameters
    ----------
    correlation, partial : ndarray, shape (k,)
        Autocorrelation and partial autocorrelation at lags 1 … k.
    n : int
        Samples behind them.

    A correlogram that ends within `MAX_ORDER` lags where the other trails off names the class; two that
    trail off mean ARMA. Bounds are widened for the number of lags.
    """
    bound = normal_reach(1.0 - SIGNIFICANCE_LEVEL / len(correlation)) / np.sqrt(n)
    ends = [int(np.max(np.flatnonzero(np.abs(c) > bound), initial=-1)) + 1 for c in (correlation, partial)]
    if ends[0] == 0 and ends[1] == 0:
        return "white"
    if ends[0] <= MAX_ORDER and ends[0] < ends[1]:
        return f"MA({ends[0]})"
    if ends[1] <= MAX_ORDER and ends[1] < ends[0]:
        return f"AR({ends[1]})"
    return "ARMA"


def fit_arma(
    y: FloatArray,
    interval: float,
    unit: str,
    *,
    likelihood: Likelihood = "fast",
) -> ArmaFit:
    """Prepare a series, choose the order of an ARMA model, estimate it and test what it leaves.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Samples without gaps, at least 100.
    interval : float
        Sampling interval, s.
    unit : str
        Unit of the samples.
    likelihood : str
        ``fast``: the log-binned periodogram of up to a million samples; ``exact``: the innovations likelihood
        of the first 20 000.

    Returns
    -------
    ArmaFit
        Without coefficients where the series is indistinguishable from white noise.

    Raises
    ------
    ValueError
        With fewer than `MIN_SAMPLES` samples.
    """
    if len(y) < MIN_SAMPLES:
        raise ValueError(f"an ARMA model needs at least {MIN_SAMPLES} samples, got {len(y)}")
    looked_at = y[: WHITTLE_SAMPLES if likelihood == "fast" else EXACT_SAMPLES]
    prepared = prepare(looked_at)
    n = len(looked_at)
    lags = min(_TESTED_LAGS, n // 4)
    correlation, partial = _correlograms(prepared.y, lags)
    fits = _all_orders(prepared.y, likelihood)
    penalty = float(np.log(n))
    scores = {order: found.score(penalty) for order, found in fits.items()}
    best = min(scores, key=lambda order: scores[order])
    p_white = chi2_beyond(fits[0, 0].deviance - fits[best].deviance, max(sum(best), 1))
    white = best == (0, 0) or p_white > SIGNIFICANCE_LEVEL
    chosen = fits[0, 0] if white else fits[best]
    source = {
        "fast": "likelihood of the log-binned periodogram",
        "exact": "innovations likelihood",
    }[likelihood]
    what = f"first {n} of {len(y)}" if n < len(y) else f"all {n}"
    steps = (
        f"series: {what} samples of the longest gap-free stretch, {interval:.6g} s apart",
        *prepared.steps,
        f"correlograms of {lags} lags suggest: {suggested_class(correlation, partial, n)}",
        f"order by BIC over p, q ≤ {MAX_ORDER}, {source}: ARMA{best}",
        _whiteness(best, p_white, scores, white),
        *_residual_report(prepared.y, chosen),
    )
    return ArmaFit(
        *_coefficients(chosen, n),
        chosen.variance,
        interval,
        unit,
        "bic",
        scores,
        white,
        steps,
    )


def _all_orders(y: FloatArray, likelihood: Likelihood) -> dict[Order, WhittleArma]:
    """Fit every order up to `MAX_ORDER` on either side."""
    if likelihood == "fast":
        return fit_orders(y, (MAX_ORDER, MAX_ORDER))
    orders = range(MAX_ORDER + 1)
    found = {(p, q): _exact(y, (p, q)) for p in orders for q in orders}
    return {order: fit for order, fit in found.items() if fit is not None}


def _exact(y: FloatArray, order: Order) -> WhittleArma | None:
    """Maximise the innovations likelihood of the normalised series; None where that leaves the stationary models."""
    from statsmodels.tools.sm_exceptions import ConvergenceWarning
    from statsmodels.tsa.arima.estimators.innovations import innovations_mle
    from statsmodels.tsa.innovations.arma_innovations import arma_loglike

    scale = float(np.std(y))
    x = y / scale
    if order == (0, 0):
        ar, ma, variance = np.zeros(0), np.zeros(0), float(np.mean(x**2))
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            try:
                found, _ = innovations_mle(x, order=(order[0], 0, order[1]), demean=False)
            except ValueError:
                return None
        ar, ma, variance = found.ar_params, found.ma_params, float(found.sigma2)
    deviance = -2.0 * float(arma_loglike(x, ar, ma, variance))
    return WhittleArma(tuple(map(float, ar)), tuple(map(float, ma)), variance * scale**2, deviance)


def _correlograms(y: FloatArray, lags: int) -> tuple[FloatArray, FloatArray]:
    """Return autocorrelation and partial autocorrelation at lags 1 …, both of shape (lags,)."""
    record = Record("series", np.arange(len(y), dtype=np.float64), y, ("x",), "1", 1.0)
    correlation = acf(record, lag=np.arange(lags + 1.0).tolist()).value[:, 0]
    partial = [solve_toeplitz(correlation[:k], correlation[1 : k + 1])[-1] for k in range(1, lags + 1)]
    return correlation[1:], np.array(partial)


def _coefficients(fit: WhittleArma, n: int) -> tuple[tuple[Coefficient, ...], tuple[Coefficient, ...]]:
    """Return the coefficients with their intervals."""
    reach = normal_reach(LEVEL) * np.sqrt(np.diag(coefficient_covariance(fit.ar, fit.ma, n)))
    every = [
        Coefficient.known(value, value - float(r), value + float(r), "1")
        for value, r in zip((*fit.ar, *fit.ma), reach, strict=True)
    ]
    return tuple(every[: len(fit.ar)]), tuple(every[len(fit.ar) :])


def _whiteness(best: Order, p_white: float, scores: Mapping[Order, float], white: bool) -> str:
    """Whether the model is distinguishable from white noise."""
    if best == (0, 0):
        runner = min((score, order) for order, score in scores.items() if order != (0, 0))
        gap = runner[0] - scores[0, 0]
        return f"not distinguishable from white: the next best, ARMA{runner[1]}, scores {gap:.3g} worse"
    figures = f"likelihood ratio against white noise p = {p_white:.2g}"
    return f"not distinguishable from white: {figures}" if white else f"not white: {figures}"


def _residual_report(y: FloatArray, fit: WhittleArma) -> tuple[str, ...]:
    """Test the one-step residuals for correlation and normality, in words.

    They begin where those of the start from rest, which decay as the largest zero to the number of samples, are gone;
    half of the series at most is left out.
    """
    slowest = float(np.abs(np.roots([1.0, *fit.ma])).max(initial=0.0))
    begun = math.ceil(math.log(START_LEFT) / math.log(slowest)) if 0.0 < slowest < 1.0 else 0
    residual = (y - one_step(y, fit.ar, fit.ma))[min(begun, len(y) // 2) :]
    if not np.ptp(residual) > 0.0:
        return ("residuals: none",)
    n, lags = len(residual), min(_TESTED_LAGS, len(residual) // 4)
    correlation, _ = _correlograms(residual, lags)
    statistic = float(n * (n + 2.0) * np.sum(correlation**2 / (n - np.arange(1, lags + 1))))
    p_value = chi2_beyond(statistic, max(lags - len(fit.ar) - len(fit.ma), 1))
    shape = normality(residual)
    normal = min(shape.jarque_bera, shape.dagostino) >= SIGNIFICANCE_LEVEL
    return (
        f"residuals: Ljung–Box of {lags} lags {statistic:.3g}, p = {p_value:.2g}: "
        + ("no correlation left" if p_value >= SIGNIFICANCE_LEVEL else "correlation is left"),
        f"residuals: Jarque–Bera p = {shape.jarque_bera:.2g}, D'Agostino p = {shape.dagostino:.2g}, "
        f"excess kurtosis {shape.excess_kurtosis:.2g}: {'normal' if normal else 'not normal'}",
    )
