"""Wrong units of a drive are refused with their name; right ones are left alone."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.earth import llh_displaced
from models.measurements import perfect_fixes
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run
from tuner.navigation.drive.axis_checks import with_axes_found
from tuner.navigation.drive.gross_outliers import without_gross_outliers
from tuner.navigation.drive.mean_velocities import mean_velocities
from tuner.navigation.drive.unit_checks import (
    height_factor,
    refuse_wrong_units,
    suspected_unit,
    unit_factor,
    velocity_factor,
)
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.types.records import DataError, Gnss

FOOT, MILE, KNOT = 0.3048, 1609.344 / 3600.0, 1852.0 / 3600.0
DT = 0.02
TURNS = {"deg/s": np.degrees(1.0), "rad/s taken for deg/s": np.radians(1.0), "rad in 0.02 s": DT}


def refused(path, capsys):
    """Return the one line with which `navigate` refuses a file."""
    assert run(["navigate", str(path), "--config", "mpu9250", "--quiet"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gnss_vned": 3.6}, "velocities look to be in km/h: 3.60 (3.5"),
        ({"gnss_vned": 1.0 / KNOT}, "velocities look to be in knots: 1.94 ("),
        ({"gnss_vned": 1.0 / MILE}, "velocities look to be in mph: 2.2"),
        ({"gnss_vned": 1.0 / FOOT}, "velocities look to be in ft/s: 3.2"),
        ({"gnss_llh": np.array([1.0, 1.0, 1.0 / FOOT])}, "heights look to be in ft"),
        ({"gnss_llh": np.array([np.pi / 180.0, np.pi / 180.0, 1.0])}, "longitude look to be in rad"),
        *(({"gyro": size}, f"gyros look to be in {name}: ") for name, size in TURNS.items()),
        ({"gyro": 1e3}, "check the unit"),
        ({"accel": 1.0 / 9.80665}, "to be in g: convert it to m/s²"),
        ({"accel": 1e3 / 9.80665}, "to be in mg: convert"),
        ({"accel": DT}, "to be in m/s gained in 0.02 s: convert"),
        ({"accel": 1.0 / FOOT}, "to be in ft/s²: convert"),
    ],
)
def test_a_unit_is_named(saved, data, tmp_path, capsys, change, words):
    wrong = {name: values * change.get(name, 1.0) for name, values in data.items()}
    assert words in refused(saved(tmp_path / "wrong.npz", wrong), capsys)


@pytest.mark.slow
def test_a_unit_is_named_in_another_order_of_axes(saved, data, tmp_path, capsys):
    v = 3.6 * data["gnss_vned"]
    wrong = {**data, "gnss_vned": np.column_stack([v[:, 1], v[:, 0], -v[:, 2]])}
    assert "in km/h" in refused(saved(tmp_path / "wrong.npz", wrong), capsys)


@pytest.mark.parametrize("size", [1.5, 0.5])
def test_a_weak_factor_without_a_cause_is_reported_as_uncertain_only(saved, data, tmp_path, size):
    """A gyroscope of another range, say: it is for the filter to try."""
    drive = read_drive(saved(tmp_path / "wrong.npz", {**data, "gyro": size * data["gyro"]}))
    (doubt,) = refuse_wrong_units(drive, drive.gnss)
    assert "gyros are" in doubt
    assert "check their unit" in doubt


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


@pytest.mark.parametrize("interval", [1.0, 0.1])
@pytest.mark.parametrize("motion", MOTIONS)
def test_what_is_right_is_not_touched(motion, interval):
    """Chance 1e-5 a slope, six slopes a drive, and they are 1.25 from 1 besides: less than 1e-4 each."""
    receivers = [load_gnss(name) for name in ("spp", "rtk")]
    for seed, receiver in enumerate(receivers):
        drive, _ = simulate_drive(
            load_grade("mpu9250"),
            MOTIONS[motion](300.0),
            replace(receiver, interval=interval),
            rate=25.0,
            seed=seed,
        )
        assert with_axes_found(drive.gnss, drive.source)[1] is None
        assert refuse_wrong_units(drive, drive.gnss) == ()


@pytest.mark.slow
@pytest.mark.parametrize("motion", MOTIONS)
def test_what_is_right_is_seldom_far_from_1(motion):
    """Hundreds of receivers: no factor is another one."""
    rng, flown = np.random.default_rng(1), MOTIONS[motion](240.0)
    for _ in range(300):
        interval = float(rng.choice([0.1, 0.2, 1.0]))
        sds = np.concatenate(
            [10.0 ** rng.uniform(-2.0, 0.7) * np.array([1.0, 1.0, 1.8]), 10.0 ** rng.uniform(-2.0, 0.0, 3)]
        )
        t = np.arange(interval, 240.0, interval)
        llh, vel = perfect_fixes(flown, t)
        error = rng.standard_t(4, (len(t), 6)) * sds
        gnss = Gnss(
            t,
            llh_displaced(llh, error[:, :3]),
            vel + error[:, 3:],
            *np.tile(sds, (len(t), 1)).reshape(len(t), 2, 3).swapaxes(0, 1),
        )
        told = mean_velocities(gnss)
        for found in (velocity_factor(told), height_factor(told)):
            assert found is None or not found.other


def test_a_factor_lies_between_its_regressions():
    """Noise in either series pulls one regression: the truth, 3.6, is between them whatever the noise."""
    rng = np.random.default_rng(3)
    t = np.arange(600.0)
    signal = np.cumsum(rng.standard_normal((600, 2)), axis=0)
    for noise in ((0.0, 3.0), (3.0, 0.0), (3.0, 3.0)):
        a = 3.6 * (signal + noise[0] * rng.standard_normal(signal.shape))
        b = signal + noise[1] * rng.standard_normal(signal.shape)
        found = unit_factor(a, b, t, 10.0)
        assert found is not None
        assert found.other
        assert found.interval[0] < 3.6 < found.interval[1]
        assert found.low <= found.high


@pytest.mark.parametrize("motion", ["straight", "circle"])
def test_a_mean_that_is_no_bias_is_reported_where_a_filter_fails(motion):
    drive, _ = simulate_drive(
        load_grade("mpu9250"), TRAJECTORIES[motion](120.0), load_gnss("rtk"), rate=25.0, seed=1
    )
    assert suspected_unit(drive, drive.gnss) is None
    fast = np.hstack([np.degrees(drive.rates[:, :3] + 0.02), drive.rates[:, 3:]])
    assert "more than any bias of theirs" in suspected_unit(replace(drive, rates=fast), drive.gnss)


def test_a_receiver_at_rest_is_not_tested():
    """Its positions may follow a tenth of what its velocities say."""
    drive, _ = simulate_drive(
        load_grade("mpu9250"), TRAJECTORIES["static"](300.0), load_gnss("rtk"), rate=25.0, seed=1
    )
    wander = 0.02 * np.cumsum(np.random.default_rng(2).standard_normal((len(drive.gnss), 3)), axis=0)
    vel = np.gradient(wander, drive.gnss.t, axis=0)
    gnss = replace(drive.gnss, llh=llh_displaced(drive.gnss.llh[:1], 0.1 * wander), vel_n=vel)
    assert velocity_factor(mean_velocities(gnss)).other
    assert refuse_wrong_units(drive, gnss) == ()


def test_noise_has_no_factor():
    """Whatever the sizes: a good gyroscope that does not turn beside a course that is noise.

    Their slopes are some sds from 0 at most, and above `ALIKE` with a chance of 1e-5 only were they there on average.
    """
    rng = np.random.default_rng(4)
    t = np.arange(600.0)
    for size in (1e-4, 1e-2, 1.0, 1e2, 1e4):
        for _ in range(200):
            a, b = rng.standard_normal((2, 600, 1))
            found = unit_factor(size * a, b, t, 10.0)
            assert found is None or not found.other


def test_legs_leave_holes_out():
    t = np.concatenate([np.arange(0.0, 60.0), np.arange(66.0, 120.0)])
    llh = np.column_stack([0.8 + 1e-6 * t, np.full_like(t, 0.1), np.full_like(t, 100.0)])
    vel = np.tile([1e-6 * 6.37e6, 0.0, 0.0], (len(t), 1))
    told = mean_velocities(Gnss(t, llh, vel, vel, vel))
    assert not np.any((told.t > 50.0) & (told.t < 60.0))
    np.testing.assert_allclose(told.by_position[:, 0], vel[0, 0], rtol=0.01)
    np.testing.assert_allclose(told.by_velocity[:, 0], vel[0, 0], rtol=1e-12)


MEASURED = Path(os.environ.get("TUNER_DATA", "")) / "drives"


@pytest.mark.skipif(not os.environ.get("TUNER_DATA"), reason="TUNER_DATA is not set")
@pytest.mark.parametrize(
    "file", ["rtkexplorer_drive_0708", "hipnuc_span_20220405", "stim300_rtk_20180419_sharp"]
)
def test_units_of_measured_drives(file):
    drive = read_drive(MEASURED / f"{file}.npz")
    drive = replace(drive, gnss=without_gross_outliers(drive.gnss)[0])
    assert refuse_wrong_units(drive, drive.gnss) == ()
    for size, name in ((3.6, "km/h"), (1.0 / KNOT, "knots"), (1.0 / MILE, "mph"), (1.0 / FOOT, "ft/s")):
        with pytest.raises(DataError, match=f"velocities look to be in .*{name}"):
            refuse_wrong_units(drive, replace(drive.gnss, vel_n=size * drive.gnss.vel_n))
    fast = replace(drive, rates=np.hstack([np.degrees(drive.rates[:, :3]), drive.rates[:, 3:]]))
    assert suspected_unit(drive, drive.gnss) is None
    assert "gyros look to be in deg/s" in suspected_unit(fast, drive.gnss)
