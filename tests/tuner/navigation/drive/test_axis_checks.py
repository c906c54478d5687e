"""Axes of a drive in another order or sign are named, turned or refused; right ones are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.consistency.score_drive import navigate_drive
from tuner.diagnosis.drive import diagnose_drive
from tuner.navigation.drive.axis_checks import inertial_axes, with_axes_found
from tuner.navigation.drive.clock import clock_of_drive
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.types.records import DataError, Gnss

MOUNTING_RPY = (180.0, 3.0, 100.0)


def test_swapped_axes_are_named(saved, data, tmp_path):
    enu = dict(data)
    v = data["gnss_vned"]
    enu["gnss_vned"] = np.column_stack([v[:, 1], v[:, 0], -v[:, 2]])
    drive = read_drive(saved(tmp_path / "enu.npz", enu))
    mended, name = with_axes_found(drive.gnss, drive.source)
    assert name == "east-north-up"
    np.testing.assert_allclose(mended.vel_n, v[: len(mended)], atol=1e-12)
    assert with_axes_found(mended, "a drive")[1] is None


def test_gyros_in_other_axes_are_named(saved, data, tmp_path):
    """Three mirrored ones; exchanged ones are those of `test_diagnosis_refuses_wrong_axes`."""
    wrong = read_drive(saved(tmp_path / "wrong.npz", dict(data, gyro=-data["gyro"])))
    assert "the gyros read as (−x, −y, −z)" in inertial_axes(wrong)


ACCELS_READ = {"(x, −y, z)": (1.0, -1.0, 1.0), "(−x, −y, −z)": (-1.0, -1.0, -1.0)}


@pytest.mark.parametrize("read", ["(x, −y, z)", pytest.param("(−x, −y, −z)", marks=pytest.mark.slow)])
def test_accelerometers_in_other_axes_are_named_when_the_filter_diverges(
    saved, data, tmp_path, configuration, read
):
    wrong = dict(data, accel=data["accel"] * np.array(ACCELS_READ[read]))
    found = navigate_drive(read_drive(saved(tmp_path / "wrong.npz", wrong)), configuration())
    assert found.consistency.diverged
    assert any(f"the accelerometers read as {read}" in note for note in found.notes)


def test_diagnosis_refuses_wrong_axes(saved, data, tmp_path, configuration):
    wrong = read_drive(saved(tmp_path / "wrong.npz", dict(data, gyro=data["gyro"][:, [1, 2, 0]])))
    with pytest.raises(DataError, match=r"gyros read as \(z, x, y\)"):
        diagnose_drive(wrong, configuration())


@pytest.fixture(scope="module")
def hardly_stood():
    return simulate_drive(
        load_grade("mti1"), TRAJECTORIES["city"](300.0), load_gnss("rtk"), rate=50.0, seed=1
    )[0]


@pytest.mark.parametrize(
    "read", ["(x, y, −z)", *(pytest.param(one, marks=pytest.mark.slow) for one in ("(x, y, z)", "(y, x, z)"))]
)
def test_axes_are_named_where_cheap_gyros_hardly_stand(hardly_stood, read):
    """Three seconds of standing leave the biases of the sensors open."""
    names = [word.strip("( )") for word in read.split(",")]
    order, sign = ["xyz".index(name[-1]) for name in names], [-1.0 if "−" in name else 1.0 for name in names]
    wrong = np.hstack([hardly_stood.rates[:, order] * sign, hardly_stood.rates[:, 3:]])
    told = inertial_axes(replace(hardly_stood, rates=wrong))
    assert told is None if read == "(x, y, z)" else f"the gyros read as {read}" in told


def test_a_frame_without_a_name_is_unknown_and_reported(saved, data, tmp_path):
    drive = read_drive(saved(tmp_path / "odd.npz", data, imu_frame="unknown, z up"))
    assert drive.mounting is None
    assert any("'unknown, z up'" in note for note in drive.notes)


def test_axes_as_they_are_are_not_named(file):
    assert inertial_axes(read_drive(file)) is None


def test_two_fixes_tell_nothing_of_the_axes(saved, data, tmp_path, configuration):
    few = {name: values[:2] if name.startswith("gnss") else values for name, values in data.items()}
    drive = read_drive(saved(tmp_path / "few.npz", few))
    assert inertial_axes(drive) is None
    with pytest.raises(DataError, match="no stretch of the drive could be aligned"):
        navigate_drive(drive, configuration())


def test_fixes_on_another_clock_leave_too_few_to_align(saved, data, tmp_path, configuration):
    """Stamps × 100 left two fixes, one at the last sample: an IndexError from inside."""
    few = {name: values[:2] if name.startswith("gnss") else values for name, values in data.items()}
    few["gnss_t"] = data["imu_t"][[len(data["imu_t"]) // 2, -1]]
    drive = read_drive(saved(tmp_path / "few.npz", few))
    assert inertial_axes(drive) is None
    with pytest.raises(
        DataError, match=r"expected 10 fixes or more .* found 1; put the stamps of both on one"
    ):
        navigate_drive(drive, configuration())


def test_exchanged_latitude_and_longitude_are_refused(saved, data, tmp_path):
    wrong = dict(data, gnss_llh=data["gnss_llh"][:, [1, 0, 2]])
    drive = read_drive(saved(tmp_path / "wrong.npz", wrong))
    for refused in (clock_of_drive, inertial_axes):  # it read "drive: expected positions …"
        with pytest.raises(DataError, match=r"^wrong\.npz: .*latitude and longitude exchanged"):
            refused(drive)


def test_a_stated_frame_that_the_motion_contradicts_is_reported(saved, data, tmp_path, configuration):
    """The unit stands on its head in the frame that is said to be forward-right-down."""
    upside = rotation.mat_from_rpy(np.radians((180.0, 0.0, 0.0)))
    turned = rotation.mat_from_rpy(np.radians(MOUNTING_RPY)).T @ upside  # vehicle axes, then on its head
    wrong = dict(data, gyro=data["gyro"] @ turned.T, accel=data["accel"] @ turned.T)
    found = navigate_drive(read_drive(saved(tmp_path / "wrong.npz", wrong, imu_frame="FRD")), configuration())
    assert not found.consistency.diverged
    assert any("from those stated" in note for note in found.notes)


@pytest.mark.parametrize(("climb", "named"), [(0.4, "north-east-up"), (0.0, None)])
def test_an_upward_speed_is_named_on_nearly_flat_ground(climb, named):
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 600.0)
    height = 100.0 + 20.0 * climb * np.sin(t / 20.0) + 0.02 * rng.standard_normal(len(t))
    up = climb * np.cos(t / 20.0) + 0.05 * rng.standard_normal(len(t))
    llh = np.column_stack([0.84 + 15.0 * t / 6.38e6, np.full_like(t, 0.16), height])
    vel = np.column_stack([15.0 + rng.standard_normal(len(t)), rng.standard_normal(len(t)), up])
    sd = np.full_like(llh, 0.05)
    mended, name = with_axes_found(Gnss(t, llh, vel, sd, sd), "a drive")
    assert name == named
    assert with_axes_found(mended, "a drive")[1] is None
