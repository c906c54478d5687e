"""Measured drives: a folder of CSV files, an NPZ, or the text files of KF-GINS.

=============  ================================================================================================
folder         ``imu.csv`` as any log; ``gnss.csv``: t, lat, lon [deg], height, vn, ve, vd, sd_n, sd_e, sd_d,
               sd_vn, sd_ve, sd_vd, solution (its class as in GGA, 4: RTK fixed); ``truth.csv``, optional: t, lat,
               lon, height, vn, ve, vd, roll, pitch, yaw; ``wheels.csv``, optional: t, vx, vy, vz, sd_vx, sd_vy,
               sd_vz, forward, right, down;
               a unit may follow in brackets: ``vn [km/h]``; in place of ``gnss.csv`` a solution of RTKLIB
               (``.pos``), an NMEA log (``.nmea``), a UBX log (``.ubx``) or text of Waypoint: `tuner.readers.fixes`;
               in place of ``truth.csv`` text of Inertial Explorer with attitude: `tuner.readers.waypoint`
NPZ            its arrays: `tuner.readers.drive_npz`
KF-GINS        its YAML: `tuner.readers.kf_gins`
=============  ================================================================================================

Stamps out of order, doubled rows, unreadable rows and fixes outside the inertial record are removed and
counted; the scatter of stamps about an even clock is taken out (`tuner.readers.steady_stamps`).
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.formats.customary_units import percent
from tuner.formats.guard import input_guard
from tuner.readers import read
from tuner.readers.columns import digest
from tuner.readers.drive_checks import expect_streams
from tuner.readers.drive_npz import DriveArrays, read_drive_npz
from tuner.readers.drive_tables import ordered, table, table_of_fixes
from tuner.readers.fixes import READERS as FIX_READERS
from tuner.readers.fixes import fix_files, read_fix_file, reference_files
from tuner.readers.fixes.gps_time import on_clock_of
from tuner.readers.kf_gins import read_kf_gins
from tuner.readers.log_format import file_of, format_of, library_of, log_folder
from tuner.readers.options import STAMP
from tuner.readers.pose_run import POSE_FILES
from tuner.readers.refusal import without_options
from tuner.readers.source_kind import drive_in_messages, is_drive_by_form, with_name
from tuner.readers.steady_stamps import steady_stamps
from tuner.readers.waypoint import read_waypoint
from tuner.types.arguments import expect
from tuner.types.named_cause import NamedCause, one_line
from tuner.types.number_ranges import LONGEST_LEVER_ARM
from tuner.types.one_line import printable
from tuner.types.records import BodyVelocity, DataError, Drive, Gnss, Reference, Start
from tuner.types.repair import Repair

CONTENT = "a drive: arrays and settings, one row a sample or fix"
"""What is expected of a file, for messages."""
FRAMES: Mapping[str, tuple[float, float, float]] = {
    "FRD": (0.0, 0.0, 0.0),
    "FLU": (180.0, 0.0, 0.0),
    "RFU": (180.0, 0.0, 90.0),
}
"""Mounting (roll, pitch, yaw, deg) of a unit whose axes point forward, right, up and so on."""
_TRUTH_COLUMNS = ("t", "lat", "lon", "height", "vn", "ve", "vd", "roll", "pitch", "yaw")

_WHEEL_COLUMNS = ("t", "vx", "vy", "vz", "sd_vx", "sd_vy", "sd_vz")


def read_drive(path: str | Path) -> Drive:
    """Read a drive.

    Parameters
    ----------
    path : str or Path
        A folder, an NPZ or a YAML of KF-GINS.

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    expect(
        path,
        (str, Path),
        "drive",
        "the path of a drive: a folder, an NPZ, a log of messages or a YAML of KF-GINS",
    )
    path = file_of(Path(path))
    if not path.exists():
        raise DataError(
            f"{path}: expected a drive (folder with imu.csv and gnss.csv, NPZ, or YAML of KF-GINS), found nothing"
        )
    readers = {".npz": read_drive_npz, ".yaml": read_kf_gins, ".yml": read_kf_gins}
    read_arrays, content = readers.get(path.suffix.lower(), _messages), CONTENT
    if path.is_dir() and log_folder(path) is None:
        read_arrays, content = _folder, "a drive: imu.csv, gnss.csv and perhaps truth.csv"
    with input_guard(path, content):
        return _drive(path, read_arrays(path))


def read_if_drive(source: str | Path) -> Drive | None:
    """Read a drive, as `read_drive`; None where the source is a log of the inertial unit alone.

    A log of messages has to be read to tell: once, not once to tell and once more for the drive.
    """
    path = file_of(Path(source))
    by_form = is_drive_by_form(path)
    if by_form is not None:
        return read_drive(path) if by_form else None
    found = drive_in_messages(path)
    if found is None:
        return None
    with input_guard(path, CONTENT):
        return _drive(path, found)


def mounting_of(frame: str | None, rpy_deg: Any) -> FloatArray | None:
    """Return the matrix from vehicle axes to sensor axes, from a frame name such as RFU or from angles, deg.

    What follows the name, as in ``FRD after mounting``, is a remark.
    """
    if rpy_deg is not None:
        return rotation.mat_from_rpy(np.radians(np.asarray(rpy_deg, dtype=float)))
    key = next(iter((frame or "").upper().replace(",", " ").split()), "")
    return rotation.mat_from_rpy(np.radians(FRAMES[key])) if key in FRAMES else None


def with_mounting(
    drive: Drive,
    *,
    frame: str | None = None,
    rpy_deg: tuple[float, float, float] | None = None,
    lever_arm: tuple[float, float, float] | None = None,
) -> Drive:
    """Return a drive with mounting and lever arm as its user states them, in place of those of the file.

    Parameters
    ----------
    drive : Drive
        The drive.
    frame : str, optional
        Axes of the sensor in the vehicle, a key of `FRAMES`.
    rpy_deg : tuple of 3 floats, optional
        Mounting angles roll, pitch, yaw, deg; they go before `frame`.
    lever_arm : tuple of 3 floats, optional
        From the inertial unit to the antenna, forward, right, down, m.

    Raises
    ------
    DataError
        For an unknown frame, or a lever arm that is not three numbers, is longer than `LONGEST_LEVER_ARM`, or is of
        a unit whose axes in the vehicle nothing states.
    """
    if frame is not None and frame.upper() not in FRAMES:
        raise DataError(f"--imu-frame {frame}: expected one of {' '.join(FRAMES)}")
    stated = mounting_of(frame, rpy_deg)
    mounting = drive.mounting if stated is None else stated
    if lever_arm is None:
        return replace(drive, mounting=mounting)
    where = f"--lever-arm {','.join(f'{x:g}' for x in lever_arm)}"
    if len(lever_arm) != 3:
        raise DataError(f"{where}: expected three numbers")
    if max(map(abs, lever_arm)) > LONGEST_LEVER_ARM:
        raise DataError(f"{where}: expected {LONGEST_LEVER_ARM:g} m at most")
    if mounting is None and any(lever_arm):
        raise DataError(
            f"{where}: expected a drive that states the axes of the unit in the vehicle, as an NPZ does by imu_frame, "
            "found none; state them by --imu-frame"
        )
    return replace(drive, mounting=mounting, lever_arm=lever_arm)


def _messages(path: Path) -> DriveArrays:
    declared = format_of(path)
    if declared.drive is None:
        raise DataError(
            f"{path}: expected a drive (folder, .npz, .yaml of KF-GINS, or a log of messages: .ulg .bag .mcap .bin), "
            f"got {declared.title}; make a folder with imu.csv and gnss.csv of it"
        )
    with library_of(declared, path):
        return declared.drive(path)


def _folder(path: Path) -> DriveArrays:
    if not (path / "imu.csv").is_file():
        raise DataError(f"{path / 'imu.csv'}: expected this file in the folder of a drive, found nothing")
    try:
        inertial = read(
            path / "imu.csv",
            constant_axes=True,
            assume="si",
            memory=sys.float_info.max,
            stamps=True,
        )
    except DataError as error:  # the options of a log are none of a drive: its header says the same
        said = re.sub(r"pass --columns 't=([^']*)'(?! --)", r"write '\1' into the header", str(error))
        raise DataError(without_options(said)) from None
    records = {r.name: r for r in inertial}
    found = [axis for record in records.values() for axis in record.axes]
    if len(found) != 6:
        raise DataError(
            f"{path / 'imu.csv'}: expected three axes of gyroscope and accelerometer, found {' '.join(found)}"
        )
    gyro, accel = records["gyro"], records["accel"]
    stamps = gyro.covariates.get(STAMP)  # as the file has them; the even ones where those are coarse
    t = gyro.t if stamps is None or np.any(np.diff(stamps) <= 0.0) else stamps
    imu = np.column_stack([t, gyro.y, accel.y])
    fixes, notes = _fixes_beside(path, imu)
    truth, more = _truth_beside(path, imu)
    own = (note.replace("as --assume si says", "as nothing states it") for note in gyro.notes)
    wheels = path / "wheels.csv"
    return DriveArrays(
        imu,
        fixes,
        truth,
        notes=(*own, *notes, *more),
        wheels=table(wheels, _WHEEL_COLUMNS, 2) if wheels.is_file() else None,
    )


def _fixes_beside(path: Path, imu: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the fixes in the folder of a drive, of ``gnss.csv`` or the one file of a receiver, on the IMU's clock."""
    if (path / "gnss.csv").is_file():
        return table_of_fixes(path / "gnss.csv", float(imu[0, 0]), float(imu[-1, 0])), ()
    found = fix_files(path)
    if len(found) != 1:
        names = ", ".join(file.name for file in found) or "nothing"
        integrated = ", ".join(file.name for file in reference_files(path))
        hint = (
            f"; {integrated} has attitude: it is a reference, export the GNSS epochs, too"
            if integrated
            else ""
        )
        poses = next((name for name in POSE_FILES if (path / name).is_file()), None)
        if poses is not None:
            hint = f"; with {poses} it is a run with poses, for tune beside a log at rest"
        raise DataError(
            f"{path}: expected gnss.csv or one file {' '.join(FIX_READERS)} or text of Waypoint beside imu.csv, found "
            f"{names}{hint}"
        )
    (file,) = found
    fixes = read_fix_file(file)
    rows, note = on_clock_of(file, fixes, float(imu[0, 0]), float(imu[-1, 0]))
    return rows, (*fixes.notes, note)


def _truth_beside(path: Path, imu: FloatArray) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return the reference in the folder of a drive, of ``truth.csv`` or Inertial Explorer, on the IMU's clock."""
    if (path / "truth.csv").is_file():
        return table(path / "truth.csv", _TRUTH_COLUMNS, 4), ()
    found = reference_files(path)
    if not found:
        return None, ()
    if len(found) > 1:
        raise DataError(
            f"{path}: expected one reference, found {', '.join(file.name for file in found)}; leave one"
        )
    solution = read_waypoint(found[0])
    rows, note = on_clock_of(found[0], solution, float(imu[0, 0]), float(imu[-1, 0]))
    return rows, (*solution.notes, note)


def _drive(path: Path, found: DriveArrays) -> Drive:
    """Clean the streams and put them on one clock."""
    messages, repairs = list(found.notes), list[Repair]()
    mounting = mounting_of(found.frame, found.mounting_rpy_deg)
    if found.frame and mounting is None:
        messages.append(
            NamedCause.of(
                f"the file calls the axes of the unit '{found.frame}', which is none of {' '.join(FRAMES)}",
                "certain",
                "attitudes are those of the unit, not of the vehicle",
                "state them by --imu-frame",
            )
        )
    imu = ordered(path, "IMU", found.imu, found.imu, messages, repairs)
    fixes = ordered(path, "GNSS", found.fixes, found.fixes[:, :4], messages, repairs)
    for rows, whose in ((imu, "inertial unit"), (fixes, "receiver")):
        rows[:, 0], scatter = steady_stamps(rows[:, 0])
        if scatter:
            messages.append(
                f"stamps of the {whose} scatter by {1e3 * scatter:.2g} ms (sd) about an even clock: taken out"
            )
    for block in (slice(7, 10), slice(10, 13)):
        _resolve_zeros(fixes[:, block])
    begin, end = imu[0, 0], imu[-1, 0]
    inside = (fixes[:, 0] >= begin) & (fixes[:, 0] <= end)
    if np.count_nonzero(inside) < 2:
        raise DataError(
            f"{path}: expected two fixes or more of the time of the IMU, {begin:.3f} … {end:.3f} s, got "
            f"{np.count_nonzero(inside)} of {len(fixes)}, {fixes[0, 0]:.3f} … {fixes[-1, 0]:.3f} s; "
            "put both on one clock"
        )
    if not inside.all():
        messages.append(f"{np.count_nonzero(~inside)} fixes outside the inertial record removed")
    fixes = fixes[inside]
    if not fixes[:, 6].any() and fixes[:, 4:6].any():
        fixes[:, 6] = np.nan
        messages.append("vertical velocities are 0 in every fix: taken as not measured")
    expect_streams(path, imu, fixes)
    repeats = int(np.count_nonzero(np.all(np.diff(imu[:, 1:], axis=0) == 0.0, axis=1)))
    if repeats:
        messages.append(
            f"{repeats} inertial rows repeat the one before ({percent(repeats / len(imu))}): kept"
        )
    llh = np.column_stack([np.radians(fixes[:, 1:3]), fixes[:, 3]])
    gnss = Gnss(
        fixes[:, 0] - begin, llh, fixes[:, 4:7], fixes[:, 7:10], fixes[:, 10:13], fixes[:, 13:].ravel()
    )
    return Drive(
        printable(with_name(path).stem),
        imu[:, 0] - begin,
        imu[:, 1:],
        gnss,
        None if found.truth is None else _reference(path, found.truth, begin, messages),
        float(begin),
        found.lever_arm,
        mounting,
        printable(with_name(path).name),
        digest(path / "imu.csv" if (path / "imu.csv").is_file() else path),
        one_line(messages),
        tuple(repairs),
        start=None if found.start is None else _start(found.start, begin, float(gnss.llh[0, 1])),
        compensated=found.compensated,
        wheels=None if found.wheels is None else _wheels(path, found.wheels, begin, messages),
    )


def _wheels(path: Path, rows: FloatArray, begin: float, notes: list[str]) -> BodyVelocity:
    rows = ordered(path, "wheels", rows, rows[:, :2], notes)
    return BodyVelocity(rows[:, 0] - begin, rows[:, 1:4], rows[:, 4:7])


def _start(row: FloatArray, begin: float, longitude: float) -> Start:
    """Return a start, on the side of the date line on which the first fix is, rad."""
    llh = np.array([*np.radians(row[1:3]), row[3]])
    llh[1] += 2.0 * np.pi * np.round((longitude - llh[1]) / (2.0 * np.pi))
    return Start(float(row[0] - begin), llh, row[4:7], np.radians(row[7:10]))


def _resolve_zeros(sd: FloatArray) -> None:
    """Put half of the least sd in place of zeros beside others of a fix, which were rounded to nothing; in place."""
    positive = sd > 0.0
    if positive.any():
        sd[(sd == 0.0) & positive.any(axis=1, keepdims=True)] = 0.5 * sd[positive].min()


def _reference(path: Path, rows: FloatArray, begin: float, notes: list[str]) -> Reference:
    rows = ordered(path, "reference", rows, rows[:, :4], notes)
    llh = np.column_stack([np.radians(rows[:, 1:3]), rows[:, 3]])
    sd = None
    if rows.shape[1] > 10 and np.isfinite(rows[:, 10:]).any():
        sd = np.hstack([rows[:, 10:16], np.radians(rows[:, 16:19])])
    return Reference(rows[:, 0] - begin, llh, rows[:, 4:7], np.radians(rows[:, 7:10]), sd)
