"""Units, signs and axes of a recorded drive are named and mended before a filter; a right drive is left alone."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run
from tuner.consistency.score_drive import navigate_drive
from tuner.examination import examined_drive as door
from tuner.examination.examine import examine
from tuner.examination.examined_drive import examined_drive
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.types.records import DataError

FOOT, MILE, KNOT = 0.3048, 1609.344 / 3600.0, 1852.0 / 3600.0
DT = 0.02
GRAVITY = 9.80665


def before_filter(drive):
    """Return what a filter begins without, in words."""
    return [note for note in drive.notes if note.startswith("before the filter: ")]


@pytest.fixture(scope="module")
def right(file):
    return read_drive(file)


UNITS = {
    "Velocities are in km/h": {"gnss_vned": 3.6},
    "Velocities are in knots": {"gnss_vned": 1.0 / KNOT},
    "Velocities are in mph": {"gnss_vned": 1.0 / MILE},
    "Velocities are in ft/s": {"gnss_vned": 1.0 / FOOT},
    "Velocities are in mm/s": {"gnss_vned": 1e3},
    "Fixes are in rad": {"gnss_llh": np.array([np.pi / 180.0, np.pi / 180.0, 1.0])},
    "Gyro is in deg/s": {"gyro": np.degrees(1.0)},
    "Gyro is in rad/s, read as deg/s": {"gyro": np.radians(1.0)},
    "Gyro is in rad in 0.02 s": {"gyro": DT},
    "Gyro is in mrad/s": {"gyro": 1e3},
    "Accelerometer is in g": {"accel": 1.0 / GRAVITY},
    "Accelerometer is in mg": {"accel": 1e3 / GRAVITY},
    "Accelerometer is in m/s gained in 0.02 s": {"accel": DT},
    "Accelerometer is in ft/s²": {"accel": 1.0 / FOOT},
}
QUICK = ("Velocities are in mm/s", "Fixes are in rad", "Gyro is in rad in 0.02 s")


@pytest.mark.parametrize(
    "words", [one if one in QUICK else pytest.param(one, marks=pytest.mark.slow) for one in UNITS]
)
def test_a_unit_is_named_and_mended(saved, data, right, tmp_path, words):
    wrong = {name: values * UNITS[words].get(name, 1.0) for name, values in data.items()}
    mended, found = examined_drive(saved(tmp_path / "wrong.npz", wrong))
    (said,) = before_filter(mended)
    assert words in said
    assert found.before_filter[0] in found.repairs
    np.testing.assert_allclose(mended.rates, right.rates, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(mended.gnss.vel_n, right.gnss.vel_n, rtol=1e-5)
    np.testing.assert_allclose(mended.gnss.llh, right.gnss.llh, rtol=1e-9)


def test_heights_in_feet_are_mended_where_the_vehicle_climbs():
    drive, _ = simulate_drive(
        load_grade("mpu9250"), TRAJECTORIES["climb"](200.0), load_gnss("spp"), rate=25.0, seed=1
    )
    feet = replace(drive, gnss=replace(drive.gnss, llh=drive.gnss.llh / [1.0, 1.0, FOOT]))
    mended, _ = examined_drive(feet)
    assert "have heights in ft" in before_filter(mended)[0]
    np.testing.assert_allclose(mended.gnss.llh, drive.gnss.llh)


@pytest.mark.slow
def test_no_unit_is_taken_twice(saved, data, tmp_path):
    """Heights × 10⁴: feet of feet of feet would be those of a mountain."""
    wrong = dict(data, gnss_llh=data["gnss_llh"] * [1.0, 1.0, 1e4])
    with pytest.raises(DataError, match=r"^wrong\.npz: expected heights in m, got"):
        examined_drive(saved(tmp_path / "wrong.npz", wrong))


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.5, 0.5])
def test_a_factor_that_is_no_unit_is_left_to_the_filter(saved, data, tmp_path, size):
    """A gyroscope of another range, say."""
    mended, _ = examined_drive(saved(tmp_path / "wrong.npz", dict(data, gyro=size * data["gyro"])))
    assert not before_filter(mended)


AXES = {
    "Velocities are east, north, up": ("gnss_vned", [1, 0, 2], [1.0, 1.0, -1.0]),
    "Accelerometer y has the wrong sign": ("accel", [0, 1, 2], [1.0, -1.0, 1.0]),
    "Accelerometer has the sign of gravity": ("accel", [0, 1, 2], [-1.0, -1.0, -1.0]),
    "Gyro has its axes exchanged against the accelerometer": ("gyro", [1, 2, 0], [1.0, 1.0, 1.0]),
    "Fixes have latitude and longitude exchanged": ("gnss_llh", [1, 0, 2], [1.0, 1.0, 1.0]),
}


@pytest.mark.parametrize(
    "words",
    [*(pytest.param(one, marks=pytest.mark.slow) for one in list(AXES)[:-1]), list(AXES)[-1]],
)
def test_axes_are_named_and_mended(saved, data, right, tmp_path, words):
    name, order, sign = AXES[words]
    wrong = dict(data, **{name: data[name][:, order] * sign})
    mended, _ = examined_drive(saved(tmp_path / "wrong.npz", wrong))
    assert words in before_filter(mended)[0]
    np.testing.assert_allclose(mended.gnss.vel_n, right.gnss.vel_n)
    np.testing.assert_allclose(mended.gnss.llh, right.gnss.llh)
    np.testing.assert_allclose(mended.rates, right.rates)


def test_every_command_with_a_filter_begins_without_what_was_found(saved, data, tmp_path, capsys):
    """Gyros in other axes and accelerometers in g: it was refused."""
    wrong = dict(data, gyro=data["gyro"][:, [1, 2, 0]], accel=data["accel"] / GRAVITY)
    path = saved(tmp_path / "wrong.npz", wrong)
    stored, out = tmp_path / "out.json", tmp_path / "kf-gins.yaml"
    commands = {
        "navigate": ["navigate", str(path), "--config", "mpu9250", "--json", str(stored)],
        "diagnose": ["diagnose", str(path), "--config", "mpu9250", "--jobs", "1"],
    }
    for words in commands.values():
        assert run([*words, "--quiet"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "Before the filter: Accelerometer is in g, read as m/s² (certain); mended copy: multip" in said
        assert "Before the filter: Gyro has its axes exchanged against the accelerometer" in said
    assert not json.loads(stored.read_text(encoding="utf-8"))["diverged"]
    export = ["export", "bmi088", "--to", "kf-gins", "--drive", str(path), "-o", str(out)]
    assert run([*export, "--quiet"]) == 0
    assert "before the filter: Gyro has its axes exchanged" in out.read_text(encoding="utf-8")
    force = np.loadtxt(tmp_path / "kf-gins-imu.txt")[5:, 4:].mean(axis=0)
    assert np.linalg.norm(force) == pytest.approx(GRAVITY * DT, rel=0.1)


def test_two_readings_that_are_left_are_refused_with_both(right, monkeypatch):
    both = "gyro z has the wrong sign, or gyro has its axes exchanged"
    undecided = replace(examine(right), undecided=both)
    monkeypatch.setattr(door, "examine", lambda _: undecided)
    with pytest.raises(DataError, match=rf"^drive\.npz: {both}"):
        examined_drive(right)


def test_two_fixes_are_too_few(saved, data, tmp_path, configuration):
    few = {name: values[:2] if name.startswith("gnss") else values for name, values in data.items()}
    drive, found = examined_drive(saved(tmp_path / "few.npz", few))
    assert found is None
    with pytest.raises(DataError, match="no stretch of the drive could be aligned"):
        navigate_drive(drive, configuration())


def test_fixes_on_another_clock_leave_too_few_to_align(saved, data, tmp_path, configuration):
    """Stamps × 100 left two fixes, one at the last sample: an IndexError from inside."""
    few = {name: values[:2] if name.startswith("gnss") else values for name, values in data.items()}
    few["gnss_t"] = data["imu_t"][[len(data["imu_t"]) // 2, -1]]
    drive, _ = examined_drive(saved(tmp_path / "few.npz", few))
    with pytest.raises(
        DataError, match=r"expected 10 fixes or more .* found 1; put the stamps of both on one"
    ):
        navigate_drive(drive, configuration())


def cart(duration):
    """A cart at a walk, 1 m/s, that stops and turns."""
    return Trajectory(
        "cart",
        duration,
        Profile(0.6, waves=(Wave(0.6, 1.0 / 37.0),)),
        Profile(waves=(Wave(1.5, 1.0 / 53.0),)),
        pitch=Profile(waves=(Wave(0.01, 1.0 / 71.0),)),
    )


MOTIONS = {"cart": cart, **{name: TRAJECTORIES[name] for name in ("static", "straight", "city", "climb")}}


RECORDED = [(motion, receiver) for motion in MOTIONS for receiver in ("spp", "rtk")]


@pytest.mark.parametrize(
    ("motion", "receiver"),
    [one if one == ("static", "rtk") else pytest.param(*one, marks=pytest.mark.slow) for one in RECORDED],
)
def test_what_is_right_is_not_touched(motion, receiver):
    gnss = replace(load_gnss(receiver), interval=1.0)
    drive, _ = simulate_drive(load_grade("mpu9250"), MOTIONS[motion](300.0), gnss, rate=25.0, seed=3)
    found, _ = examined_drive(drive)
    assert not before_filter(found)
    np.testing.assert_array_equal(found.rates, drive.rates)
    np.testing.assert_array_equal(found.gnss.llh, drive.gnss.llh)


MEASURED = Path(os.environ.get("TUNER_DATA", "")) / "drives"


@pytest.mark.slow
@pytest.mark.skipif(not os.environ.get("TUNER_DATA"), reason="TUNER_DATA is not set")
@pytest.mark.parametrize(
    "file", ["rtkexplorer_drive_0708", "hipnuc_span_20220405", "stim300_rtk_20180419_sharp"]
)
def test_units_of_measured_drives(file):
    drive = read_drive(MEASURED / f"{file}.npz")
    assert not before_filter(examined_drive(drive)[0])
    for size, name in ((3.6, "km/h"), (1.0 / KNOT, "knots")):
        fast = replace(drive, gnss=replace(drive.gnss, vel_n=size * drive.gnss.vel_n))
        assert f"Velocities are in {name}" in before_filter(examined_drive(fast)[0])[0]
    fast = replace(drive, rates=np.hstack([np.degrees(drive.rates[:, :3]), drive.rates[:, 3:]]))
    assert "Gyro is in deg/s" in before_filter(examined_drive(fast)[0])[0]
