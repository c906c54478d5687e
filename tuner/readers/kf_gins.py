"""Drives in the text layout of KF-GINS: a YAML that names the files and states the errors at the start.

==============================  ===============================================================================
imupath                         t s, angle increments x y z rad, velocity increments x y z m/s, forward-right-down;
                                behind a gap of 0.1 s or more still those of one interval, 1/imudatarate
gnsspath                        t s, latitude, longitude deg, height m, sd north east down m; or 13 columns: velocity
                                behind the height, the sds of the position are the 8th to 10th
starttime, endtime              s: what is processed; endtime < 0 stands for the end
initgyrbias deg/h, initaccbias  measured = (1 + scale) true + bias, as KF-GINS takes them out at its start
mGal, initgyrscale ppm,
initaccscale ppm
antlever                        from the unit to the antenna, forward, right, down, m
NAME-truth.nav, or truth.nav    optional, beside the YAML: week, t, latitude, longitude deg, height m, velocity north
                                east down m/s, roll, pitch, yaw deg
compensated                     our own entry: what a configuration takes out of the drive is taken out
initpos deg deg m, initvel m/s, the start: position, velocity north, east, down, roll pitch yaw, at starttime; where
initatt deg                     one is missing, the drive is aligned from its own fixes
==============================  ===============================================================================

Commas, blanks or tabs separate the columns.

Source: README.md (2.2), dataset/kf-gins.yaml, src/fileio and src/kf-gins/gi_engine.cpp of
https://github.com/i2Nav-WHU/KF-GINS (facts only).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from models.units import unit_value
from tuner.formats.codec import load
from tuner.formats.documents import parse_yaml
from tuner.readers.drive_npz import DriveArrays
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import find_dialect
from tuner.types.number_ranges import Finite, LeverArm, Positive, Vector3
from tuner.types.records import DataError

MIN_GAP = 0.1
"""Distance of stamps from which an increment is taken for one of 1/imudatarate, s."""
DEFAULT_RATE = 200.0
"""imudatarate where the file has none, Hz."""
BIAS_ENTRIES = (("initgyrbias", "deg/h"), ("initaccbias", "mGal"))
SCALE_ENTRIES = (("initgyrscale", "ppm"), ("initaccscale", "ppm"))


def read_kf_gins(path: Path) -> DriveArrays:
    """Read the drive of a YAML of KF-GINS.

    Raises
    ------
    DataError
        No such YAML, settings that are none, or files that are not in this layout.
    """
    settings = _settings(path)
    imu, fixes = (_numbers(_beside(path, name)) for name in (settings.imupath, settings.gnsspath))
    if imu.shape[1] < 7 or fixes.shape[1] not in (7, 13):
        raise DataError(
            f"{path}: expected 7 columns or more in the IMU file and 7 or 13 in the GNSS file, got {imu.shape[1]} "
            f"and {fixes.shape[1]}"
        )
    notes: list[str] = []
    # Of the three gyroscopes, then of the accelerometers, SI.
    bias, scale = (
        np.concatenate([unit_value(unit) * np.array(getattr(settings, name)) for name, unit in entries])
        for entries in (BIAS_ENTRIES, SCALE_ENTRIES)
    )
    if bias.any() or scale.any():
        notes.append("the initial sensor errors of the settings are taken out")
    interval = 1.0 / settings.imudatarate
    dt = np.diff(imu[:, 0], prepend=imu[0, 0] - interval)
    dt = np.where(dt < MIN_GAP, dt, interval)
    rates = (imu[:, 1:7] / np.where(dt > 0.0, dt, np.nan)[:, None] - bias) / (1.0 + scale)
    begin = -math.inf if settings.starttime is None else settings.starttime
    end = settings.endtime if settings.endtime >= 0.0 else math.inf
    inside = (imu[:, 0] >= begin) & (imu[:, 0] <= end)
    if not inside.all():
        notes.append(f"{np.count_nonzero(~inside)} inertial rows outside starttime … endtime left out")
    blank = np.full((len(fixes), 3), np.nan)
    sds = fixes[:, 7:10] if fixes.shape[1] == 13 else fixes[:, 4:7]
    start = _start(settings, imu[:, 0], notes)
    return DriveArrays(
        np.column_stack([imu[:, 0], rates])[inside],
        np.column_stack([fixes[:, :4], blank, sds, blank]),
        _truth(path),
        "FRD",
        lever_arm=settings.antlever,
        notes=tuple(notes),
        start=start,
        compensated=settings.compensated,
    )


@dataclass(frozen=True, kw_only=True)
class _Settings:
    """The entries of a YAML of KF-GINS that are read."""

    imupath: str
    gnsspath: str
    imudatarate: Positive = DEFAULT_RATE
    starttime: Finite | None = None
    endtime: Finite = -1.0
    antlever: LeverArm | None = None
    initpos: Vector3 | None = None
    initvel: Vector3 | None = None
    initatt: Vector3 | None = None
    initgyrbias: Vector3 = (0.0, 0.0, 0.0)
    initaccbias: Vector3 = (0.0, 0.0, 0.0)
    initgyrscale: Vector3 = (0.0, 0.0, 0.0)
    initaccscale: Vector3 = (0.0, 0.0, 0.0)
    compensated: bool = False


def _settings(path: Path) -> _Settings:
    """Return the settings of a YAML of KF-GINS."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path}: expected a YAML of KF-GINS, got no text from byte {error.start + 1} on"
        ) from None
    found = parse_yaml(text, source=str(path), expected="a YAML of KF-GINS")
    if not isinstance(found, dict) or not {"imupath", "gnsspath"} <= found.keys():
        raise DataError(f"{path}: expected a YAML of KF-GINS with imupath and gnsspath")
    return load(found, _Settings, source=str(path))


def _start(settings: _Settings, t: FloatArray, notes: list[str]) -> FloatArray | None:
    """Return time, position, velocity and angles of the start, shape (10,), at the first inertial row of the run.

    None where one of them is not stated, or states a time before the record, which KF-GINS refuses.
    """
    begin, parts = settings.starttime, (settings.initpos, settings.initvel, settings.initatt)
    if begin is None or any(part is None for part in parts) or begin > t[-1]:
        return None
    if begin < t[0]:
        notes.append(
            f"starttime is {t[0] - begin:.3f} s before the inertial record: the stated start is not used"
        )
        return None
    first = t[np.searchsorted(t, begin)]
    return np.concatenate([[first], *(part for part in parts if part is not None)])


def _truth(path: Path) -> FloatArray | None:
    file = next(
        (f for n in (f"{path.stem}-truth.nav", "truth.nav") if (f := path.with_name(n)).is_file()), None
    )
    if file is None:
        return None
    rows = _numbers(file)
    if rows.shape[1] != 11:
        raise DataError(
            f"{file}: expected 11 columns, week, t, position, velocity and angles, got {rows.shape[1]}"
        )
    return rows[:, 1:]


def _beside(path: Path, name: str) -> Path:
    """Return the file a YAML names, relative to it; else the file of that name beside it."""
    found = next((f for f in (path.parent / name, path.parent / Path(name).name) if f.is_file()), None)
    if found is None:
        raise DataError(f"{path.parent / name}: expected this file, which {path.name} names, found nothing")
    return found


def _numbers(path: Path) -> FloatArray:
    """Return the numbers of a text file, shape (n, m)."""
    dialect = find_dialect(path)
    (rows,) = read_numbers(path, dialect, [range(len(dialect.names))])
    return rows
