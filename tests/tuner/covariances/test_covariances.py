"""White and lasting errors of streams, and what robot_localization is given for them."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from models import rotation
from models.earth import ned_between
from models.trajectory.catalogue import city
from tests import robot_localization as robot
from tests.tuner.covariances.recordings import Errors, recording
from tests.tuner.readers.messages.writers import write_bag
from tuner.cli import run
from tuner.covariances.proposal import covariances_of, key_of
from tuner.covariances.robot_localization_form import DENSITIES, FILTER_STEP, Settings, course_of, predicted
from tuner.covariances.streams import StreamErrors, stream_errors
from tuner.formats.logs import write_drive
from tuner.readers.drive import read_drive
from tuner.synthesis.from_drive import config_for_drive
from tuner.types import Coefficient

FIXES, WHEELS = Errors(0.4, 0.8, 12.0), Errors(0.05, 0.05, 12.0)


def known(value, unit):
    return Coefficient.known(value, value, value, unit)


def stream(name, part, errors, interval, unit="m"):
    sizes = (known(x, unit) for x in (errors.white, errors.lasting))
    return StreamErrors(name, part, None, *sizes, known(errors.time, "s"), known(errors.size, unit), interval)


def test_intervals_hold_the_truth_and_what_is_declared_does_not_matter():
    found = {}
    for declared in ("right", "three times"):
        drive, _ = recording(12, declared=declared, velocities=True, fixes=FIXES, wheels=WHEELS)
        errors, _ = stream_errors(drive, config_for_drive(drive, "icm20602"), drive)
        found[declared] = {key_of(one): one for one in errors}
    for name, errors in (("fixes horizontal", FIXES), ("wheels forward", WHEELS)):
        one = found["right"][name]
        low, high = np.log(one.size.interval)
        assert abs(np.log(one.size.value / errors.size)) < 4.0 * (high - low) / 3.92  # one draw: four sds
        assert one.declared == pytest.approx(errors.size)
        three = found["three times"][name]
        assert three.declared == pytest.approx(3.0 * errors.size)
        assert three.size.value == pytest.approx(one.size.value, rel=0.2)
    assert found["right"]["gyro"].time is None


@pytest.fixture(scope="module")
def town():
    """A course of a town, known exactly, and settings for it."""
    motion, t = city(120.0), np.arange(1.0, 119.0)
    at = motion.evaluate(t)
    state = SimpleNamespace(vel_n=at.vel_n, quat_nb=rotation.quat_from_mat(at.mat_nb))
    drive, _ = recording(3, duration=120.0, fixes=FIXES, wheels=WHEELS)
    course = course_of(drive, SimpleNamespace(solutions=[SimpleNamespace(t=t, state=state)]))
    sds = {"fixes horizontal": 1.5, "fixes vertical": 1.5, "wheels forward": 0.1, "wheels across": 0.1}
    roots = dict(zip(DENSITIES, (0.2, 0.02, 0.02, 0.1, 0.3), strict=True))
    return drive, motion, course, Settings({**sds, "gyro": 0.004}, roots)


def test_what_is_predicted_is_what_the_filter_itself_predicts(town):
    _, motion, course, settings = town
    streams = {
        "fixes horizontal": stream("fixes", "horizontal", FIXES, 1.0),
        "fixes vertical": stream("fixes", "vertical", FIXES, 1.0),
        "wheels forward": stream("wheels", "forward", WHEELS, 0.1, "m/s"),
        "wheels across": stream("wheels", "across", WHEELS, 0.1, "m/s"),
        "gyro": stream("gyro", "", Errors(0.001, 0.002, 1e9), 0.1, "rad/s"),
    }
    with_fixes, after_ten = predicted(course, streams, [settings])[0][:2]
    t = 1.0 + FILTER_STEP * np.arange(len(course.change))
    at = motion.evaluate(t)
    start = np.zeros((1, 15))
    start[:, robot.ANGLES] = at.rpy[:1]
    body = np.einsum("nji,nj->ni", at.mat_nb, at.vel_n)
    place = np.where((np.arange(len(t)) % 10 == 0)[:, None], ned_between(at.llh, at.llh[0]), np.nan)
    readings = {"rate": at.omega_ib_b[None], "speed": body[None], "place": place[None]}
    variances = {"rate": np.full(3, 0.004**2), "speed": np.full(3, 0.01), "place": np.full(3, 1.5**2)}
    _, p = robot.filtered(start, readings, settings.process_noise, variances, FILTER_STEP)
    ours = np.sqrt(np.diagonal(with_fixes.covariance[-20:, :3, :3], axis1=1, axis2=2).mean(axis=0))
    theirs = np.sqrt(np.diagonal(p[0, -200:, :3, :3], axis1=1, axis2=2)[::10].mean(axis=0))
    assert ours == pytest.approx(theirs, rel=0.1)
    assert after_ten.rms > with_fixes.rms


def test_errors_that_last_make_a_filter_without_their_states_optimistic(town):
    _, _, course, settings = town

    def ratio(fixes):
        parts = {f"fixes {part}": stream("fixes", part, fixes, 1.0) for part in ("horizontal", "vertical")}
        parts["gyro"] = stream("gyro", "", Errors(0.001, 1e-6, 1e9), 0.1, "rad/s")
        wheels = Errors(0.05, 1e-6, 1.0)
        parts |= {
            f"wheels {part}": stream("wheels", part, wheels, 0.1, "m/s") for part in ("forward", "across")
        }
        own = {name: fixes.size if name.startswith("fixes") else 0.05 for name in parts}
        one = predicted(course, parts, [replace(settings, sds={**own, "gyro": 0.004})])[0][0]
        return float(np.sqrt(np.mean(one.squares(slice(0, 3))) / 3.0))

    assert ratio(Errors(0.1, 1.0, 60.0)) > 1.5 * ratio(Errors(np.hypot(0.1, 1.0), 1e-6, 60.0))


def test_wheels_are_read_from_an_npz_a_folder_and_a_bag(tmp_path):
    drive, _ = recording(1, duration=60.0)
    write_drive(drive, tmp_path / "drive.npz")
    assert read_drive(tmp_path / "drive.npz").wheels.v == pytest.approx(drive.wheels.v)
    folder = tmp_path / "drive"
    folder.mkdir()
    gnss, wheels = drive.gnss, drive.wheels
    llh = np.column_stack([np.degrees(gnss.llh[:, :2]), gnss.llh[:, 2]])
    for name, head, rows in (
        ("imu", "t,gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2]",
         np.column_stack([drive.imu_t, drive.rates])),
        ("gnss", "t,lat,lon,height", np.column_stack([gnss.t, llh])),
        ("wheels", "t,vx,vy,vz,sd_vx", np.column_stack([wheels.t, wheels.v, wheels.sd[:, 0]])),
    ):  # fmt: skip
        np.savetxt(folder / f"{name}.csv", rows, "%.12g", ",", header=head, comments="")
    assert read_drive(folder).wheels.v == pytest.approx(wheels.v, abs=1e-9)
    assert read_drive(folder).wheels.sd[:, 0] == pytest.approx(wheels.sd[:, 0])
    imu, still = drive.rates * [1, -1, -1, 1, -1, -1], np.zeros((6, 6))
    topics = {
        "/imu": (
            "sensor_msgs/msg/Imu",
            [(round(1e9 * t), {"gyro": x[:3], "accel": x[3:]}) for t, x in zip(drive.imu_t, imu, strict=True)],
        ),
        "/fix": (
            "sensor_msgs/msg/NavSatFix",
            [(round(1e9 * t), {"llh": x, "sd_enu": (1, 1, 1)}) for t, x in zip(gnss.t, llh, strict=True)],
        ),
        "/odom": (
            "nav_msgs/msg/Odometry",
            [
                (round(1e9 * t), {"place": (0, 0, 0), "quat": (1, 0, 0, 0), "covariance": still,
                                  "velocity": v * [1, -1, -1], "velocity_covariance": 0.04 * np.eye(3)})
                for t, v in zip(wheels.t, wheels.v, strict=True)
            ],
        ),
    }  # fmt: skip
    write_bag(tmp_path / "run", topics, kind="ros2")
    found = read_drive(tmp_path / "run")
    assert found.wheels.v == pytest.approx(wheels.v)
    assert found.wheels.sd == pytest.approx(0.2)
    assert found.mounting == pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=1e-12)


def test_the_command_writes_what_robot_localization_reads(tmp_path, capsys):
    drive, _ = recording(2, duration=150.0, declared="zero", velocities=True, fixes=FIXES, wheels=WHEELS)
    write_drive(drive, tmp_path / "drive.npz")
    words = ["covariances", str(tmp_path / "drive.npz"), "-o", str(tmp_path / "out")]
    assert run([*words, "--json", str(tmp_path / "found.json")]) == 0
    said = capsys.readouterr().out
    assert "Verdict: usable" in said
    assert len(said.splitlines()) <= 30
    assert max(map(len, said.splitlines())) <= 120
    own = yaml.safe_load((tmp_path / "out" / "robot_localization.yaml").read_text())
    parameters = own["ekf_filter_node"]["ros__parameters"]
    assert len(parameters["process_noise_covariance"]) == 15
    assert {name for name in parameters if name.endswith("rejection_threshold")} == {
        "odom0_pose_rejection_threshold",
        "twist0_rejection_threshold",
        "imu0_twist_rejection_threshold",
    }
    found = json.loads((tmp_path / "found.json").read_text())
    (fixes,) = (x for x in found["streams"] if (x["stream"], x["part"]) == ("fixes", "horizontal"))
    assert fixes["declared"] == 0.0
    assert fixes["size"]["value"] == pytest.approx(FIXES.size, rel=0.6)
    assert fixes["to_write"] >= fixes["white"]["value"]


def test_wheels_of_a_unit_with_unknown_axes_are_left_out_in_words():
    drive, _ = recording(1, duration=100.0, velocities=True)
    found = covariances_of(replace(drive, mounting=None))
    assert "wheels are left out" in found.notes[0]
    assert not any(one.stream == "wheels" for one in found.streams)


def test_a_run_with_poses_is_refused_with_what_does_it(tmp_path, capsys):
    (tmp_path / "run").mkdir()
    t, noise = np.arange(0.0, 10.0, 0.01), np.random.default_rng(0).standard_normal((1000, 6))
    np.savetxt(
        tmp_path / "run" / "imu.csv", np.column_stack([t, 0.01 * noise + [0, 0, 0, 0, 0, 9.8]]), "%.6g", ",",
        header="t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", comments="",
    )  # fmt: skip
    rows = np.column_stack([t, noise[:, :3], 0.0 * noise[:, :3], 0.0 * t + 1.0])
    np.savetxt(tmp_path / "run" / "poses.txt", rows, "%.6g")
    assert run(["covariances", str(tmp_path / "run")]) == 2
    assert "expected fixes, found poses" in capsys.readouterr().err
