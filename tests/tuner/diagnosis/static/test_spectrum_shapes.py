"""Filters, resonances and rounding in the spectrum: found, and not found in white noise.

Seeds are fixed and are the first that were tried.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from models.effects.static.spectral import Vibration
from tests.cramer_rao import butterworth_gain, spectral_bound
from tuner.diagnosis import diagnose
from tuner.diagnosis.data_quality.repeated_samples import find_repeated_samples
from tuner.diagnosis.static.causes import vibration
from tuner.diagnosis.static.causes.burst import Burst
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.hypothesis_tests import threshold
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel
from tuner.diagnosis.static.search import search_causes
from tuner.diagnosis.static.spectrum.binned import bins, sized
from tuner.diagnosis.static.spectrum.filters import (
    COLOURS,
    FILTERS,
    arma_power,
    colour_arma,
    filter_arma,
    filter_power,
    is_mean,
)
from tuner.diagnosis.static.spectrum.shape import few_shapes, many_shapes
from tuner.segments.quantizer import quantizer_step
from tuner.types import Coefficient
from tuner.types.records import Record

RATE, N = 100.0, 120_000
CYCLES = (np.arange(128) + 0.5) / 256.0


def record(y: np.ndarray) -> Record:
    return Record("gyro", np.arange(len(y)) / RATE, 1e-3 * y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE)


def fitted(y: np.ndarray) -> FittedChannel:
    return fit_channel(channel(record(y), "gyro_x"))


def filtered(order: int, cutoff: float, rng: np.random.Generator, times: int = 8) -> np.ndarray:
    """Noise filtered at many times the rate, then sampled."""
    fine = rng.standard_normal(times * (N + 64))
    y = sosfilt(butter(order, cutoff, fs=times * RATE, output="sos"), fine)[64 * times :: times]
    return y / y.std()


@pytest.mark.parametrize(
    ("order", "cutoff", "resonance"), [(2, 18.0, 22.0), (2, 15.0, 12.0), (2, 20.0, 20.0)]
)
def test_a_filter_and_a_resonance_beside_its_corner_have_their_own_frequencies(order, cutoff, resonance):
    """Seen: 15 Hz beside one at 12 Hz were 5.72 Hz, 20 Hz beside one at 20 Hz 16.3 Hz; it was 3 to 8 times as wide."""
    rng = np.random.default_rng(1)
    r, angle = np.exp(-np.pi * resonance / 6.0 / RATE), 2.0 * np.pi * resonance / RATE
    shaken = lfilter([1.0], [1.0, -2.0 * r * np.cos(angle), r * r], rng.standard_normal(N + 1000))[1000:]
    y = filtered(order, cutoff, rng) + 0.35 / shaken.std() * shaken
    found = search_causes(channel(record(y), "gyro_x"), threshold(1)).accepted
    low, peak = (
        next(one.extension.values for one in found if one.extension.cause == cause)
        for cause in ("lowpass", "vibration")
    )
    assert low["cutoff"].value == pytest.approx(cutoff, rel=0.05)
    assert peak["frequency"].value == pytest.approx(resonance, rel=0.01)
    assert peak["quality"].value == pytest.approx(6.0, rel=0.25)


@pytest.mark.parametrize("name", FILTERS)
def test_recursion_has_the_power_of_its_filter(name):
    for cutoff in (0.01, 0.1, 0.4):
        if is_mean(name) and not FILTERS[name][0] < cutoff < FILTERS[name][1]:
            continue
        ar, ma = filter_arma(name, cutoff)
        power = arma_power(ar, ma, CYCLES) * ((1.0 - sum(ar)) / (1.0 + sum(ma))) ** 2
        np.testing.assert_allclose(power, filter_power(name, cutoff, CYCLES), rtol=2e-3, atol=2e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_oversampled_filter_tends_to_the_sampled_analogue_one(order):
    """Correlation of an analogue Butterworth filter of white noise at lag k, in closed form."""
    cutoff = 0.1
    ar, ma = filter_arma("pole1" if order == 1 else "sampled2x16", cutoff)
    impulse = lfilter([1.0, *ma], [1.0, *(-a for a in ar)], np.eye(1, 400)[0])
    found = [float(impulse[k:] @ impulse[: 400 - k]) for k in range(6)]
    a = 2.0 * np.pi * cutoff * np.arange(6) / (1.0 if order == 1 else np.sqrt(2.0))
    truth = np.exp(-a) * (1.0 if order == 1 else np.cos(a) + np.sin(a))
    np.testing.assert_allclose(np.array(found) / found[0], truth, atol=2e-3)


@pytest.mark.parametrize("name", COLOURS)
def test_colours_are_stationary_and_invertible(name):
    rng = np.random.default_rng(5)
    for _ in range(50):
        ar, ma = colour_arma(name, rng.uniform(-2.0, 2.0, sum(COLOURS[name][:2])))
        assert np.all(np.abs(np.roots([1.0, *(-a for a in ar)])) < 1.0)
        assert np.all(np.abs(np.roots([1.0, *ma])) < 1.0)


def test_sizes_are_the_best_of_their_likelihood():
    data = bins(fitted(np.random.default_rng(1).standard_normal(N)))
    shapes = np.stack((np.ones_like(data.cycles), data.cycles))
    best = sized(data, shapes)
    for step in (0.99, 1.01):
        other = np.asarray(best.size * [step, 1.0]) @ shapes
        ratio = data.power / other
        assert 0.5 * data.count @ (ratio - 1.0 - np.log(ratio)) > best.cost


def check_cutoff(found: Coefficient, order: int, cutoff: float, rounding: float = 0.0) -> None:
    """Five Cramér–Rao sds from the truth at most, 2 % for what folds back besides, and no surer than the bound.

    `rounding` is the square of the quantizer's step, in variances of the noise.
    """
    floor = rounding / 12.0 / RATE
    level = 1.0 / (
        2.0
        * np.mean(butterworth_gain(np.linspace(0.0, RATE / 2.0, 5001), cutoff, order, 1.0 / RATE))
        * RATE
        / 2.0
    )
    sd = spectral_bound(
        lambda f, power, at: power * butterworth_gain(f, at, order, 1.0 / RATE) + floor,
        (level, cutoff),
        N,
        1.0 / RATE,
    )[1]
    low, high = found.interval
    assert abs(np.log(found.value / cutoff)) < 5.0 * sd + 0.02
    assert np.log(high / low) > 2.0 * 1.96 * sd


@pytest.mark.parametrize(("order", "cutoff"), [(1, 5.0), (2, 30.0)])
def test_filter_is_named_alone_and_its_cutoff_covered(order, cutoff):
    y = filtered(order, cutoff, np.random.default_rng([order, int(cutoff)]))
    found = diagnose(record(y)).findings
    assert [f.cause for f in found] == ["lowpass"]
    check_cutoff(found[0].parameters["cutoff"], order, cutoff)


def test_rounding_after_the_filter_does_not_move_the_cutoff():
    y = filtered(1, 8.0, np.random.default_rng(9))
    found = diagnose(record(0.5 * np.round(2.0 * y))).findings
    assert [f.cause for f in found] == ["lowpass"]
    check_cutoff(found[0].parameters["cutoff"], 1, 8.0, rounding=0.25)


def test_wide_and_narrow_resonances_are_found():
    """Resonances of 40 … 60 nats at both ends of the range of qualities: the chance to miss one is below 1e-4."""
    for frequency, quality, sd in ((11.4, 24.0, 0.12), (30.0, 90.0, 0.11), (8.0, 8.0, 0.15)):
        rng = np.random.default_rng(int(frequency))
        y = rng.standard_normal(N) + Vibration(frequency, quality, sd).signal(N, 1.0 / RATE, rng)
        found = fitted(y)
        result = vibration.test(found, many_shapes(few_shapes(found)))
        assert result.p_value < threshold(6)
        assert result.gain > 0.0
        assert result.propose is not None
        assert result.propose()[0].values["frequency"].value == pytest.approx(frequency, rel=0.05)


def test_a_resonance_far_above_the_noise_is_nothing_else():
    """Three white sds; before, its sd was told 3.6 times too large, and a misfit was left."""
    rng = np.random.default_rng(9)
    shaken = Vibration(24.9, 29.8, 3.0).signal(N // 4, 1.0 / RATE, rng)
    found = diagnose(record(shaken + rng.standard_normal(N // 4)))
    assert [f.cause for f in found.findings] == ["vibration"]
    assert not found.unexplained
    assert found.findings[0].parameters["sd"].value == pytest.approx(3e-3, rel=0.1)


def test_burst_of_five_per_cent_of_a_record_is_found():
    rng = np.random.default_rng(4)
    y = rng.standard_normal(360_000)
    y[100_000:118_000] *= np.sqrt(1.12)
    result = Burst.test(fitted(y))
    assert result.p_value < threshold(6)
    assert result.gain > 0.0


def test_white_noise_has_no_resonance_and_no_burst():
    """Forty records: the chance of a p-value below 1e-4 among them is 1 %, of one below 1e-6 1e-4."""
    for seed in range(20):
        found = fitted(np.random.default_rng([seed, 3]).standard_normal(20_000))
        assert vibration.test(found, many_shapes(few_shapes(found))).p_value > 1e-6
        assert Burst.test(found).p_value > 1e-6


def test_repeated_samples_on_a_fine_quantizer_do_not_depend_on_the_colour():
    """A filtered sensor with 0.5 % repeated readings, and without: 10 sd apart."""
    rng = np.random.default_rng(2)
    codes = np.round(8.0 * filtered(1, 25.0, rng))
    assert find_repeated_samples([codes[:, None]], [1.0]).p_value > 1e-4
    repeated = rng.random(N) < 0.01
    place = np.maximum.accumulate(np.where(repeated, 0, np.arange(N)))
    test = find_repeated_samples([codes[place][:, None]], [1.0])
    assert test.p_value < 1e-6
    # Chance alone makes neighbours equal with g = 1/(16 √π) on a step of an eighth of a sd, more after a filter.
    assert test.fraction == pytest.approx(repeated.mean(), abs=6.0 * np.sqrt(0.15 / N))


def test_bandwidth_of_a_filter_is_that_of_its_order():
    """π/2 cutoff for one pole; flat noise says only that the bandwidth is half the rate or more."""
    rng = np.random.default_rng(6)
    (note,) = diagnose(record(filtered(1, 10.0, rng))).notes
    width = float(note.partition("noise bandwidth ")[2].partition(" Hz")[0])
    assert width == pytest.approx(5.0 * np.pi, rel=0.05)
    (note,) = diagnose(record(rng.standard_normal(20_000))).notes
    assert "50 Hz or more, rate ÷ bandwidth 2 or less" in note


def test_digits_of_arithmetic_are_no_quantizer():
    codes = np.round(5.0 * np.random.default_rng(0).standard_normal(100_001))
    between = np.interp(np.arange(100_000) + 0.3, np.arange(100_001), codes)
    assert quantizer_step([between]) == 0.0
    assert quantizer_step([1.234e-4 * codes]) == pytest.approx(1.234e-4)


def test_filter_is_named_beside_a_resonance_and_repeated_samples():
    """On a lattice where a tenth of the neighbours are equal by chance, the excess alone is bridged."""
    rng = np.random.default_rng(1)
    y = lfilter([1.0], [1.0, -np.exp(-2.0 * np.pi * 0.2)], rng.standard_normal(N + 200))[200:]
    first, second = Vibration(31.0, 20.0, 1.0).recursion(1.0 / RATE)
    hum = lfilter([1.0], [1.0, -first, -second], rng.standard_normal(N + 5000))[5000:]
    y = y / y.std() + 0.25 * hum / hum.std()
    fresh = np.where(rng.random(N) < 0.02, 0, np.arange(N))
    y = (0.25 * np.round(y / 0.25))[np.maximum.accumulate(fresh)]
    found = diagnose(record(y))
    assert {f.cause for f in found.findings} == {"duplicates", "lowpass", "vibration"}
    assert not found.unexplained


@pytest.mark.parametrize(
    ("ma", "ar", "rises"),
    [
        (-0.83, 0.0, True),
        (0.0, -0.1, False),
        pytest.param(0.0, -0.5, True, marks=pytest.mark.slow),
        (0.0, -0.9, True),
    ],
)
def test_noise_that_rises_towards_half_the_rate_is_no_sign_of_folding(ma, ar, rises):
    """Differences, as quantization and an AR of negative coefficient make them: no bandwidth shows."""
    y = lfilter([1.0, ma], [1.0, -ar], np.random.default_rng(7).standard_normal(40_001))[1:]
    notes = " ".join(diagnose(record(y)).notes)
    assert "are folded" not in notes
    assert ("rises towards half the rate" in notes) is rises
