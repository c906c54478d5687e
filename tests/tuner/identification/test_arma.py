"""ARMA models: order and coefficients come back; white noise stays white."""

import json

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.signal import lfilter

from tuner.identification.arma import coefficient_covariance, fit_arma, one_step, suggested_class


def series(seed, ar=(), ma=(), n=20_000, sd=1.0):
    e = sd * np.random.default_rng(seed).standard_normal(n + 500)
    return lfilter((1.0, *ma), (1.0, *(-a for a in ar)), e)[500:]


# n times the variance of each estimate (Box & Jenkins, ch. 7): 1 − φ², 1 − θ², 1 − φ₂² twice; of ARMA(1, 1), with
# c = (1 + φθ)²/(φ + θ)², c (1 − φ²) and c (1 − θ²).
ONE_ONE = (1.0 - 0.36) ** 2 / 0.25
ORDERS = [
    ((0.8,), (), (0.36,)),
    ((), (0.6,), (0.64,)),
    ((0.9,), (-0.4,), (0.19 * ONE_ONE, 0.84 * ONE_ONE)),
    ((1.2, -0.5), (), (0.75, 0.75)),
]


@pytest.mark.parametrize(("ar", "ma", "variances"), ORDERS)
def test_order_and_coefficients_are_found(ar, ma, variances):
    found = fit_arma(series(1, ar, ma, sd=0.02), 0.01, "rad/s")
    assert found.order == (len(ar), len(ma))
    assert not found.white
    assert found.variance == pytest.approx(0.0004, rel=0.1)
    for coefficient, truth, variance in zip((*found.ar, *found.ma), (*ar, *ma), variances, strict=True):
        sd = np.sqrt(variance / 20_000)
        assert coefficient.value == pytest.approx(truth, abs=5.0 * sd)
        low, high = coefficient.interval
        assert high - low == pytest.approx(2.0 * 1.96 * sd, rel=0.1)


def test_white_noise_is_called_white():
    fits = [fit_arma(series(100 + seed, n=3000), 0.01, "rad/s") for seed in range(20)]
    white = [found for found in fits if found.white]
    assert len(white) >= 14  # measured: 3 % are not; seven of 20 have probability 1e-6
    for found in white:
        assert found.order == (0, 0)
        assert any("not distinguishable from white" in step for step in found.steps)


def test_nearly_cancelling_roots_of_the_third_paper_are_white_at_its_length():
    white = [
        fit_arma(series(200 + seed, (0.476425,), (-0.455909,), n=2000), 0.01, "rad/s").white
        for seed in range(12)
    ]
    assert sum(white) >= 8  # 97 % each by simulation


def dense_likelihood(y, ar, ma, variance):
    """Log likelihood of an ARMA(1, 1) from the covariance matrix of its samples (Box & Jenkins, eq. 3.4.7)."""
    lag_0 = (1.0 + 2.0 * ar * ma + ma**2) / (1.0 - ar**2)
    lag_1 = (1.0 + ar * ma) * (ar + ma) / (1.0 - ar**2)
    row = variance * np.concatenate([[lag_0], lag_1 * ar ** np.arange(len(y) - 1)])
    factor = cho_factor(toeplitz(row), lower=True)
    return (
        -0.5 * y @ cho_solve(factor, y)
        - np.sum(np.log(np.diag(factor[0])))
        - 0.5 * len(y) * np.log(2.0 * np.pi)
    )


def test_an_order_that_leaves_the_stationary_models_is_left_out(monkeypatch):
    """`--arma exact` ended with an error where one order of many did."""
    from statsmodels.tsa.arima.estimators import innovations

    whole = innovations.innovations_mle

    def failing(x, order, **kwargs):
        if order[0] == 2:
            raise ValueError("(ar) indicate that the process is non-stationary")
        return whole(x, order=order, **kwargs)

    monkeypatch.setattr(innovations, "innovations_mle", failing)
    y = lfilter([1.0], [1.0, -0.6], np.random.default_rng(3).standard_normal(2000))
    assert len(fit_arma(y, 0.01, "rad/s", likelihood="exact").ar) == 1


def test_exact_and_fast_likelihood_have_the_maximum_of_the_joint_density():
    """No step of half a sd from the exact estimate is likelier, by more than rounding of the optimiser; from the fast
    one, which is right to order 1/n, by no more than 0.05 nats."""
    y = series(3, (0.9,), (-0.4,), n=1500)
    y = y - y.mean()
    fast, exact = (fit_arma(y, 0.01, "rad/s", likelihood=kind) for kind in ("fast", "exact"))
    sds = np.sqrt(np.array([0.19, 0.84]) * ONE_ONE / len(y))
    for found, tolerance in ((exact, 1e-3), (fast, 0.05)):
        assert found.order == (1, 1)
        at = np.array([found.ar[0].value, found.ma[0].value])
        best = dense_likelihood(y, *at, found.variance)
        for step in 0.5 * sds * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]]):
            assert dense_likelihood(y, *(at + step), found.variance) < best + tolerance
        for factor in (0.98, 1.02):
            assert dense_likelihood(y, *at, factor * found.variance) < best + tolerance
    for a, b in zip((*fast.ar, *fast.ma), (*exact.ar, *exact.ma), strict=True):
        assert a.value == pytest.approx(b.value, abs=0.02)
    assert fast.variance == pytest.approx(exact.variance, rel=0.02)


def test_coefficients_have_the_spread_of_an_autoregression():
    # var of φ of an AR(1) is (1 − φ²)/n
    assert coefficient_covariance((0.6,), (), 10_000)[0, 0] == pytest.approx((1.0 - 0.36) / 10_000, rel=1e-6)
    # nearly cancelling roots: 33.5/√n for the model of the third paper, correlation with the other −0.9997
    covariance = coefficient_covariance((0.476425,), (-0.455909,), 10_000)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.335, rel=0.01)
    assert covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]) == pytest.approx(-0.9997, abs=2e-4)


def test_one_step_prediction_leaves_the_innovations():
    e = np.random.default_rng(4).standard_normal(500)
    y = lfilter((1.0, 0.4), (1.0, -0.7), e)
    assert y - one_step(y, (0.7,), (0.4,)) == pytest.approx(e)
    assert one_step(y, (), ()) == pytest.approx(np.zeros(500))


def test_residuals_of_a_slow_zero_begin_behind_the_start_from_rest():
    """Three zeros near 0.9 left tens of sds in the first samples: Ljung–Box 30 400, kurtosis 540 of a right model."""
    e = np.random.default_rng(9).standard_normal(21_000)
    y = lfilter((1.0, 2.537, 2.174, 0.627), (1.0, -0.437, 0.171, -0.051), e)[1000:]
    said = " ".join(fit_arma(y, 0.01, "rad/s").steps)
    assert "no correlation left" in said
    assert ": normal" in said


@pytest.mark.parametrize(
    ("ar", "ma", "expected"),
    [((), (), "white"), ((0.8,), (), "AR(1)"), ((), (0.7,), "MA(1)"), ((0.9,), (-0.5,), "ARMA")],
)
def test_correlograms_name_the_class(ar, ma, expected):
    k = np.arange(1, 21)
    impulse = lfilter((1.0, *ma), (1.0, *(-a for a in ar)), np.eye(1, 400)[0])
    correlation = np.array([impulse[j:] @ impulse[: 400 - j] for j in range(21)])
    correlation /= correlation[0]
    partial = []
    for order in k:
        matrix = correlation[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        partial.append(np.linalg.solve(matrix, correlation[1 : order + 1])[-1])
    assert suggested_class(correlation[1:], np.array(partial), 10_000) == expected


def test_steps_tell_the_whole_story():
    found = fit_arma(series(5, (0.8,)), 0.01, "rad/s")
    text = " ".join(found.steps)
    for word in (
        "samples",
        "outliers",
        "trend",
        "ADF",
        "correlograms",
        "BIC",
        "Ljung",
        "Jarque",
        "D'Agostino",
    ):
        assert word in text
    json.dumps([c.value for c in found.ar])
    assert found.interval == 0.01


def test_short_series_are_refused():
    with pytest.raises(ValueError, match="at least 100"):
        fit_arma(np.zeros(99), 0.01, "rad/s")
