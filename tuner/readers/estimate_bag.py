"""Outputs of filters in ROS 1 and ROS 2 bags and MCAP files: odometry, poses with covariance, poses, paths.

=========================================  ===========================================================================
nav_msgs/Odometry                          pose in axes of the world; twist in axes of the body (REP 105), or of the
                                           world where its velocity fits the positions better so
geometry_msgs/PoseWithCovarianceStamped    pose with its covariance
geometry_msgs/PoseStamped                  pose
geometry_msgs/TransformStamped             pose, as bridges of motion capture publish it
nav_msgs/Path                              poses of its last message
=========================================  ===========================================================================

World axes are x east, y north, z up, those of the body x forward, y left, z up (REP 103), unless they are named.
Covariances are row-major 6 × 6, of position and of roll, pitch and yaw about fixed axes of the world, of the velocity
along the axes of the body; all zeros, or a negative variance, mean that none is stated.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.readers.axes_letters import WORLD_LETTERS, axes_rotation
from tuner.readers.estimate_columns import Frames, assemble, rotvec_of_angles
from tuner.readers.messages.rosbag import METADATA, SIGNATURES, clock_of_stamps, opened_bag
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

ODOMETRY_KIND, PATH_KIND = "nav_msgs/msg/Odometry", "nav_msgs/msg/Path"
POSE_KINDS = (
    ODOMETRY_KIND,
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TransformStamped",
    PATH_KIND,
)
WORLD_SHARE = 0.5
"""Misfit of velocities taken as of the world ÷ that as of the body, below which they are taken so."""
_POSE_NAMES = ("x", "y", "z", "phi_n", "phi_e", "phi_d")
_POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")
_TWIST_NAMES = ("vn", "ve", "vd")


def is_bag(path: Path) -> bool:
    """Tell whether a file or folder is a bag."""
    if path.is_dir():
        return (path / METADATA).is_file()
    with path.open("rb") as file:
        return file.read(16).startswith(SIGNATURES) or (path.parent / METADATA).is_file()


def read_estimate_bag(path: Path, frames: Frames, *, topic: str | None) -> FilterOutput:
    """Read a filter's output of a bag.

    Parameters
    ----------
    path : Path
        Bag, MCAP file, or folder of a ROS 2 bag.
    frames : Frames
        Axes of world and body; those that are not stated are east, north, up and forward, left, up.
    topic : str or None
        The topic, where there are several.

    Raises
    ------
    DataError
        No bag, no such topic, or several.
    """
    stamps: list[tuple[int, int]] = []
    rows: list[tuple[float, ...]] = []
    with opened_bag(path) as bag:
        found = {c.topic: c.msgtype for c in bag.connections if c.msgtype in POSE_KINDS}
        chosen = _topic(path, found, topic)
        kind = found[chosen]
        for connection, recorded, raw in bag.messages([c for c in bag.connections if c.topic == chosen]):
            message: Any = bag.deserialize(raw, connection.msgtype)
            if kind == PATH_KIND:
                stamps, rows = [], []
            for one in message.poses if kind == PATH_KIND else (message,):
                stamp = one.header.stamp
                stamps.append((stamp.sec * 1_000_000_000 + stamp.nanosec, recorded))
                rows.append(_numbers(one, kind))
    if len(rows) < 2:
        raise DataError(f"{path}: topic {chosen}: expected two poses or more, found {len(rows)}")
    t = 1e-9 * clock_of_stamps(np.array(stamps, dtype=np.int64)).astype(float)
    return _assembled(f"{path}:{chosen}", t, np.array(rows), kind, frames)


def _topic(path: Path, found: dict[str, str], wanted: str | None) -> str:
    listed = ", ".join(f"{name} ({kind})" for name, kind in found.items()) or "none"
    if wanted is not None:
        if wanted not in found:
            raise DataError(
                f"{path}: --topic {wanted}: expected a topic of odometry, poses or a path, found {listed}"
            )
        return wanted
    if len(found) != 1:
        raise DataError(
            f"{path}: expected one topic of odometry, poses or a path, found {listed}: name it with --topic"
        )
    return next(iter(found))


def _numbers(message: Any, kind: str) -> tuple[float, ...]:
    """Return position, quaternion (w first), 36 of the pose's covariance, velocity, 9 of its covariance; NaN."""
    if hasattr(message, "transform"):
        with_covariance, p, q = False, message.transform.translation, message.transform.rotation
    else:
        with_covariance = hasattr(message.pose, "covariance")
        pose = message.pose.pose if with_covariance else message.pose
        p, q = pose.position, pose.orientation
    spread = message.pose.covariance if with_covariance else [np.nan] * 36
    row = [p.x, p.y, p.z, q.w, q.x, q.y, q.z, *spread]
    if kind == ODOMETRY_KIND:
        v = message.twist.twist.linear
        mat = np.reshape(message.twist.covariance, (6, 6))[:3, :3]
        return (*row, v.x, v.y, v.z, *mat.ravel())
    return (*row, *[np.nan] * 12)


def _assembled(source: str, t: FloatArray, rows: FloatArray, kind: str, frames: Frames) -> FilterOutput:
    axes = Frames(frames.world or "ENU", frames.body or "FLU")
    mat_nw = axes_rotation(str(axes.world), WORLD_LETTERS, option="--frame")
    length = np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
    quat = np.where(length > 0.0, rows[:, 3:7] / np.where(length > 0.0, length, 1.0), np.nan)
    columns: dict[str, tuple[FloatArray, str | None]] = {"t": (t, "s")}
    columns |= {name: (rows[:, j], None) for j, name in enumerate(("x", "y", "z"))}
    if np.isfinite(quat).all():
        columns |= {name: (quat[:, j], None) for j, name in enumerate(("qw", "qx", "qy", "qz"))}
    spread = rows[:, 7:43].reshape(-1, 6, 6)
    if _stated(spread[:, :3, :3]):
        turn = np.tile(np.eye(6), (len(t), 1, 1))
        angles = rotation.rpy_from_quat(np.where(np.isfinite(quat), quat, [1.0, 0.0, 0.0, 0.0]))
        turn[:, 3:, 3:] = mat_nw @ rotvec_of_angles(angles)
        count = 6 if _stated(spread[:, 3:, 3:]) else 3
        _add(columns, turn @ spread @ np.swapaxes(turn, -1, -2), _POSE_NAMES[:count], _POSE_UNITS)
    notes: list[str] = []
    of_body = False
    if kind == ODOMETRY_KIND:
        v, spread = rows[:, 43:46], rows[:, 46:55].reshape(-1, 3, 3)
        mat = mat_nw @ rotation.mat_from_quat(quat)
        of_body = True
        if _of_world(t, rows[:, :3], v, quat):
            notes.append(f"{source}: velocities are taken in axes of the world: they fit the positions so")
            mat, of_body = np.broadcast_to(mat_nw, mat.shape), False
        velocity = np.einsum("nij,nj->ni", mat, v)
        columns |= {name: (velocity[:, j], None) for j, name in enumerate(_TWIST_NAMES)}
        if _stated(spread):
            _add(columns, mat @ spread @ np.swapaxes(mat, -1, -2), _TWIST_NAMES, ("m/s",) * 3)
    return replace(assemble(source, columns, axes, notes=tuple(notes)), vel_of_body=of_body)


def _stated(spread: FloatArray) -> bool:
    """Tell whether variances are stated: positive throughout."""
    return bool((np.einsum("nii->ni", spread) > 0.0).all())


def _add(
    columns: dict[str, tuple[FloatArray, str | None]],
    spread: FloatArray,
    names: tuple[str, ...],
    units: tuple[str, ...],
) -> None:
    for i, j in itertools.combinations_with_replacement(range(len(names)), 2):
        unit = f"{units[i]}*{units[j]}" if units[i] != units[j] else f"({units[i]})^2"
        columns[f"cov_{names[i]}_{names[j]}"] = (spread[:, i, j], unit)


def _of_world(t: FloatArray, place: FloatArray, v: FloatArray, quat: FloatArray) -> bool:
    """Tell whether velocities fit the positions in axes of the world far better than in those of the body."""
    moved = np.diff(place, axis=0) / np.maximum(np.diff(t), 1e-9)[:, None]
    own = np.einsum("nij,nj->ni", rotation.mat_from_quat(quat), v)
    as_world, as_body = (
        float(np.median(np.linalg.norm(moved - 0.5 * (u[1:] + u[:-1]), axis=1))) for u in (v, own)
    )
    return as_world < WORLD_SHARE * as_body
