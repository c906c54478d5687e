"""Simulated noise has the sampled Allan variance of its term.

Each estimate is the mean over independent records, judged by Student's t at 1e-6 two-sided: with the 110
comparisons here a correct simulation fails for about one choice of seed in ten thousand.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from models.noise import (
    Arma,
    BiasInstability,
    GaussMarkov,
    LowPassWhite,
    NoiseModel,
    RandomWalk,
    Sinusoid,
    White,
)
from tests.extension.second_order_gauss_markov import SecondOrderGaussMarkov
from tests.models.noise.terms import INTERVAL, RANDOM, named

ARMA = Arma((0.7, -0.2), (0.3,), 0.04, INTERVAL)
SAMPLED = [
    *RANDOM,
    LowPassWhite(0.1, 0.2, order=2),
    LowPassWhite(0.1, 7.0, order=2),
    White(0.1) + BiasInstability(0.2) + RandomWalk(0.05),
]
RECORDS, LENGTH = 48, 6000


def overlapping_allan(y, m):
    x = np.concatenate([[0.0], np.cumsum(y - y.mean())])
    return np.mean((x[2 * m :] - 2.0 * x[m:-m] + x[: -2 * m]) ** 2) / (2.0 * m**2)


@pytest.mark.parametrize("term", SAMPLED, ids=named)
def test_sampled_allan_variance_of_samples(term):
    rng = np.random.default_rng(7)
    records = [term.sample(LENGTH, INTERVAL, rng) for _ in range(RECORDS)]
    for m in (1, 2, 5, 20, 100):
        estimates = np.array([overlapping_allan(y, m) for y in records])
        expected = float(term.allan_variance(m * INTERVAL, interval=INTERVAL))
        score = (estimates.mean() - expected) / (estimates.std(ddof=1) / np.sqrt(RECORDS))
        assert abs(score) < student.isf(0.5e-6, RECORDS - 1)


@pytest.mark.parametrize(
    "term",
    [GaussMarkov(0.3, 50.0), SecondOrderGaussMarkov(0.3, 50.0), LowPassWhite(1.0, 0.01, order=2), ARMA],
    ids=lambda t: t.name,
)
def test_stationary_from_the_first_sample(term):
    rng = np.random.default_rng(8)
    starts = np.array([term.sample(3, INTERVAL, rng) for _ in range(2000)])
    expected = term.autocovariance(np.array([0.0, 1.0, 2.0]) * INTERVAL)
    for k in range(3):
        products = starts[:, 0] * starts[:, k]
        score = (products.mean() - expected[k]) / (products.std() / np.sqrt(len(products)))
        assert abs(score) < student.isf(0.5e-6, len(products) - 1)


def test_flicker_is_exact_from_the_first_sample_to_the_last():
    rng, n = np.random.default_rng(9), 257
    flicker = BiasInstability(1.0)
    ends = np.array([flicker.sample(n, INTERVAL, rng)[[0, 1, -1]] for _ in range(4000)])
    odd = 1.0 / (2.0 * np.arange(1, n) - 1.0)
    assert np.all(ends[:, 0] == 0.0)
    for column, lag in ((1, 1), (2, n - 1)):
        squares = ends[:, column] ** 2
        score = (squares.mean() - 4.0 / np.pi * odd[:lag].sum()) / (squares.std() / np.sqrt(len(squares)))
        assert abs(score) < student.isf(0.5e-6, len(squares) - 1)


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("term", [*SAMPLED, Sinusoid(1.0, 2.0)], ids=named)
def test_short_records(term, n):
    assert term.sample(n, INTERVAL, np.random.default_rng(0)).shape == (n,)


def test_seed_decides_everything():
    model = NoiseModel(RANDOM)
    first, second = (model.sample(100, INTERVAL, np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(first, second)
