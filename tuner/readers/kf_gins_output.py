"""What KF-GINS writes: ``KF_GINS_Navresult.nav``, and beside it ``KF_GINS_STD.txt`` and ``KF_GINS_IMU_ERR.txt``.

=========  ===================================================================================================
nav        week, s, lat, lon, deg, height, m, velocity, m/s, roll, pitch, yaw, deg
STD        s, sds of position, m, velocity, m/s, attitude, deg, gyro bias, deg/h, accelerometer bias, mGal, …
IMU_ERR    s, gyro bias, deg/h, accelerometer bias, mGal, scale factors
=========  ===================================================================================================

The sds of attitude are those of a rotation about north, east and down.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from tuner.readers.estimate_columns import Frames, assemble
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import find_dialect
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

_NAV = (("lat", "deg"), ("lon", "deg"), ("height", "m"), ("vn", "m/s"), ("ve", "m/s"), ("vd", "m/s"),
        ("roll", "deg"), ("pitch", "deg"), ("yaw", "deg"))  # fmt: skip
_BIAS = tuple((f"bg_{x}", "deg/h") for x in "xyz") + tuple((f"ba_{x}", "mGal") for x in "xyz")
_STD = (
    *((f"sd_{name}", "m") for name in ("n", "e", "d")),
    *((f"sd_{name}", "m/s") for name in ("vn", "ve", "vd")),
    *((f"sd_phi_{x}", "deg") for x in "ned"),
    *((f"sd_{name}", unit) for name, unit in _BIAS),
)
SAME_INSTANT = 1e-4
"""Largest difference of stamps of one instant, s: they are written with digits enough for a tenth of it."""


def read_kf_gins_output(path: Path) -> FilterOutput:
    """Read the navigation result of KF-GINS, with its sds and biases where they stand beside it.

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    nav = _table(path, 11)
    columns: dict[str, tuple[FloatArray, str | None]] = {"t": (nav[:, 1], "s")}
    columns |= {name: (nav[:, j + 2], unit) for j, (name, unit) in enumerate(_NAV)}
    notes = []
    for kind, layout in (("STD", _STD), ("IMU_ERR", _BIAS)):
        file = _beside(path, kind)
        if file is None:
            notes.append(f"no {kind} file of KF-GINS beside {path.name}: its numbers are not scored")
            continue
        rows = _table(file, 1 + len(layout))
        if len(rows) != len(nav) or not np.abs(rows[:, 0] - nav[:, 1]).max() < SAME_INSTANT:
            raise DataError(
                f"{file}: expected the {len(nav)} epochs of {path.name}, found others: were they written by one run?"
            )
        columns |= {name: (rows[:, j + 1], unit) for j, (name, unit) in enumerate(layout)}
    return assemble(str(path), columns, Frames(), notes=tuple(notes))


def _table(path: Path, width: int) -> FloatArray:
    """Return the first columns of a file of numbers, shape (n, width)."""
    dialect = find_dialect(path)
    if len(dialect.names) < width:
        raise DataError(f"{path}: expected {width} columns of KF-GINS or more, found {len(dialect.names)}")
    (rows,) = read_numbers(path, dialect, [range(width)])
    return rows


def _beside(path: Path, kind: str) -> Path | None:
    """Return the file of a kind beside a navigation result: of the same name, or the only one of its kind."""
    exact = path.with_name(path.stem.replace("Navresult", kind) + ".txt")
    if exact != path and exact.is_file():
        return exact
    found = sorted(path.parent.glob(f"*{kind}*.txt"))
    return found[0] if len(found) == 1 else None
