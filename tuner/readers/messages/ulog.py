"""Logs of PX4 (ULog), read with pyulog: inertial samples of all instances, fixes of all receivers.

Message fields as in PX4's ``msg`` folder: `sensor_combined` (rates and specific forces that the estimator uses),
`vehicle_imu` (increments, by instance), `sensor_gyro` with `sensor_accel`; `vehicle_gps_position`, `sensor_gps`.
Body axes are forward, right, down; time is µs since boot.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.readers.log_format import LogFormat
from tuner.readers.messages.streams import (
    FixStream,
    InertialStream,
    MessageLog,
    drive_of_log,
    known,
    listing_of_log,
)
from tuner.readers.solutions import OF_AUTOPILOTS, solutions
from tuner.types.records import DataError

SIGNATURE = b"ULog\x01\x12\x35"
FIX_3D = 3
"""Least fix type of a position in three dimensions."""

Fields = Mapping[str, NDArray[Any]]


def read_ulog(path: Path) -> MessageLog:
    """Return the inertial samples and fixes of a ULog.

    Raises
    ------
    DataError
        What is no ULog, or a damaged one.
    """
    from pyulog import ULog

    try:
        # The library prints what it finds damaged.
        with path.open("rb") as file, contextlib.redirect_stdout(io.StringIO()):
            log = ULog(file, disable_str_exceptions=True)
    except (OSError, TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
        raise DataError(f"{path}: cannot be read as ULog: {error}; download the log again") from None
    data = {(one.name, one.multi_id): one.data for one in log.data_list if len(one.data["timestamp"])}
    inertial: list[InertialStream] = []
    fixes: list[FixStream] = []
    for (name, instance), fields in data.items():
        title = f"{name}.{instance}"
        if name == "sensor_combined":
            arrays = {"gyro": _three(fields, "gyro_rad"), "accel": _three(fields, "accelerometer_m_s2")}
            inertial.append(_stream(title, fields, arrays, 0))
        elif name == "vehicle_imu":
            inertial.append(_stream(title, fields, _of_increments(fields), 1))
        elif name in ("sensor_gyro", "sensor_accel"):
            part = name.removeprefix("sensor_")
            arrays = {part: np.column_stack([fields[axis] for axis in "xyz"])}
            inertial.append(_stream(title, fields, arrays, 2))
        elif name in ("vehicle_gps_position", "sensor_gps"):
            fixes.append(FixStream(title, _fixes(fields)))
    topics = tuple(
        f"{name}.{instance} ({len(fields['timestamp'])})" for (name, instance), fields in data.items()
    )
    damaged = ("the file is damaged: what could be read of it is used",) if log.file_corruption else ()
    return MessageLog(tuple(inertial), tuple(fixes), "FRD", topics, damaged)


def _stream(name: str, fields: Fields, arrays: dict[str, NDArray[Any]], rank: int) -> InertialStream:
    stamps = fields.get("timestamp_sample", fields["timestamp"])
    t = stamps if stamps.any() else fields["timestamp"]
    if "temperature" in fields:
        arrays["temperature"] = fields["temperature"].astype(float)
    return InertialStream(name, t.astype(np.int64), arrays, "us", rank)


def _three(fields: Fields, name: str) -> NDArray[Any]:
    return np.column_stack([fields[f"{name}[{i}]"] for i in range(3)]).astype(float)


def _of_increments(fields: Fields) -> dict[str, NDArray[Any]]:
    """Return mean rates and specific forces of `vehicle_imu`: increments by the time, µs, they are over."""
    arrays = {}
    for part, name in (("gyro", "delta_angle"), ("accel", "delta_velocity")):
        dt = fields[f"{name}_dt"].astype(float)
        arrays[part] = _three(fields, name) / (1e-6 * np.where(dt > 0.0, dt, math.nan))[:, None]
    return arrays


def _fixes(fields: Fields) -> NDArray[np.float64]:
    """Return the rows of a `FixStream`: positions of three-dimensional fixes, and valid velocities."""
    if "latitude_deg" in fields:  # since PX4 1.14
        llh = [fields["latitude_deg"], fields["longitude_deg"], fields["altitude_ellipsoid_m"]]
    else:
        llh = [1e-7 * fields["lat"], 1e-7 * fields["lon"], 1e-3 * fields["alt_ellipsoid"]]
    velocity = [fields[f"vel_{axis}_m_s"].astype(float) for axis in "ned"]
    valid = fields.get("vel_ned_valid", np.ones(len(llh[0]))).astype(bool)
    horizontal = known(fields["eph"])  # for each axis, as PX4's own estimator takes it
    vertical, speed = known(fields["epv"]), known(fields["s_variance_m_s"])
    sds = [horizontal, horizontal, vertical, speed, speed, speed]
    stamps = fields.get("timestamp_sample", fields["timestamp"])
    t = (stamps if stamps.any() else fields["timestamp"]).astype(float)
    classes = solutions(fields["fix_type"], OF_AUTOPILOTS)
    rows = np.column_stack([1e-6 * t, *llh, *velocity, *sds, classes]).astype(float)
    rows[~valid, 4:7] = math.nan
    return rows[fields["fix_type"] >= FIX_3D]


FORMAT = LogFormat(
    "ulog",
    "ULog of PX4",
    (".ulg", ".ulog"),
    lambda path, _: listing_of_log(path, read_ulog(path)),
    lambda head: head.startswith(SIGNATURE),
    extra="ulog",
    drive=lambda path: drive_of_log(path, read_ulog(path)),
)
