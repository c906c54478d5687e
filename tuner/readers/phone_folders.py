"""Recordings of phones: a folder or ZIP with one CSV a sensor, as phyphox and Sensor Logger export.

Gyroscope and accelerometer are stamped each by itself. Samples are paired by their order from the first common stamp
on, so that none is repeated, left out or interpolated; where the two clocks part by more than a sample, each file must
be read alone.
"""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.arrays import FloatArray, IntArray
from tuner.formats.files import temporary_place
from tuner.readers.column_names import known_unit
from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.log_format import LogFormat
from tuner.readers.text import read_numbers
from tuner.readers.text_dialect import find_dialect
from tuner.types.records import DataError

MAX_UNPACKED = 1 << 32
"""Largest size of a member of a ZIP that is unpacked, bytes: days of a phone's samples."""
MAX_EXPANSION, FREE_BYTES = 200, 1 << 28
"""Unpacked ÷ packed that a member of more than `FREE_BYTES` may have: measured samples stay below 20."""


@dataclass(frozen=True)
class _App:
    """Files of an application, the preferred first, and the columns of time and axes in them.

    Stamps since 1970 are in ns and stand in columns of exactly these names; others may have a sensor before the axis.
    """

    title: str
    gyro: tuple[str, ...]
    accel: tuple[str, ...]
    columns: tuple[str, str, str, str]
    since_1970: bool = False


APPS = (
    _App(
        "Sensor Logger",
        ("GyroscopeUncalibrated.csv", "Gyroscope.csv"),
        ("TotalAcceleration.csv", "AccelerometerUncalibrated.csv"),
        ("seconds_elapsed", "x", "y", "z"),
    ),
    _App(
        "Sensor Logger",
        ("GyroscopeUncalibrated.csv", "Gyroscope.csv"),
        ("TotalAcceleration.csv", "AccelerometerUncalibrated.csv"),
        ("time", "x", "y", "z"),
        since_1970=True,
    ),
    _App(
        "phyphox",
        ("Gyroscope.csv",),
        ("Accelerometer.csv", "Acceleration.csv"),
        ("time", "x", "y", "z"),
    ),
)
"""Uncalibrated readings go first: a phone subtracts from the others a bias that it estimates as it goes.

Sensor Logger's ``Accelerometer.csv`` is without gravity; its versions of 2021 have stamps since 1970 alone.
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


def is_phone_folder(path: Path) -> bool:
    """Tell a folder with a gyroscope's CSV."""
    return path.is_dir() and any((path / name).is_file() for app in APPS for name in app.gyro)


def list_phone(path: Path) -> Listing:
    """Return the samples of gyroscope and accelerometer on the gyroscope's stamps.

    Raises
    ------
    DataError
        Where no application's files are there, or their clocks part.
    """
    if path.is_dir():
        return _list(path, path)
    with temporary_place(Path(tempfile.mkdtemp(prefix="tuner-phone-"))) as folder:
        try:
            with zipfile.ZipFile(path) as archive:
                wanted = {name for app in APPS for name in (*app.gyro, *app.accel)}
                for member in archive.infolist():
                    name = Path(member.filename).name
                    if name not in wanted or member.is_dir():
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
        return _list(path, folder)


def _list(path: Path, folder: Path) -> Listing:
    for app in APPS:
        gyro = next((folder / name for name in app.gyro if (folder / name).is_file()), None)
        if gyro is None:
            continue
        rates = _columns(gyro, app)
        if rates is None:
            continue
        accel = next((folder / name for name in app.accel if (folder / name).is_file()), None)
        force = None if accel is None else _columns(accel, app)
        notes: tuple[str, ...] = (
            f"{app.title}: gyroscope of {gyro.name}"
            + ("" if accel is None or force is None else f", accelerometer of {accel.name}"),
        )
        arrays: Mapping[str, FloatArray]
        units = {"t": "s", "gyro": rates.unit or "rad/s"}
        if force is None:
            arrays = {"t": rates.values[:, 0], "gyro": rates.values[:, 1:]}
        else:
            first, second = _paired(path, rates.values, force.values)
            arrays = {"t": first[:, 0], "gyro": first[:, 1:], "accel": second[:, 1:]}
            units["accel"] = force.unit or "m/s^2"
            usual = float(np.median(np.linalg.norm(second[:, 1:], axis=1)))
            if app.title == "Sensor Logger" and force.unit is None and abs(usual - 1.0) < IN_G:
                units["accel"] = "g"
                notes += (
                    f"{app.title} states no unit; its accelerometer reads {usual:.3g} in the median: g",
                )
        listing = listing_of_arrays(path, arrays, units=units, meta={})
        return Listing(path, listing.shapes, listing.load, listing.units, listing.integer, notes=notes)
    raise DataError(
        f"{path}: expected Gyroscope.csv as phyphox or Sensor Logger export it; of another application name one CSV "
        "with its --columns"
    )


@dataclass(frozen=True)
class _Columns:
    """Time, s, and axes of a CSV, shape (n, 4), and the unit that its header states; None where it states none."""

    values: FloatArray
    unit: str | None


def _columns(path: Path, app: _App) -> _Columns | None:
    """Return time and axes of a CSV, or None where it has other columns."""
    dialect = find_dialect(path)
    plain = [name.split("(")[0].strip().lower() for name in dialect.names]
    endings = ("",) if app.since_1970 else ("", " ", "_")
    places = [
        next(
            (
                j
                for j, name in enumerate(plain)
                for e in endings
                if name == word or (e and name.endswith(f"{e}{word}"))
            ),
            None,
        )
        for word in app.columns
    ]
    if any(place is None for place in places):
        return None
    (rows,) = read_numbers(path, dialect, [[place for place in places if place is not None]])
    if app.since_1970:
        if not len(rows) or rows[0, 0] < FIRST_STAMP_OF_2001:
            return None
        rows[:, 0] *= 1e-9
    stated = dialect.names[places[1] or 0].partition("(")[2].partition(")")[0]
    return _Columns(rows, known_unit(stated) if stated else None)


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
    folder=is_phone_folder,
)
