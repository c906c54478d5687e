"""Streams of a message log, and how a static log or a drive is made of them.

A message log may hold several inertial units. The first of the format's order that has most samples is used; a note
names the others and how to choose one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.readers.column_names import TIME_UNITS
from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.drive_npz import DriveArrays
from tuner.readers.source_kind import UNIT
from tuner.types.records import DataError

UNITS = {"gyro": "rad/s", "accel": "m/s^2", "temperature": "degC"}
"""Units of the arrays of every message log."""
MIN_FIXES = 10
"""Fixes from which a log counts as a drive: fewer do not align a filter."""


@dataclass(frozen=True)
class InertialStream:
    """Samples of one inertial unit.

    Attributes
    ----------
    name : str
        Topic or message with its instance, such as ``vehicle_imu.0`` or ``/imu/data``.
    t : ndarray, shape (n,)
        Stamps in `clock_unit`.
    arrays : mapping of str to ndarray
        ``gyro`` and ``accel``, (n, 3), one of them at least, and perhaps ``temperature``, (n,), in `UNITS`.
    clock_unit : str
        A key of `column_names.TIME_UNITS`.
    rank : int
        Place in the format's order of preference, 0 first.
    """

    name: str
    t: NDArray[Any]
    arrays: Mapping[str, NDArray[Any]]
    clock_unit: str
    rank: int = 0

    @property
    def complete(self) -> bool:
        """Whether it has both gyroscope and accelerometer."""
        return {"gyro", "accel"} <= set(self.arrays)

    def seconds(self) -> FloatArray:
        """Return the stamps, s."""
        return np.asarray(self.t, dtype=float) * TIME_UNITS[self.clock_unit]


@dataclass(frozen=True)
class FixStream:
    """Fixes of one receiver.

    Attributes
    ----------
    name : str
        Topic or message with its instance.
    rows : ndarray, shape (k, 13) or (k, 14)
        t, s, on the clock of the inertial samples; latitude, longitude, deg, height above the ellipsoid, m; velocity
        north, east, down, m/s; sds of both; class of solution; NaN where there is none.
    notes : tuple of str
        How the rows were understood.
    """

    name: str
    rows: FloatArray
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MessageLog:
    """What a message log holds for this package.

    Attributes
    ----------
    inertial : tuple of InertialStream
        Inertial units.
    fixes : tuple of FixStream
        Receivers.
    frame : str or None
        Axes of the units where the format defines them, such as FRD.
    topics : tuple of str
        Everything the file holds, for messages about what is missing.
    notes : tuple of str
        What was found damaged.
    cure : str
        How messages become readable that are not, for messages about what is missing.
    wheels : mapping of str to ndarray, shape (w, 7)
        Velocities of odometry by topic: t, s, forward, right, down, m/s, and their sds.
    """

    inertial: tuple[InertialStream, ...]
    fixes: tuple[FixStream, ...]
    frame: str | None = None
    topics: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    cure: str = ""
    wheels: Mapping[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))


def listing_of_log(path: Path, log: MessageLog, unit: str = "") -> Listing:
    """Return the columns of one inertial unit as ``t, gyro, accel, temperature``; without a name, the preferred one's.

    Then the others' columns follow by their topic.

    Raises
    ------
    DataError
        Where the log holds no inertial samples, or none of the unit named.
    """
    chosen = _named(path, log, unit) if unit else _preferred(path, log)
    arrays: dict[str, NDArray[Any]] = {"t": chosen.t, **chosen.arrays}
    units = {"t": chosen.clock_unit, **{part: UNITS[part] for part in chosen.arrays}}
    others = [stream for stream in log.inertial if stream is not chosen]
    notes = log.notes
    if (warm := _thermometer(chosen, others)) is not None:
        arrays["temperature"] = np.interp(chosen.seconds(), warm.seconds(), warm.arrays["temperature"])
        units["temperature"] = UNITS["temperature"]
        notes += (f"temperature of '{warm.name}', {len(warm.t)} values, between its stamps",)
    for stream in log.inertial if others and not unit else ():
        parts = {"t": stream.t, **{k: v for k, v in stream.arrays.items() if k != "temperature"}}
        arrays |= {f"{stream.name}/{part}": array for part, array in parts.items()}
        units |= {f"{stream.name}/{part}": UNITS.get(part, stream.clock_unit) for part in parts}
    if others and not unit:
        notes += (f"{_about_units(chosen, others)}: choose one by {_how_named(path, others)}",)
    found = listing_of_arrays(path, arrays, units=units, meta={})
    return replace(found, notes=(*found.notes, *notes), of_unit=lambda name: listing_of_log(path, log, name))


def _thermometer(chosen: InertialStream, others: Sequence[InertialStream]) -> InertialStream | None:
    """Return the stream whose temperature stands for that of a unit without: of its own instance, if there is one."""
    if "temperature" in chosen.arrays:
        return None
    number = chosen.name.rpartition(".")[2]
    warm = [s for s in others if "temperature" in s.arrays and len(s.t) > 1]
    return max(warm, key=lambda s: (s.name.rpartition(".")[2] == number, len(s.t)), default=None)


def _about_units(chosen: InertialStream, others: Sequence[InertialStream]) -> str:
    return f"inertial samples of {_sizes([chosen])}; the file also holds {_sizes(others)}"


def _how_named(path: Path, others: Sequence[InertialStream]) -> str:
    """Return what a command takes to read the most complete of other units."""
    other = max(others, key=lambda stream: (stream.complete, len(stream.t)))
    if UNIT.fullmatch(other.name):
        return f"{path.name}:{other.name}"
    kept = [part for part in other.arrays if part != "temperature"]
    return f"{path.name} --columns '{','.join(f'{part}={other.name}/{part}' for part in ('t', *kept))}'"


def _sizes(streams: Sequence[InertialStream]) -> str:
    return ", ".join(f"{stream.name} ({len(stream.t)} samples)" for stream in streams)


def drive_of_log(path: Path, log: MessageLog) -> DriveArrays:
    """Return the arrays of a drive: the preferred inertial unit and the receiver with most fixes.

    Raises
    ------
    DataError
        Where the log holds no complete inertial unit, or no fixes.
    """
    chosen = _preferred(path, log)
    if not chosen.complete:
        raise DataError(
            f"{path}: expected gyroscope and accelerometer in one stream, found {', '.join(chosen.arrays)}"
        )
    if not any(len(stream.rows) >= MIN_FIXES for stream in log.fixes):
        counts = ", ".join(f"{s.name} with {len(s.rows)}" for s in log.fixes) or "none that is read"
        unread = not log.fixes and any(re.search("gps|gnss", topic.lower()) for topic in log.topics)
        cure = (
            "make a folder with imu.csv and gnss.csv of it"
            if unread
            else "at rest it is a log: `tuner tune FILE`"
        )
        raise DataError(
            f"{path}: expected a receiver with {MIN_FIXES} fixes or more, found {counts} among {_some(log.topics)}; "
            f"{cure}"
        )
    fixes = max(log.fixes, key=lambda stream: len(stream.rows))
    imu = np.column_stack([chosen.seconds(), chosen.arrays["gyro"], chosen.arrays["accel"]])
    others = [stream for stream in log.inertial if stream is not chosen]
    noise = f"`tuner identify {_how_named(path, others)}` gives the noise of another" if others else ""
    notes: tuple[str, ...] = (f"{_about_units(chosen, others)}: {noise}",) if others else ()
    frame, wheels = log.frame, None
    if len(log.wheels) == 1:
        ((topic, wheels),) = log.wheels.items()
        frame = frame or "FLU"
        notes += (
            f"wheels are '{topic}'; axes of the unit are taken as forward, left, up, as REP 103 has them",
        )
    elif log.wheels:
        notes += (f"several topics of odometry, none taken as that of wheels: {_some(tuple(log.wheels))}",)
    return DriveArrays(imu, fixes.rows, frame=frame, notes=(*fixes.notes, *notes), wheels=wheels)


def _named(path: Path, log: MessageLog, unit: str) -> InertialStream:
    found = next((stream for stream in log.inertial if stream.name == unit), None)
    if found is None:
        present = _sizes(log.inertial) or f"none among {_some(log.topics)}{log.cure}"
        raise DataError(f"{path}:{unit}: the log has no inertial unit '{unit}': it has {present}")
    return found


def _preferred(path: Path, log: MessageLog) -> InertialStream:
    if not log.inertial:
        raise DataError(f"{path}: expected messages of an inertial unit, found {_some(log.topics)}{log.cure}")
    return min(log.inertial, key=lambda s: (not s.complete, s.rank, -len(s.t)))


def _some(topics: Sequence[str], shown: int = 12) -> str:
    more = f" and {len(topics) - shown} more" if len(topics) > shown else ""
    return (", ".join(topics[:shown]) or "nothing") + more


def known(values: NDArray[Any]) -> FloatArray:
    """Return accuracies or variances; NaN for those that are 0 or negative, which stand for unknown."""
    return np.where(values > 0.0, values.astype(float), math.nan)
