"""The output of any filter, and truths to score it by: which file is what, and rows in order of time."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from tuner.formats.guard import input_guard
from tuner.readers.axes_letters import BODY_LETTERS, WORLD_LETTERS, axes_rotation
from tuner.readers.estimate_bag import is_bag, read_estimate_bag
from tuner.readers.estimate_columns import Frames, assemble, read_columns
from tuner.readers.estimate_csv import names_known_columns, read_estimate_csv
from tuner.readers.estimate_npz import read_estimate_npz
from tuner.readers.gps_solution import gps_solution, of_gps_solution
from tuner.readers.kf_gins_output import read_kf_gins_output
from tuner.readers.log_format import library_of
from tuner.readers.messages.rosbag import FORMAT as BAG_FORMAT
from tuner.readers.navego_output import read_navego_output
from tuner.readers.text_dialect import find_dialect
from tuner.readers.trajectory_files import TUM, columns_of_euroc, read_kitti
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

MAX_UNUSABLE_SHARE = 0.01
"""Share of rows without a time or out of order above which a file is refused."""
KNOWN_FORMS = (
    "CSV with named columns, NPZ, TUM, KITTI, EuRoC, text of Inertial Explorer, .pos of RTKLIB, *.nav of KF-GINS, "
    "nav_e of NaveGo as .mat, ROS bag, MCAP"
)
"""What can be read, for messages."""


def read_estimate(
    path: str | Path,
    *,
    frame: str | None = None,
    body: str | None = None,
    columns: Mapping[str, str] | None = None,
    topic: str | None = None,
    beside: FilterOutput | None = None,
) -> FilterOutput:
    """Read the output of a filter, or a truth.

    Parameters
    ----------
    path : str or Path
        A file in one of the forms of `KNOWN_FORMS`, or a folder with the output of KF-GINS.
    frame : str, optional
        Axes of the world for columns x, y, z: three letters such as ENU, or ECEF.
    body : str, optional
        Axes of the body: three letters such as FLU; by default FRD.
    columns : mapping of str to str, optional
        Columns of a CSV by our name.
    topic : str, optional
        Topic of a bag, where it has several.
    beside : FilterOutput, optional
        What a truth is for: GPS time of Inertial Explorer and RTKLIB is put on its clock; without it, on the seconds of
        the week.

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    path = Path(path)
    if frame is not None and frame.strip().upper() != "ECEF":
        axes_rotation(frame, WORLD_LETTERS, option=f"{path}: --frame")
    if body is not None:
        axes_rotation(body, BODY_LETTERS, option=f"{path}: --body")
    found = _estimate(path, Frames(frame, body), columns, topic, beside)
    _refuse_idle(path, found, frame, body)
    return found


def _estimate(
    path: Path,
    frames: Frames,
    columns: Mapping[str, str] | None,
    topic: str | None,
    beside: FilterOutput | None,
) -> FilterOutput:
    """Return what a file of any form holds, in order of time."""
    if path.exists() and is_bag(path):
        with library_of(BAG_FORMAT, path), input_guard(path, "a ROS bag or MCAP file"):
            return in_order(read_estimate_bag(path, frames, topic=topic))
    if topic is not None:
        raise DataError(f"{path}: --topic {topic}: expected a ROS bag or MCAP file, found another file")
    with input_guard(path, "the output of a filter"):
        solution = None if columns or not path.is_file() else gps_solution(path)
        if solution is not None:
            return in_order(of_gps_solution(path, solution, beside))
        return in_order(_read(path, frames, columns))


def _refuse_idle(path: Path, found: FilterOutput, frame: str | None, body: str | None) -> None:
    """Refuse axes of the world or of the body that are stated, and turn nothing of what was read."""
    axes = found.axes
    world = "NED" if frame is None else frame.strip().upper()
    used = (
        found.llh is not None
        if world == "ECEF"
        else world in (axes.positions, axes.velocities, axes.attitudes)
    )
    if not used and world != "NED":
        raise DataError(
            f"{path}: --frame {frame}: expected columns x, y, z, vx, vy, vz or a quaternion, whose axes it states, "
            "found none: leave it out"
        )
    if body is not None and not (np.isfinite(found.quat_nb).any() or np.isfinite(found.bias).any()):
        raise DataError(
            f"{path}: --body {body}: expected an attitude or biases, whose axes it states, found none: leave it out"
        )


def _read(path: Path, frames: Frames, columns: Mapping[str, str] | None) -> FilterOutput:
    if path.is_dir():
        results = sorted(path.glob("*Navresult*.nav")) or sorted(path.glob("*.nav"))
        if len(results) != 1:
            raise DataError(
                f"{path}: expected a folder with one .nav of KF-GINS, found {len(results)}; name the file"
            )
        return read_kf_gins_output(results[0])
    if not path.is_file():
        raise DataError(f"{path}: expected the output of a filter ({KNOWN_FORMS}), found nothing")
    suffix = path.suffix.lower()
    if suffix == ".npz" or (suffix != ".csv" and zipfile.is_zipfile(path)):
        return read_estimate_npz(path, frames)
    if suffix == ".mat":
        return read_navego_output(path)
    if suffix == ".nav":
        return read_kf_gins_output(path)
    dialect = find_dialect(path)
    places = columns_of_euroc(dialect)
    of_tum = {"tx", "ty", "tz"} <= {name.lower() for name in dialect.names}  # they carry names as a comment
    if not places and (columns or (names_known_columns(dialect) and not of_tum)):
        return read_estimate_csv(path, frames, columns=columns)
    if not places and len(dialect.names) == 8 and dialect.separator in (None, ","):
        places = TUM
    if places:
        axes = Frames(frames.world or "ENU", frames.body)
        return assemble(str(path), read_columns(path, dialect, places), axes)
    if len(dialect.names) == 12 and not dialect.header:
        return read_kitti(path, dialect, frames)
    raise DataError(
        f"{path}: expected the output of a filter ({KNOWN_FORMS}), found {len(dialect.names)} columns: "
        f"{', '.join(dialect.names[:6])}, …; name them in a header or with --columns"
    )


def in_order(found: FilterOutput) -> FilterOutput:
    """Return the epochs in order of time, without those that have no time or a doubled one; each repair is noted.

    Raises
    ------
    DataError
        Fewer than two epochs, or more than 1 % of them unusable.
    """
    t, notes = found.t, list(found.notes)
    finite = np.isfinite(t)
    behind = int(np.count_nonzero(t[finite] < np.maximum.accumulate(t[finite]))) if finite.any() else 0
    unusable = int(np.count_nonzero(~finite)) + behind
    if unusable > MAX_UNUSABLE_SHARE * len(t):
        raise DataError(
            f"{found.name}: expected times that rise, found {unusable} of {len(t)} rows without a time or behind an "
            "earlier one"
        )
    order = np.flatnonzero(finite)[np.argsort(t[finite], kind="stable")]
    fresh = np.concatenate([[True], np.diff(t[order]) > 0.0]) if len(order) else np.zeros(0, dtype=bool)
    if unusable:
        notes.append(f"{unusable} rows without a time or out of order sorted or removed")
    if not fresh.all():
        notes.append(f"{np.count_nonzero(~fresh)} rows with a doubled time removed")
    if np.count_nonzero(fresh) < 2:
        raise DataError(f"{found.name}: expected two epochs or more, found {np.count_nonzero(fresh)}")
    return replace(found.rows(order[fresh]), notes=tuple(notes))
