"""ARMA models by the Whittle likelihood of the cosine periodogram."""

import numpy as np
import pytest
from scipy.signal import lfilter
from statsmodels.tsa.arima.estimators.innovations import innovations_mle

from tuner.identification.arma_whittle import _Likelihood, fit_orders
from tuner.identification.periodogram import cosine_periodogram


def series(seed, ar=(), ma=(), n=20_000, sd=1.0):
    e = sd * np.random.default_rng(seed).standard_normal(n + 2000)
    return lfilter((1.0, *ma), (1.0, *(-a for a in ar)), e)[2000:]


def best(fits, n):
    return min(fits, key=lambda order: fits[order].score(np.log(n)))


def test_equal_to_maximum_likelihood():
    ar, ma, n = (0.75, -0.25), (0.65, 0.35), 10_000
    for seed in range(3):
        y = series(seed, ar, ma, n)
        ours = fit_orders(y, (2, 2))[2, 2]
        exact, _ = innovations_mle(y, order=(2, 0, 2))
        sd = 2.0 / np.sqrt(n)
        np.testing.assert_allclose(ours.ar, exact.ar_params, atol=0.15 * sd)
        np.testing.assert_allclose(ours.ma, exact.ma_params, atol=0.15 * sd)
        assert ours.variance == pytest.approx(exact.sigma2, rel=0.003)


def test_the_order_of_the_arma_2_2_truth_is_found():
    n = 10_000
    hits = sum(best(fit_orders(series(s, (0.75, -0.25), (0.65, 0.35), n)), n) == (2, 2) for s in range(12))
    assert hits >= 8  # at 95 %: fewer have probability 2e-4; measured 100 % of 60


def test_a_slow_process_under_white_noise_is_found():
    n, phi = 100_000, 0.999
    y = series(1, (phi,), (), n, sd=np.sqrt(0.05 * (1.0 - phi**2))) + series(2, n=n)
    fits = fit_orders(y)
    assert best(fits, n) == (1, 1)
    assert fits[1, 1].ar[0] == pytest.approx(phi, abs=1.5e-3)


def test_a_sharp_resonance_is_not_smeared():
    r, f = 0.99, 0.2
    ar = (2.0 * r * np.cos(2.0 * np.pi * f), -(r**2))
    found = fit_orders(series(3, ar, (), 50_000), (2, 0))[2, 0]
    np.testing.assert_allclose(found.ar, ar, atol=5.0 * np.sqrt((1.0 - r**4) / 50_000))


def test_models_are_causal_and_invertible():
    y = series(4, (), (0.9,), 5000)
    for model in fit_orders(y, (3, 3)).values():
        assert np.all(np.abs(np.roots((1.0, *(-a for a in model.ar)))) <= 1.0)
        assert np.all(np.abs(np.roots((1.0, *model.ma))) <= 1.0)


def test_larger_models_are_never_less_likely():
    fits = fit_orders(series(5, (0.5,), (0.3,), 5000), (3, 3))
    for (p, q), model in fits.items():
        for smaller in ((p - 1, q), (p, q - 1)):
            if smaller in fits:
                assert model.deviance <= fits[smaller].deviance + 1e-3


def test_gradient_of_the_likelihood():
    data = cosine_periodogram([series(6, (0.5,), (0.3,), 3000)], 1.0)
    powers = np.exp(-2j * np.pi * np.outer([1, 2], data.frequency))
    likelihood = _Likelihood(data, powers, powers[:1])
    theta = np.array([0.1, 0.4, -0.2, 0.3])
    numeric = [(likelihood(theta + h)[0] - likelihood(theta - h)[0]) / 2e-6 for h in 1e-6 * np.eye(4)]
    np.testing.assert_allclose(likelihood(theta)[1], numeric, rtol=1e-4, atol=1e-2)


def test_highest_orders():
    fits = fit_orders(series(7, n=2000), (5, 5))
    assert len(fits) == 36
    assert best(fits, 2000) == (0, 0)


@pytest.mark.slow
def test_roots_that_nearly_cancel_are_white():
    n, runs = 2000, 200
    white = sum(best(fit_orders(series(s, (0.476425,), (-0.455909,), n)), n) == (0, 0) for s in range(runs))
    assert white >= 174  # 95 % of 200 is 190; fewer have probability 2e-5
