"""Recordings of phones: a folder or ZIP with one CSV a sensor, as phyphox and Sensor Logger export.

Gyroscope and accelerometer are stamped each by itself. Samples are paired by their order from the first common stamp
on, so that none is repeated, left out or interpolated; where the two clocks part by more than a sample, each file must
be read alone. With fixes beside the sensors it is a drive.
"""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from models.arrays import FloatArray, IntArray
from models.units import unit_value
from tuner.formats.files import temporary_place
from tuner.readers.column_names import SENSORS, TIME_UNITS, known_unit, parse_name
from tuner.readers.columns import FREE_BYTES, MAX_EXPANSION, Listing, listing_of_arrays
from tuner.readers.drive_npz import DriveArrays
from tuner.readers.drive_tables import table_of_fixes
from tuner.readers.log_format import LogFormat
from tuner.readers.messages.streams import MIN_FIXES
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import find_dialect
from tuner.types.records import DataError

MAX_UNPACKED = 1 << 32
"""Largest size of a member of a ZIP that is unpacked, bytes: days of a phone's samples."""
LOGGER = "Sensor Logger"
"""It writes ``seconds_elapsed`` or, in its versions of 2021, stamps since 1970 alone; phyphox writes neither."""
GYRO = ("gyroscopeuncalibrated.csv", "gyroscope.csv", "gyro.csv", "*_gyro.csv")
ACCEL = ("accelerometer.csv", "acceleration.csv", "acc.csv", "accel.csv", "*_acc.csv", "*_accel.csv")
ACCEL_OF_LOGGER = ("totalacceleration.csv", "accelerometeruncalibrated.csv")
FIXES = ("locationgps.csv", "location.csv", "gnss.csv", "gps.csv", "*_gnss.csv", "*_gps.csv")
"""Names of files in lower case, the preferred first.

Uncalibrated readings go first: a phone subtracts from the others a bias that it estimates as it goes. Sensor Logger's
``Accelerometer.csv`` is without gravity.
"""
MOST_APART = 1.5
"""Distance of stamps of samples that count as taken together, intervals: phones stamp one sensor after the other."""
IN_G = 0.1
"""Distance from 1 of the usual force within which it is in g: so it is on iPhones, and no phone rests at 1 m/s²."""
SAME_STEP, LEAST_PAIRED = 0.005, 0.9
"""Relative difference of the usual intervals, and share of samples with a fellow, of sensors that run at one rate but
lost samples of their own: the rest is left out. Two clocks of a phone differ by less than 0.01 %."""
SHIFTS = (0.0, 0.25, -0.25)
"""Shifts of the stamps before the nearest is looked for, intervals: halfway between two, jitter alone would choose."""
FIRST_STAMP_OF_2001 = 1e18
"""ns since 1970."""


def list_phone(path: Path) -> Listing:
    """Return the samples of gyroscope and accelerometer on the gyroscope's stamps.

    Raises
    ------
    DataError
        Where the files of the sensors are not there, or their clocks part.
    """
    with _unpacked(path) as folder:
        rows, units, notes = _sensors(path, folder)
    sensors = {"gyro": rows[:, 1:4], "accel": rows[:, 4:]}
    arrays = {name: values for name, values in {"t": rows[:, 0], **sensors}.items() if values.size}
    found = listing_of_arrays(path, arrays, units={"t": "s", **units}, meta={}, notes=notes)
    return replace(found, stream=None, rows=0)


def drive_of_phone(path: Path) -> DriveArrays:
    """Return the drive of a phone whose fixes are beside its sensors.

    Raises
    ------
    DataError
        As `list_phone`, and where a sensor or the fixes are missing.
    """
    with _unpacked(path) as folder:
        rows, units, notes = _sensors(path, folder)
        place = _file(folder, FIXES)
        if rows.shape[1] < 7 or place is None:
            raise DataError(
                f"{path}: expected gyroscope, accelerometer and fixes of a drive, found "
                f"{', '.join(sorted(file.name for file in folder.iterdir()))}"
            )
        fixes = table_of_fixes(place, rows[0, 0], rows[-1, 0])
        if len(fixes) < MIN_FIXES:
            raise DataError(f"{place}: expected {MIN_FIXES} fixes or more, found {len(fixes)}")
    factors = np.repeat([1.0, *(unit_value(units[name]) for name in SENSORS)], [1, 3, 3])
    return DriveArrays(factors * rows, fixes, notes=(*notes, f"fixes of {place.name}"))


def _file(folder: Path, names: tuple[str, ...]) -> Path | None:
    """Return the first file of some names, or None; of a pattern that several files fit none is meant."""
    for name in names:
        found = [file for file in folder.iterdir() if fnmatch(file.name.lower(), name)]
        if len(found) == 1 and found[0].is_file():
            return found[0]
    return None


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    """Give the folder with the files of a folder or ZIP."""
    if path.is_dir():
        yield path
        return
    with temporary_place(Path(tempfile.mkdtemp(prefix="tuner-phone-"))) as folder:
        try:
            with zipfile.ZipFile(path) as archive:
                for member in archive.infolist():
                    name = Path(member.filename).name
                    wanted = any(
                        fnmatch(name.lower(), one) for one in (*GYRO, *ACCEL, *ACCEL_OF_LOGGER, *FIXES)
                    )
                    if not wanted or member.is_dir():
                        continue
                    if member.file_size > min(
                        MAX_UNPACKED, max(FREE_BYTES, MAX_EXPANSION * member.compress_size)
                    ):
                        size = member.file_size
                        raise DataError(
                            f"{path}: {name} unpacks to {size} bytes: unpack it yourself and name the folder"
                        )
                    with archive.open(member) as packed, (folder / name).open("wb") as unpacked:
                        shutil.copyfileobj(packed, unpacked)
        except (
            OSError,
            zipfile.BadZipFile,
            NotImplementedError,
            RuntimeError,
            EOFError,
            ValueError,
        ) as error:
            raise DataError(
                f"{path}: cannot be unpacked: {error}; unpack it yourself and name the folder"
            ) from None
        try:
            yield folder
        except DataError as error:
            raise DataError(str(error).replace(str(folder), str(path))) from None


def _sensors(path: Path, folder: Path) -> tuple[FloatArray, dict[str, str], tuple[str, ...]]:
    """Return stamps, s, and samples of both sensors, (n, 7), or of the gyroscope alone, (n, 4); units; notes."""
    gyro = _file(folder, GYRO)
    of_gyro = None if gyro is None else _columns(gyro)
    if gyro is None or of_gyro is None:
        raise DataError(
            f"{path}: expected Gyroscope.csv as phyphox or Sensor Logger export it; of another application name one "
            "CSV with its --columns"
        )
    rates, unit, logger = of_gyro
    accel = _file(folder, ACCEL_OF_LOGGER if logger else ACCEL)
    of_accel = None if accel is None else _columns(accel)
    units = {"gyro": unit or "rad/s"}
    source = f"{LOGGER if logger else 'a file a sensor'}: gyroscope of {gyro.name}"
    if accel is None or of_accel is None:
        return rates, units, (source,)
    forces, unit, _ = of_accel
    first, second = _paired(path, rates, forces)
    notes: tuple[str, ...] = (f"{source}, accelerometer of {accel.name}",)
    units["accel"] = unit or "m/s^2"
    usual = float(np.median(np.linalg.norm(second[:, 1:], axis=1)))
    if logger and unit is None and abs(usual - 1.0) < IN_G:
        units["accel"] = "g"
        notes += (f"{LOGGER} states no unit; its accelerometer reads {usual:.3g} in the median: g",)
    return np.hstack([first, second[:, 1:]]), units, notes


def _columns(path: Path) -> tuple[FloatArray, str | None, bool] | None:
    """Return time, s, and axes of a CSV, (n, 4), their unit as it is stated, and whether Sensor Logger wrote it.

    None where it has other columns.
    """
    dialect = find_dialect(path)
    names = [parse_name(written) for written in dialect.names]
    plain = [name.plain for name in names]
    clocks = [
        j for word in ("seconds_elapsed", "time") for j, one in enumerate(plain) if one.startswith(word)
    ]
    axes = [next((j for j, one in enumerate(plain) if one.split("_")[-1] == axis), None) for axis in "xyz"]
    places = [*clocks[:1], *(place for place in axes if place is not None)]
    if len(places) < 4:
        return None
    (rows,) = read_numbers(path, dialect, [places])
    clock = names[places[0]]
    since_1970 = clock.unit is None and len(rows) > 0 and rows[0, 0] > FIRST_STAMP_OF_2001
    rows[:, 0] *= 1e-9 if since_1970 else TIME_UNITS.get(clock.unit or "s", 1.0)
    stated = names[places[1]].unit
    logger = since_1970 or clock.plain == "seconds_elapsed"
    return rows, known_unit(stated) if stated else None, logger


def _paired(path: Path, gyro: FloatArray, accel: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rows of both sensors that belong together: in order, or where one lost samples, by their times."""
    step = float(np.median(np.diff(gyro[:, 0]))) if len(gyro) > 1 else 0.0
    begin = max(gyro[0, 0], accel[0, 0]) - 0.5 * step
    first, second = (x[int(np.searchsorted(x[:, 0], begin)) :] for x in (gyro, accel))
    count = min(len(first), len(second))
    if count > 1 and np.abs(first[:count, 0] - second[:count, 0]).max() <= MOST_APART * step:
        return first[:count], second[:count]
    other = float(np.median(np.diff(accel[:, 0]))) if len(accel) > 1 else 0.0
    if count > 1 and abs(other - step) < SAME_STEP * step:
        pairs = (_nearest(first[:, 0] + shift * step, second[:, 0], step) for shift in SHIFTS)
        rows, at = max(pairs, key=lambda pair: len(pair[0]))
        if len(rows) >= LEAST_PAIRED * count:
            return first[rows], second[at]
    rates = [1.0 / float(np.median(np.diff(x[:, 0]))) if len(x) > 1 else 0.0 for x in (gyro, accel)]
    raise DataError(
        f"{path}: gyroscope ({len(gyro)} samples, {rates[0]:.4g} Hz) and accelerometer ({len(accel)}, "
        f"{rates[1]:.4g} Hz) are not sampled together: unpack it and read Gyroscope.csv and the accelerometer's "
        "file one at a time"
    )


def _nearest(t: FloatArray, others: FloatArray, step: float) -> tuple[IntArray, IntArray]:
    """Return which stamps have a partner within three quarters of an interval, one for each, and the partners."""
    at = np.clip(np.searchsorted(others, t), 1, len(others) - 1)
    at -= t - others[at - 1] < others[at] - t
    near = np.abs(t - others[at]) <= MOST_APART / 2.0 * step
    rows = np.flatnonzero(near)
    own = np.diff(at[rows], prepend=-1) > 0
    return rows[own], at[rows[own]]


FORMAT = LogFormat(
    "phone",
    "ZIP or folder of phyphox or Sensor Logger",
    (".zip",),
    lambda path, _: list_phone(path),
    folder=lambda path: path.is_dir() and not (path / "imu.csv").is_file() and _file(path, GYRO) is not None,
    drive=drive_of_phone,
)
