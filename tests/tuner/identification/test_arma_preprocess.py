"""Preparation of a record for ARMA: outliers, trends, seasonal parts, tests of stationarity."""

import re

import numpy as np
import pytest
from statsmodels.tsa.stattools import adfuller, kpss

from tuner.identification.arma_preprocess import (
    prepare,
    remove_trend,
    replace_outliers,
    reverse_arrangements,
    robust_outliers,
    sigma_outliers,
    stationarity_tests,
    unit_root,
    variance_change,
)
from tuner.identification.unit_root import dickey_fuller, steady_level


def white(seed, n=20_000):
    return np.random.default_rng(seed).standard_normal(n)


def test_rule_of_three_sigmas_takes_clean_data():
    y = white(1, 200_000)
    taken = sigma_outliers(y)
    assert np.mean(taken) == pytest.approx(0.0027, rel=0.2)
    assert np.var(y[~taken]) == pytest.approx(0.9733, rel=0.01)
    assert np.sum(robust_outliers(y, 4.5)) < 10  # 6.8e-6 each: 1.4 expected


def test_spikes_are_found_on_a_drift():
    y = white(2) + np.linspace(0.0, 300.0, 20_000)
    spikes = np.array([100, 7000, 15_500])
    y[spikes] += 12.0
    marked = robust_outliers(y, 4.5)
    assert np.all(marked[spikes])
    assert marked.sum() < 10
    assert not np.any(sigma_outliers(y))  # the drift hides them from the plain rule


def test_quantized_samples_are_not_outliers():
    for sd in (0.3, 0.2):  # nine of ten samples are equal, or nearly all
        assert not np.any(robust_outliers(np.round(sd * white(3)), 4.5))
    assert not np.any(robust_outliers(np.zeros(500), 4.5))


def test_outliers_are_bridged_in_place():
    y = np.arange(10.0)
    marked = np.zeros(10, dtype=bool)
    y[[3, 4]], marked[[3, 4]] = 99.0, True
    assert replace_outliers(y, marked) == pytest.approx(np.arange(10.0))
    assert y[3] == 99.0  # the input stays


def test_a_line_is_removed_exactly():
    slope, rest = remove_trend(5.0 - 0.25 * (np.arange(101) - 50.0))
    assert slope == pytest.approx(-0.25)
    assert rest == pytest.approx(5.0)


def test_reverse_arrangements_of_ten_groups():
    # ten ordered group means: A = 0 or 45, mean 22.5, variance 31.25, half a step for continuity
    rising = np.repeat(np.arange(10.0), 50)
    z = (22.5 - 0.5) / np.sqrt(31.25)
    assert reverse_arrangements(rising).statistic == pytest.approx(-z)
    assert reverse_arrangements(-rising).statistic == pytest.approx(z)
    assert reverse_arrangements(rising).p_value < 1e-4


@pytest.mark.parametrize("test", [reverse_arrangements, variance_change])
def test_size_on_stationary_noise(test):
    rng = np.random.default_rng(4)
    rejected = sum(test(rng.standard_normal(4000)).p_value < 0.05 for _ in range(300))
    assert 1 <= rejected <= 33  # 15 expected, sd 3.8: beyond 4.7 sd


def test_detrending_blinds_the_reverse_arrangements_to_a_walk():
    rng = np.random.default_rng(5)
    seen = [0, 0]
    for _ in range(60):
        walk = np.cumsum(rng.standard_normal(2000))
        seen[0] += reverse_arrangements(walk).p_value < 0.05
        seen[1] += reverse_arrangements(remove_trend(walk)[1]).p_value < 0.05
    assert seen[0] > 20
    assert seen[1] <= 3


def test_a_change_of_variance_is_seen():
    y = white(6)
    y[:10_000] *= 1.3
    assert variance_change(y).p_value < 1e-6
    assert variance_change(np.zeros(5000)).p_value == 1.0


def test_unit_root_tests_tell_a_walk_from_white_noise():
    y = white(7)
    adf, kpss = unit_root(y)
    assert adf.p_value < 1e-6
    assert kpss.p_value > 0.01
    adf, kpss = unit_root(np.cumsum(y))
    assert adf.p_value > 0.01
    assert kpss.p_value < 0.05


@pytest.mark.filterwarnings("ignore")
def test_unit_root_tests_are_those_of_statsmodels():
    y = white(8, 700)
    for x in (y, np.cumsum(y), 0.1 * np.cumsum(y) + y[::-1], np.arange(700.0) ** 1.5 + y):
        ours, theirs = dickey_fuller(x, 15), adfuller(x, maxlag=15, autolag=None)
        assert ours == pytest.approx(theirs[:2], rel=1e-9)
        assert steady_level(x, 15) == pytest.approx(kpss(x, nlags=15)[:2], rel=1e-9)


def test_steps_say_what_was_done():
    y = 3.0 + 0.001 * np.arange(20_000) + white(8)
    y[77] += 30.0
    prepared = prepare([y], "deg/s")
    said = " ".join(prepared.steps)
    assert int(re.search(r"outliers: (\d+) of", said)[1]) >= 1
    assert float(re.search(r"mean: (\S+) deg/s removed", said)[1]) == pytest.approx(13.0, abs=0.1)
    rise = float(re.search(r"trend: (\S+) deg/s over the record", said)[1])
    assert rise == pytest.approx(0.001 * len(y), rel=0.01)
    assert np.mean(prepared.pieces[0]) == pytest.approx(0.0, abs=1e-9)
    names = " ".join(test.name for test in stationarity_tests(prepared.pieces[0]))
    for word in ("reverse arrangements", "ADF", "KPSS", "variance"):
        assert word in names


def test_no_sample_of_normal_noise_is_replaced():
    """One interpolated sample of 20 000 left 18 claimed sds in a zero of 0.98: a rule of 4.5 sds takes one in seven."""
    replaced = [
        int(re.search(r"outliers: (\d+) of", prepare([white(seed)]).steps[0])[1]) for seed in range(100, 140)
    ]
    assert sum(replaced) <= 3  # 0.4 expected


def test_stretches_lose_one_line_together():
    """A line of each stretch took what a model of all has at low frequencies: AR(1) of 20 stretches became (2,1)."""
    rng = np.random.default_rng(31)
    pieces = [3.0 + k + 0.01 * np.arange(1000) + rng.standard_normal(1000) for k in range(20)]
    left = prepare(pieces).pieces
    assert all(abs(piece.mean()) < 1e-9 for piece in left)
    slopes = [remove_trend(piece)[0] for piece in left]
    assert np.mean(slopes) == pytest.approx(0.0, abs=1e-12)
    assert np.std(slopes) > 1e-5
