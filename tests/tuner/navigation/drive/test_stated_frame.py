"""A stated frame of the unit: unknown names are reported, and those that the motion contradicts."""

from __future__ import annotations

import numpy as np

from models import rotation
from tuner.consistency.score_drive import navigate_drive
from tuner.readers.drive import read_drive

MOUNTING_RPY = (180.0, 3.0, 100.0)


def test_a_frame_without_a_name_is_unknown_and_reported(saved, data, tmp_path):
    drive = read_drive(saved(tmp_path / "odd.npz", data, imu_frame="unknown, z up"))
    assert drive.mounting is None
    assert any("'unknown, z up'" in note for note in drive.notes)


def test_a_stated_frame_that_the_motion_contradicts_is_reported(saved, data, tmp_path, configuration):
    """The unit stands on its head in the frame that is said to be forward-right-down."""
    upside = rotation.mat_from_rpy(np.radians((180.0, 0.0, 0.0)))
    turned = rotation.mat_from_rpy(np.radians(MOUNTING_RPY)).T @ upside  # vehicle axes, then on its head
    wrong = dict(data, gyro=data["gyro"] @ turned.T, accel=data["accel"] @ turned.T)
    found = navigate_drive(read_drive(saved(tmp_path / "wrong.npz", wrong, imu_frame="FRD")), configuration())
    assert not found.consistency.diverged
    assert any("from those stated" in note for note in found.notes)
