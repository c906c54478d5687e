"""Averages over N seconds, correlograms, and the noise type at a cluster time."""

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz

from models.noise import BiasInstability
from tuner.curves import acf, pacf
from tuner.curves.series import averages, exponent, noise_types, nsec
from tuner.types.records import DataError, Record


def record(y, interval=0.01, segments=()):
    y = np.asarray(y, dtype=float).reshape(len(y), -1)
    axes = tuple(f"accel_{j}" for j in range(y.shape[1]))
    return Record("accel", interval * np.arange(len(y)), y, axes, "m/s^2", interval, segments)


def test_nsec_is_the_scatter_of_averages():
    y = np.random.default_rng(1).standard_normal((1003, 2))
    found = nsec(y, [1, 10, 501])
    for j in range(2):
        np.testing.assert_allclose(found[0, j], np.var(y[:, j], ddof=1))
        np.testing.assert_allclose(found[1, j], np.var(averages(y[:, j], 10), ddof=1))
    assert averages(y, 10).shape == (100, 2)


@pytest.mark.parametrize("kind", ["quantization", "white", "bias_instability", "random_walk"])
def test_lag_one_names_the_noise(kind):
    """With 4096 averages the type is right every time; α is within 0.35 of its number."""
    rng = np.random.default_rng(2)
    alpha = {"quantization": 2.0, "white": 0.0, "bias_instability": -1.0, "random_walk": -2.0}[kind]
    for _ in range(10):
        white = rng.standard_normal(4096)
        y = {
            "quantization": lambda w=white: np.diff(w, prepend=0.0),
            "white": lambda w=white: w,
            "bias_instability": lambda: BiasInstability(1.0).sample(4096, 1.0, rng),
            "random_walk": lambda w=white: np.cumsum(w),
        }[kind]()
        assert noise_types(y, [1]) == (kind,)
        assert exponent(y) == pytest.approx(alpha, abs=0.35)


def test_types_follow_the_cluster_time():
    rng = np.random.default_rng(3)
    y = rng.standard_normal(200_000) + 0.02 * np.cumsum(rng.standard_normal(200_000))
    types = noise_types(y, [1, 4, 2000, 50_000])
    assert types == ("white", "white", "random_walk", "random_walk")


def test_short_or_constant_series_count_as_white():
    assert noise_types(np.arange(10.0), [1, 3]) == ("white", "white")
    assert noise_types(np.zeros(1000), [1, 30]) == ("white", "white")


def test_acf_of_a_first_order_process():
    """r_k = φ^k to 5 standard errors; the partial one is φ and then nothing."""
    rng = np.random.default_rng(4)
    phi, n = 0.8, 100_000
    y = np.zeros(n)
    noise = rng.standard_normal(n)
    for i in range(1, n):
        y[i] = phi * y[i - 1] + noise[i]
    found, partial = acf(record(y)), pacf(record(y))
    assert found.lag.size == partial.lag.size == 101
    np.testing.assert_allclose(found.value[:20, 0], phi ** np.arange(20), atol=5 * 3 / np.sqrt(n))
    assert partial.value[1, 0] == pytest.approx(phi, abs=0.01)
    assert np.all(np.abs(partial.value[2:, 0]) < 3 * found.band)
    assert found.band == pytest.approx(1.96 / np.sqrt(n))


def test_band_holds_white_noise():
    found = acf(record(np.random.default_rng(5).standard_normal((50_000, 3))))
    outside = np.mean(np.abs(found.value[1:]) > found.band)
    assert 0.01 < outside < 0.11


def test_products_do_not_cross_a_gap():
    y = np.random.default_rng(6).standard_normal(900)
    cut = acf(record(y, segments=((0, 300), (400, 900))), lag=[0.0, 0.02])
    pieces = [y[:300], y[400:]]
    mean = np.concatenate(pieces).mean()
    expected = sum(np.dot(p[2:] - mean, p[:-2] - mean) for p in pieces) / sum(
        np.sum((p - mean) ** 2) for p in pieces
    )
    assert cut.value[1, 0] == pytest.approx(expected, rel=1e-9)


def test_one_value_for_each_lag_in_order():
    y = record(np.random.default_rng(7).standard_normal(500))
    every = acf(y).value[:, 0]
    chosen = acf(y, lag=[0.5, 0.0, 0.5])
    np.testing.assert_allclose(chosen.value[:, 0], [every[50], 1.0, every[50]])
    np.testing.assert_allclose(chosen.lag, [0.5, 0.0, 0.5])
    np.testing.assert_allclose(pacf(y, lag=[0.0]).value, [[1.0]])


def test_a_constant_axis_has_no_correlation():
    y = np.column_stack([np.full(100, 2.0), np.random.default_rng(8).standard_normal(100)])
    for found in (acf(record(y)), pacf(record(y))):
        assert np.all(np.isnan(found.value[:, 0]))
        assert found.value[0, 1] == 1.0


@pytest.mark.parametrize("lag", [[-0.1], [1.0], [float("nan")]])
def test_lags_out_of_range_are_named(lag):
    with pytest.raises(DataError, match=r"lag .* s: expected 0 to 0.99 s"):
        acf(record(np.arange(100.0) % 7), lag=lag)


def test_long_partial_correlations_are_refused():
    with pytest.raises(DataError, match="at most 20000"):
        pacf(record(np.random.default_rng(9).standard_normal(50_000)), lag=[300.0])


def test_partial_correlation_is_the_last_weight_of_the_best_prediction():
    y = record(np.random.default_rng(11).standard_normal(400).cumsum() + np.arange(400.0) % 5)
    seconds = np.arange(31) * 0.01
    correlation, partial = acf(y, lag=seconds).value[:, 0], pacf(y, lag=seconds).value[:, 0]
    for order in (1, 2, 7, 30):
        weights = solve_toeplitz(correlation[:order], correlation[1 : order + 1])
        np.testing.assert_allclose(partial[order], weights[-1], rtol=1e-9, atol=1e-12)
