"""Small valid files of every reader and document, to be damaged."""

from __future__ import annotations

import gzip
import io
import json
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import scipy.io
from pyarrow import parquet

from tests.tuner.readers import test_receiver_files
from tests.tuner.readers.messages import writers
from tests.tuner.readers.test_estimate_bags import rows as bag_rows
from tuner.catalogue.datasheet import is_datasheet, read_datasheet
from tuner.catalogue.grades import grade_identification, load_grade, parse_gnss
from tuner.formats import noise_yaml
from tuner.formats.documents import json_text, parse_json, read_text
from tuner.formats.identification import identification_json
from tuner.production.limits import read_limits
from tuner.readers import is_curve, kf_gins_settings, read, read_curve
from tuner.readers.drive import read_drive
from tuner.readers.estimate import read_estimate
from tuner.readers.fixes import read_fix_file
from tuner.readers.gnss_log import is_fixes, read_fixes
from tuner.readers.source_kind import drive_in_messages, is_drive_by_form, is_log
from tuner.readers.stored_identification import is_stored, read_stored
from tuner.synthesis import synthesize
from tuner.types.records import DataError

CONFIGS = Path(__file__).parents[2] / "configs"
ROWS = 60
RNG = np.random.default_rng(16)
T = 0.01 * np.arange(ROWS)
GYRO = RNG.normal(0.0, 1e-3, (ROWS, 3))
ACCEL = RNG.normal(0.0, 0.02, (ROWS, 3)) + np.array([0.1, -0.2, 9.8])
NAMES = ["t", *(f"{s}_{a} [{u}]" for s, u in (("gyro", "rad/s"), ("accel", "m/s^2")) for a in "xyz")]
LOG = np.column_stack([T, GYRO, ACCEL])


@dataclass(frozen=True)
class Seed:
    """A valid file: its name, its bytes, what reads it, and whether it is text."""

    name: str
    content: bytes
    read: Callable[[Path], Any]
    text: bool = False


def _text(rows: np.ndarray, header: str = "", separator: str = ",") -> bytes:
    lines = [separator.join(repr(v) for v in row) for row in rows.tolist()]
    return "\n".join([*([header] if header else []), *lines, ""]).encode()


def _classified(path: Path) -> Any:
    """Every question that the commands ask of a path, then the reader of logs."""
    for question in (
        is_log,
        is_drive_by_form,
        drive_in_messages,
        is_stored,
        is_datasheet,
        is_curve,
        is_fixes,
    ):
        question(path)
    return read(path)


def _npz(save: Callable[..., None], **arrays: Any) -> bytes:
    file = io.BytesIO()
    save(file, **arrays)
    return file.getvalue()


def _phone() -> bytes:
    """Return a ZIP of phyphox: one CSV a sensor."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, rows, unit in (("Gyroscope", GYRO, "rad/s"), ("Accelerometer", ACCEL, "m/s^2")):
            header = ",".join(['"Time (s)"', *(f'"{name} {axis} ({unit})"' for axis in "xyz")])
            archive.writestr(f"{name}.csv", _text(np.column_stack([T, rows]), header))
    return file.getvalue()


def _mat(**how: Any) -> bytes:
    file = io.BytesIO()
    content: dict[str, Any] = {"t": T, "gyro": GYRO, "accel": ACCEL}
    if how.get("format") != "4":
        content = {"imu": {"t": T, "wb": GYRO, "fb": ACCEL}, "rate": 100.0, "note": "text", **content}
    scipy.io.savemat(file, content, **how)
    return file.getvalue()


def _hdf5(userblock: bytes = b"") -> bytes:
    file = io.BytesIO()
    with h5py.File(file, "w", userblock_size=512 if userblock else 0) as stored:
        for name, value in (("t", T[:, None]), ("gyro", GYRO), ("accel", ACCEL)):
            made = stored.create_dataset(
                f"imu/{name}", data=value.T if userblock else value, compression="gzip"
            )
            made.attrs["unit"] = {"t": "s", "gyro": "rad/s", "accel": "m/s^2"}[name]
        stored.attrs["rate_hz"] = 100.0
    whole = file.getvalue()
    return userblock + whole[len(userblock) :] if userblock else whole


def _parquet() -> bytes:
    file = io.BytesIO()
    columns = {name.split(" ")[0]: LOG[:, j] for j, name in enumerate(NAMES)}
    columns["t"] = pa.array((1e6 * T).astype(np.int64), pa.timestamp("us"))
    columns["status"] = np.arange(ROWS, dtype=np.uint64) + 2**63
    parquet.write_table(pa.table(columns).replace_schema_metadata({"rate_hz": "100", "note": "x"}), file)
    return file.getvalue()


def _drive() -> dict[str, Any]:
    n, k = 400, 8
    imu_t, gnss_t = 0.01 * np.arange(n), 0.5 * np.arange(k)
    force = RNG.normal(0.0, 0.02, (n, 3)) + np.array([0.0, 0.0, -9.81])
    llh = np.column_stack([48.0 + 1e-6 * np.arange(k), 11.0 + 0.0 * gnss_t, 500.0 + 0.0 * gnss_t])
    return {
        "imu_t": imu_t,
        "gyro": RNG.normal(0.0, 1e-3, (n, 3)),
        "accel": force,
        "gnss_t": gnss_t,
        "gnss_llh": llh,
        "gnss_vned": np.zeros((k, 3)),
        "gnss_pstd": np.ones((k, 3)),
        "ref_t": gnss_t,
        "ref_llh": llh,
        "meta": np.array(json.dumps({"imu_frame": "FRD", "lever_arm_frd_m": [0.5, 0.0, -1.0]})),
    }


def _drive_folder(path: Path) -> Any:
    """Read a folder whose ``gnss.csv`` is the file."""
    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    drive = _drive()
    (folder / "imu.csv").write_bytes(
        _text(np.column_stack([drive["imu_t"], drive["gyro"], drive["accel"]]), ",".join(NAMES))
    )
    (folder / "gnss.csv").write_bytes(path.read_bytes())
    return read_drive(folder)


def _frame(path: Path) -> Any:
    """Read what pandas makes of a CSV; what it refuses is no input of ours."""
    try:
        frame = pd.read_csv(path)
    except (ValueError, UnicodeError) as error:
        raise DataError(str(error) or "refused") from None
    return read(frame, rate=100.0)


def _kf_gins(path: Path) -> Any:
    """Read a YAML of KF-GINS beside its files."""
    drive = _drive()
    imu = np.column_stack([drive["imu_t"], 0.01 * drive["gyro"], 0.01 * drive["accel"]])
    fixes = np.column_stack([drive["gnss_t"], drive["gnss_llh"], np.ones((8, 3))])
    for name, rows in (("imu.txt", imu), ("gnss.pos", fixes)):
        if not path.with_name(name).exists():
            path.with_name(name).write_bytes(_text(rows, separator=" "))
    return read_drive(path)


def _gnss_csv() -> bytes:
    drive = _drive()
    rows = np.column_stack([drive["gnss_t"], drive["gnss_llh"], np.zeros((8, 3)), np.ones((8, 3))])
    return _text(rows, "t,lat,lon,height,vn,ve,vd,sd_n,sd_e,sd_d")


def _message_logs() -> list[Seed]:
    """Return a ULog, a dataflash log, a bag and an MCAP of the samples, and files of receivers."""
    stamps = np.round(1e6 * T).astype(int) + 5_000_000
    fields = {f"gyro_rad[{j}]": GYRO[:, j] for j in range(3)}
    fields |= {f"accelerometer_m_s2[{j}]": ACCEL[:, j] for j in range(3)}
    imu = [(1000 * int(t), {"gyro": w, "accel": f}) for t, w, f in zip(stamps, GYRO, ACCEL, strict=True)]
    messages = [
        (
            "IMU",
            {"TimeUS": ("Q", int(t)), "I": ("B", 0)}
            | {f"Gyr{a}": ("f", w[j]) for j, a in enumerate("XYZ")}
            | {f"Acc{a}": ("f", f[j]) for j, a in enumerate("XYZ")},
        )
        for t, w, f in zip(stamps, GYRO, ACCEL, strict=True)
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        topic = {"timestamp": stamps.astype(np.uint64), **fields}
        writers.write_ulog(folder / "log.ulg", {("sensor_combined", 0): topic})
        writers.write_dataflash(folder / "log.bin", messages)
        topics = {"/imu": ("sensor_msgs/msg/Imu", imu)}
        writers.write_bag(folder / "log.bag", topics, kind="ros1")
        writers.write_bag(folder / "ros2", topics, kind="mcap")
        logs = {path.name: path.read_bytes() for path in folder.glob("log.*")}
        logs["log.mcap"] = next((folder / "ros2").glob("*.mcap")).read_bytes()
    solution = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns\n" + "".join(
        f"2022/03/20 10:00:{k:02d}.000 47.{k:09d} 8.0 430.0 1 9 0.01 0.02 0.03 0 0 0 0 9\n" for k in range(40)
    )
    return [
        *(Seed(name, content, _classified) for name, content in sorted(logs.items())),
        Seed("rover.pos", solution.encode(), read_fix_file, text=True),
    ]


def _solutions() -> list[Seed]:
    """Return the output of a filter in four forms, and files of receivers that a library parses."""
    drive, one = _drive(), np.ones((8, 3))
    poses = np.column_stack([drive["gnss_t"], drive["gnss_llh"], np.zeros((8, 3)), one])
    mapped = {f"sd_{a} [cm]": f"s{a}" for a in "ned"}
    names = "t,lat,lon,height,vn,ve,vd,sn,se,sd"
    tum = np.column_stack([drive["gnss_t"], drive["gnss_llh"], np.zeros((8, 3)), one[:, 0]])
    arrays = {"t": drive["gnss_t"], "llh": drive["gnss_llh"], "covariance": np.tile(np.eye(9), (8, 1, 1))}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        test_receiver_files.nmea(folder)
        test_receiver_files.ubx(folder)
        writers.write_bag(folder / "estimate.bag", {"/o": ("nav_msgs/msg/Odometry", bag_rows())}, kind="ros1")
        content = {path.name: path.read_bytes() for path in folder.iterdir()}
    return [
        Seed("mapped.csv", _text(poses, names), lambda p: read_estimate(p, columns=mapped), text=True),
        Seed("estimate.npz", _npz(np.savez_compressed, **arrays), read_estimate),
        Seed("poses.tum", _text(tum, separator=" "), lambda p: read_estimate(p, frame="ENU"), text=True),
        Seed("estimate.bag", content["estimate.bag"], read_estimate),
        Seed("rover.nmea", content["rover.nmea"], read_fix_file, text=True),
        Seed("rover.ubx", content["rover.ubx"], read_fix_file),
    ]


@cache
def seeds() -> tuple[Seed, ...]:
    """Return a valid file for each reader and document."""
    header = ",".join(NAMES)
    csv = _text(LOG, header)
    told = grade_identification(load_grade("mpu9250"))
    config = synthesize(told)
    kf_gins = (
        b"imupath: imu.txt\ngnsspath: gnss.pos\nimudatarate: 100\nantlever: [0.5, 0.0, -1.0]\n"
        b"initgyrbias: [1, 2, 3]\n"
    )
    settings = (
        b"imudatarate: 200\nimunoise:\n  arw: [0.2, 0.2, 0.2]\n  vrw: [0.4, 0.4, 0.4]\n  gbstd: [24, 24, 24]\n"
        b"  abstd: [400, 400, 400]\n  gsstd: [1000, 1000, 1000]\n  asstd: [1000, 1000, 1000]\n  corrtime: 1.0\n"
    )
    plain = {
        "t": T,
        "gyro": GYRO,
        "accel": ACCEL,
        "meta": np.array(json.dumps({"rate_hz": 100.0, "gyro_unit": "rad/s"})),
    }
    return (
        Seed("log.csv", csv, _classified, text=True),
        Seed("dates.csv", csv.replace(b"\n0.", b"\n2024-05-01T12:00:00."), _classified, text=True),
        Seed("semicolon.csv", _text(LOG, header.replace(",", ";"), ";"), _classified, text=True),
        Seed(
            "increments.txt", _text(LOG * np.array([1.0, *6 * [0.01]]), separator=" "), _classified, text=True
        ),
        Seed("packed.csv.gz", gzip.compress(csv), _classified),
        Seed(
            "curve.csv",
            b"tau,deviation [deg/h],dof\n"
            + b"".join(b"%d,%g,%d\n" % (2**i, 3.0 / (i + 1), 99 - i) for i in range(9)),
            read_curve,
            text=True,
        ),
        Seed("fixes.csv", _gnss_csv(), read_fixes, text=True),
        Seed("gnss.csv", _gnss_csv(), _drive_folder, text=True),
        Seed("log.npz", _npz(np.savez, **plain), _classified),
        Seed("packed.npz", _npz(np.savez_compressed, **plain), _classified),
        Seed("drive.npz", _npz(np.savez, **_drive()), read_drive),
        Seed("four.mat", _mat(format="4"), _classified),
        Seed("five.mat", _mat(), _classified),
        Seed("seven.mat", _mat(do_compression=True), _classified),
        Seed(
            "seven_three.mat",
            _hdf5(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(384)),
            _classified,
        ),
        Seed("log.h5", _hdf5(), _classified),
        Seed("log.parquet", _parquet(), _classified),
        Seed("phone.zip", _phone(), _classified),
        *_message_logs(),
        Seed("noise.yaml", noise_yaml.dumps(config).encode(), noise_yaml.load, text=True),
        Seed("sheet.yaml", (CONFIGS / "examples" / "datasheet.yaml").read_bytes(), read_datasheet, text=True),
        Seed(
            "gnss.yaml",
            (CONFIGS / "gnss" / "spp.yaml").read_bytes(),
            lambda p: parse_gnss(read_text(p, expected="YAML"), source=str(p)),
            text=True,
        ),
        Seed("identified.json", json_text(identification_json(told)).encode(), read_stored, text=True),
        Seed(
            "any.json",
            b'{"schema": "x", "a": [1, 2, {"b": null}]}',
            lambda p: parse_json(read_text(p, expected="JSON"), source=str(p)),
            text=True,
        ),
        Seed("drive.yaml", kf_gins, _kf_gins, text=True),
        Seed("settings.yaml", settings, kf_gins_settings.load, text=True),
        Seed("grade.yaml", (CONFIGS / "sensors" / "fog.yaml").read_bytes(), read_datasheet, text=True),
        Seed("limits.yaml", (CONFIGS / "examples" / "limits.yaml").read_bytes(), read_limits, text=True),
        Seed(
            "result.json",
            json_text(
                {
                    "schema": "tuner.result/1",
                    "files": {"a.png": "00"},
                    "identification": identification_json(told),
                }
            ).encode(),
            read_stored,
            text=True,
        ),
        Seed("frame.csv", csv, _frame, text=True),
        *_solutions(),
    )
