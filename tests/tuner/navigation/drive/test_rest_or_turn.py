"""The mean of the gyros before the motion: a bias, or a turn on the spot that fixes do not show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, steps
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment import align
from tuner.navigation.drive.run import prepare
from tuner.navigation.settings import filter_settings
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config

RATE, REST = 50.0, 40.0


@pytest.fixture(scope="module")
def drive():
    """A vehicle that stands for 40 s, then speeds up, brakes and turns."""
    level = Profile(steps=steps((REST, 8.0, 12.0), (60.0, 8.0, -6.0), (75.0, 6.0, 8.0), (95.0, 5.0, -9.0)))
    turn = Profile(0.7, steps=steps((65.0, 6.0, 1.0), (90.0, 6.0, -1.5)))
    receiver = replace(load_gnss("rtk"), correlated=())
    return simulate_drive(
        load_grade("stim300"), Trajectory("start", 130.0, level, turn), receiver, rate=RATE, seed=2
    )[0]


def aligned(drive, added, prior):
    """Return the alignment of a drive with rates added, (n, 3), and its heading error."""
    rates = drive.rates.copy()
    rates[:, :3] += added
    found = align(
        Steps(0.0, np.diff(drive.imu_t), rates[1:] / RATE), drive.gnss, bias_sd=np.repeat([prior, 0.02], 3)
    )
    off = rotation.rpy_from_quat(found.quat_nb)[2] - np.interp(
        found.t, drive.reference.t, drive.reference.rpy[:, 2]
    )
    return found, off


def test_a_bias_beyond_its_prior_is_found_whole(drive):
    """A mean of 40 s was pulled towards a prior of 1e-5 rad/s: 25 % short, 11 of its sds."""
    bias = np.array([2e-3, -1e-3, 2e-3])
    found, off = aligned(drive, bias, 1e-5)
    clean, _ = aligned(drive, 0.0, 1e-3)
    assert np.abs(found.gyro_bias - clean.gyro_bias - bias).max() < 3e-5
    assert abs(off) < 4.0 * max(found.heading_sd, np.radians(0.3))


def test_no_note_gives_a_second_sd_of_the_heading(drive):
    """A filter begins with twice the sd of the alignment: an answer had both, and those of two runs."""
    _, notes = prepare(drive, filter_settings(load_config("stim300", gnss=load_gnss("rtk"))))
    assert any("attitude at" in note for note in notes)
    assert not any("sd of the heading" in note for note in notes)


def test_a_steady_turn_on_the_spot_is_no_bias(drive):
    """A turn by 3 deg/s over all of the stand was a bias, and the heading tens of degrees off."""
    standing = drive.imu_t < REST - 2.0
    added = np.zeros((len(drive.imu_t), 3))
    added[standing, 2] = 0.05
    found, off = aligned(drive, added, 1e-3)
    turned = 0.05 * (REST - 2.0 - found.t)
    assert np.abs(found.gyro_bias).max() < 2e-3
    assert abs((off + turned + np.pi) % (2.0 * np.pi) - np.pi) < 4.0 * max(found.heading_sd, np.radians(0.5))
    assert np.isinf(found.gyro_bias_sd).all()
