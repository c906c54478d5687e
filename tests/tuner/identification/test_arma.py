"""ARMA models: order and coefficients come back; white noise stays white."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.signal import lfilter

from tuner.identification.arma import (
    _moved,
    cancelling,
    coefficient_covariance,
    fit_arma,
    one_step,
    roots,
    suggested_class,
)
from tuner.types import ArmaFit, Coefficient


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
    found = fit_arma([series(1, ar, ma, sd=0.02)], 0.01, "rad/s")
    assert found.order == (len(ar), len(ma))
    assert not found.white
    assert found.variance == pytest.approx(0.0004, rel=0.1)
    for coefficient, truth, variance in zip((*found.ar, *found.ma), (*ar, *ma), variances, strict=True):
        sd = np.sqrt(variance / 20_000)
        assert coefficient.value == pytest.approx(truth, abs=5.0 * sd)
        low, high = coefficient.interval
        assert high - low == pytest.approx(2.0 * 1.96 * sd, rel=0.1)


def test_white_noise_is_called_white():
    fits = [fit_arma([series(100 + seed, n=3000)], 0.01, "rad/s") for seed in range(20)]
    white = [found for found in fits if found.white]
    assert len(white) >= 14  # measured: 3 % are not; seven of 20 have probability 1e-6
    for found in white:
        assert found.order == (0, 0)
        assert "not distinguishable from white" in [test.found for test in found.tests]


def test_nearly_cancelling_roots_of_the_third_paper_are_white_at_its_length():
    white = [
        fit_arma([series(200 + seed, (0.476425,), (-0.455909,), n=2000)], 0.01, "rad/s").white
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


def test_estimates_have_the_maximum_of_the_joint_density():
    """No step of half a sd is likelier by more than 0.05 nats: the periodogram is right to order 1/n."""
    y = series(3, (0.9,), (-0.4,), n=1500)
    y = y - y.mean()
    found = fit_arma([y], 0.01, "rad/s")
    sds = np.sqrt(np.array([0.19, 0.84]) * ONE_ONE / len(y))
    assert found.order == (1, 1)
    at = np.array([found.ar[0].value, found.ma[0].value])
    best = dense_likelihood(y, *at, found.variance)
    for step in 0.5 * sds * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]]):
        assert dense_likelihood(y, *(at + step), found.variance) < best + 0.05
    for factor in (0.98, 1.02):
        assert dense_likelihood(y, *at, factor * found.variance) < best + 0.05


def test_the_whole_series_is_looked_at():
    """Where the first 20 000 samples are white, the others are not; stretches count together."""
    white, coloured = series(1), series(2, (0.9,), (-0.8,), n=100_000)
    assert fit_arma([white], 0.01, "rad/s").white
    assert not fit_arma([np.concatenate((white, coloured))], 0.01, "rad/s").white
    parts = fit_arma([white[:50], coloured[:50_000], coloured[50_000:]], 0.01, "rad/s")
    assert parts.samples == 100_000
    assert parts.ar[0].value == pytest.approx(0.9, abs=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_twenty_stretches_are_one_series(seed):
    """A line out of each made AR(1) an ARMA(2,1) with θ = −1.000000 ± 2e-6; ARMA(1,1) missed its φ."""
    whole = series(300 + seed, (0.99,), (-0.9,))
    for y, truth in ((series(400 + seed, (0.9,)), 0.9), (whole, 0.99)):
        found = fit_arma(np.array_split(y, 20), 0.01, "rad/s")
        assert found.order == ((1, 0) if truth == 0.9 else (1, 1))
        low, high = found.ar[0].interval
        assert abs(found.ar[0].value - truth) < 1.8 * (high - low)  # seven sds


def test_residuals_of_an_autoregression_begin_behind_its_past():
    """The first residual was the first sample: Jarque–Bera 1.5e7 of normal innovations beside φ = 0.999."""
    y = series(7, (0.999,))
    (shape,) = (test for test in fit_arma([y], 0.01, "rad/s").tests if test.name.startswith("Jarque"))
    assert shape.statistic < 14.0  # χ²₂ beyond by 1e-3


def test_a_root_at_its_limit_has_no_interval():
    """Differences of white noise have a zero at 1, white noise on a random walk a pole: no normal law."""
    e = np.random.default_rng(10).standard_normal(5001)
    found = fit_arma([np.diff(e)], 0.01, "rad/s")
    near = [abs(z) for z in np.concatenate(roots(found))]
    assert max(near) < 1.0 - 1.0 / 5000 or all(c.interval is None for c in (*found.ar, *found.ma))


def test_scores_are_those_of_akaike_and_schwarz():
    """AIC = −2 ln L + 2k, BIC = −2 ln L + k ln n, k = p + q + 1, whichever of them chose the order."""
    y = series(6, (0.8,), n=5000)
    by = {criterion: fit_arma([y], 0.01, "rad/s", criterion=criterion) for criterion in ("aic", "bic")}
    for order, score in by["bic"].scores.items():
        price = (np.log(5000) - 2.0) * (sum(order) + 1)
        assert by["bic"].scores_by("aic")[order] == pytest.approx(score - price)
        assert by["aic"].scores_by("bic")[order] == pytest.approx(score, abs=0.1)
    assert len(fit_arma([y], 0.01, "rad/s", highest=5).scores) == 36


def test_roots_that_nearly_cancel_are_said():
    """Of ARMA(1,1) with φ = 0.9 and θ = −0.88 the roots differ by 0.02, which 3000 samples do not show."""
    close = ArmaFit(
        (Coefficient.known(0.9, 0.8, 1.0, "1"),),
        (Coefficient.known(-0.88, -1.0, -0.7, "1"),),
        1.0,
        0.01,
        "rad/s",
        "bic",
        {},
        white=False,
        samples=3000,
    )
    assert cancelling(close) == ((0.9, 0.88),)
    assert cancelling(replace(close, samples=10_000_000)) == ()
    assert cancelling(replace(close, ma=())) == ()


def test_a_random_walk_has_no_interval():
    """White noise on a random walk is an ARMA(1,1) whose pole is 1: ± 1e-6 was said of it."""
    rng = np.random.default_rng(8)
    found = fit_arma(
        [rng.standard_normal(20_000) + 0.02 * np.cumsum(rng.standard_normal(20_000))], 0.01, "rad/s"
    )
    assert found.order == (1, 1)
    held = [c.interval is None or c.interval[0] < 1.0 - 1e-5 for c in found.ar]
    assert all(held)


def test_roots_move_with_their_coefficients_as_differences_say():
    """The sd of the difference of a pole and a zero is that of the linear map through coefficients."""
    ar, ma, n = (1.2, -0.5), (-0.3,), 20_000
    fit = ArmaFit(
        tuple(Coefficient.known(x, x - 0.1, x + 0.1, "1") for x in ar),
        tuple(Coefficient.known(x, x - 0.1, x + 0.1, "1") for x in ma),
        1.0,
        0.01,
        "rad/s",
        "bic",
        {},
        white=False,
        samples=n,
    )
    poles, zeros = roots(fit)
    np.testing.assert_allclose(poles**2, 1.2 * poles - 0.5)
    np.testing.assert_allclose(zeros, [0.3])
    step = 1e-6
    moved = np.roots([1.0, -1.2 - step, 0.5])
    np.testing.assert_allclose(_moved(poles, np.array(ar))[:, 0], (moved - poles) / step, rtol=1e-4)


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
    said = [test.found for test in fit_arma([y], 0.01, "rad/s").tests]
    assert "no correlation left" in said
    assert any(text.startswith("normal") for text in said)


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


def test_steps_and_tests_tell_the_whole_story():
    found = fit_arma([series(5, (0.8,))], 0.01, "rad/s")
    text = " ".join([*found.steps, *(test.name for test in found.tests)])
    for word in (
        "samples",
        "outliers",
        "trend",
        "ADF",
        "KPSS",
        "correlograms",
        "BIC",
        "Ljung",
        "Jarque",
        "D'Ago",
    ):
        assert word in text
    assert all(0.0 <= test.p_value <= 1.0 for test in found.tests)
    assert found.interval == 0.01


def test_short_series_are_refused():
    with pytest.raises(ValueError, match="100 samples or more, got 99"):
        fit_arma([np.zeros(99)], 0.01, "rad/s")
