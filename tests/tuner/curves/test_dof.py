"""Degrees of freedom: the trace formula of a quadratic form, Monte Carlo, and their use."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, Ramp, RandomWalk, White
from tuner.curves import difference_dof as differences
from tuner.curves.allan import overlapping_allan
from tuner.curves.difference_dof import Difference, two_groups
from tuner.curves.edf import PURE_NOISES, dof, dominant
from tuner.curves.theo import theo1, theo_br
from tuner.curves.total import total

N = 201  # phase points of the dense forms

COVARIANCE = {
    "quantization": lambda t: (t == 0) * 1.0,
    "white": lambda t: -np.abs(t) / 2,
    "bias_instability": lambda t: t**2 * np.log(np.maximum(np.abs(t), 1e-300)) / (2 * np.pi),
    "random_walk": lambda t: np.abs(t) ** 3 / 12,
}


def generalised(function):
    t = np.arange(N, dtype=float)
    return function(t[:, None] - t[None, :])


def squared(m, order, step=1, start=0):
    weights = {2: [1, -2, 1], 3: [-1, 3, -3, 1]}[order]
    begins = np.arange(start, N - order * m, step)
    rows = np.zeros((begins.size, N))
    for j, weight in enumerate(weights):
        rows[np.arange(begins.size), begins + j * m] = weight
    return rows


def rows_of(estimator, m):
    """Return z = A x and the weights of z² in the variance."""
    if estimator == "oadev":
        rows = squared(m, 2)
    elif estimator == "ohdev":
        rows = squared(m, 3)
    elif estimator == "adev":
        rows = squared(m, 2, step=m)
    elif estimator == "hdev":
        rows = squared(m, 3, step=m)
    elif estimator == "mdev":
        single = squared(m, 2)
        rows = np.array([single[j : j + m].sum(axis=0) for j in range(len(single) - m + 1)])
    elif estimator == "twogroup":
        first, second = squared(m, 2, step=m), squared(m, 2, step=m, start=m // 2)
        weights = np.concatenate([np.full(len(r), 1 / len(r)) for r in (first, second)])
        return np.vstack([first, second]), weights
    elif estimator == "totdev":
        extended = np.zeros((3 * N - 4, N))
        extended[np.arange(N - 2, 2 * N - 2), np.arange(N)] = 1
        for j in range(1, N - 1):
            extended[N - 2 - j, [0, j]] += [2, -1]
            extended[2 * N - 3 + j, [N - 1, N - 1 - j]] += [2, -1]
        centre = np.arange(N - 1, 2 * N - 3)
        rows = extended[centre - m] - 2 * extended[centre] + extended[centre + m]
    else:
        k = m // 2
        rows, weights = [], []
        for c in range(k, N - k):
            for d in range(k):
                row = np.zeros(N)
                row[[c - k, c + k]] += 1
                row[c - d] -= 1
                row[c + d] -= 1
                rows.append(row)
                weights.append(1 / (k - d))
        return np.array(rows), np.array(weights)
    return rows, np.ones(len(rows))


def exact(estimator, m, covariance):
    rows, weights = rows_of(estimator, m)
    cross = rows @ covariance @ rows.T
    return float((weights @ np.diag(cross)) ** 2 / (weights @ cross**2 @ weights))


@pytest.mark.parametrize("estimator", ["adev", "oadev", "twogroup", "mdev", "hdev", "ohdev"])
@pytest.mark.parametrize("noise", list(PURE_NOISES))
def test_differences_are_exact(estimator, noise):
    m = np.array([1, 2, 5, 16, 32, 60])
    expected = [exact(estimator, k, generalised(COVARIANCE[noise])) for k in m]
    np.testing.assert_allclose(dof(estimator, N - 1, m, noise), expected, rtol=2e-4)


@pytest.mark.parametrize("estimator", ["oadev", "mdev", "ohdev"])
@pytest.mark.parametrize("noise", list(PURE_NOISES))
def test_the_grid_of_long_clusters_is_fine_enough(estimator, noise, monkeypatch):
    n, m = 100_000, np.array([33, 100, 700, 5000])
    coarse = dof(estimator, n, m, noise)
    monkeypatch.setattr(differences, "MAX_SUMMED_LAGS", 10**6)
    np.testing.assert_allclose(coarse, dof(estimator, n, m, noise), rtol=2e-3)


@pytest.mark.parametrize("estimator", ["adev", "oadev", "mdev", "ohdev"])
def test_sums_of_terms_are_exact(estimator):
    """Quantization, white noise and random walk that cross inside the record, with Gauss–Markov noise."""
    interval = 0.5
    model = NoiseModel(
        (
            Quantization(2.0),
            White(1.0),
            RandomWalk(0.1),
            BiasInstability(0.3),
            GaussMarkov(0.4, 8.0),
            Ramp(1.0),
        )
    )

    def covariance(t):
        t = np.abs(t) * interval
        markov = -((0.4 * 8.0) ** 2) * (t / 8.0 + np.expm1(-t / 8.0))
        flicker = 0.09 * t**2 * np.log(np.maximum(t, 1e-300)) / (2 * np.pi)
        return 4.0 * (t == 0) - t / 2 + 0.01 * t**3 / 12 + flicker + markov

    m = np.array([1, 3, 10, 30])
    expected = [exact(estimator, k, generalised(covariance)) for k in m]
    np.testing.assert_allclose(dof(estimator, N - 1, m, model, interval=interval), expected, rtol=2e-3)


def test_no_digits_are_lost_in_long_records():
    """Random walk, m = 1, a million samples: z has the correlation 1/4 at lag 1, so ν = n/(1 + 2/16)."""
    assert dof("oadev", 10**6, [1], "random_walk")[0] == pytest.approx((10**6 - 1) / 1.125, rel=1e-4)


@pytest.mark.parametrize("noise", list(PURE_NOISES))
def test_total_variance_table(noise):
    m = np.array([1, 2, 4, 8, 20, 50, 100, 105, 120, 150, 180, 199])
    expected = np.array([exact("totdev", k, generalised(COVARIANCE[noise])) for k in m])
    known = np.isin(2 * m, [N - 1, 300, 2 * (N - 2)]) | (
        2 * m < N
    )  # elsewhere between three traces, short of 15 %
    found = dof("totdev", N - 1, m, noise)
    np.testing.assert_allclose(found[known], expected[known], rtol=0.04)
    np.testing.assert_allclose(found[~known], expected[~known], rtol=0.15)


@pytest.mark.parametrize("noise", ["white", "bias_instability", "random_walk", "quantization"])
def test_theo1_table(noise):
    m = np.array([10, 16, 30, 60, 100, 150, 180, 194, 200])
    expected = np.array([exact("theo1", k, generalised(COVARIANCE[noise])) for k in m])
    tolerance = 0.25 if noise == "quantization" else 0.09  # a published formula there, short of its end
    np.testing.assert_allclose(dof("theo1", N - 1, m, noise), expected, rtol=tolerance)


@pytest.mark.parametrize("estimator", ["totdev", "theo1", "theobr", "oadev", "mdev", "nsec"])
@pytest.mark.parametrize("noise", list(PURE_NOISES))
def test_never_below_one(estimator, noise):
    m = np.arange(10, 200 if estimator in ("totdev", "theo1", "theobr") else 66, 2)
    assert np.all(dof(estimator, 200, m, noise) >= 1.0)


def test_two_groups_meet_their_limits():
    """Offset 0 repeats the first grouping; at m = 16, N = 401 offset m/2 gains 1.69, offset 1 1.09."""
    z = Difference(PURE_NOISES["white"], 2, 16.0)
    plain = two_groups(z, 24, 24, 0.0)
    assert plain == pytest.approx(dof("adev", 400, [16], "white")[0])
    assert two_groups(z, 24, 23, 0.5) / plain == pytest.approx(1.69, abs=0.02)
    assert two_groups(z, 24, 23, 1 / 16) / plain == pytest.approx(1.09, abs=0.02)


def test_monte_carlo_of_theo_br():
    """ν of ThêoBR from 2000 records of white noise; the variance of a variance is known to about 5 %."""
    rng = np.random.default_rng(11)
    m = np.array([40, 100, 200, 400])
    found = np.array([theo_br(rng.standard_normal(600), m) for _ in range(2000)])
    expected = 2 * found.mean(axis=0) ** 2 / found.var(axis=0)
    np.testing.assert_allclose(dof("theobr", 600, m, "white"), expected, rtol=0.25)
    assert np.all(dof("theobr", 600, m, "white") < dof("theo1", 600, m, "white"))


@pytest.mark.parametrize("statistic", ["oadev", "totdev", "theo1"])
@pytest.mark.parametrize("noise", ["white", "random_walk"])
def test_intervals_cover(statistic, noise):
    """95 % χ² intervals hold the truth in 94 … 97.5 % of 2000 records at each τ (margin 1e-5)."""
    rng = np.random.default_rng(12)
    n, m = 400, np.array([10, 40, 100])
    function = {"oadev": overlapping_allan, "totdev": total, "theo1": theo1}[statistic]
    white = rng.standard_normal((n, 2000))
    found = function(white if noise == "white" else np.cumsum(white, axis=0), m)
    truth = found.mean(axis=1, keepdims=True)
    freedom = dof(statistic, n, m, noise)[:, None]
    inside = (freedom * found / chi2.ppf(0.975, freedom) < truth) & (
        truth < freedom * found / chi2.ppf(0.025, freedom)
    )
    low, high = binom.ppf(1e-5, 2000, 0.94) / 2000, binom.ppf(1 - 1e-5, 2000, 0.975) / 2000
    assert np.all((inside.mean(axis=1) > low) & (inside.mean(axis=1) < high))


def test_stable32_intervals():
    """68.3 % limits that Stable32 prints for PHASE.DAT, white noise (its own ν, hence 2 %)."""
    printed = {  # estimator, m: sigma, lower, upper
        ("oadev", 1): (0.2922319, 0.28515, 0.29987),
        ("oadev", 16): (0.06191478, 0.057696, 0.067217),
        ("oadev", 128): (0.02767386, 0.023045, 0.037027),
        ("totdev", 256): (0.01336944, 0.010734, 0.019924),
    }
    for (estimator, m), (sigma, lower, upper) in printed.items():
        freedom = dof(estimator, 1000, [m], "white")[0]
        limits = sigma * np.sqrt(freedom / chi2.ppf([0.8415, 0.1585], freedom))
        np.testing.assert_allclose(limits, [lower, upper], rtol=0.02)


def test_the_ruling_term():
    model = NoiseModel((Quantization(1e-3), White(1e-2), RandomWalk(1e-3), GaussMarkov(1e-3, 3.0), Ramp(1.0)))
    assert [dominant(model, tau) for tau in (0.01, 1.0, 1e4)] == ["quantization", "white", "random_walk"]
    assert dominant(NoiseModel((Ramp(1.0),)), 1.0) == "white"
    for tau in (0.01, 1.0, 1e4):  # whatever the unit: the variances of a good gyro are below 1e-18 rad²/s²
        assert dominant(model.scaled(1e-9), tau) == dominant(model, tau)


def test_unknown_names_are_answered():
    with pytest.raises(ValueError, match="'estimator' must be one of"):
        dof("allan", 100, [1], "white")
    with pytest.raises(ValueError, match="'noise' must be one of"):
        dof("oadev", 100, [1], "pink")
