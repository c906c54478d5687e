"""Likelihood of a filter's scores: that of normal errors, written out, and what weakens it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tuner.consistency.attribution.likelihood import WhitenedProducts, deviance, whitened_products


def test_deviance_is_that_of_independent_normal_errors():
    """−2 Σ ln p of n vectors of covariance V, up to n d ln 2π, from their mean product alone."""
    rng = np.random.default_rng(1)
    n, true = 400, np.array([[1.0, 0.4, 0.1], [0.4, 2.0, -0.3], [0.1, -0.3, 0.5]])
    errors = rng.multivariate_normal(np.zeros(3), true, n)
    products = WhitenedProducts((errors.T @ errors / n)[None], np.full(3, float(n)))
    for covariance in (true, np.eye(3), 3.0 * true):
        expected = -2.0 * multivariate_normal(np.zeros(3), covariance).logpdf(errors).sum() - 3 * n * np.log(
            2.0 * np.pi
        )
        assert deviance([products], covariance.reshape(-1))[0] == pytest.approx(expected, rel=1e-9)


def test_blocks_add_and_runs_are_apart():
    one = WhitenedProducts(np.array([[[1.5]], [[0.5]]]), np.array([100.0]))
    two = WhitenedProducts(np.array([[[2.0]], [[1.0]]]), np.array([40.0]))
    both = deviance([one, two], np.array([1.2, 0.8]))
    by_hand = 100.0 * (np.log(1.2) + np.array([1.5, 0.5]) / 1.2) + 40.0 * (
        np.log(0.8) + np.array([2.0, 1.0]) / 0.8
    )
    np.testing.assert_allclose(both, by_hand)


def test_an_error_of_the_model_counts_like_chance():
    """A mean square of n values has the relative variance 2/n: with e² besides it is worth 1/(1/n + e²/2) values."""
    one = WhitenedProducts(np.array([[[1.5]]]), np.array([1000.0]))
    free, bound = (deviance([one], np.array([1.0]), model_error=error)[0] for error in (0.0, 0.1))
    assert free == pytest.approx(1000.0 * 1.5)
    assert bound == pytest.approx(1.5 / (1.0 / 1000.0 + 0.005))


def test_white_values_count_one_each_and_repeated_ones_less():
    """Values that are held for five epochs each hold a fifth of the information; 20 runs of 500: 15 % is 5 sd."""
    rng = np.random.default_rng(2)
    used = np.ones((20, 500), dtype=bool)
    white = rng.standard_normal((20, 500, 1))
    held = np.repeat(rng.standard_normal((20, 100, 1)), 5, axis=1)
    assert whitened_products(white, used).effective[0] == pytest.approx(10_000.0, rel=0.15)
    assert whitened_products(held, used).effective[0] == pytest.approx(2_000.0, rel=0.35)
    half = used.copy()
    half[:, 250:] = False
    np.testing.assert_allclose(
        whitened_products(white, half).products[:, 0, 0], np.mean(white[:, :250, 0] ** 2, axis=1)
    )
