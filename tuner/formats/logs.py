"""Records and drives to files that any reader of the input format understands: CSV (plain or gzip) and NPZ.

Columns are ``t`` and the axes of the records, in SI units named in brackets in a text header, then the
covariates. Numbers are written in full: what is read back is equal to the last bit. Files appear whole or not
at all.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import in_degrees
from tuner.formats.files import whole_file
from tuner.types.records import DataError, Drive, Record

COVARIATE_UNITS = {"temperature": "degC"}
TRIADS = ("gyro", "accel")


def write_log(records: Sequence[Record], path: Path) -> None:
    """Write records in the format of the ending of the file: .csv, .csv.gz or .npz."""
    name = path.name.lower()
    if name.endswith(".npz"):
        write_npz(records, path)
    elif name.endswith((".csv", ".csv.gz")):
        write_csv(records, path)
    else:
        raise DataError(f"{path}: expected a name that ends in .csv, .csv.gz or .npz, got '{path.name}'")


def write_csv(records: Sequence[Record], path: Path) -> None:
    """Write records that share one clock as text with a header; gzip where the name ends in ``.gz``."""
    import pandas as pd

    columns = {"t [s]": _clock(records)}
    for record in records:
        columns |= {f"{axis} [{record.unit}]": record.column(axis) for axis in record.axes}
    for name, values in _covariates(records).items():
        unit = COVARIATE_UNITS.get(name)
        columns[f"{name} [{unit}]" if unit else name] = values
    frame = pd.DataFrame(columns)
    with whole_file(path) as temporary, temporary.open("wb") as raw:
        if path.suffix.lower() == ".gz":  # without name and time: the same log gives the same bytes
            with gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed:
                frame.to_csv(packed, index=False, mode="wb")
        else:
            frame.to_csv(raw, index=False, mode="wb")


def write_npz(records: Sequence[Record], path: Path) -> None:
    """Write records that share one clock as arrays: ``t``, ``gyro`` (n, 3), ``accel`` (n, 3), units, covariates.

    A sensor that has not exactly three axes is written as one array an axis.
    """
    arrays = {"t": _clock(records)}
    for record in records:
        if record.name in TRIADS and len(record.axes) == 3:
            arrays[record.name] = record.y
        else:
            arrays |= {axis: record.column(axis) for axis in record.axes}
        if record.name in TRIADS:
            arrays[f"{record.name}_unit"] = np.array(record.unit)
    arrays |= _covariates(records)
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def write_drive(drive: Drive, path: Path) -> None:
    """Write a drive as one NPZ: the arrays of `tuner.readers.drive`."""
    if path.suffix.lower() != ".npz":
        raise DataError(f"{path}: expected a name that ends in .npz, got '{path.name}'")
    with whole_file(path) as temporary:
        temporary.write_bytes(drive_npz(drive))


def drive_npz(drive: Drive) -> bytes:
    """Return a drive as the content of an NPZ."""
    gnss, begin = drive.gnss, drive.origin
    meta: dict[str, object] = {"name": drive.name, "lever_arm_frd_m": drive.lever_arm}
    if drive.mounting is not None:
        meta["mounting_rpy_deg"] = np.degrees(rotation.rpy_from_mat(drive.mounting)).tolist()
    arrays = {
        "imu_t": drive.imu_t + begin,
        "gyro": drive.rates[:, :3],
        "accel": drive.rates[:, 3:],
        "gnss_t": gnss.t + begin,
        "gnss_llh": in_degrees(gnss.llh),
        "gnss_vned": gnss.vel_n,
        "gnss_pstd": gnss.position_sd,
        "gnss_vstd": gnss.velocity_sd,
        "meta": np.array(json.dumps(meta)),
    }
    if drive.wheels is not None:
        arrays |= {"wheel_t": drive.wheels.t + begin, "wheel_v": drive.wheels.v, "wheel_sd": drive.wheels.sd}
    if drive.reference is not None:
        r = drive.reference
        arrays |= {
            "ref_t": r.t + begin,
            "ref_llh": in_degrees(r.llh),
            "ref_vned": r.vel_n,
            "ref_rpy": np.degrees(r.rpy),
        }
    content = BytesIO()
    np.savez(content, **arrays)  # type: ignore[arg-type]
    return content.getvalue()


def _clock(records: Sequence[Record]) -> FloatArray:
    if not records:
        raise ValueError("'records' must hold one record or more, got none")
    t = records[0].t
    if not all(np.array_equal(t, record.t) for record in records):
        raise ValueError("'records' must share one clock to be written to one file")
    return t


def _covariates(records: Sequence[Record]) -> dict[str, FloatArray]:
    return {name: values for record in records for name, values in record.covariates.items()}
