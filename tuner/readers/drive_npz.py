"""Drives in one NPZ: numeric arrays, and JSON in ``meta``, each refused by its name where it is none.

=================  ===================================================================
imu_t              (n,), s
gyro, accel        (n, 3), rad/s, m/s²
gnss_t             (k,), s
gnss_llh           (k, 3), deg, deg, m
gnss_vned          optional (k, 3), m/s
gnss_pstd, _vstd   optional (k, 3), m, m/s
gnss_fix           optional (k,), class of solution as in GGA (4: RTK fixed); gnss_q: as RTKLIB numbers it
wheel_t, wheel_v   optional (w,), (w, 3), s, m/s forward, right, down; wheel_sd (w, 3)
ref_t, ref_llh     optional (r,), (r, 3); with them ref_vned, ref_rpy (deg), ref_pstd,
                   ref_vstd, ref_astd (deg)
meta               optional JSON: imu_frame, mounting_rpy_deg, lever_arm_frd_m
=================  ===================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.formats.codec import load
from tuner.formats.documents import parse_json
from tuner.readers.npz_members import stored_arrays
from tuner.readers.solutions import OF_RTKLIB, solutions
from tuner.types.number_ranges import LeverArm, Vector3
from tuner.types.records import DataError

REQUIRED_ARRAYS = ("imu_t", "gyro", "accel", "gnss_t", "gnss_llh")
FIX_ARRAYS = ("gnss_llh", "gnss_vned", "gnss_pstd", "gnss_vstd")
SOLUTION_ARRAYS = ("gnss_fix", "gnss_q")
WHEEL_ARRAYS = ("wheel_v", "wheel_sd")
REFERENCE_ARRAYS = ("ref_llh", "ref_vned", "ref_rpy", "ref_pstd", "ref_vstd", "ref_astd")


@dataclass(frozen=True)
class _Installation:
    """Settings of the installation, the entries of ``meta`` that are read."""

    imu_frame: str | None = None
    mounting_rpy_deg: Vector3 | None = None
    lever_arm_frd_m: LeverArm | None = None


@dataclass(frozen=True)
class DriveArrays:
    """A drive as its files have it, whatever form they have.

    Attributes
    ----------
    imu : ndarray, shape (n, 7)
        t, angular rates rad/s, specific forces m/s².
    fixes : ndarray, shape (k, 13) or (k, 14)
        t, latitude and longitude deg, height m, velocity m/s, sds of both, and class of solution where it is known; NaN
        where there is none.
    truth : ndarray, shape (r, 10) or (r, 19), or None
        t, position, velocity, angles deg, and sds of the three.
    frame : str or None
        Axes of the unit.
    mounting_rpy_deg, lever_arm : tuple of 3 floats, or None
        deg, m.
    notes : tuple of str
        How the files were understood.
    start : ndarray, shape (10,), or None
        t, position, velocity and angles at the start, as of `truth`.
    compensated : bool
        Whether it was written without what a configuration takes out.
    wheels : ndarray, shape (w, 7), or None
        t, velocity forward, right, down, m/s, and its sds; NaN where there is none.
    """

    imu: FloatArray
    fixes: FloatArray
    truth: FloatArray | None = None
    frame: str | None = None
    mounting_rpy_deg: tuple[float, float, float] | None = None
    lever_arm: tuple[float, float, float] | None = None
    notes: tuple[str, ...] = ()
    start: FloatArray | None = None
    compensated: bool = False
    wheels: FloatArray | None = None


def read_drive_npz(path: Path) -> DriveArrays:
    """Read the arrays of a drive.

    Raises
    ------
    DataError
        What is no NPZ, or an array or setting that is not as it must be.
    """
    data = _arrays(path)
    missing = [name for name in REQUIRED_ARRAYS if name not in data]
    if missing:
        raise DataError(f"{path}: expected the arrays of a drive, {', '.join(missing)} missing")
    meta = _meta(path, data)
    given = "ref_t" in data and "ref_llh" in data
    return DriveArrays(
        _table(path, data, "imu_t", ("gyro", "accel")),
        np.column_stack([_table(path, data, "gnss_t", FIX_ARRAYS), _solutions(path, data)]),
        _table(path, data, "ref_t", REFERENCE_ARRAYS) if given else None,
        meta.imu_frame,
        meta.mounting_rpy_deg,
        meta.lever_arm_frd_m,
        wheels=_table(path, data, "wheel_t", WHEEL_ARRAYS) if {"wheel_t", "wheel_v"} <= set(data) else None,
    )


def _arrays(path: Path) -> Mapping[str, NDArray[np.generic]]:
    stored, unread = stored_arrays(path)
    wanted = {
        "imu_t",
        "gnss_t",
        "ref_t",
        "wheel_t",
        "gyro",
        "accel",
        "meta",
        *FIX_ARRAYS,
        *REFERENCE_ARRAYS,
        *WHEEL_ARRAYS,
        *SOLUTION_ARRAYS,
    }
    if bad := [name for name in unread if name in wanted]:
        raise DataError(
            f"{path}: {bad[0]}: expected an array of numbers or a text, got {unread[bad[0]]}; save it anew"
        )
    return {name: array.read() for name, array in stored.items() if name in wanted}


def _meta(path: Path, data: Mapping[str, NDArray[np.generic]]) -> _Installation:
    """Return the settings of the installation, none where there is no ``meta``."""
    if "meta" not in data:
        return _Installation()
    source = f"{path}: meta"
    stated = data["meta"].item() if data["meta"].size == 1 else None
    if isinstance(stated, bytes):
        stated = stated.decode(errors="replace")
    if not isinstance(stated, str):
        raise DataError(f"{source}: expected one text of JSON, got an array of shape {data['meta'].shape}")
    return load(parse_json(stated, source=source), _Installation, source=source)


def _solutions(path: Path, data: Mapping[str, NDArray[np.generic]]) -> FloatArray:
    """Return the classes of solution of the fixes, by their numbers in `SOLUTIONS`, NaN where none are stated."""
    count = data["gnss_t"].size
    for name in SOLUTION_ARRAYS:
        if (found := data.get(name)) is not None:
            if found.shape != (count,) or found.dtype.kind not in "fiu":
                raise DataError(
                    f"{path}: expected numbers of shape {(count,)} in {name}, got shape {found.shape}, {_kind(found)}"
                )
            numbers = found.astype(float)
            return solutions(numbers, OF_RTKLIB) if name == "gnss_q" else numbers
    return np.full(count, np.nan)


def _table(
    path: Path, data: Mapping[str, NDArray[np.generic]], clock: str, names: tuple[str, ...]
) -> FloatArray:
    """Return a clock and the triples along it, NaN for absent ones; (n, 1 + 3 per name)."""
    t = data[clock]
    if t.dtype.kind not in "fiu" or t.size != len(np.atleast_1d(t)):
        raise DataError(
            f"{path}: expected stamps, s, of shape (n,) in {clock}, got shape {t.shape}, {_kind(t)}"
        )
    columns = [np.asarray(t, dtype=float).reshape(-1, 1)]
    for name in names:
        found = data.get(name, np.full((t.size, 3), np.nan))
        if found.shape != (t.size, 3) or found.dtype.kind not in "fiu":
            raise DataError(
                f"{path}: expected numbers of shape {(t.size, 3)} in {name}, three a stamp of {clock}, "
                f"got shape {found.shape}, {_kind(found)}"
            )
        columns.append(np.asarray(found, dtype=float))
    return np.hstack(columns)


def _kind(found: NDArray[np.generic]) -> str:
    return {"U": "text", "S": "text", "b": "true and false"}.get(found.dtype.kind, f"type {found.dtype}")
