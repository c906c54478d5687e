"""Runs with poses as files: bags, folders of EuRoC, a log beside a trajectory; answer and settings of `tune`."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.tuner.poses.simulated_run import RATE, REST, simulated_run
from tests.tuner.poses.test_run_with_poses import CONFIG
from tests.tuner.readers.messages.writers import write_bag
from tuner.cli import run
from tuner.poses.run_with_poses import compare_with_poses, poses_of
from tuner.readers.pose_run import read_pose_run
from tuner.report.pose_run_answer import pose_run_lines

EPOCH = 1_700_000_000.0
HEADER = "t [s],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2]"


@pytest.fixture(scope="module")
def simulated():
    return simulated_run(1, seconds=60.0, factors=(5.0, 5.0))


def in_folder(folder, simulated):
    """Write a log beside a trajectory of TUM."""
    (gyro, accel), poses = simulated
    folder.mkdir()
    rows = np.column_stack([gyro.t, gyro.y, accel.y])
    np.savetxt(folder / "imu.csv", rows, delimiter=",", header=HEADER, comments="", fmt="%.9g")
    rows = np.column_stack([poses.t, poses.place, poses.quat[:, [1, 2, 3, 0]]])
    np.savetxt(folder / "poses.txt", rows, fmt="%.9f")
    return folder


def as_euroc(folder, simulated, name="vicon0"):
    """Write the folders of EuRoC."""
    (gyro, accel), poses = simulated
    for one, head, rows in (
        (
            "imu0",
            ",".join(f"{of}_RS_S_{x} [{u}]" for of, u in (("w", "rad s^-1"), ("a", "m s^-2")) for x in "xyz"),
            np.column_stack([gyro.t, gyro.y, accel.y]),
        ),
        (
            name,
            "p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []",
            np.column_stack([poses.t, poses.place, poses.quat]),
        ),
    ):
        (folder / "mav0" / one).mkdir(parents=True)
        lines = [f"#timestamp [ns],{head}"]
        lines += [",".join([str(round(1e9 * (EPOCH + t))), *(f"{x:.9g}" for x in rest)]) for t, *rest in rows]
        (folder / "mav0" / one / "data.csv").write_text("\n".join(lines) + "\n")
    return folder


def in_bag(path, simulated, topics=("/vicon/unit",), kind="geometry_msgs/msg/TransformStamped", **more):
    """Write a ROS 2 bag with poses of a motion capture, by default transforms."""
    (gyro, accel), poses = simulated
    stamps = [round(1e9 * (EPOCH + t)) for t in gyro.t]
    samples = [(at, {"gyro": w, "accel": f}) for at, w, f in zip(stamps, gyro.y, accel.y, strict=True)]
    moved = [
        (round(1e9 * (EPOCH + t)), {"place": place, "quat": quat, **more})
        for t, place, quat in zip(poses.t, poses.place, poses.quat, strict=True)
    ]
    write_bag(
        path, {"/imu": ("sensor_msgs/msg/Imu", samples)} | dict.fromkeys(topics, (kind, moved)), kind="ros2"
    )
    return path


@pytest.mark.parametrize("write", [in_folder, as_euroc, in_bag])
def test_every_form_gives_the_same_samples_and_poses(tmp_path, simulated, write):
    found = read_pose_run(write(tmp_path / "run", simulated))
    (gyro, _), poses = simulated
    assert found.name == "run"
    assert found.records[0].y == pytest.approx(gyro.y, abs=1e-6)
    assert found.poses.t[0] - found.records[0].t[0] == pytest.approx(poses.t[0] - gyro.t[0], abs=1e-5)
    step = np.diff(found.poses.local, axis=0)
    assert np.linalg.norm(step, axis=1) == pytest.approx(
        np.linalg.norm(np.diff(poses.place, axis=0), axis=1), abs=1e-6
    )


def test_of_two_topics_one_is_named(tmp_path, simulated, capsys):
    bag = in_bag(tmp_path / "run", simulated, ("/vicon/unit", "/vicon/wand"))
    assert read_pose_run(f"{bag}:/vicon/unit").poses is not None
    assert run(["tune", "mpu9250", "--drive", str(bag)]) == 2
    assert f"{bag}:/vicon/unit" in capsys.readouterr().err


def test_tune_writes_the_noise_in_motion_and_says_why(tmp_path, simulated, capsys):
    rng = np.random.default_rng(0)
    size = (int(1800 * RATE), 3)
    rest = {name: white * np.sqrt(RATE) * rng.normal(size=size) for name, (white, _) in REST.items()}
    rest["accel"][:, 2] += 9.81
    np.savez(tmp_path / "rest.npz", t=np.arange(size[0]) / RATE, **rest)
    folder = in_folder(tmp_path / "run", simulated)
    command = ["tune", str(tmp_path / "rest.npz"), "--assume", "si", "--drive", str(folder), "--to", "vins"]
    assert run([*command, "-o", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(r"gyro: high-frequency noise of the samples is [45]\.\d × that at rest: vibration", said)
    assert re.search(r"white noise of gyro x y z, accel x y z × [\d.]+ to [\d.]+ \(vibration\)", said)
    written = dict(
        line.split("  #")[0].split(": ")
        for line in (tmp_path / "out/vins.txt").read_text().splitlines()
        if "acc_n" in line or "gyr_n" in line
    )
    # VINS enters N √(2/dt): `tuner.exporters.vins`.
    for key, name in (("gyr_n", "gyro"), ("acc_n", "accel")):
        assert float(written[key]) == pytest.approx(5.0 * REST[name][0] * np.sqrt(2.0 * RATE), rel=0.25)


def test_covariances_that_poses_declare_stand_beside_their_errors(tmp_path, simulated):
    spread = np.diag([3e-3] * 3 + [6e-4] * 3) ** 2  # ten and two times the errors
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    found = read_pose_run(in_bag(tmp_path / "run", simulated, kind=kind, covariance=spread))
    compared = compare_with_poses(found.records, poses_of(found.poses), CONFIG, "run")
    (line,) = (one for one in pose_run_lines(compared) if isinstance(one, str) and "declared" in one)
    ratios = re.search(r"true ÷ declared ([\d.]+) ± [\d.]+ and ([\d.]+) ±", line)
    assert float(ratios[1]) == pytest.approx(0.5, rel=0.1)
    assert float(ratios[2]) == pytest.approx(0.1, rel=0.1)


def test_a_table_of_poses_needs_no_axes_and_may_lack_rows(tmp_path, simulated):
    folder = in_folder(tmp_path / "run", simulated)
    _, poses = simulated
    rows = np.column_stack([poses.t, poses.place, poses.quat])
    rows[::100, 4:] = np.nan  # tracking lost
    np.savetxt(
        folder / "poses.csv", rows, delimiter=",", header="t,x,y,z,qw,qx,qy,qz", comments="", fmt="%.9f"
    )
    assert len(poses_of(read_pose_run(folder).poses).t) == len(poses.t) - len(poses.t[::100])
    (folder / "gnss.csv").write_text("t,lat,lon,height\n")
    assert read_pose_run(folder) is None  # a drive


def test_a_drive_beside_a_trajectory_is_no_run(tmp_path, simulated):
    folder = in_folder(tmp_path / "run", simulated)
    np.savez(folder / "drive.npz", gnss_t=np.arange(10.0))
    assert read_pose_run(folder / "drive.npz") is None
    assert read_pose_run(folder / "imu.csv") is not None


def test_a_run_without_a_log_at_rest_is_refused(tmp_path, simulated, capsys):
    assert run(["tune", "--drive", str(in_folder(tmp_path / "run", simulated))]) == 2
    assert "expected a log at rest before --drive" in capsys.readouterr().err
