"""ARMA noise: spectrum, autocovariance, samples and state space agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from models.noise import GaussMarkov, White
from models.noise.arma import Arma

EXAMPLES = [
    Arma((), (), 0.5, 0.1),
    Arma((0.9,), (), 0.5, 0.1),
    Arma((), (0.4, -0.3, 0.2), 0.5, 0.1),
    Arma((0.5, 0.2, -0.1), (0.6, 0.1), 0.5, 0.1),
    Arma((1.2, -0.72), (0.3,), 0.5, 0.1),
]


def named(arma):
    return f"{len(arma.ar)}-{len(arma.ma)}"


@pytest.mark.parametrize("arma", EXAMPLES, ids=named)
def test_autocovariance_is_that_of_the_discrete_states(arma):
    transition, noise, covariance = arma.transition()
    np.testing.assert_allclose(transition @ covariance @ transition.T + noise, covariance, atol=1e-12)
    lags = np.arange(12)
    powers = [np.linalg.matrix_power(transition, int(k)) @ covariance for k in lags]
    expected = [p[0, 0] for p in powers]
    np.testing.assert_allclose(arma.autocovariance(lags * arma.interval), expected, atol=1e-13)


@pytest.mark.parametrize("arma", EXAMPLES, ids=named)
def test_allan_variance_of_long_clusters_is_that_of_the_equivalent_white_noise(arma):
    white = White(math.sqrt(arma.psd(0.0)))
    tau = np.array([1e6, 1e7]) * arma.interval
    np.testing.assert_allclose(arma.allan_variance(tau), white.allan_variance(tau), rtol=1e-4)
    np.testing.assert_allclose(arma.hadamard_variance(tau), white.hadamard_variance(tau), rtol=1e-4)


@pytest.mark.parametrize("time_constant", [0.05, 3.0, 1e3, 1e5])
def test_first_order_is_gauss_markov(time_constant):
    interval, sd = 0.1, 0.7
    phi = math.exp(-interval / time_constant)
    arma = Arma((phi,), (), sd**2 * -math.expm1(-2.0 * interval / time_constant), interval)
    markov = GaussMarkov(sd, time_constant)
    tau = np.array([1, 2, 10, 1000, 30000]) * interval
    np.testing.assert_allclose(
        arma.allan_variance(tau), markov.allan_variance(tau, interval=interval), rtol=1e-7
    )
    np.testing.assert_allclose(
        arma.hadamard_variance(tau), markov.hadamard_variance(tau, interval=interval), rtol=1e-6
    )


def test_common_roots_cancel():
    tau = np.array([1, 3, 50]) * 0.1
    white = Arma((0.6,), (-0.6,), 0.5, 0.1)
    np.testing.assert_allclose(white.allan_variance(tau), 0.5 * 0.1 / tau, rtol=1e-12)


@pytest.mark.parametrize("ar", [(1.0,), (1.01,), (0.5, 0.5), (0.0, 1.0)])
def test_stationary_only(ar):
    with pytest.raises(ValueError, match="'ar' must be stationary: largest root below 1"):
        Arma(ar, (), 1.0, 1.0)


@pytest.mark.parametrize("ma", [(-1.0,), (2.0,), (0.0, -1.5)])
def test_invertible_only(ma):
    with pytest.raises(ValueError, match="'ma' must be invertible: largest root below 1"):
        Arma((), ma, 1.0, 1.0)


def test_only_its_own_interval():
    arma = EXAMPLES[1]
    with pytest.raises(ValueError, match="'interval' must be that of the ARMA sequence"):
        arma.psd(0.1, interval=0.2)
    with pytest.raises(ValueError, match="'tau' must be whole multiples"):
        arma.allan_variance(0.15)
    with pytest.raises(ValueError, match="'variance' must be positive"):
        Arma((), (), 0.0, 1.0)
    with pytest.raises(ValueError, match=r"use Arma\.transition"):
        arma.state_space()
