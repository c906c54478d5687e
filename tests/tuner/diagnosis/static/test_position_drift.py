"""Drifts that remain are compared at the cluster time of the samples."""

from __future__ import annotations

import numpy as np
import pytest

from models.noise import NoiseModel
from models.noise.arma import Arma
from tuner.diagnosis import diagnose
from tuner.diagnosis.static.position_drift import left_drifts
from tuner.types.records import Record


def test_a_step_in_a_log_of_three_minutes_makes_drift() -> None:
    """No duration of a minute fits four times: a step of 0.6 deg/s changed "noise and drift by less than 5 %"."""
    t = 0.01 * np.arange(16_000)
    y = np.random.default_rng(7).normal(0.0, 1e-3, (16_000, 1)) + np.where(t > 21.0, 0.01, 0.0)[:, None]
    record = Record(name="gyro", t=t, y=y, axes=("gyro_x",), unit="rad/s", interval=0.01)
    (step,) = diagnose([record]).findings
    before, after = step.drift["10 s"]
    assert before > 2.0 * after


@pytest.mark.parametrize("interval", [1.28, 0.0100003, 0.0123])
def test_a_model_of_samples_is_compared_where_no_duration_is_a_multiple_of_them(interval: float) -> None:
    noise = Arma((0.5,), (), 1e-6, interval)
    count = int(1200.0 / interval)
    y = noise.sample(count, interval, np.random.default_rng(5))[:, None]
    record = Record(
        name="gyro", t=interval * np.arange(count), y=y, axes=("gyro_x",), unit="rad/s", interval=interval
    )
    drifts = left_drifts([], [record], {"gyro_x": NoiseModel((noise,))})["gyro_x"]
    measured, modelled = next(iter(drifts.values()))
    assert measured == pytest.approx(modelled, rel=0.3)


def test_a_model_of_samples_without_repeats_is_compared_at_its_own_interval() -> None:
    """Two of three readings repeat the last: the model is of those kept, three times as far apart."""
    noise = Arma((0.5,), (), 1e-6, 0.03)
    y = np.repeat(noise.sample(40_000, 0.03, np.random.default_rng(6)), 3)[:, None]
    record = Record(
        name="gyro", t=0.01 * np.arange(120_000), y=y, axes=("gyro_x",), unit="rad/s", interval=0.01
    )
    measured, modelled = next(
        iter(left_drifts([], [record], {"gyro_x": NoiseModel((noise,))})["gyro_x"].values())
    )
    assert measured == pytest.approx(modelled, rel=0.3)
