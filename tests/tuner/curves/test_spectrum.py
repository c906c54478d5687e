"""Multitaper spectrum: definition, level and distribution for white noise, lines."""

import numpy as np
import pytest
from scipy.stats import binom

from tuner.curves import psd
from tuner.curves.spectrum import multitaper
from tuner.types.records import DataError, Record


def record(y, interval=0.01, segments=()):
    y = np.asarray(y, dtype=float).reshape(len(y), -1)
    axes = tuple(f"gyro_{j}" for j in range(y.shape[1]))
    return Record("gyro", interval * np.arange(len(y)), y, axes, "rad/s", interval, segments)


def test_equals_the_tapered_transforms():
    y = np.random.default_rng(1).standard_normal(60)
    tapers, interval, period = 3, 0.5, 61
    t = np.arange(1, period)
    expected = []
    for j in range(tapers // 2 + 1, (period - tapers) // 2 + 1):
        wave = np.exp(-2j * np.pi * j * t / period)
        each = [
            abs(np.sum(np.sqrt(2 / period) * np.sin(np.pi * k * t / period) * (y - y.mean()) * wave)) ** 2
            for k in range(1, tapers + 1)
        ]
        expected.append(interval * np.mean(each))
    np.testing.assert_allclose(multitaper(y, interval, tapers), expected, rtol=1e-10)


@pytest.mark.parametrize("n", [1000, 50_021])
def test_white_noise_is_flat_with_the_stated_scatter(n):
    """Two-sided density var · dt, held by the 95 % intervals as often as it should (margin 1e-6)."""
    rng = np.random.default_rng(2)
    spectrum = psd(record(2.0 * rng.standard_normal((n, 8))))
    lower, upper = spectrum.interval()
    inside = (lower < 0.04) & (upper > 0.04)
    trials = inside.size / 4  # neighbouring single frequencies share tapers
    assert binom.ppf(1e-6, int(trials), 0.95) < inside.sum() / 4 < binom.ppf(1 - 1e-6, int(trials), 0.955)
    weights = spectrum.dof / spectrum.dof.sum()
    assert weights @ spectrum.density.mean(axis=1) == pytest.approx(0.04, rel=0.02)


def test_degrees_of_freedom_match_the_scatter():
    rng = np.random.default_rng(3)
    spectrum = psd(record(rng.standard_normal((4000, 300))))
    scatter = 2 * spectrum.density.mean(axis=1) ** 2 / spectrum.density.var(axis=1, ddof=1)
    # each ratio is known to 8 %; 200 of them on average to below 2 %
    assert np.mean(scatter / spectrum.dof) == pytest.approx(1.0, abs=0.05)
    assert spectrum.dof.min() == pytest.approx(10.0)


def test_random_walk_does_not_leak():
    """The spectrum of a random walk falls as 1/f² over three decades, to 10 %."""
    walk = np.cumsum(np.random.default_rng(4).standard_normal((100_000, 8)), axis=0)
    spectrum = psd(record(walk, interval=1.0))
    expected = 1 / (2 * np.sin(np.pi * spectrum.frequency)) ** 2
    chosen = (spectrum.frequency > 1e-3) & (spectrum.frequency < 0.4)
    ratio = spectrum.density.mean(axis=1)[chosen] / expected[chosen]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.03)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.05)


def test_a_few_hundred_points_for_any_length():
    for n in (100, 10_000, 1_000_000):
        found = psd(record(np.random.default_rng(5).standard_normal(n)))
        assert found.frequency.size < 400
        assert np.all(np.diff(found.frequency) > 0)
        assert found.frequency[-1] < 50.0


def test_a_line_stands_where_it_is():
    t = 0.01 * np.arange(30_000)
    y = np.random.default_rng(6).standard_normal(t.size) + 0.5 * np.sin(2 * np.pi * 7.3 * t)
    spectrum = psd(record(y))
    peak = spectrum.frequency[np.argmax(spectrum.density[:, 0])]
    assert peak == pytest.approx(7.3, rel=2 ** (1 / 24) - 1)


def test_segments_are_averaged_by_their_degrees_of_freedom():
    y = np.random.default_rng(7).standard_normal(30_000)
    whole = psd(record(y))
    parts = psd(record(y, segments=((0, 12_000), (12_500, 12_510), (13_000, 30_000))))
    assert parts.frequency[0] > whole.frequency[0]
    mean = np.average(parts.density[:, 0], weights=parts.dof)
    assert mean == pytest.approx(0.01, rel=0.05)
    assert parts.dof[-5:].sum() == pytest.approx(whole.dof[-5:].sum() * 29 / 30, rel=0.1)
    alone = psd(record(np.concatenate([y[:12_000], y[13_000:]])))
    assert parts.dof.sum() == pytest.approx(alone.dof.sum(), rel=0.06)  # shared tapers count a little twice


def test_scales_as_a_density_and_ignores_the_mean():
    y = np.random.default_rng(8).standard_normal(3000)
    first, second = psd(record(y)), psd(record(3.0 * y + 100.0))
    np.testing.assert_allclose(second.density, 9.0 * first.density, rtol=1e-9)


def test_short_records_are_refused_in_words():
    with pytest.raises(DataError, match="at least 24 samples, got 20"):
        psd(record(np.arange(20.0)))
