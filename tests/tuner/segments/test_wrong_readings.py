"""Wrong readings: told from every law of noise of finite variance, and left out of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.tuner.segments.test_error_codes import record
from tuner.diagnosis import diagnose
from tuner.identification import identify
from tuner.pipeline import identified_again
from tuner.segments.conditions import at_rest
from tuner.segments.wrong_readings import find_wrong_readings
from tuner.synthesis.findings import left_out
from tuner.types import Diagnosis

COUNT = 100_000
STEP = 0.25


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(COUNT)


def rows(seed: int, share: float) -> np.ndarray:
    return np.random.default_rng(seed).random(COUNT) < share


@pytest.mark.parametrize("share", [2e-3, 2e-2])
@pytest.mark.parametrize("size", [20.0, 300.0])
@pytest.mark.parametrize("one_sided", [False, True])
def test_single_samples_far_off_are_found_and_the_noise_is_that_without(share, size, one_sided):
    y, wrong = noise(1), rows(2, share)
    signs = 1.0 if one_sided else np.random.default_rng(3).choice([-1.0, 1.0], COUNT)
    y[wrong] += (signs * size)[wrong] if np.ndim(signs) else size
    log = record(np.round(y / STEP)[:, None] * STEP)
    (found,) = find_wrong_readings(log)
    assert np.mean(found.rows[wrong]) > 0.99  # but for several side by side
    assert not found.rows[~wrong].any()
    (still,) = at_rest((log,))
    assert np.std(still.y) == pytest.approx(np.std(noise(1)), rel=0.01)


@pytest.mark.parametrize(
    "y",
    [
        noise(1),
        np.cumsum(noise(2)),
        np.round(0.2 * noise(3)),
        np.random.default_rng(4).standard_t(2.5, COUNT),
        np.where(rows(5, 0.2), 3.0, 1.0) * noise(5),
        np.where(np.arange(COUNT) % 5000 < 1000, 20.0, 1.0) * noise(6),
        np.repeat(noise(7)[: COUNT // 10], 10),
        np.convolve(noise(8), np.ones(10) / 10, "same"),
        np.exp(noise(9)),
        noise(10) + np.where(np.arange(COUNT) % 3000 < 5, 30.0, 0.0),
        np.mod(noise(11) + 17.5, 20.0),
        0.02 * noise(1) + np.cumsum(np.where(rows(5, 2e-4), 1.0, 0.0) * noise(6)),
    ],
    ids=[
        "white",
        "walk",
        "codes",
        "t",
        "widths",
        "swells",
        "held",
        "filtered",
        "skewed",
        "bumps",
        "overflow",
        "steps",
    ],
)
def test_noise_bursts_bumps_and_what_a_register_wraps_are_no_wrong_readings(y):
    assert find_wrong_readings(record(y[:, None])) == ()


def test_samples_too_far_apart_to_tell_a_movement_are_not_judged():
    y, wrong = noise(1), rows(2, 1e-3)
    y[wrong] += 50.0
    log = record(y[:, None])
    slow = type(log)("gyro", np.arange(COUNT) * 1.0, log.y, log.axes, log.unit, 1.0)
    assert find_wrong_readings(log)
    assert find_wrong_readings(slow) == ()


def test_few_that_are_left_of_many_are_judged_with_these():
    """PX4 issue 19134 at a coarse gyroscope: of wrong bytes, all of one size, the reader took most."""
    y = np.round(noise(1))
    y[[30_000, 60_000]] += 100.0
    log = record(y[:, None])
    assert not find_wrong_readings(log)
    (found,) = find_wrong_readings(replace(log, broken={log.axes[0]: (130, 100.0)}))
    assert np.flatnonzero(found.rows).tolist() == [30_000, 60_000]


def test_single_readings_that_are_named_are_no_noise():
    """A single one is no proof against heavy tails; where the noise that is left has none, it is named and left out."""
    y = noise(1)[:12_000]
    y[4_000] += 150.0
    log = record(y[:, None])
    assert not find_wrong_readings(log)
    found = identify((log,))
    diagnosis = diagnose(log, identification=found)
    assert {one.cause for one in diagnosis.findings} == {"spikes"}
    assert left_out(diagnosis.findings)
    (still,), _ = identified_again((log,), found, diagnosis, terms=None, latitude=None)
    assert np.flatnonzero(still.y[:, 0] != y).tolist() == [4_000]


def test_a_step_that_is_named_is_no_random_walk():
    """rosflight_firmware issue 166: the bias is set to zero while the log runs."""
    y = 0.01 * noise(1)
    y[COUNT // 3 :] += 1.0
    log = record(y[:, None])
    found = identify((log,))
    diagnosis = diagnose(log, identification=found)
    assert {one.cause for one in diagnosis.findings} == {"step"}
    _, again = identified_again((log,), found, diagnosis, terms=None, latitude=None)
    (axis,) = log.axes
    assert found.channels[axis].model.allan_variance(np.array([100.0]))[0] > 1e-2
    assert again.channels[axis].model.allan_variance(np.array([100.0]))[0] < 1e-6


def test_several_steps_of_an_axis_are_noise():
    """A bias that jumps every two minutes: without its steps the random walk would be a third of what it is."""
    jumps = np.where(np.random.default_rng(5).random(COUNT) < 1e-4, 1.0, 0.0) * noise(6)
    log = record((0.02 * noise(1) + np.cumsum(jumps))[:, None])
    found = identify((log,))
    steps = [replace(one, cause="step") for one in diagnose(log, identification=found).findings[:1]] * 2
    assert left_out(steps[:1]) == steps[:1]
    assert left_out(steps) == []
    (same,), again = identified_again((log,), found, Diagnosis(tuple(steps)), terms=None, latitude=None)
    assert same is log
    assert again is found


def pulses(width: int) -> np.ndarray:
    return np.convolve(rows(7, 2e-4), 60.0 * np.hanning(width + 2)[1:-1], "same")


def test_readings_that_a_filter_spread_over_some_samples_are_found():
    """Full-scale readings behind a low-pass: their samples were motion in parts, and noise in the rest."""
    still = np.stack([noise(1), noise(2), noise(3)], axis=1)
    (found,) = find_wrong_readings(record(still + pulses(7)[:, None] * [0.0, 0.0, 1.0]))
    assert found.axis.endswith("z")
    assert np.mean(found.rows[pulses(7) > 8.0]) > 0.95
    assert np.mean(found.rows) < 25.0 * 2e-4  # twelve or sixteen samples each


@pytest.mark.parametrize(
    ("filtered", "rate"),
    [(([1.0], [1.0, 0.4, 0.35]), 200.0), (([1.0], [1.0, -0.75]), 1000.0)],
    ids=["rings", "decays"],
)
def test_what_a_filter_rings_and_decays_belongs_to_a_wrong_reading(filtered, rate):
    """Rows beside the pulses stayed: N was 2.3 times, or "the sensor moved in 44 %"."""
    struck = np.where(rows(12, 3e-4), 2000.0, 0.0)
    still = np.stack([noise(1), noise(2), noise(3)], axis=1)
    y = still + lfilter(*filtered, struck)[:, None] * [0.0, 1.0, 0.0]
    fast = replace(record(y), t=np.arange(COUNT) / rate, interval=1.0 / rate)
    (found,) = find_wrong_readings(fast)
    assert np.abs(y[~found.rows, 1]).max() < 10.0
    assert found.rows.mean() < 0.06


def test_what_two_axes_show_for_some_samples_is_motion():
    still = np.stack([noise(1), noise(2), noise(3)], axis=1)
    assert find_wrong_readings(record(still + pulses(7)[:, None] * [0.0, 0.3, 1.0])) == ()


def test_a_register_that_overflows_beside_others_has_no_wrong_readings():
    still = np.stack([noise(1), noise(2), np.mod(noise(11) + 17.5, 20.0)], axis=1)
    assert find_wrong_readings(record(still)) == ()


def test_three_readings_far_beyond_all_others_are_wrong_ones():
    """Of one octave three say nothing, of eight empty ones that each noise would fill they do: (4^−8)^3."""
    y = noise(1)
    y[[20_000, 50_000, 80_000]] += [3000.0, -3000.0, 3000.0]
    (found,) = find_wrong_readings(record(y[:, None]))
    assert list(np.flatnonzero(found.rows)) == [20_000, 50_000, 80_000]


@pytest.mark.parametrize("count", [1, 3, 12, 300])
def test_short_logs_have_none(count):
    assert find_wrong_readings(record(np.stack([noise(s)[:count] for s in (1, 2, 3)], axis=1))) == ()
