"""Var(s²) = σ⁴ (2/(n − 1) + κ/n): intervals of white noise follow the tails of the samples, and nothing else does."""

import numpy as np
import pytest
from scipy.stats import binom

from tuner.identification.identify_channel import identify_channel
from tuner.identification.law_of_samples import variance_by_law
from tuner.identification.likelihood import fit
from tuner.types.records import Record

INTERVAL = 0.01


@pytest.mark.parametrize("m", [1, 4])
def test_laplace_samples_add_three_variances(m):
    n = 200_000
    y = np.random.default_rng(1).laplace(size=n) / np.sqrt(2.0) + 1e-3 * np.arange(n)  # a ramp takes no part
    pieces = [y[: n // 3], y[n // 3 :]]
    assert variance_by_law(pieces, INTERVAL, m) == pytest.approx(3.0 * INTERVAL**2 / n, rel=0.1 * m)


def test_lighter_tails_than_normal_ones_add_nothing():
    rng = np.random.default_rng(2)
    line = np.sqrt(2.0) * np.sin(0.7 * np.arange(20_000))
    for y in (rng.standard_normal(20_000), rng.uniform(size=20_000), rng.standard_normal(20_000) + line):
        assert variance_by_law([y], INTERVAL) == 0.0


def test_intervals_cover_the_density_of_skewed_noise():
    runs, hits, rng = 100, 0, np.random.default_rng(3)
    for _ in range(runs):
        low, high = fit([rng.exponential(size=3000)], INTERVAL, ["white"]).interval("white.density")
        hits += low <= np.sqrt(INTERVAL) <= high
    assert binom.ppf(1e-4, runs, 0.95) <= hits  # 73 of 100 where the law does not count


@pytest.mark.parametrize("method", ["likelihood", "leastsquares"])
def test_both_methods_widen_white_noise_alone(method):
    rng, n = np.random.default_rng(4), 30_000
    walk = 0.02 * np.cumsum(rng.standard_normal(n))
    widths = []
    for white in (rng.standard_normal(n), rng.exponential(size=n)):
        record = Record("gyro", INTERVAL * np.arange(n), (white + walk)[:, None], ("x",), "rad/s", INTERVAL)
        found = identify_channel(record, "x", method=method, terms=["white", "random_walk"])
        ends = [term.coefficients["density"].interval for term in found.terms if term.present]
        widths.append([np.log(high / low) for low, high in ends])
    white, walk = np.array(widths[1]) / np.array(widths[0])
    assert white == pytest.approx(np.sqrt(1.0 + 6.0 / 2.0), rel=0.15)  # κ of an exponential law is 6
    assert walk == pytest.approx(1.0, abs=0.1)
