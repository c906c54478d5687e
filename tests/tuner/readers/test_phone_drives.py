"""Drives as phones write them, a file a sensor with the fixes beside, hold what was put in."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tuner.examination.examine import examine
from tuner.readers.drive import read_drive, read_if_drive
from tuner.types.records import DataError

RATE, SECONDS = 50.0, 30
RNG = np.random.default_rng(5)
T = np.arange(SECONDS * RATE) / RATE
GYRO = RNG.normal(0.0, 1e-3, (len(T), 3))
ACCEL = RNG.normal(0.0, 1e-2, (len(T), 3)) + np.array([0.0, 0.0, 9.81])
FIX_T = np.arange(2.0, SECONDS - 1.0)
LAT, LON = 48.8 + 1e-4 * FIX_T, 9.1 + 0.0 * FIX_T
SPEED, COURSE = np.full(len(FIX_T), 11.0), np.full(len(FIX_T), 30.0)
BOOT = 473_990_000_000_000
PHONES = Path(os.environ.get("TUNER_DATA", "nowhere")) / "phones"


def _table(path: Path, head: str, columns: list[np.ndarray], separator: str = ",", above: str = "") -> None:
    rows = (
        separator.join(f"{x:.15g}" for x in row) + separator * (separator == ";")
        for row in zip(*columns, strict=True)
    )
    path.write_text(above + head + "\n" + "\n".join(rows) + "\n")


def published(folder: Path) -> Path:
    """Semicolons to the end of the line, two lines above the header, ns since the phone was started."""
    for name, long, unit, values in (("Acc", "Acc", "m/s^2", ACCEL), ("Gyro", "Gyro", "rad/s", GYRO)):
        head = "; ".join([f"Timestamp{long} [ns]", *(f"{name}{a} [{unit}]" for a in "XYZ")])
        above = "Sensor: LSM6DSL\nVendor: STM\n"
        _table(folder / f"trip_{long}.csv", head, [BOOT + 1e9 * T, *values.T], ";", above)
    head = (
        "TimestampGNSS [ns]; UTC time [ms]; Lat [deg]; Lon [deg]; Height [m]; Speed [m/s]; Heading [deg]; "
        "Hor Acc [m]; Vert Acc [m]; Speed Acc [m/s]; Heading Acc [deg]"
    )
    columns = [BOOT + 1e9 * FIX_T, 1.6e12 + 1e3 * FIX_T, LAT, LON, 300.0 + 0.0 * FIX_T, SPEED, COURSE]
    columns += [np.full(len(FIX_T), x) for x in (3.0, 5.0, 0.2, 2.0)]
    _table(folder / "trip_GNSS.csv", head, columns, ";")
    return folder


def sensor_logger(folder: Path) -> Path:
    for name, values in (("GyroscopeUncalibrated", GYRO), ("TotalAcceleration", ACCEL)):
        _table(folder / f"{name}.csv", "time,seconds_elapsed,z,y,x", [1.7e18 + 1e9 * T, T, *values.T[::-1]])
    head = (
        "time,seconds_elapsed,bearingAccuracy,speedAccuracy,verticalAccuracy,horizontalAccuracy,speed,bearing,"
        "altitude,longitude,latitude"
    )
    sds = [np.full(len(FIX_T), x) for x in (2.0, 0.2, 5.0, 3.0)]
    place = [SPEED, COURSE, 300.0 + 0.0 * FIX_T, LON, LAT]
    _table(folder / "Location.csv", head, [1.7e18 + 1e9 * FIX_T, FIX_T, *sds, *place])
    return folder


def phyphox(folder: Path) -> Path:
    for name, unit, values in (("Gyroscope", "rad/s", GYRO), ("Accelerometer", "m/s^2", ACCEL)):
        head = ",".join(['"Time (s)"', *(f'"{name} {a} ({unit})"' for a in "xyz")])
        _table(folder / f"{name}.csv", head, [T, *values.T])
    head = (
        '"Time (s)","Latitude (°)","Longitude (°)","Height (m)","Velocity (m/s)","Direction (°)",'
        '"Horizontal Accuracy (m)","Vertical Accuracy (°)"'  # phyphox itself writes degrees above metres
    )
    sds = [np.full(len(FIX_T), x) for x in (3.0, 5.0)]
    _table(folder / "Location.csv", head, [FIX_T, LAT, LON, 300.0 + 0.0 * FIX_T, SPEED, COURSE, *sds])
    return folder


@pytest.mark.parametrize("write", [published, sensor_logger, phyphox])
def test_samples_and_fixes_come_back(write, tmp_path):
    """A course of 30° turns 11 m/s into 9.53 m/s north and 5.5 m/s east; the phone gives none down."""
    drive = read_drive(write(tmp_path))
    np.testing.assert_allclose(drive.rates, np.hstack([GYRO, ACCEL]), atol=1e-9)
    np.testing.assert_allclose(drive.imu_t, T, atol=1e-4)
    np.testing.assert_allclose(drive.gnss.t, FIX_T, atol=1e-4)
    np.testing.assert_allclose(np.degrees(drive.gnss.llh[:, 0]), LAT)
    np.testing.assert_allclose(drive.gnss.vel_n[:, :2], np.tile([9.526, 5.5], (len(FIX_T), 1)), atol=1e-3)
    assert np.isnan(drive.gnss.vel_n[:, 2]).all()
    # 68 % of a circular normal error lie within 1.51 sds of an axis (Rayleigh)
    np.testing.assert_allclose(
        drive.gnss.position_sd, np.tile([1.987, 1.987, 5.0], (len(FIX_T), 1)), atol=1e-3
    )


def test_the_sd_of_a_velocity_is_that_of_speed_along_and_of_course_across(tmp_path):
    """0.2 m/s along 30°, 11 m/s times 2° = 0.384 m/s across it."""
    drive = read_drive(published(tmp_path))
    north, east = np.hypot([0.1732, 0.1], [0.192, 0.3325])
    np.testing.assert_allclose(drive.gnss.velocity_sd[0, :2], [north, east], atol=1e-3)


def test_what_a_phone_writes_for_unknown_is_no_number(tmp_path):
    """A phone that stands has speed 0, course −3000 and accuracy −1: velocity zero, of an unknown sd."""
    file = published(tmp_path) / "trip_GNSS.csv"
    file.write_text(file.read_text().replace(";11;30;3;5;0.2;2;", ";0;-3000;3;5;0.2;-1;", 1))
    file.write_text(file.read_text().replace(";11;30;3;5;0.2;2;", ";4;-3000;3;5;0.2;-1;", 1))
    gnss = read_drive(tmp_path).gnss
    np.testing.assert_array_equal(gnss.vel_n[0, :2], 0.0)
    assert np.isnan(gnss.vel_n[1]).all()
    assert np.isfinite(gnss.vel_n[2:, :2]).all()
    assert not (gnss.velocity_sd[:, :2] < 0.0).any()


def test_without_fixes_it_is_a_log(tmp_path):
    (published(tmp_path) / "trip_GNSS.csv").unlink()
    assert read_if_drive(tmp_path) is None
    with pytest.raises(
        DataError, match="expected gyroscope, accelerometer and fixes of a drive, found trip_Acc"
    ):
        read_drive(tmp_path)


def test_a_table_of_fixes_may_have_the_names_of_others(tmp_path):
    """Only t, lat, lon and height were known in gnss.csv."""
    head = "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    _table(tmp_path / "imu.csv", head, [T, *GYRO.T, *ACCEL.T])
    head = "timestamp [ms],latitude,longitude,altitude,speed [km/h],bearing"
    _table(tmp_path / "gnss.csv", head, [1e3 * FIX_T, LAT, LON, 300.0 + 0.0 * FIX_T, 3.6 * SPEED, COURSE])
    gnss = read_drive(tmp_path).gnss
    np.testing.assert_allclose(gnss.t, FIX_T, atol=1e-6)
    np.testing.assert_allclose(np.hypot(*gnss.vel_n[:, :2].T), SPEED)


@pytest.mark.skipif(not PHONES.is_dir(), reason="TUNER_DATA does not name a folder with recordings")
@pytest.mark.parametrize("name", ["20201104_091730", "20201121_152755_city"])
def test_published_drives_of_phones_are_read(name):
    """Turns, axes, units and clocks agree (their owner's data by hand): late stamps are all that contradicts."""
    drive = read_drive(PHONES / name)
    assert np.median(np.linalg.norm(drive.rates[:, 3:], axis=1)) == pytest.approx(9.8, abs=0.3)
    found = examine(drive)
    assert all("late by" in one.fault for one in found.repairs)
    assert {one.stream for one in found.repairs} <= {"receiver", "velocities"}
    assert not any("delay" in one for one in found.unseen) or not found.repairs
