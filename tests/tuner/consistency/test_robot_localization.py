"""Output of robot_localization, written into bags as it publishes it, is judged and its faults are named.

The filter is `tests.robot_localization`; what it states is in a message of odometry: pose in axes of the world with the
covariance of x, y, z, roll, pitch and yaw, twist in axes of the body with that of its velocity.
"""

from __future__ import annotations

import numpy as np
import pytest

from models import rotation
from tests import robot_localization as robot
from tests.tuner.readers.messages.writers import write_bag
from tuner.consistency.score_output import score_outputs
from tuner.readers.estimate import read_estimate

STUDY = {
    "none": ({}, None),
    "r": ({"r": 3.0}, "gnss_noise_scale"),
    "q": ({"q": 0.1}, "imu_noise_scale"),
    "delay": ({"delay": 0.1}, "time_offset"),
    "lever_arm": ({}, "lever_arm"),
}


def odometry(path, t, state, covariance=None):
    """Write states (k, 15) and covariances (k, 15, 15) as messages of odometry; return them as read."""
    quat = rotation.quat_from_mat(robot.matrix(state[:, robot.ANGLES]))
    pose = np.zeros((len(t), 6, 6)) if covariance is None else covariance[:, :6, :6]
    twist = np.zeros((len(t), 3, 3)) if covariance is None else covariance[:, robot.SPEED, robot.SPEED]
    rows = [
        (
            round(1e9 * t[k]),
            {
                "place": state[k, robot.PLACE],
                "quat": quat[k],
                "covariance": pose[k],
                "velocity": state[k, robot.SPEED],
                "velocity_covariance": twist[k],
            },
        )
        for k in range(len(t))
    ]
    write_bag(path, {"/odometry/filtered": ("nav_msgs/msg/Odometry", rows)}, kind="ros2")
    return read_estimate(path)


def scored(folder, runs):
    """Score each of some runs by its bag."""
    for i, state in enumerate(runs.state):
        estimate = odometry(folder / f"estimate{i}", runs.t, state, runs.covariance[i])
        truth = odometry(folder / f"truth{i}", runs.t, runs.truth[i])
        yield score_outputs([estimate], [truth])


def test_a_fault_is_named_and_measured(tmp_path):
    runs = robot.run(100.0, 1, np.random.default_rng(4), delay=0.1)
    (found,) = scored(tmp_path, runs)
    assert not found.consistency.consistent
    assert [(cause.cause, cause.subject) for cause in found.causes] == [("time_offset", "fixes")]
    assert found.causes[0].size == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("fault", STUDY)
def test_study_of_fifty_runs(tmp_path, fault):
    faults, cause = STUDY[fault]
    rng = np.random.default_rng(77)
    flagged = named = count = 0
    for part in range(10 if cause is None else 5):
        if fault == "lever_arm":
            arm = rng.standard_normal(3) * [1.0, 1.0, 0.3]
            faults = {"lever_arm": 0.5 * arm / np.linalg.norm(arm)}
        runs = robot.run(600.0, 10, rng, **faults)
        folder = tmp_path / str(part)
        folder.mkdir()
        for found in scored(folder, runs):
            count += 1
            flagged += not found.consistency.consistent
            named += bool(found.causes) and found.causes[0].cause == cause
    if cause is None:
        assert flagged <= 2
    else:
        assert flagged >= 48
        assert named >= 45
