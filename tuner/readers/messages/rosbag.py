"""ROS 1 and ROS 2 bags and MCAP files, read with rosbags: `sensor_msgs/Imu`, `sensor_msgs/NavSatFix`, velocities.

Odometry gives velocities of wheels, forward, left, up in axes of the vehicle. Stamps are those of the headers; where a
driver leaves them 0, the time of recording is taken. Velocities of fixes are those of a `TwistStamped` or
`TwistWithCovarianceStamped` topic that is stamped as the fixes are: a receiver publishes both for one epoch, east,
north, up. A message of another type that has one `Imu` or `NavSatFix` among its fields is read by that field: many
drivers have messages of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.readers.log_format import LogFormat
from tuner.readers.messages.streams import (
    FixStream,
    InertialStream,
    MessageLog,
    drive_of_log,
    known,
    listing_of_log,
)
from tuner.types.records import DataError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


IMU, FIX = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix"
VELOCITIES = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/TwistWithCovarianceStamped")
ODOMETRY = "nav_msgs/msg/Odometry"
READ = (IMU, FIX, ODOMETRY, *VELOCITIES)
SAME_EPOCH = 0.02
"""Stamps of a position and a velocity this close, s, are of one epoch: receivers report every 50 ms at most."""
MIN_COMMON_SHARE = 0.9
"""Share of fixes with a velocity of the same epoch from which a topic is taken for the receiver's velocity."""
METADATA = "metadata.yaml"
"""File that makes a folder a ROS 2 bag."""
SIGNATURES = (b"#ROSBAG V2.0", b"\x89MCAP")


@contextmanager
def opened_bag(path: Path) -> Iterator[Any]:
    """Open a bag; what goes wrong while it is read is one line.

    Raises
    ------
    DataError
        What is no bag, or a damaged one.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    # Of a ROS 2 bag, a folder with ``metadata.yaml``, rosbags opens the folder, not a file in it.
    whole = path.parent if (path.parent / METADATA).is_file() else path
    try:
        with AnyReader([whole], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            yield bag
    except DataError:
        raise
    except (
        AnyReaderError,
        OSError,
        ValueError,
        LookupError,
        AttributeError,
        TypeError,
        AssertionError,
    ) as error:
        reason = " ".join(str(error).split())
        raise DataError(
            f"{path}: cannot be read as a ROS bag: {reason}; `ros2 bag info` or `rosbag check` tell more"
        ) from None


def read_bag(path: Path) -> MessageLog:
    """Return the inertial samples and fixes of a bag.

    Raises
    ------
    DataError
        What is no bag, or a damaged one.
    """
    samples: dict[str, list[tuple[float, ...]]] = {}
    stamps: dict[str, list[tuple[int, int]]] = {}
    with opened_bag(path) as bag:
        found = {
            c.topic: one for c in bag.connections if (one := _holding(c.msgtype, bag.typestore)) is not None
        }
        wanted = [c for c in bag.connections if c.topic in found]
        kinds = {topic: kind for topic, (kind, _) in found.items()}
        topics = tuple(f"{name} ({topic.msgtype}, {topic.msgcount})" for name, topic in bag.topics.items())
        undefined = {c.msgtype for c in bag.connections} - set(bag.typestore.fielddefs)
        for connection, recorded, raw in bag.messages(connections=wanted) if wanted else ():
            whole: Any = bag.deserialize(raw, connection.msgtype)
            kind, field = found[connection.topic]
            message = whole if field is None else getattr(whole, field)
            stamps.setdefault(connection.topic, []).append((_stamp(message) or _stamp(whole), recorded))
            samples.setdefault(connection.topic, []).append(_numbers(message, kind))
    rows = {topic: np.array(values) for topic, values in samples.items()}
    clocks = {topic: clock_of_stamps(np.array(pairs, dtype=np.int64)) for topic, pairs in stamps.items()}
    inertial = tuple(
        InertialStream(
            topic,
            clocks[topic],
            {"gyro": rows[topic][:, :3], "accel": rows[topic][:, 3:]},
            "ns",
        )
        for topic in rows
        if kinds[topic] == IMU
    )
    velocities = {topic: rows[topic] for topic in rows if kinds[topic] in VELOCITIES}
    fixes = tuple(_fixes(topic, clocks, rows[topic], velocities) for topic in rows if kinds[topic] == FIX)
    wheels = {
        topic: np.column_stack(
            [
                1e-9 * clocks[topic],
                rows[topic][:, :3][:, [1, 0, 2]],
                np.sqrt(known(rows[topic][:, [4, 3, 5]])),
            ]
        )
        * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0]
        for topic in rows
        if kinds[topic] == ODOMETRY
    }
    convert = (
        f"; the file does not define {', '.join(sorted(undefined))}: `ros2 bag convert` to MCAP, "
        "run where these are installed, adds definitions"
    )
    return MessageLog(inertial, fixes, None, topics, cure=convert if undefined else "", wheels=wheels)


def _holding(kind: str, store: Typestore) -> tuple[str, str | None] | None:
    """Return the type that is read of messages of a kind, and the field that holds it; None where there is none."""
    if kind in READ:
        return kind, None
    _, fields = store.fielddefs.get(kind, ((), ()))
    inner = [(of, name) for name, (_, of) in fields if of in (IMU, FIX)]
    return inner[0] if len(inner) == 1 else None


def _stamp(message: Any) -> int:
    """Return the stamp of a message's header, ns; 0 where it has none."""
    header = getattr(message, "header", getattr(message, "Header", None))
    return 0 if header is None else int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def clock_of_stamps(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the header's stamps, ns, those of recording where a driver left the header's empty."""
    header, recorded = pairs.T
    return np.asarray(recorded if np.count_nonzero(header) < 0.5 * len(header) else header)


def _numbers(message: Any, kind: str) -> tuple[float, ...]:
    """Return what is used of a message: six rates; or position, sds, status; or velocity and sds."""
    if kind == IMU:
        w, f = message.angular_velocity, message.linear_acceleration
        return (w.x, w.y, w.z, f.x, f.y, f.z)
    if kind == FIX:
        known = message.position_covariance_type > 0
        variances = [message.position_covariance[i] if known else 0.0 for i in (4, 0, 8)]
        return (message.latitude, message.longitude, message.altitude, *variances, message.status.status)
    with_covariance = hasattr(message.twist, "covariance")
    linear = message.twist.twist.linear if with_covariance else message.twist.linear
    variances = [message.twist.covariance[i] if with_covariance else 0.0 for i in (7, 0, 14)]
    return (linear.y, linear.x, -linear.z, *variances)


def _fixes(
    topic: str, clocks: dict[str, NDArray[np.int64]], rows: FloatArray, velocities: dict[str, FloatArray]
) -> FixStream:
    t = 1e-9 * clocks[topic].astype(float)
    table = np.full((len(t), 13), math.nan)
    table[:, 0], table[:, 1:4], table[:, 7:10] = t, rows[:, :3], np.sqrt(known(rows[:, 3:6]))
    notes: tuple[str, ...] = ()
    for name, values in velocities.items():
        theirs = clocks[name]
        order = np.argsort(theirs)
        place = np.clip(np.searchsorted(theirs[order], clocks[topic]), 1, max(1, len(order) - 1))
        before, after = order[place - 1], order[np.minimum(place, len(order) - 1)]
        early = np.abs(theirs[before] - clocks[topic]) <= np.abs(theirs[after] - clocks[topic])
        nearest = np.where(early, before, after)
        same = np.abs(theirs[nearest] - clocks[topic]) * 1e-9 <= SAME_EPOCH
        if np.count_nonzero(same) >= MIN_COMMON_SHARE * len(t) and len(theirs) <= 2 * len(t):
            table[same, 4:7] = values[nearest[same], :3]
            table[same, 10:13] = np.sqrt(known(values[nearest[same], 3:]))
            notes = (f"velocities of the fixes are those of '{name}', east, north, up",)
            break
    return FixStream(topic, table[rows[:, 6] >= 0], notes)


FORMAT = LogFormat(
    "ros-bag",
    "ROS bag or MCAP",
    (".bag", ".mcap", ".db3"),
    lambda path, _: listing_of_log(path, read_bag(path)),
    lambda head: head.startswith(SIGNATURES),
    extra="ros",
    drive=lambda path: drive_of_log(path, read_bag(path)),
)
