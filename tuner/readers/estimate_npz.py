"""A filter's output, or a truth, in an NPZ: the columns of a CSV as arrays, or whole vectors and matrices.

=====================================  ====================================================================
t                                      (n,), s
llh | ned, vned, rpy | quat            (n, 3): deg, deg, m | m, m/s, deg; (n, 4): w, x, y, z
bg, ba                                 (n, 3): rad/s, m/s²
sd_ned, sd_vned, sd_rpy                (n, 3): sds, m, m/s, deg
covariance                             (n, k, k), k = 3, 6, 9 or 15: position (m), velocity, attitude (rotation
                                       about north, east, down, rad), gyro and accelerometer biases
innovation, innovation_covariance      (n, 3 or 6), (n, 3 or 6, 3 or 6): position, velocity
outages                                (w, 2): begin and end, s
=====================================  ====================================================================

A drive as an NPZ is a truth by its reference, ``ref_t``, ``ref_llh`` and so on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from tuner.readers.estimate_column_names import canonical_name, is_known
from tuner.readers.estimate_columns import Frames, assemble
from tuner.readers.npz_members import stored_arrays
from tuner.types.filter_output import FilterOutput
from tuner.types.one_line import printable
from tuner.types.records import DataError

_VECTORS: Mapping[str, tuple[str, ...]] = {
    "llh": ("lat", "lon", "height"),
    "ned": ("n", "e", "d"),
    "vned": ("vn", "ve", "vd"),
    "rpy": ("roll", "pitch", "yaw"),
    "quat": ("qw", "qx", "qy", "qz"),
    "bg": ("bg_x", "bg_y", "bg_z"),
    "ba": ("ba_x", "ba_y", "ba_z"),
    "sd_ned": ("sd_n", "sd_e", "sd_d"),
    "sd_vned": ("sd_vn", "sd_ve", "sd_vd"),
    "sd_rpy": ("sd_roll", "sd_pitch", "sd_yaw"),
}
"""Arrays of several columns."""
_REFERENCE = {
    "ref_t": "t",
    "ref_llh": "llh",
    "ref_vned": "vned",
    "ref_rpy": "rpy",
    "ref_pstd": "sd_ned",
    "ref_vstd": "sd_vned",
    "ref_astd": "sd_rpy",
}


def read_estimate_npz(path: Path, frames: Frames) -> FilterOutput:
    """Read the arrays of a filter's output, or the reference of a drive.

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    data = _arrays(path)
    if "t" not in data and "ref_t" in data:
        data = {new: data[old] for old, new in _REFERENCE.items() if old in data}
    if "t" not in data or data["t"].ndim != 1 or not data["t"].size:
        if any(name.startswith("imu_") for name in data):
            raise DataError(
                f"{path}: this drive has no reference (ref_t, ref_llh, …): score it against a better solution"
            )
        raise DataError(
            f"{path}: expected an array t of times, s, found {', '.join(data) or 'no arrays of numbers'}"
        )
    n = len(data["t"])
    columns: dict[str, tuple[FloatArray, str | None]] = {}
    for name, array in data.items():
        if name in _VECTORS:
            wide = _shaped(path, name, array, (n, len(_VECTORS[name])))
            columns |= {own: (wide[:, j], None) for j, own in enumerate(_VECTORS[name])}
        elif array.shape == (n,) and is_known(canonical_name(name)[0]):
            columns[canonical_name(name)[0]] = (array, None)
    found = assemble(str(path), columns, frames)
    if "covariance" in data:
        found = replace(found, covariance=_covariance(path, data["covariance"], n), correlated=True)
    if "innovation" in data:
        z, s = _innovations(path, data, n)
        found = replace(found, innovation=z, innovation_covariance=s)
    if "outages" in data:
        windows = data["outages"]
        found = replace(found, outages=_shaped(path, "outages", windows, (len(windows), 2)))
    return found


def _arrays(path: Path) -> dict[str, FloatArray]:
    stored, unread = stored_arrays(path)
    if unread:
        name, why = next(iter(unread.items()))
        raise DataError(
            f"{path}: {printable(name)}: expected an array of numbers, got {why}; is it damaged? save it anew"
        )
    return {
        name: np.asarray(array.read(), dtype=float)
        for name, array in stored.items()
        if array.dtype.kind in "fiub"
    }


def _shaped(path: Path, name: str, array: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    if array.shape != shape:
        raise DataError(f"{path}: {name}: expected shape {shape}, found {array.shape}")
    return array


def _covariance(path: Path, array: FloatArray, n: int) -> FloatArray:
    k = array.shape[-1]
    if array.shape != (n, k, k) or k not in (3, 6, 9, 15):
        raise DataError(
            f"{path}: covariance: expected shape ({n}, k, k) with k = 3, 6, 9 or 15, found {array.shape}"
        )
    whole = np.full((n, 15, 15), np.nan)
    whole[:, :k, :k] = array
    return whole


def _innovations(path: Path, data: Mapping[str, FloatArray], n: int) -> tuple[FloatArray, FloatArray]:
    k = data["innovation"].shape[-1]
    if k not in (3, 6) or "innovation_covariance" not in data:
        raise DataError(
            f"{path}: innovation: expected shape ({n}, 3 or 6) and innovation_covariance beside it"
        )
    z, s = np.full((n, 6), np.nan), np.full((n, 6, 6), np.nan)
    z[:, :k] = _shaped(path, "innovation", data["innovation"], (n, k))
    s[:, :k, :k] = _shaped(path, "innovation_covariance", data["innovation_covariance"], (n, k, k))
    return z, s
