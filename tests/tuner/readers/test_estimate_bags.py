"""Outputs of filters in bags, in the layout of the messages of ROS: numbers, axes and covariances as written.

The messages are those that robot_localization publishes, by their declarations in nav_msgs and geometry_msgs; the bags
are written by rosbags.
"""

from __future__ import annotations

import numpy as np
import pytest

from models import rotation
from tests.tuner.readers.messages.writers import write_bag
from tuner.cli import run
from tuner.readers.estimate import read_estimate
from tuner.types.records import DataError

ODOMETRY = "nav_msgs/msg/Odometry"
N = 30
T = 1_600_000_000.0 + 0.1 * np.arange(N)
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""East, north, up of north, east, down, and back."""
FLU = np.diag([1.0, -1.0, -1.0])
MOVED = T - T[0]
NED = np.column_stack([np.sin(MOVED), 0.5 * MOVED, 0.1 * np.cos(MOVED)])
VEL = np.column_stack([np.cos(MOVED), np.full(N, 0.5), -0.1 * np.sin(MOVED)])
QUAT = rotation.quat_from_rpy(np.column_stack([0.1 * np.sin(MOVED), 0.2 * np.cos(MOVED), 2.0 + MOVED]))
MAT_NB = rotation.mat_from_quat(QUAT)


def rows(*, world: bool = False) -> list[tuple[int, dict]]:
    """Return the poses in axes of ROS; with `world`, velocities in those of the world."""
    root = np.random.default_rng(0).normal(size=(6, 6)) * np.repeat([0.5, 0.01], 3)[:, None]
    found = []
    for k in range(N):
        mat = ENU @ MAT_NB[k] @ FLU
        found.append(
            (
                round(1e9 * T[k]),
                {
                    "place": ENU @ NED[k],
                    "quat": rotation.quat_from_mat(mat),
                    "covariance": root @ root.T,
                    "velocity": ENU @ VEL[k] if world else mat.T @ ENU @ VEL[k],
                    "velocity_covariance": np.diag([0.01, 0.04, 0.09]),
                },
            )
        )
    return found


def bag(tmp_path, kind, topics):
    path = tmp_path / {"ros1": "a.bag", "ros2": "a", "mcap": "b"}[kind]
    write_bag(path, topics, kind=kind)
    return path


@pytest.mark.parametrize("kind", ["ros1", "ros2", "mcap"])
def test_odometry_is_read_in_our_axes_with_its_covariances(tmp_path, kind):
    given = rows()
    found = read_estimate(bag(tmp_path, kind, {"/odometry/filtered": (ODOMETRY, given)}))
    assert found.t == pytest.approx(T, abs=1e-6)
    assert found.local == pytest.approx(NED, abs=1e-9)
    assert found.vel_n == pytest.approx(VEL, abs=1e-9)
    turn = rotation.quat_multiply(found.quat_nb, rotation.quat_conjugate(QUAT))
    assert np.abs(rotation.rotvec_from_quat(turn)).max() < 1e-9
    # Of roll, pitch and yaw about fixed axes (geometry_msgs/PoseWithCovariance): rotations by a small one of each.
    mat = ENU @ MAT_NB[0] @ FLU
    rpy, tiny = rotation.rpy_from_mat(mat), 1e-6
    turns = [
        rotation.rotvec_from_mat(rotation.mat_from_rpy(rpy + tiny * e) @ mat.T) / tiny for e in np.eye(3)
    ]
    whole = np.zeros((6, 6))
    whole[:3, :3], whole[3:, 3:] = ENU, ENU @ np.transpose(turns)
    spread = whole @ given[0][1]["covariance"] @ whole.T
    assert found.covariance[0][np.ix_([0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8])] == pytest.approx(
        spread, rel=1e-4
    )
    mat = MAT_NB[3] @ FLU
    assert found.covariance[3, 3:6, 3:6] == pytest.approx(mat @ np.diag([0.01, 0.04, 0.09]) @ mat.T)
    assert found.correlated
    assert found.vel_of_body


def test_velocities_of_the_world_are_told_by_the_positions(tmp_path):
    found = read_estimate(bag(tmp_path, "ros2", {"/odom": (ODOMETRY, rows(world=True))}))
    assert found.vel_n == pytest.approx(VEL, abs=1e-9)
    assert any("axes of the world" in note for note in found.notes)


def test_poses_and_paths_are_read_and_covariances_of_zeros_are_none(tmp_path):
    given = rows()
    blank = [(stamp, fields | {"covariance": np.zeros((6, 6))}) for stamp, fields in given]
    topics = {
        "/pose": ("geometry_msgs/msg/PoseWithCovarianceStamped", blank),
        "/path": (
            "nav_msgs/msg/Path",
            [(given[k][0], {"poses": [f for _, f in given[: k + 1]]}) for k in (5, N - 1)],
        ),
    }
    path = bag(tmp_path, "ros2", topics)
    pose = read_estimate(path, topic="/pose")
    assert pose.local == pytest.approx(NED, abs=1e-9)
    assert np.isnan(pose.covariance).all()
    assert np.isnan(pose.vel_n).all()
    with pytest.raises(DataError, match=r"expected one topic .* /pose .* /path .*: name it with --topic"):
        read_estimate(path)
    with pytest.raises(DataError, match="--topic /other: expected a topic of odometry"):
        read_estimate(path, topic="/other")


def test_a_bag_is_scored_against_another(tmp_path):
    given = rows()
    for _, fields in given:
        fields["covariance"] = np.diag([0.01] * 3 + [1e-4] * 3)
    estimate = bag(tmp_path, "ros1", {"/odometry/filtered": (ODOMETRY, given)})
    truth = bag(tmp_path, "ros2", {"/truth": (ODOMETRY, rows()), "/other": (ODOMETRY, rows())})
    command = [
        "score",
        str(estimate),
        "--truth",
        str(truth),
        "--imu",
        "icm20602",
        "--quiet",
        "--json",
        str(tmp_path / "s.json"),
    ]
    assert run([*command, "--truth-topic", "/truth"]) == 0
    assert run(command) == 2
