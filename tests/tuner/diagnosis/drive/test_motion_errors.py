"""Errors that follow the motion are found beside what is named, and take the place of no cause that is true."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.correlation_left import correlation_left
from tuner.diagnosis.drive.hypothesis import with_density_factors
from tuner.diagnosis.drive.motion_courses import Motion
from tuner.diagnosis.drive.motion_errors import (
    Fit,
    Innovations,
    bias_columns,
    errors_in,
    ports,
    with_named_noise,
)
from tuner.linear_run.likelihood import NoiseHypothesis, as_configured
from tuner.linear_run.whitened_innovations import whiten
from tuner.synthesis.load_config import load_config
from tuner.types import Parameter

DELAY = Parameter("time_offset", "delay")


def looked_at(linearized, *beside, more=0.0, hurdle=0.0):
    """Return the innovations of a run, with columns beside; `more` of the first is put back."""
    noise = as_configured(linearized)
    w = whiten(noise)
    columns = w.slope[:, list(beside)]
    put_back = columns[:, 0] * more if beside else 0.0
    return Innovations(noise, w.residual + put_back, columns[:, :0] if more else columns, hurdle)


@pytest.fixture(scope="module")
def source(short_drive):
    return Source.of(as_configured(short_drive))


def test_every_error_has_columns_for_states_and_for_all_rows_of_a_fix(short_drive):
    """An attitude that jumps had three of six rows: compiled code read beyond the end of the array."""
    k, n = short_drive.transition.shape[:2]
    for port in ports(short_drive, [float(short_drive.t[k // 2])]):
        push, shift = port.columns
        assert push.shape[:2] == (k, n)
        assert shift.shape == (k, 6, push.shape[2])


def test_nothing_is_found_in_clean_innovations(source):
    """A log Bayes factor of 5 in 100 directions, paid for: less than 1 of 100 drives."""
    for seed in range(2):
        clean = source.draw(np.random.default_rng(seed))
        assert errors_in({"": looked_at(clean)})[""].evidence < 5.0


def test_vibration_that_shifts_accelerometers_is_found_in_what_it_grows_with(source, short_drive):
    motion = Motion.of(short_drive)
    speed = np.linalg.norm(motion.velocity, axis=1)
    push = bias_columns(short_drive)[:, :, 3] * (0.03 * (speed / speed.max()) ** 2)[:, None]
    at = short_drive.parameters.index(DELAY)
    pushed = replace(short_drive, B=short_drive.B.copy(), D=short_drive.D.copy())
    pushed.B[:, :, at], pushed.D[:, :, at] = push, 0.0
    drawn = Source.of(as_configured(pushed)).draw(
        np.random.default_rng(4), np.array([1.0, *np.zeros(len(short_drive.parameters) - 1)])
    )
    drawn = replace(drawn, B=short_drive.B, D=short_drive.D)
    found = errors_in({"": looked_at(drawn)})[""]
    assert found.evidence > 10.0
    assert found.text.startswith("an error of the accelerometers that grows with")
    assert "speed" in found.grows_with


def test_a_delay_that_is_true_is_not_replaced(source, short_drive):
    """0.2 s are some hundred nats, which have to be beaten; nothing else follows the velocity better."""
    at = short_drive.parameters.index(DELAY)
    drawn = source.draw(np.random.default_rng(5))
    alone = looked_at(drawn, at, more=0.2)
    slope = whiten(alone.noise).slope[:, at]
    nats = 0.5 * (slope @ alone.residual) ** 2 / (slope @ slope) - 10.0
    assert errors_in({"time_offset": replace(alone, hurdle=nats)})["time_offset"].evidence < 0.0


def test_correlation_is_found_in_the_row_that_has_it_and_not_by_chance(source):
    """p values below 1/20 come in 1 of 20 clean runs: at most 12 of 100 but for 1 of 1000 such tests."""
    rng = np.random.default_rng(6)
    clean = [correlation_left(as_configured(source.draw(rng))).p_value for _ in range(100)]
    assert sum(p < 0.05 for p in clean) <= 12
    drawn = source.draw(rng)
    wander, decay = np.zeros(len(drawn)), 0.8
    for i in range(1, len(wander)):
        wander[i] = decay * wander[i - 1] + np.sqrt(1.0 - decay**2) * rng.standard_normal()
    moved = drawn.innovation + np.outer(wander, [0.0, 0.0, 0.0, 0.0, 0.0, 0.4])
    left = correlation_left(as_configured(replace(drawn, innovation=moved)))
    assert left.p_value < 1e-4
    assert left.evidence > 5.0
    assert "velocities down" in left.text or "heights" in left.text


def test_an_attitude_that_jumps_and_a_bias_that_settles_are_found_as_what_they_are(source, short_drive):
    """Neither is a jump of a bias, which is all that the catalogue has for them."""
    motion, unit = Motion.of(short_drive), bias_columns(short_drive)
    i = len(short_drive) // 2
    turned = np.zeros_like(unit[:, :, 0])
    turned[i, 6:8] = 0.01
    warming = (
        unit[:, :, [0, 3]]
        @ np.array([5e-4, 0.04])
        * (1.0 - np.exp(-(motion.t - motion.t[0]) / 100.0))[:, None]
    )
    for push, expected in ((turned, "an attitude that jumps"), (warming, "settles within")):
        at = short_drive.parameters.index(DELAY)
        pushed = replace(short_drive, B=short_drive.B.copy(), D=short_drive.D.copy())
        pushed.B[:, :, at], pushed.D[:, :, at] = push, 0.0
        drawn = Source.of(as_configured(pushed)).draw(
            np.random.default_rng(8), np.eye(len(short_drive.parameters))[at]
        )
        drawn = replace(drawn, B=short_drive.B, D=short_drive.D)
        found = errors_in({"": looked_at(drawn)}, [float(motion.t[i])])[""]
        assert found.evidence > 10.0
        assert expected in found.text


def test_noise_that_no_finding_states_does_not_judge_causes():
    """A search widened the drift of biases 30 times: what replaces a jump is judged by the drift that is stated."""
    stated = load_config("mpu9250")
    wide = with_density_factors(
        stated, {"gyro_white": 1.0, "accel_white": 1.0, "gyro_bias": 30.0, "accel_bias": 1.0}
    )
    runs = [SimpleNamespace(hypothesis=SimpleNamespace(config=config)) for config in (stated, wide)]
    outcome = SimpleNamespace(accepted=(), base=runs[0], final=runs[1])
    noise = NoiseHypothesis(None, np.ones((1, 6)), np.ones(4), np.ones((1, 6), dtype=bool))
    assert with_named_noise(outcome, noise).process_noise_scale == pytest.approx([1.0, 1.0, 1.0 / 30.0, 1.0])
    outcome.accepted = (SimpleNamespace(cause="imu_noise_scale"),)
    assert with_named_noise(outcome, noise) is noise


def test_two_fits_are_compared_by_one_scatter():
    """A true delay leaves sums that scatter 1.6 times as much by chance: twelve cosines of a delay explain no more."""
    constant, waves = Fit(503.0, 1, 1.6), Fit(479.0, 12, 1.0)
    assert waves.evidence(waves.colour) > constant.evidence(constant.colour)
    assert waves.evidence_above(constant) < -10.0
