"""Logs of messages hold the numbers that were written into them: units, axes, clocks, accuracies."""

import contextlib
import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from tests.tuner.readers.messages.writers import write_bag, write_dataflash, write_ulog
from tuner.cli.commands.inputs import load_sources
from tuner.cli.commands.options import Reading
from tuner.cli.progress import Messages
from tuner.identification.identify_source import records_name
from tuner.readers import log_format, read
from tuner.readers.drive import read_drive, read_if_drive
from tuner.types.records import DataError

RATE, FIX_RATE, SECONDS = 100, 5, 30
RNG = np.random.default_rng(11)
T = np.arange(RATE * SECONDS) / RATE
GYRO = RNG.normal(0.0, 1e-3, (len(T), 3))
ACCEL = RNG.normal(0.0, 1e-2, (len(T), 3)) + np.array([0.0, 0.0, -9.81])
FIX_T = np.arange(1, FIX_RATE * (SECONDS - 1)) / FIX_RATE
LLH = np.column_stack(
    [47.0 + 1e-7 * np.arange(len(FIX_T)), 8.0 + 2e-7 * np.arange(len(FIX_T)), 400.0 + FIX_T]
)
VEL = np.column_stack([1.0 + 0.1 * np.sin(FIX_T), 2.0 + 0.0 * FIX_T, -0.3 + 0.0 * FIX_T])


def ulog(path, *, fixes=True, instances=1, combined=False):
    topics = {}
    if combined:  # twice the rate of the others; only the thermometers of the parts have a temperature
        stamps = (5e5 * np.arange(2 * len(T)) / RATE + 5e6).astype(np.uint64)
        topics["sensor_combined", 0] = {
            "timestamp": stamps,
            **{f"gyro_rad[{j}]": np.concatenate([GYRO[:, j], GYRO[::-1, j]]) for j in range(3)},
            **{f"accelerometer_m_s2[{j}]": np.concatenate([ACCEL[:, j], ACCEL[::-1, j]]) for j in range(3)},
        }
        for i in range(instances):
            topics["sensor_accel", i] = {
                "timestamp": np.array([5_000_000, 35_000_000], dtype=np.uint64),
                **{axis: np.full(2, 9.81) for axis in "xyz"},
                "temperature": np.full(2, 20.0 + 10.0 * i),
            }
    for i in range(instances):
        dt = np.full(len(T), 1e6 / RATE)
        topics["vehicle_imu", i] = {
            "timestamp": (1e6 * T + 5e6).astype(np.uint64),
            **{f"delta_angle[{j}]": GYRO[:, j] / RATE for j in range(3)},
            **{f"delta_velocity[{j}]": ACCEL[:, j] / RATE for j in range(3)},
            "delta_angle_dt": dt,
            "delta_velocity_dt": dt,
        }
    if fixes:
        topics["vehicle_gps_position", 0] = {
            "timestamp": (1e6 * FIX_T + 5e6).astype(np.uint64),
            "lat": np.round(1e7 * LLH[:, 0]).astype(np.int32),
            "lon": np.round(1e7 * LLH[:, 1]).astype(np.int32),
            "alt_ellipsoid": np.round(1e3 * LLH[:, 2]).astype(np.int32),
            **{f"vel_{axis}_m_s": VEL[:, i] for i, axis in enumerate("ned")},
            "eph": np.full(len(FIX_T), 0.8),
            "epv": np.full(len(FIX_T), 1.5),
            "s_variance_m_s": np.full(len(FIX_T), 0.2),
            "fix_type": np.full(len(FIX_T), 3, dtype=np.int32),
            "vel_ned_valid": np.where(FIX_T < 2.0, 0, 1).astype(np.int32),
        }
    write_ulog(path, topics)
    return path


def dataflash(path, *, fixes=True, instances=1):
    rows = []
    for k, t in enumerate(T):
        for i in range(instances):
            values = {"TimeUS": ("Q", round(1e6 * t) + 5_000_000), "I": ("B", i)}
            values |= {f"Gyr{a}": ("f", GYRO[k, j]) for j, a in enumerate("XYZ")}
            values |= {f"Acc{a}": ("f", ACCEL[k, j]) for j, a in enumerate("XYZ")}
            rows.append((t, ("IMU", values)))
    for k, t in enumerate(FIX_T if fixes else ()):
        stamp = ("Q", round(1e6 * t) + 5_000_000)
        speed, course = np.hypot(*VEL[k, :2]), np.degrees(np.arctan2(VEL[k, 1], VEL[k, 0]))
        gps = {"TimeUS": stamp, "I": ("B", 0), "Status": ("B", 3)}
        gps |= {
            "Lat": ("L", round(1e7 * LLH[k, 0])),
            "Lng": ("L", round(1e7 * LLH[k, 1])),
            "Alt": ("d", LLH[k, 2]),
        }
        gps |= {"Spd": ("d", speed), "GCrs": ("d", course), "VZ": ("d", VEL[k, 2])}
        rows.append((t, ("GPS", gps)))
        gpa = {"TimeUS": stamp, "I": ("B", 0), "HAcc": ("d", 0.8), "VAcc": ("d", 1.5), "SAcc": ("d", 0.2)}
        rows.append((t, ("GPA", gpa)))
    write_dataflash(path, [message for _, message in sorted(rows, key=lambda row: row[0])])
    return path


def bag(path, kind, *, fixes=True, instances=1, message="sensor_msgs/msg/Imu"):
    def stamp(t):
        return round(1e9 * t) + 1_700_000_000_000_000_000

    topics = {
        f"/imu{i}": (
            message,
            [(stamp(t), {"gyro": w, "accel": f}) for t, w, f in zip(T, GYRO, ACCEL, strict=True)],
        )
        for i in range(instances)
    }
    if fixes:
        topics["/fix"] = (
            "sensor_msgs/msg/NavSatFix",
            [(stamp(t), {"llh": llh, "sd_enu": (0.8, 0.8, 1.5)}) for t, llh in zip(FIX_T, LLH, strict=True)],
        )
        enu = VEL[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
        topics["/vel"] = (
            "geometry_msgs/msg/TwistStamped",
            [(stamp(t), {"enu": v}) for t, v in zip(FIX_T, enu, strict=True)],
        )
    write_bag(path, topics, kind=kind)
    if path.is_dir():
        return next(path.glob("*.mcap"), path)
    return path


MAKERS = {
    "ulog": lambda folder, **how: ulog(folder / "log.ulg", **how),
    "dataflash": lambda folder, **how: dataflash(folder / "log.bin", **how),
    "ros1": lambda folder, **how: bag(folder / "log.bag", "ros1", **how),
    "ros2": lambda folder, **how: bag(folder / "log", "sqlite3", **how),
    "mcap": lambda folder, **how: bag(folder / "log", "mcap", **how),
}
LIBRARY = {
    "ulog": "pyulog",
    "dataflash": "pymavlink",
    "ros1": "rosbags",
    "ros2": "rosbags",
    "mcap": "rosbags",
}
KINDS = pytest.mark.parametrize("kind", MAKERS)


@KINDS
def test_a_static_log_holds_its_samples(kind, tmp_path):
    pytest.importorskip(LIBRARY[kind])
    gyro, accel = read(MAKERS[kind](tmp_path, fixes=False))
    exact = 1e-7 if kind == "dataflash" else 1e-12  # dataflash keeps single precision
    np.testing.assert_allclose(gyro.y, GYRO, rtol=exact, atol=1e-11)
    np.testing.assert_allclose(accel.y, ACCEL, rtol=exact, atol=1e-9)
    assert gyro.interval == pytest.approx(1.0 / RATE, rel=1e-9)


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_messages_of_a_driver_are_read_by_the_imu_in_them(kind, tmp_path):
    pytest.importorskip("rosbags")
    gyro, accel = read(MAKERS[kind](tmp_path, fixes=False, message="driver_msgs/msg/Reading"))
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-12, atol=1e-9)
    assert gyro.interval == pytest.approx(1.0 / RATE, rel=1e-9)


def test_a_dataflash_log_of_2014_has_stamps_in_milliseconds_and_a_type_an_instance(tmp_path):
    """Such logs were refused as damaged; the fields are those of the log of an APM:Copter 3.2."""
    pytest.importorskip("pymavlink")
    stamped = np.round(1e3 * T) + 5000
    rows = []
    for k, milliseconds in enumerate(stamped.astype(int).tolist()):
        for name, scale in (("IMU", 1.0), ("IMU2", 2.0)):
            values = {"TimeMS": ("I", milliseconds)}
            values |= {f"Gyr{a}": ("f", scale * GYRO[k, j]) for j, a in enumerate("XYZ")}
            values |= {f"Acc{a}": ("f", ACCEL[k, j]) for j, a in enumerate("XYZ")}
            rows.append((milliseconds, (name, values)))
    for k, t in enumerate(FIX_T):
        gps = {"Status": ("B", 3), "TimeMS": ("I", 400_000_000 + round(1e3 * t)), "Week": ("I", 1800)}
        gps |= {
            "Lat": ("L", round(1e7 * LLH[k, 0])),
            "Lng": ("L", round(1e7 * LLH[k, 1])),
            "Alt": ("d", LLH[k, 2]),
        }
        gps |= {"Spd": ("d", 1.0), "GCrs": ("d", 0.0), "VZ": ("d", 0.0), "T": ("I", round(1e3 * t) + 5000)}
        rows.append((round(1e3 * t) + 5000, ("GPS", gps)))
    path = tmp_path / "log.bin"
    write_dataflash(path, [message for _, message in sorted(rows, key=lambda row: row[0])])
    drive = read_drive(path)
    np.testing.assert_allclose(drive.rates[:, :3], GYRO[: len(drive.rates)], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(drive.gnss.t, FIX_T, atol=1.1e-3)
    chosen = {"t": "IMU.1/t", "gyro": "IMU.1/gyro", "accel": "IMU.1/accel"}
    second = read(path, columns=chosen)[0]
    np.testing.assert_allclose(second.y[10:20], 2.0 * GYRO[10:20], rtol=1e-6, atol=1e-9)
    both = load_sources([f"{path}:IMU.0", f"{path}:IMU.1"], Reading(), Messages(quiet=True))
    for scale, (gyro, accel) in zip((1.0, 2.0), both, strict=True):
        np.testing.assert_allclose(gyro.y[10:20], scale * GYRO[10:20], rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(accel.y[10:20], ACCEL[10:20], rtol=1e-6, atol=1e-6)
    assert [records_name(one) for one in both] == ["log-IMU.0", "log-IMU.1"]
    with pytest.raises(DataError, match=r"IMU\.7"):
        load_sources([f"{path}:IMU.7"], Reading(), Messages(quiet=True))


def test_a_unit_named_of_a_ulog_has_its_own_temperature_and_notes(tmp_path):
    """The temperature of `sensor_combined`, of another rate, was taken for that of every unit, and refused."""
    pytest.importorskip("pyulog")
    path = ulog(tmp_path / "log.ulg", fixes=False, instances=2, combined=True)
    said = []
    messages = Messages(quiet=True)
    for i in (0, 1):
        gyro, accel = load_sources([f"{path}:vehicle_imu.{i}"], Reading(), messages)[0]
        np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(accel.covariates["temperature"], 20.0 + 10.0 * i)
        said += gyro.notes
    assert not any("columns" in note for note in said)
    by_columns = {part: f"vehicle_imu.1/{part}" for part in ("t", "gyro", "accel")}
    gyro, _ = read(path, columns=by_columns)
    assert "temperature" not in gyro.covariates
    assert any("temperature" in note and "left out" in note for note in gyro.notes)
    both = read(path)[0].notes
    assert any("sensor_combined.0" in note and "log.ulg:vehicle_imu.0" in note for note in both)
    assert not read(path, columns={"temperature": "none"})[0].covariates


def test_a_unit_that_a_log_has_not_is_refused_with_those_it_has(tmp_path):
    pytest.importorskip("pyulog")
    path = ulog(tmp_path / "log.ulg", fixes=False)
    with pytest.raises(
        DataError, match=r"no inertial unit 'vehicle_imu\.1': it has vehicle_imu\.0"
    ) as refused:
        read(f"{path}:vehicle_imu.1")
    assert "--columns" not in str(refused.value)
    np.savez(tmp_path / "log.npz", gyro=GYRO, accel=ACCEL, t=T)
    with pytest.raises(DataError, match=r"leave ':IMU\.0' out"):
        read(f"{tmp_path / 'log.npz'}:IMU.0")


@pytest.mark.parametrize("kind", ["ulog", "dataflash"])
def test_a_drive_says_which_of_its_units_it_took(kind, tmp_path):
    pytest.importorskip(LIBRARY[kind])
    notes = read_drive(MAKERS[kind](tmp_path, instances=2)).notes
    assert any(".0 (" in note and "also holds" in note for note in notes)


def test_types_that_a_file_does_not_define_are_named_with_the_cure(tmp_path):
    pytest.importorskip("rosbags")
    path = bag(tmp_path / "log", "sqlite3", fixes=False, message="driver_msgs/msg/Reading")
    with contextlib.closing(sqlite3.connect(next(path.glob("*.db3")))) as file, file:
        file.execute("DROP TABLE message_definitions")
        file.execute("UPDATE schema SET schema_version = 3")
    (path / "metadata.yaml").unlink()
    with pytest.raises(
        DataError, match="does not define driver_msgs/msg/Reading: `ros2 bag convert` to MCAP"
    ):
        read(next(path.glob("*.db3")))


@KINDS
def test_a_drive_holds_its_fixes(kind, tmp_path):
    pytest.importorskip(LIBRARY[kind])
    path = MAKERS[kind](tmp_path)
    drive = read_if_drive(path)
    assert drive is not None
    # ULog and dataflash keep degrees · 10⁷: half a unit is 9e-10 rad.
    np.testing.assert_allclose(drive.gnss.llh[:, :2], np.radians(LLH[:, :2]), atol=1e-9)
    np.testing.assert_allclose(drive.gnss.llh[:, 2], LLH[:, 2], atol=6e-4)
    np.testing.assert_allclose(drive.gnss.t, FIX_T, atol=1e-6)
    known = np.isfinite(drive.gnss.vel_n[:, 0])
    assert np.count_nonzero(~known) == (9 if kind == "ulog" else 0)  # velocities marked as invalid
    np.testing.assert_allclose(drive.gnss.vel_n[known], VEL[known], atol=1e-9)
    np.testing.assert_allclose(drive.gnss.position_sd, np.tile([0.8, 0.8, 1.5], (len(FIX_T), 1)), rtol=1e-6)
    np.testing.assert_allclose(drive.rates[:, 3:], ACCEL, rtol=1e-6, atol=1e-9)
    framed = kind in ("ulog", "dataflash")
    assert any("velocities of the fixes are those of '/vel'" in note for note in drive.notes) != framed
    assert (drive.mounting is not None) == framed


@KINDS
def test_a_log_is_parsed_once_to_tell_and_to_read_its_drive(kind, tmp_path, monkeypatch):
    pytest.importorskip(LIBRARY[kind])
    path, parsed = MAKERS[kind](tmp_path), []
    declared = log_format.format_of(log_format.file_of(path))
    counting = replace(declared, drive=lambda p: parsed.append(p) or declared.drive(p))
    monkeypatch.setattr(log_format, "format_of", lambda _: counting)
    drive = read_if_drive(path)
    assert len(parsed) == 1
    np.testing.assert_array_equal(drive.rates, read_drive(path).rates)
    (tmp_path / "static").mkdir()
    assert read_if_drive(MAKERS[kind](tmp_path / "static", fixes=False)) is None


@KINDS
def test_a_second_unit_is_named_and_can_be_chosen(kind, tmp_path):
    pytest.importorskip(LIBRARY[kind])
    path = MAKERS[kind](tmp_path, fixes=False, instances=2)
    gyro, _ = read(path)
    note = next(note for note in gyro.notes if "the file also holds" in note)
    named, _, option = note.split("choose one by ")[1].partition(" --columns ")
    chosen = dict(part.split("=") for part in option.strip("'").split(",")) if option else None
    again, accel = read(path if option else path.with_name(named), columns=chosen)
    np.testing.assert_array_equal(again.y, gyro.y)
    assert accel.axes == ("accel_x", "accel_y", "accel_z")


@KINDS
def test_a_drive_without_fixes_is_one_line(kind, tmp_path):
    pytest.importorskip(LIBRARY[kind])
    path = MAKERS[kind](tmp_path, fixes=False)
    assert read_if_drive(path) is None
    with pytest.raises(DataError, match="expected a receiver with 10 fixes or more"):
        read_drive(path)


def test_a_temperature_that_px4_logs_rarely_is_put_between_the_samples(tmp_path):
    """Loggers of PX4 keep `sensor_combined` at full rate and the sensors with their temperature once a second."""
    rare = T[:: 5 * RATE]
    topics = {
        ("sensor_combined", 0): {
            "timestamp": (1e6 * T + 5e6).astype(np.uint64),
            **{f"gyro_rad[{j}]": GYRO[:, j] for j in range(3)},
            **{f"accelerometer_m_s2[{j}]": ACCEL[:, j] for j in range(3)},
        },
        ("sensor_gyro", 0): {
            "timestamp": (1e6 * rare + 5e6).astype(np.uint64),
            **dict.fromkeys("xyz", 0.0 * rare),
            "temperature": 30.0 + rare,
        },
    }
    write_ulog(tmp_path / "a.ulg", topics)
    records = read(tmp_path / "a.ulg")
    assert any("temperature of 'sensor_gyro.0'" in note for note in records[0].notes)
    celsius = records[0].covariates["temperature"]
    np.testing.assert_allclose(celsius[: len(T) // 2], 30.0 + T[: len(T) // 2], atol=0.02)


def test_compiled_code_of_a_library_prints_nothing(tmp_path, capfd):
    pytest.importorskip("pymavlink")
    path = dataflash(tmp_path / "log.bin")
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 50] = bytes(50)
    path.write_bytes(content)
    with contextlib.suppress(DataError):
        read(path)
    assert capfd.readouterr() == ("", "")


@KINDS
def test_a_truncated_file_is_read_to_its_end_or_refused_in_one_line(kind, tmp_path):
    pytest.importorskip(LIBRARY[kind])
    path = MAKERS[kind](tmp_path)
    if path.is_dir():
        path = next(path.glob("*.db3"))
    data = path.read_bytes()
    for share in (0.5, 0.02, 0.0001):
        short = tmp_path / f"short{path.suffix}"
        short.write_bytes(data[: int(share * len(data))])
        try:
            gyro, *_ = read(short)
        except DataError as error:
            said = str(error)
        else:
            np.testing.assert_allclose(gyro.y, GYRO[: len(gyro.y)], rtol=1e-7, atol=1e-9)
            continue
        assert str(short) in said
        assert "\n" not in said


def test_binary_output_of_another_sensor_is_no_dataflash_log(tmp_path):
    """Of a VectorNav's log.bin it was said that it holds no messages of an inertial unit."""
    (tmp_path / "log.bin").write_bytes(b"\xfa\x01\x29\x01" * 100)
    with pytest.raises(DataError, match="found fa 01: export another sensor's binary output as CSV"):
        read(tmp_path / "log.bin")
