"""Simulated drives: read as written, effects included, noise unchanged; effects in measured drives."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from models.earth import EARTH_RATE, ned_between
from models.effects.drive import EFFECTS
from models.measurements import perfect_fixes
from models.trajectory.catalogue import city
from models.trajectory.motion import Trajectory, imu_increments
from models.trajectory.profiles import Profile, steps
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run as run_command
from tuner.formats.logs import write_drive
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment import align
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.types.records import DataError

DURATION, RATE = 120.0, 50.0
MOTION = city(DURATION)
RECEIVER = replace(load_gnss("rtk"), correlated=())


def run(*hidden, seed=3, **options):
    return simulate_drive(
        load_grade("stim300"), MOTION, RECEIVER, rate=RATE, seed=seed, effects=hidden, **options
    )


def test_errors_of_unit_and_receiver_have_their_size():
    """6000 samples and 118 fixes: χ² of the white parts within five standard errors (6e-7)."""
    drive, _ = run()
    perfect = np.hstack(imu_increments(MOTION, 1.0 / RATE)) * RATE
    error = drive.rates[1:] - perfect
    grade = load_grade("stim300")
    for first, kind in ((0, "gyro"), (3, "accel")):
        white = np.diff(error[:, first : first + 3], axis=0) / np.sqrt(2.0)
        sd = grade.noise_model(kind).white_density() * np.sqrt(RATE)
        assert np.sqrt(np.mean(white**2)) == pytest.approx(sd, rel=0.05)
    llh, vel = perfect_fixes(MOTION, drive.gnss.t)
    for off, sd in (
        (ned_between(drive.gnss.llh, llh), drive.gnss.position_sd),
        (drive.gnss.vel_n - vel, drive.gnss.velocity_sd),
    ):
        assert np.mean((off / sd) ** 2) == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / off.size))


def test_seed_decides_and_effects_leave_the_noise():
    clean, key = run()
    again, twin = run()
    np.testing.assert_array_equal(clean.rates, again.rates)
    assert key == twin
    scaled, _ = run("gyro_scale:z=1e-3")
    change = scaled.rates - clean.rates
    perfect = np.hstack(imu_increments(MOTION, 1.0 / RATE)) * RATE
    np.testing.assert_allclose(change[1:, 2], 1e-3 * perfect[:, 2], atol=1e-12)
    np.testing.assert_array_equal(scaled.gnss.llh, clean.gnss.llh)


def test_drive_is_read_as_it_was_written(tmp_path):
    drive, _ = run("time_offset:delay=0.05", lever_arm=(0.5, -0.2, -1.0))
    write_drive(drive, tmp_path / "drive.npz")
    read = read_drive(tmp_path / "drive.npz")
    np.testing.assert_array_equal(read.rates, drive.rates)
    np.testing.assert_array_equal(read.imu_t, drive.imu_t)
    np.testing.assert_array_equal(read.gnss.t, drive.gnss.t)
    np.testing.assert_allclose(ned_between(read.gnss.llh, drive.gnss.llh), 0.0, atol=1e-8)
    np.testing.assert_allclose(read.reference.rpy, drive.reference.rpy, atol=1e-14)
    np.testing.assert_allclose(read.mounting, np.eye(3), atol=1e-15)
    assert read.lever_arm == drive.lever_arm
    with pytest.raises(DataError, match=r"ends in \.npz"):
        write_drive(drive, tmp_path / "drive.csv")


def test_every_cause_can_be_drawn_into_a_drive():
    for code in EFFECTS:
        drive, key = run(code)
        assert key["hidden"][0]["cause"] == code
        assert np.isfinite(drive.rates).all()
        json.dumps(key)


def test_command_writes_a_drive_and_its_key(tmp_path, capsys):
    path = tmp_path / "d.npz"
    command = [
        "simulate",
        "stim300",
        "--trajectory",
        "city",
        "--hours",
        "0.03",
        "--rate",
        "50",
        "-o",
        str(path),
    ]
    assert run_command([*command, "--hide", "time_offset:delay=0.05", "--quiet"]) == 0
    key = json.loads((tmp_path / "d.key.json").read_text())
    assert key["hidden"] == [{"cause": "time_offset", "channels": ["drive"], "parameters": {"delay": 0.05}}]
    assert read_drive(path).gnss.t[0] == pytest.approx(1.05)
    for wrong, says in (
        (["--hide", "delay"], "must be one of time_offset"),
        (["--hide", "time_offset:lag=1"], "takes delay=VALUE"),
    ):
        assert run_command([*command, *wrong]) == 2
        assert says in capsys.readouterr().err
    assert run_command(["simulate", "stim300", "--trajectory", "moon"]) == 2
    assert run_command(["simulate", "stim300", "--gnss", "spp"]) == 2


def test_a_stand_still_tells_the_bias_without_the_rate_of_the_earth():
    """Mean over 60 s of a navigation-grade unit: far within a hundredth of the rate of the Earth."""
    level = Profile(steps=steps((60.0, 8.0, 12.0), (80.0, 8.0, -6.0), (95.0, 6.0, 8.0)))
    turn = Profile(0.7, steps=steps((85.0, 6.0, 1.0)))
    motion = Trajectory("start", 130.0, level, turn)
    drive, key = simulate_drive(load_grade("rlg"), motion, RECEIVER, rate=RATE, seed=2)
    t, gnss = drive.imu_t, drive.gnss
    increments = Steps(0.0, np.diff(t), drive.rates[1:] / RATE)
    found = align(increments, gnss, bias_sd=np.repeat([1e-6, 1e-3], 3))
    truth = [key["channels"][f"gyro_{axis}"]["constant"] for axis in "xyz"]
    np.testing.assert_allclose(found.gyro_bias, truth, atol=0.02 * EARTH_RATE)


def test_an_effect_after_the_end_is_refused_with_its_name_once():
    motion = city(60.0)
    with pytest.raises(DataError, match=r"^effect 'bias_jump': expected 'time' within the record"):
        simulate_drive(load_grade("mti1"), motion, load_gnss("rtk"), seed=1, effects=("bias_jump:time=100",))
