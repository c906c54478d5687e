"""ArduPilot dataflash logs (BIN), read with pymavlink: messages IMU by instance, GPS with its accuracies GPA.

Axes are forward, right, down; `TimeUS` is µs since boot. Logs before 2015 have `TimeMS` (of a `GPS`, the time since
boot is its `T`), and one type of message an instance: IMU, IMU2, IMU3. Heights of GPS are above mean sea level: over a
drive, a constant offset to the ellipsoid. IMU is logged at the rate of `LOG_BITMASK`: set its bit "fast IMU" for
noise, for otherwise the log has 10 to 50 samples a second that alias all above half of that.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tuner.readers.log_format import LogFormat
from tuner.readers.messages.streams import (
    FixStream,
    InertialStream,
    MessageLog,
    drive_of_log,
    listing_of_log,
)
from tuner.readers.solutions import OF_AUTOPILOTS
from tuner.types.records import DataError

SIGNATURE = b"\xa3\x95\x80"
"""Head of a message (A3 95) of type 128, FMT: every log begins with the formats of its messages."""
FIX_3D = 3
"""Least status of a position in three dimensions."""
NUMBERED = {f"{kind}{number}": (kind, number - 1) for kind in ("IMU", "GPS") for number in (2, 3)}
"""Types of messages of old logs: type and instance of today's."""
MESSAGE_HEAD = b"\xa3\x95"
"""First bytes of every message."""
WANTED = ["IMU", "GPS", "GPA", *NUMBERED]


def read_dataflash(path: Path) -> MessageLog:
    """Return the inertial samples and fixes of a dataflash log.

    Raises
    ------
    DataError
        What is no such log, or a damaged one.
    """
    with path.open("rb") as file:
        if (first := file.read(len(MESSAGE_HEAD))) != MESSAGE_HEAD:
            raise DataError(
                f"{path}: expected a dataflash log of ArduPilot, whose first bytes are {MESSAGE_HEAD.hex(' ')}, found "
                f"{first.hex(' ') or 'nothing'}: export another sensor's binary output as CSV by its maker's program"
            )
    imu: dict[int, list[tuple[float, ...]]] = {}
    gps: dict[int, list[tuple[float, ...]]] = {}
    accuracy: dict[tuple[int, int], tuple[float, float, float]] = {}
    names: set[str] = set()
    try:
        for message in _messages(path):
            kind, number = NUMBERED.get(message.get_type(), (message.get_type(), 0))
            instance = int(getattr(message, "I", 0)) or number
            names.add(f"{kind}.{instance}")
            if kind == "IMU":
                rates, forces = (
                    [float(getattr(message, f"{name}{axis}")) for axis in "XYZ"] for name in ("Gyr", "Acc")
                )
                warm = float(getattr(message, "T", getattr(message, "Temp", math.nan)))
                imu.setdefault(instance, []).append((_microseconds(message), *rates, *forces, warm))
            elif kind == "GPA":
                accuracy[instance, message.TimeUS] = (message.HAcc, message.VAcc, message.SAcc)
            elif message.Status >= FIX_3D:
                gps.setdefault(instance, []).append(_gps(message))
    except (
        OSError,
        ValueError,
        LookupError,
        AttributeError,
        TypeError,
        ArithmeticError,
        struct.error,
    ) as error:
        raise DataError(
            f"{path}: cannot be read as a dataflash log: {error}; download the log again"
        ) from None
    inertial = []
    for instance, values in sorted(imu.items()):
        table = np.array(values)
        arrays = {"gyro": table[:, 1:4], "accel": table[:, 4:7]}
        if np.isfinite(table[:, 7]).all():
            arrays["temperature"] = table[:, 7]
        inertial.append(
            InertialStream(f"IMU.{instance}", table[:, 0].astype(np.int64), arrays, "us", instance)
        )
    fixes = tuple(
        FixStream(f"GPS.{instance}", np.array([_with_sds(row, instance, accuracy) for row in values]))
        for instance, values in sorted(gps.items())
    )
    return MessageLog(tuple(inertial), fixes, "FRD", tuple(sorted(names)))


def _messages(path: Path) -> Iterator[Any]:
    """Yield the messages that are used; the library's remarks on bytes between messages are kept off the terminal."""
    from pymavlink.DFReader import DFReader_binary

    log = DFReader_binary.__new__(
        DFReader_binary
    )  # so that the file can be closed where reading its index fails
    try:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            with _without_stderr():
                log.__init__(str(path), zero_time_base=True)
            while (message := log.recv_match(type=WANTED)) is not None:
                yield message
    finally:
        for handle in ("data_map", "filehandle"):
            # A failed read may still hold a view of the mapped file: then it is closed with the last of them.
            with contextlib.suppress(AttributeError, BufferError):
                getattr(log, handle).close()


@contextlib.contextmanager
def _without_stderr() -> Iterator[None]:
    """Keep off the terminal what compiled code writes to standard error."""
    try:
        kept = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nothing:
            os.dup2(nothing.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _microseconds(message: Any) -> float:
    """Return the time since boot, µs, of a message of any age."""
    if hasattr(message, "TimeUS"):
        return float(message.TimeUS)
    milliseconds = message.T if message.get_type().startswith("GPS") else message.TimeMS
    return 1e3 * float(milliseconds)


def _gps(message: Any) -> tuple[float, ...]:
    """Return t, µs, latitude, longitude, deg, height, m, velocity north, east, down, m/s, fix type."""
    course = math.radians(message.GCrs)
    speed = message.Spd
    velocity = (speed * math.cos(course), speed * math.sin(course), message.VZ)
    return (_microseconds(message), message.Lat, message.Lng, message.Alt, *velocity, message.Status)


def _with_sds(
    row: tuple[float, ...], instance: int, accuracy: dict[tuple[int, int], tuple[float, float, float]]
) -> tuple[float, ...]:
    """Return a row of a `FixStream`: accuracies are those of the same epoch, NaN where none was logged."""
    horizontal, vertical, speed = (
        value if value > 0.0 else math.nan
        for value in accuracy.get((instance, int(row[0])), (math.nan, math.nan, math.nan))
    )
    solution = OF_AUTOPILOTS.get(int(row[7]), math.nan)
    return (1e-6 * row[0], *row[1:7], horizontal, horizontal, vertical, speed, speed, speed, solution)


FORMAT = LogFormat(
    "dataflash",
    "dataflash log of ArduPilot",
    (".bin", ".log.bin"),
    lambda path, _: listing_of_log(path, read_dataflash(path)),
    lambda head: head.startswith(SIGNATURE),
    extra="ardupilot",
    drive=lambda path: drive_of_log(path, read_dataflash(path)),
)
