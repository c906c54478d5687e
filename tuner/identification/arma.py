"""ARMA model of a channel: order, coefficients with intervals, tests of what is left, and the answer "white".

The series is prepared as the MEMS papers do (`tuner.identification.arma_preprocess`); its correlograms
suggest a class; orders are compared by BIC = −2 ln L + k ln n or AIC = −2 ln L + 2k, L the likelihood of the
periodogram of the whole series (`tuner.identification.arma_whittle`).

A record of white noise often "chooses" an ARMA(1,1) whose roots nearly cancel, with coefficients that
mean nothing (their standard error is 33/√n for the model of the third paper). The model is called white
where the criterion prefers order (0, 0), or where a likelihood ratio against white noise is not
significant.

The covariance of the coefficients follows from that of the past of two processes of the same innovations e [1]_::

    cov⁻¹ = n E w wᵀ,    w = (u_1 … u_p, v_1 … v_q),    A u = e,  B v = e

References
----------
.. [1] P. J. Brockwell, R. A. Davis, Time Series: Theory and Methods, 2nd ed., ch. 8, 9 and 10.8.
.. [2] G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models, Biometrika 65, 1978.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numba
import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from models.arrays import ComplexArray, FloatArray
from models.probability import chi2_beyond, normal_reach, normality
from tuner.curves import acf, pacf
from tuner.identification.arma_preprocess import prepare, stationarity_tests
from tuner.identification.arma_whittle import WhittleArma, fit_orders
from tuner.types import LEVEL, ArmaFit, Coefficient, SeriesTest
from tuner.types.identification import price_of
from tuner.types.records import Record

Order = tuple[int, int]
Criterion = Literal["bic", "aic"]

MAX_ORDER = 3
"""Highest order on either side that is compared by default."""
HIGHEST_ORDER = 5
"""Highest order that may be wanted."""
MIN_SAMPLES = 100
"""Samples of a stretch without gaps below which no model is tried."""
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
    p, size = len(ar), len(ar) + len(ma)
    moved, inputs = np.eye(size, k=-1), np.zeros(size)
    for at, coefficients in ((0, ar), (p, tuple(-b for b in ma))):
        if coefficients:
            moved[at, :] = 0.0
            moved[at, at : at + len(coefficients)] = coefficients
            inputs[at] = 1.0
    information = solve_discrete_lyapunov(moved, np.outer(inputs, inputs))
    return np.asarray(np.linalg.pinv(n * information, hermitian=True))


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
    pieces: Sequence[FloatArray],
    interval: float,
    unit: str,
    *,
    criterion: Criterion = "bic",
    highest: int = MAX_ORDER,
) -> ArmaFit:
    """Prepare a series, choose the order of an ARMA model, estimate it and test what it leaves.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Samples, each stretch without gaps; those shorter than `MIN_SAMPLES` are left out.
    interval : float
        Sampling interval, s.
    unit : str
        Unit of the samples.
    criterion : str
        By which the order is chosen, ``bic`` or ``aic``.
    highest : int
        Highest p and q, up to `HIGHEST_ORDER`.

    Returns
    -------
    ArmaFit
        Without coefficients where the series is indistinguishable from white noise.

    Raises
    ------
    ValueError
        Where every stretch is shorter than `MIN_SAMPLES`.
    """
    long = [piece for piece in pieces if len(piece) >= MIN_SAMPLES]
    if not long:
        most = max(map(len, pieces), default=0)
        raise ValueError(f"an ARMA model needs a stretch of {MIN_SAMPLES} samples or more, got {most}")
    prepared = prepare(long, unit)
    n, longest = sum(map(len, long)), max(prepared.pieces, key=len)
    fits = fit_orders(prepared.pieces, (highest, highest))
    price = price_of(criterion, n)
    scores = {order: found.score(price) for order, found in fits.items()}
    best = min(scores, key=lambda order: scores[order])
    ratio = fits[0, 0].deviance - fits[best].deviance
    p_white = min(1.0, len(fits) * chi2_beyond(ratio, max(sum(best), 1)))
    white = best == (0, 0) or p_white > SIGNIFICANCE_LEVEL
    chosen = fits[0, 0] if white else fits[best]
    lags = min(_TESTED_LAGS, len(longest) // 4)
    suggested = suggested_class(*_correlograms(longest, lags), len(longest))
    parts = "" if len(long) == 1 else f" in {len(long)} stretches, the longest of which is tested"
    whiteness = SeriesTest(
        f"best of {len(fits)} orders against white noise, likelihood ratio",
        ratio,
        p_white,
        "white noise",
        "not distinguishable from white" if white else "not white",
    )
    return ArmaFit(
        *_coefficients(chosen, n),
        chosen.variance,
        interval,
        unit,
        criterion,
        scores,
        white,
        (
            f"series: {n} samples, {interval:.6g} s apart{parts}",
            *prepared.steps,
            f"correlograms of {lags} lags, which show nothing slower than these, suggest: {suggested}",
            f"order by {criterion.upper()} over p, q ≤ {highest}, likelihood of the periodogram: ({best[0]},{best[1]})",
        ),
        n,
        (*stationarity_tests(longest), whiteness, *_residual_tests(longest, chosen)),
    )


def _correlograms(y: FloatArray, lags: int) -> tuple[FloatArray, FloatArray]:
    """Return autocorrelation and partial autocorrelation at lags 1 …, both of shape (lags,)."""
    record = Record("series", np.arange(len(y), dtype=np.float64), y, ("x",), "1", 1.0)
    places = np.arange(lags + 1.0).tolist()
    return acf(record, lag=places).value[1:, 0], pacf(record, lag=places).value[1:, 0]


def _coefficients(fit: WhittleArma, n: int) -> tuple[tuple[Coefficient, ...], tuple[Coefficient, ...]]:
    """Return the coefficients with their intervals; none where a root has a memory longer than the series.

    Such a pole (of a random walk) or zero (of differences) lies at its limit, where an estimate has no normal law.
    """
    known = slowest_memory(fit.ar, fit.ma) < n
    reach = normal_reach(LEVEL) * np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    every = [
        Coefficient.known(value, value - float(r), value + float(r), "1")
        if known
        else Coefficient(value, None, None, "1")
        for value, r in zip((*fit.ar, *fit.ma), reach, strict=True)
    ]
    return tuple(every[: len(fit.ar)]), tuple(every[len(fit.ar) :])


def slowest_memory(ar: Sequence[float], ma: Sequence[float]) -> float:
    """Return the memory of the slowest pole or zero, −1/ln of its size, in samples; 0 where there is none."""
    largest = max(
        float(np.abs(np.roots(one)).max(initial=0.0)) for one in ([1.0, *(-a for a in ar)], [1.0, *ma])
    )
    return 0.0 if largest == 0.0 else math.inf if largest >= 1.0 else -1.0 / math.log(largest)


def innovation_sd(fit: ArmaFit) -> Coefficient:
    """Return the standard deviation of the innovations with its interval; the variance has the relative sd √(2/n)."""
    sd = math.sqrt(fit.variance)
    reach = normal_reach(LEVEL) / math.sqrt(2.0 * max(fit.samples, 1))
    return Coefficient.known(sd, sd * math.exp(-reach), sd * math.exp(reach), fit.unit)


def roots(fit: ArmaFit) -> tuple[ComplexArray, ComplexArray]:
    """Return the poles, shape (p,), and the zeros, shape (q,), of a model: roots of z^p A(1/z) and z^q B(1/z)."""
    ar, ma = ([c.value or 0.0 for c in part] for part in (fit.ar, fit.ma))
    return np.roots([1.0, *(-a for a in ar)]).astype(complex), np.roots([1.0, *ma]).astype(complex)


def cancelling(fit: ArmaFit) -> tuple[tuple[complex, complex], ...]:
    """Return the pairs of a pole and a zero that differ by no more than the 95 % error of their difference.

    A root r of 1 − Σ c_i r^−i moves by r^−i/Σ j c_j r^(−j−1) for each c_i.
    """
    poles, zeros = roots(fit)
    ar, ma = (tuple(c.value or 0.0 for c in part) for part in (fit.ar, fit.ma))
    if not ar or not ma:
        return ()
    covariance = coefficient_covariance(ar, ma, fit.samples)
    by_ar, by_ma = _moved(poles, np.array(ar)), -_moved(zeros, -np.array(ma))
    pairs = []
    for i, j in np.ndindex(len(poles), len(zeros)):
        by = np.concatenate((by_ar[i], -by_ma[j]))
        sd = math.sqrt(max(float((by @ covariance @ by.conj()).real), 0.0))
        if abs(poles[i] - zeros[j]) < normal_reach(LEVEL) * sd:
            pairs.append((complex(poles[i]), complex(zeros[j])))
    return tuple(pairs)


def _moved(of: ComplexArray, c: FloatArray) -> ComplexArray:
    """Return how roots of 1 − Σ c_i r^−i move by each coefficient, shape (k, k)."""
    i = np.arange(1, len(c) + 1)
    powers = of[:, None] ** -i.astype(float)
    return np.asarray(powers / ((powers * (i * c)).sum(axis=1) / of)[:, None])


def _residual_tests(y: FloatArray, fit: WhittleArma) -> Iterator[SeriesTest]:
    """Test the one-step residuals for correlation and normality.

    They begin behind the p first ones, and where those of the start from rest, which decay as the largest zero to the
    number of samples, are gone; half of the series at most is left out.
    """
    slowest = float(np.abs(np.roots([1.0, *fit.ma])).max(initial=0.0))
    begun = math.ceil(math.log(START_LEFT) / math.log(slowest)) if 0.0 < slowest < 1.0 else 0
    residual = (y - one_step(y, fit.ar, fit.ma))[min(begun + len(fit.ar), len(y) // 2) :]
    if not np.ptp(residual) > 0.0:
        return
    n, lags = len(residual), min(_TESTED_LAGS, len(residual) // 4)
    correlation, _ = _correlograms(residual, lags)
    statistic = float(n * (n + 2.0) * np.sum(correlation**2 / (n - np.arange(1, lags + 1))))
    p_value = chi2_beyond(statistic, max(lags - len(fit.ar) - len(fit.ma), 1))
    left = "correlation is left" if p_value < SIGNIFICANCE_LEVEL else "no correlation left"
    yield SeriesTest(
        f"Ljung–Box of {lags} lags of the residuals, Q", statistic, p_value, "no correlation", left
    )
    shape = normality(residual)
    for name, value, chance in (
        ("Jarque–Bera", shape.jarque_bera_statistic, shape.jarque_bera),
        ("D'Agostino", shape.dagostino_statistic, shape.dagostino),
    ):
        normal = "normal" if chance >= SIGNIFICANCE_LEVEL else "not normal"
        found = f"{normal}, skewness {shape.skewness:.2g}, excess kurtosis {shape.excess_kurtosis:.2g}"
        yield SeriesTest(f"{name} of the residuals, χ²", value, chance, "normal", found)
