"""Where a drive begins: what the first fix does not tell stays unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.trajectories import TRAJECTORIES
from tuner.commands.check import load_filter
from tuner.drives import simulate_drive
from tuner.drivescores import differences
from tuner.driving import navigate_drive
from tuner.grades import load_gnss, load_grade
from tuner.navigation.initial import align
from tuner.navigation.inputs import Steps

ARM = (1.0, 0.5, -1.2)
GAP = (100.0, 160.0)


@pytest.fixture(scope="module")
def believed():
    return load_filter("stim300", load_gnss("rtk"))


@pytest.fixture(scope="module")
def drive():
    motion = TRAJECTORIES["city"](400.0)
    driven, _ = simulate_drive(
        load_grade("stim300"), motion, load_gnss("rtk"), rate=50.0, seed=4, lever_arm=ARM
    )
    return replace(driven, lever_arm=None)


def _from(drive, begin, end=np.inf):
    inside = (drive.imu_t >= begin) & (drive.imu_t <= end)
    return replace(drive, imu_t=drive.imu_t[inside], rates=drive.rates[inside])


def _without_velocities(drive):
    nothing = np.full_like(drive.gnss.vel_n, np.nan)
    return replace(drive, gnss=replace(drive.gnss, vel_n=nothing, velocity_sd=nothing))


def _nees(drive, solution):
    """Return the mean squares of position and attitude errors against their sds."""
    rows = np.arange(len(solution.t))
    error = differences(drive.reference, solution, rows)
    variance = np.diagonal(solution.covariance, axis1=1, axis2=2)
    squares = error**2 / variance[:, :9]
    return squares[:, :3].mean(), squares[:, 6:].mean()


@pytest.mark.parametrize("begin", [0.0, 60.0, 100.0])
@pytest.mark.parametrize("change", [lambda d: d, _without_velocities], ids=["velocities", "positions"])
def test_an_unknown_lever_arm_is_not_taken_for_zero(drive, believed, begin, change):
    """A start that took the first fix for the inertial unit had position errors of 20 stated sds."""
    moved = change(_from(drive, begin))
    inside = moved.gnss.t > begin
    found = navigate_drive(replace(moved, gnss=moved.gnss.rows(inside)), believed)
    for (value, sd), true in zip(found.estimates["lever_arm"], ARM, strict=True):
        assert abs(value - true) < 5.0 * sd
    position, attitude = _nees(drive, found.solutions[0])
    assert position < 5.0
    assert attitude < 5.0


def test_after_a_gap_the_start_knows_the_clock(drive, believed):
    """The delay that the filter has found since the first alignment moves the start of the next stretch."""
    lost = (drive.imu_t > GAP[0]) & (drive.imu_t < GAP[1])
    broken = replace(drive, imu_t=drive.imu_t[~lost], rates=drive.rates[~lost])
    for solution in navigate_drive(broken, believed).solutions:
        position, attitude = _nees(drive, solution)
        assert position < 5.0
        assert attitude < 5.0


@pytest.mark.parametrize("interval", [1.5, 3.0])
def test_fixes_some_seconds_apart_tell_the_heading(interval):
    """Windows follow the interval of the fixes; error of the heading within 5 of its sds, of 2° at least."""
    receiver = replace(load_gnss("rtk"), interval=interval)
    driven, _ = simulate_drive(
        load_grade("stim300"), TRAJECTORIES["city"](400.0), receiver, rate=50.0, seed=6, lever_arm=ARM
    )
    t = driven.imu_t
    steps = Steps(float(t[0]), np.diff(t), driven.rates[1:] * np.diff(t)[:, None])
    found = align(steps, driven.gnss, offset=0.0)
    heading = rotation.rpy_from_quat(found.quat_nb)[2]
    at = int(np.argmin(np.abs(driven.reference.t - found.t)))
    off = (heading - driven.reference.rpy[at, 2] + np.pi) % (2.0 * np.pi) - np.pi
    assert abs(off) < 5.0 * max(found.heading_sd, np.radians(2.0))
