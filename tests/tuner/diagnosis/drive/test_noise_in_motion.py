"""A drive begins with the white noise of its samples in motion where that makes its fixes likelier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.diagnosis.drive.candidates import Trial
from tuner.diagnosis.drive.noise_in_motion import with_noise_in_motion
from tuner.examination.examine import examine
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config
from tuner.types import Enlargement

RECEIVER = load_gnss("rtk")
SHAKEN = (0.1, 1.0)
"""Sds of samples that a phone in a car has in motion, rad/s, m/s²: a hundred times those at rest."""


@pytest.fixture(scope="module")
def quiet():
    return simulate_drive(load_grade("adis16465"), TRAJECTORIES["city"](400.0), RECEIVER, rate=50.0, seed=4)[
        0
    ]


@pytest.fixture(scope="module")
def shaken(quiet):
    rng = np.random.default_rng(9)
    speed = np.interp(quiet.imu_t, quiet.gnss.t, np.linalg.norm(quiet.gnss.vel_n, axis=1))
    sd = np.repeat(SHAKEN, 3) * (speed > 0.5)[:, None]
    return replace(quiet, rates=quiet.rates + sd * rng.standard_normal(quiet.rates.shape))


def test_a_shaken_unit_begins_with_the_noise_in_motion(shaken):
    """σ of white samples at 50 Hz is σ √dt as a density: 0.0141 rad/s/√Hz, 0.141 m/s²/√Hz; all on record."""
    stated = load_config("adis16465", gnss=RECEIVER)
    begun = with_noise_in_motion(shaken, stated, examine(shaken))
    for axis, channel in begun.channels.items():
        expected = SHAKEN[axis.startswith("accel")] * np.sqrt(0.02)
        assert channel.white_density == pytest.approx(expected, rel=0.1)
    records = [
        one for one in begun.inflations if isinstance(one, Enlargement) and one.causes == ("vibration",)
    ]
    assert {one.quantity.owner for one in records} == set(begun.channels)
    trial = Trial(shaken, 0.0, 240.0, 400.0)
    assert trial.candidate("stated", stated, {}) is None  # it refuses more than half of the fixes
    assert max(trial.candidate("begun", begun, {}).first.innovations) < 1.3


def test_a_unit_as_quiet_as_stated_stays_so(quiet):
    stated = load_config("adis16465", gnss=RECEIVER)
    assert with_noise_in_motion(quiet, stated, examine(quiet)) is stated


def test_without_an_examination_nothing_changes(shaken):
    stated = load_config("adis16465", gnss=RECEIVER)
    assert with_noise_in_motion(shaken, stated, None) is stated
