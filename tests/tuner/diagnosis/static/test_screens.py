"""What is computed in a shorter way gives what the long way gives."""

from __future__ import annotations

import numpy as np
import pytest

from models.noise import GaussMarkov, NoiseModel, White
from tuner.diagnosis.static.causes import comb, periodic_variance
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.dct import between_middles
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel
from tuner.diagnosis.static.model.series_statistics import order_statistics, row_medians
from tuner.types.records import Record

N = 40_000


def fitted(y: np.ndarray) -> FittedChannel:
    return fit_channel(
        channel(Record("log", np.arange(len(y)) / 100.0, y[:, None], ("x",), "rad/s", 0.01), "x")
    )


@pytest.mark.parametrize("period", [37.313, 211.77])
def test_the_period_of_short_pulses_is_found_to_a_part_of_a_sample_over_the_record(period):
    y = np.random.default_rng(1).standard_normal(N)
    y[(np.arange(N) + 7.3) % period < 1.0] += 2.0
    result = comb.Comb.test(fitted(y))
    (found,) = result.propose()
    multiple = round(found.period / period)  # a multiple of the period is one, too
    assert abs(found.period / multiple - period) * N / period < 0.5
    assert result.gain > 50.0


def test_weak_short_pulses_are_found_by_many_multiples_of_their_period():
    """One sample in 61 is half an sd higher, 90 nats where period and phase are known; noise alone has no period."""
    y = np.random.default_rng(6).standard_normal(N)
    assert comb.Comb.test(fitted(y)).gain < 0.0
    y[7::61] += 0.524
    result = comb.Comb.test(fitted(y))
    assert result.p_value < 1e-5
    assert result.gain > 10.0
    assert result.propose()[0].period == pytest.approx(61.0, abs=0.02)


@pytest.mark.parametrize("period", [23.7, 31.0, 12.0 + 1e-9, 20.0 - 1e-9, 99.999])
@pytest.mark.parametrize("phase", [0.3, 0.5, 0.0, 0.999999999])
def test_folded_sums_are_those_of_the_phases(period, phase):
    e, number = np.random.default_rng(2).standard_normal(1000), int(period)
    total, count = comb._sums(e[100:], 100.0 + phase, period, number)
    place = comb.Comb(period, (0.0,) * number, phase)._bins(1000)[100:]
    np.testing.assert_allclose(total, np.bincount(place, e[100:], number), atol=1e-12)
    np.testing.assert_array_equal(count, np.bincount(place, minlength=number))


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize(
    "values", [np.arange(7.0), np.tan(np.arange(300.0)), np.ones(9), np.arange(60.0) % 4]
)
def test_numbers_by_rank_are_those_of_a_sorted_series(kind, values):
    x = values.astype(kind)
    ranks = np.array([0, len(x) // 3, len(x) // 2, len(x) // 2, len(x) - 1])
    np.testing.assert_array_equal(order_statistics(x, ranks), np.sort(x)[ranks])
    assert row_medians(x.reshape(1, -1))[0] == np.median(x)


def test_the_score_of_a_further_process_foretells_what_it_gains():
    rng = np.random.default_rng(3)
    one = fitted(NoiseModel([White(0.1), GaussMarkov(0.3, 1.5), GaussMarkov(0.1, 30.0)]).sample(N, 0.01, rng))
    for fit in one.fits:
        more = one.track.fit((*fit.kinds, GaussMarkov))
        gained = 2.0 * (more.log_likelihood - fit.log_likelihood)
        foretold = one.track.square_score_of_markov(fit)
        assert foretold == pytest.approx(gained, abs=3.0) or 0.3 < foretold / gained < 1.5
    assert max(one.track.square_score_of_markov(fit) for fit in one.fits) > 20.0


def test_levels_are_those_of_linear_interpolation():
    values = np.random.default_rng(4).standard_normal(7)
    for width in (6, 5):
        middle = (np.arange(7) + 0.5) * width
        expected = np.interp(np.arange(7 * width + 3), middle, values)
        np.testing.assert_allclose(between_middles(values, width, 7 * width + 3), expected, atol=1e-14)


def test_a_wave_by_sums_of_blocks_is_the_whole_wave():
    """… within what the turn of 0.6 cycles a record leaves of 4000 blocks: π 0.6/4000/√3 of its sd √n."""
    x, f = np.random.default_rng(5).standard_normal(12_000), 0.031
    for shift in (0.0, 0.6 / 12_000):
        whole = x @ np.exp(-2j * np.pi * (f + shift) * np.arange(12_000))
        assert abs(periodic_variance._wave(x, f + shift, f, 3) - whole) < 3.0 * 2.7e-4 * np.sqrt(12_000)
