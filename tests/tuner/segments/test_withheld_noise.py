"""Noise that a program withheld or took out is not read; what sensors and quantizers do to theirs is no such thing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from tests.tuner.segments.test_error_codes import record
from tuner.segments.conditions import at_rest
from tuner.segments.withheld_noise import dead_zone, high_pass, left_by_rails
from tuner.types.records import DataError

COUNT = 90_000
FLICKER = ([1.0], [1.0, -0.98])


def noise(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(COUNT)


def test_rates_that_a_fusion_gives_as_zero_are_refused():
    """BNO055_SensorAPI issue 12: 99 % are zero, and none lies between zero and 0.25 deg/s."""
    y = 0.0973 * noise()
    y[np.abs(y) < 0.25] = 0.0
    y = np.round(16.0 * y) / 16.0
    assert dead_zone(y) == 0.25
    with pytest.raises(
        DataError, match=r"accel x read 0 where they are smaller than .* a dead zone, .*fusion"
    ):
        at_rest((record(y[:, None]),))


def test_a_dead_zone_of_two_codes_is_one():
    """97 % zeros beside codes ±2 and more, printed to three digits: it read as N 0.44 times."""
    y = np.round(16.0 * 0.0583 * noise()) / 16.0
    y[np.abs(y) < 0.1] = 0.0
    assert dead_zone(np.round(y, 3)) == pytest.approx(0.125)


def test_readings_that_are_held_until_they_change_are_refused():
    """Each axis by itself, by 1.9 sd; they were rows that repeat, and N 1.7 times."""
    y = np.round(noise() / 0.35) * 0.35
    for i in range(1, COUNT):
        y[i] = y[i] if abs(y[i] - y[i - 1]) > 1.9 else y[i - 1]
    with pytest.raises(DataError, match=r"accel x stay at a reading until it changes .* \(hysteresis\)"):
        at_rest((record(y[:, None]),))


def test_noise_that_ends_at_a_rail_is_refused_where_it_misleads():
    """An accelerometer of 0.5 m/s² at 1 g, up to 9.9 m/s²: its white noise was told 1.56 times too small."""
    y = np.minimum(9.81 + 0.5 * noise(), 9.9)
    assert np.std(y) == pytest.approx(0.5 * left_by_rails(y), rel=0.02)
    with pytest.raises(DataError, match=r"accel x lie at the end of their range .* 1\.5 times weaker"):
        at_rest((record(y[:, None]),))
    cut = np.minimum(noise(), 1.0)  # a sixth of the samples: 0.83
    assert left_by_rails(cut) == pytest.approx(np.std(cut), rel=0.02)
    (said,) = at_rest((record(cut[:, None]),))[0].contradicted
    assert said == "accel x, cut off at the end of the range: noise seems 1.2 times weaker than it is"
    for step in (0.3, 1.0, 3.0):
        assert left_by_rails(step * np.round((noise() + 0.3) / step)) == 1.0


@pytest.mark.parametrize(
    "y",
    [
        np.round(noise()),
        np.round(0.2 * noise()),
        0.1 * np.round(noise()) + 0.0 * noise(),
        np.diff((0.000488 * np.round(0.7 * noise() + 1.0 / 0.000488)).astype(np.float32).astype(float)),
        np.where(np.arange(COUNT) < COUNT // 2, 0.0, 5.0 + noise()),
        np.where(np.random.default_rng(2).random(COUNT) < 0.4, 0.0, noise()),
        np.zeros(COUNT),
    ],
    ids=["codes", "coarse", "single precision", "step", "off at first", "lost rows", "off"],
)
def test_zeros_of_a_quantizer_and_of_lost_samples_are_no_dead_zone(y):
    assert dead_zone(y) == 0.0


@pytest.mark.parametrize("gain", [0.03, 0.02])
def test_a_bias_that_is_learnt_and_subtracted_is_a_high_pass(gain):
    """RTIMULib issue 1: gain 0.01 a sample."""
    y = noise() + 1e-3 * np.cumsum(noise(2))
    learnt = y - lfilter([gain], [1.0, gain - 1.0], y)
    assert high_pass([y], 0.01) == 1.0
    assert high_pass([learnt], 0.01) > 2.0
    if gain == 0.02:
        with pytest.raises(DataError, match=r"a high-pass, as where a program learns the bias"):
            at_rest((record(learnt[:, None]),))


@pytest.mark.parametrize(
    "y",
    [
        noise(),
        np.cumsum(noise()),
        noise() + 0.3 * lfilter(*FLICKER, noise(2)),
        np.convolve(noise(), np.ones(8) / 8.0, "same"),
        noise() + np.diff(3.0 * noise(2), prepend=0.0),
        np.repeat(noise()[: COUNT // 10], 10),
        np.round(0.3 * noise()),
        noise() + 3.0 * np.sin(2.0 * np.pi * 0.21 * np.arange(COUNT)),
        lfilter([1.0], [1.0, 0.5, 0.8], noise()),
        np.random.default_rng(4).standard_t(3.0, COUNT),
    ],
    ids=["white", "walk", "flicker", "filtered", "angles", "held", "codes", "line", "resonance", "tails"],
)
def test_what_sensors_do_to_their_noise_is_no_high_pass(y):
    assert high_pass([y], 0.01) == 1.0


def test_a_high_pass_shows_in_all_frequencies_below_it_together():
    """A second learnt in eight minutes: no single octave below has enough ordinates."""
    y, gain = noise()[:48_000], 0.01
    assert high_pass([y - lfilter([gain], [1.0, gain - 1.0], y)], 0.01) > 4.0


def test_a_slow_high_pass_shows_in_all_axes_together():
    """Of 8 s, in a log of 15 minutes: no axis alone is sure, and N was "rough" and the walk 5 times too small."""
    gain = 0.01 / 8.0
    axes = [y - lfilter([gain], [1.0, gain - 1.0], y) for y in map(noise, (1, 2, 3))]
    assert high_pass(axes[:1], 0.01) == 1.0
    assert high_pass(axes, 0.01) > 2.0
    assert high_pass([noise(seed) for seed in (4, 5, 6)], 0.01) == 1.0


def test_a_high_pass_shows_in_long_logs_as_well():
    """Chances that underflow to 0 were ties, of which the widest band, least affected, was kept."""
    y = np.random.default_rng(1).standard_normal(1_440_000)
    sos = butter(1, 0.3, "high", fs=100.0, output="sos")
    assert high_pass([sosfilt(sos, y)], 0.01) > 100.0
