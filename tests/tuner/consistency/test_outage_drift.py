"""Predicted drift without fixes: its growth, what wheels and receivers do, and the noise that just keeps a limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tuner.catalogue.grades import load_gnss
from tuner.consistency.choose_grade import choose, scaled
from tuner.consistency.compare_sensors import compare
from tuner.consistency.outage_drift import HORIZONS, outage_drift
from tuner.synthesis.load_config import load_config
from tuner.types.records import DataError


@pytest.fixture(scope="module")
def config():
    return load_config("stim300", gnss="rtk")


def test_drift_grows_with_time_and_wheels_hold_it_back(config):
    found = outage_drift(config)
    free, wheels = ([getattr(found, kind)[h] for h in HORIZONS] for kind in ("free", "wheels"))
    assert free == sorted(free)
    assert wheels == sorted(wheels)
    assert all(w < f for w, f in zip(wheels, free, strict=True))
    worse = outage_drift(replace(config, gnss=load_gnss("spp")))
    assert all(worse.free[h] > found.free[h] for h in HORIZONS)


def test_drift_of_white_acceleration_is_that_of_its_double_integral(config):
    """Two horizontal axes of N√(h³/3) each; a start known to centimetres by RTK adds less than 15 % after 60 s."""
    density, horizon = 0.01, 60.0
    quiet = scaled(config, 1e-3)
    noisy = {
        axis: replace(noise, white_density=density) if axis.startswith("accel") else noise
        for axis, noise in quiet.channels.items()
    }
    found = outage_drift(replace(quiet, channels=noisy), (horizon,)).free[horizon]
    expected = density * np.sqrt(2.0 * horizon**3 / 3.0)
    assert expected < found < 1.15 * expected


def test_the_noise_that_would_just_do_just_keeps_the_limit():
    found = choose(30.0, 2.0, gnss="rtk")
    assert [one.error for one in found.ranking] == sorted(one.error for one in found.ranking)
    assert found.nearest.name == found.kept[-1]
    assert found.factor is not None
    receiver = load_gnss("rtk")
    just = outage_drift(replace(scaled(found.nearest.config, found.factor), gnss=receiver), (30.0,)).free[
        30.0
    ]
    assert 0.95 * 2.0 < just <= 2.0


def test_measured_noise_is_held_against_what_is_stated():
    found = compare("icm20602", "mpu9250")
    assert found.limits == ()
    quiet, noisy = found.drift
    assert quiet.free[300.0] < noisy.free[300.0]


@pytest.mark.parametrize("wrong", [{"outage": 400.0}, {"error": 0.0}, {"gnss": "nosuch"}])
def test_what_cannot_be_chosen_is_refused(wrong):
    with pytest.raises(DataError):
        choose(**wrong)
