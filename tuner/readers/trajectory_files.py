"""Trajectories without a filter's covariance: files of TUM, KITTI and EuRoC.

======  =====================================================================================================
TUM     t, x, y, z, qx, qy, qz, qw, blanks between, no header or a comment
KITTI   the first three rows of a 4 × 4 pose, 12 numbers a line; times in ``times.txt`` beside it
EuRoC   ``data.csv`` of a ground truth: ns, p_RS_R, q_RS, v_RS_R, b_w, b_a
======  =====================================================================================================

Axes of the world are taken as x east, y north, z up; of KITTI, whose poses are a camera's, as x right, y down,
z forward at the start; ``--frame`` and ``--body`` say otherwise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.readers.estimate_columns import Frames, Places, assemble
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import Dialect
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

KITTI_INTERVAL = 0.1
"""s: the cameras of KITTI take ten pictures a second."""
_EUROC = {
    "p_rs_r_x": "x", "p_rs_r_y": "y", "p_rs_r_z": "z",
    "q_rs_w": "qw", "q_rs_x": "qx", "q_rs_y": "qy", "q_rs_z": "qz",
    "v_rs_r_x": "vx", "v_rs_r_y": "vy", "v_rs_r_z": "vz",
    "b_w_rs_s_x": "bg_x", "b_w_rs_s_y": "bg_y", "b_w_rs_s_z": "bg_z",
    "b_a_rs_s_x": "ba_x", "b_a_rs_s_y": "ba_y", "b_a_rs_s_z": "ba_z",
}  # fmt: skip
"""Columns of EuRoC and ours."""


TUM: Places = {name: (j, None) for j, name in enumerate(("t", "x", "y", "z", "qx", "qy", "qz", "qw"))}
"""Columns of TUM."""


def columns_of_euroc(dialect: Dialect) -> Places:
    """Return the columns of a ground truth of EuRoC, by its header; none of another file."""
    plain = [name.partition("[")[0].strip().lower() for name in dialect.names]
    if not any(name.startswith(("p_rs_r_x", "q_rs_w")) for name in plain):
        return {}
    return {"t": (0, "ns")} | {_EUROC[name]: (j, None) for j, name in enumerate(plain) if name in _EUROC}


def read_kitti(path: Path, dialect: Dialect, frames: Frames) -> FilterOutput:
    """Read poses of KITTI: twelve columns, times beside them."""
    (numbers,) = read_numbers(path, dialect, [range(12)])
    pose = numbers.reshape(-1, 3, 4)
    if not np.abs(np.linalg.det(pose[:, :, :3]) - 1.0).max() < 0.01:
        raise DataError(
            f"{path}: expected poses of KITTI, rows of a rotation matrix and a position, found no rotations"
        )
    t, note = _kitti_times(path, len(pose))
    quat = rotation.quat_from_mat(pose[:, :, :3])
    columns: dict[str, tuple[FloatArray, str | None]] = {"t": (t, None)}
    columns |= {name: (np.asarray(pose[:, i, 3]), None) for i, name in enumerate(("x", "y", "z"))}
    columns |= {name: (quat[:, i], None) for i, name in enumerate(("qw", "qx", "qy", "qz"))}
    axes = Frames(frames.world or "EDN", frames.body or "RDF")
    return assemble(str(path), columns, axes, notes=note)


def _kitti_times(path: Path, count: int) -> tuple[FloatArray, tuple[str, ...]]:
    file = path.with_name("times.txt")
    if not file.is_file():
        note = f"no times.txt beside {path.name}: rows are taken as {KITTI_INTERVAL:g} s apart"
        return np.asarray(KITTI_INTERVAL * np.arange(count), dtype=float), (note,)
    try:
        t = np.loadtxt(file, ndmin=1)
    except ValueError as error:
        raise DataError(f"{file}: expected one time, s, a line: {error}") from None
    if t.shape != (count,):
        raise DataError(
            f"{file}: expected {count} times, one a pose of {path.name}, found an array of shape {t.shape}"
        )
    return np.asarray(t, dtype=float), ()
