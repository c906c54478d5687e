"""A note says that the stamps of a drive scatter when it is read; the diagnosis names no scale factor for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.diagnosis.drive import diagnose_drive
from tuner.formats.logs import write_drive
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config

SCATTER = 2e-3
"""Sd of the stamps about an even clock, s: a tenth of the interval, as of a computer that is busy."""


def test_scattered_stamps_are_told_and_no_scale_factor_is(tmp_path):
    receiver = load_gnss("rtk")
    drive = simulate_drive(
        load_grade("mpu9250"), TRAJECTORIES["city"](240.0), receiver, rate=50.0, seed=6, effects=()
    )[0]
    rng = np.random.default_rng(1)
    stamps = drive.imu_t + SCATTER * rng.standard_normal(len(drive.imu_t))
    write_drive(replace(drive, imu_t=np.sort(stamps)), tmp_path / "drive.npz")
    found = diagnose_drive(read_drive(tmp_path / "drive.npz"), load_config("mpu9250", gnss=receiver))
    assert "scatter by 2" in found.notes[0]
    assert "taken out" in found.notes[0]
    assert not {one.cause for one in found.findings} & {"gyro_scale", "accel_scale", "time_offset"}
