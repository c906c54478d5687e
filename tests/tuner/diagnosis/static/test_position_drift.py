"""Drifts that remain are compared at the cluster time of the samples."""

from __future__ import annotations

import numpy as np
import pytest

from models.noise import NoiseModel
from models.noise.arma import Arma
from tuner.diagnosis.static.position_drift import left_drifts
from tuner.types.records import Record


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
