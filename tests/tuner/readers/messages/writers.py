"""Writers of message logs for tests: bytes laid out as the formats' documents say, or by the libraries' own writers.

ULog: https://docs.px4.io/main/en/dev_log/ulog_file_format. Dataflash: messages begin with A3 95 and their type, and
type 128 (FMT) gives length, name, field types and field names of the others.
"""

import struct

import numpy as np


def write_ulog(path, topics):
    """Write topics {(name, instance): {field: array}} with a field ``timestamp``, µs; others are float or int32."""

    def message(kind, body):
        return struct.pack("<Hc", len(body), kind) + body

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    rows = []
    for number, ((name, instance), fields) in enumerate(topics.items()):
        kinds = {k: _ulog_kind(k, np.asarray(v)) for k, v in fields.items()}
        if instance == 0:
            declared = "".join(f"{kind} {field};" for field, (kind, _) in _merged(kinds).items())
            out.append(message(b"F", f"{name}:{declared}".encode()))
        rows.append((number, name, instance, fields, kinds))
    for number, name, instance, _, _ in rows:
        out.append(message(b"A", struct.pack("<BH", instance, number) + name.encode()))
    for number, _, _, fields, kinds in rows:
        columns = [np.asarray(v) for v in fields.values()]
        form = "<" + "".join(code for _, code in kinds.values())
        for row in zip(*columns, strict=True):
            values = [x.item() for x in row]
            out.append(message(b"D", struct.pack("<H", number) + struct.pack(form, *values)))
    path.write_bytes(b"".join(out))


def _ulog_kind(field, values):
    if field.startswith("timestamp"):
        return ("uint64_t", "Q")
    return ("int32_t", "i") if values.dtype.kind == "i" else ("double", "d")


def _merged(kinds):
    """Turn fields ``x[0] x[1] x[2]`` into the array ``x`` of three."""
    merged = {}
    for field, kind in kinds.items():
        name, bracket, _ = field.partition("[")
        if not bracket:
            merged[name] = kind
        else:
            size = sum(other.startswith(f"{name}[") for other in kinds)
            merged[name] = (f"{kind[0]}[{size}]", kind[1])
    declared = {}
    for name, (kind, code) in merged.items():
        declared[name] = (kind, code)
    return declared


def write_dataflash(path, messages):
    """Write a list of (name, {field: (format letter, value)}) in order; B, Q, f, d, L as in the format's document."""
    codes = {"B": "B", "Q": "Q", "f": "f", "d": "d", "L": "i", "I": "I"}
    numbers = {}
    out = []

    def declare(number, length, name, letters, columns):
        body = struct.pack("<BB4s16s64s", number, length, name.encode(), letters.encode(), columns.encode())
        out.append(b"\xa3\x95\x80" + body)

    declare(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    for name, fields in messages:
        letters = "".join(letter for letter, _ in fields.values())
        form = "<" + "".join(codes[letter] for letter in letters)
        if name not in numbers:
            numbers[name] = 129 + len(numbers)
            declare(numbers[name], 3 + struct.calcsize(form), name, letters, ",".join(fields))
        values = [value for _, value in fields.values()]
        out.append(b"\xa3\x95" + bytes([numbers[name]]) + struct.pack(form, *values))
    path.write_bytes(b"".join(out))


def write_bag(path, topics, *, kind):
    """Write topics {topic: (message type, [(stamp in ns, {field: value})])} as ROS 1 bag, ROS 2 folder or MCAP.

    The type ``driver_msgs/msg/Reading`` is one of a driver's own, with an `Imu` in it whose header is left empty.
    """
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    store.register(
        get_types_from_msg(
            "std_msgs/Header header\nsensor_msgs/Imu imu\nstring raw", "driver_msgs/msg/Reading"
        )
    )
    if kind == "ros1":
        writer = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        for topic, (name, rows) in topics.items():
            connection = writer.add_connection(topic, name, typestore=store)
            for stamp, fields in rows:
                message = _message(store, name, stamp, fields, ros1=kind == "ros1")
                raw = (
                    store.serialize_ros1(message, name)
                    if kind == "ros1"
                    else store.serialize_cdr(message, name)
                )
                writer.write(connection, stamp, raw)


def _message(store, name, stamp, fields, *, ros1):
    types = store.types
    time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    seq = {"seq": 0} if ros1 else {}
    header = types["std_msgs/msg/Header"](**seq, stamp=time, frame_id="imu")

    def vector(xyz):
        return types["geometry_msgs/msg/Vector3"](*map(float, xyz))

    if name.endswith(("Odometry", "PoseWithCovarianceStamped", "PoseStamped", "Path", "TransformStamped")):
        return _poses(types, name, header, fields)
    nine = np.zeros(9)
    if name == "driver_msgs/msg/Reading":
        return types[name](header, _message(store, "sensor_msgs/msg/Imu", 0, fields, ros1=ros1), "")
    if name == "sensor_msgs/msg/Imu":
        none = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        return types[name](header, none, nine, vector(fields["gyro"]), nine, vector(fields["accel"]), nine)
    if name == "sensor_msgs/msg/NavSatFix":
        status = types["sensor_msgs/msg/NavSatStatus"](status=fields.get("status", 0), service=1)
        covariance = np.diag(np.square(fields["sd_enu"])).ravel()
        return types[name](header, status, *map(float, fields["llh"]), covariance, 2)
    twist = types["geometry_msgs/msg/Twist"](vector(fields["enu"]), vector((0, 0, 0)))
    return types[name](header, twist)


def _poses(types, name, header, fields):
    """Return a pose or path: {place, quat (w first), covariance, velocity, velocity_covariance}, or {poses}."""
    if name.endswith("Path"):
        return types[name](
            header, [_poses(types, "geometry_msgs/msg/PoseStamped", header, f) for f in fields["poses"]]
        )
    w, *xyz = map(float, fields["quat"])
    if name.endswith("TransformStamped"):
        moved = types["geometry_msgs/msg/Vector3"](*map(float, fields["place"]))
        turn = types["geometry_msgs/msg/Quaternion"](*xyz, w)
        return types[name](header, "unit", types["geometry_msgs/msg/Transform"](moved, turn))
    point = types["geometry_msgs/msg/Point"](*map(float, fields["place"]))
    pose = types["geometry_msgs/msg/Pose"](point, types["geometry_msgs/msg/Quaternion"](*xyz, w))
    if name.endswith("PoseStamped"):
        return types[name](header, pose)
    whole = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.ravel(fields["covariance"]).astype(float))
    if name.endswith("PoseWithCovarianceStamped"):
        return types[name](header, whole)
    vector = types["geometry_msgs/msg/Vector3"]
    twist = types["geometry_msgs/msg/Twist"](vector(*map(float, fields["velocity"])), vector(0.0, 0.0, 0.0))
    spread = np.zeros((6, 6))
    spread[:3, :3] = fields["velocity_covariance"]
    return types[name](
        header, "base_link", whole, types["geometry_msgs/msg/TwistWithCovariance"](twist, spread.ravel())
    )
