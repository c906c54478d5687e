"""Files of receivers beside ``imu.csv``: positions, velocities, sds, and the clock they are put on."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from tuner.readers.drive import read_drive
from tuner.readers.fixes.gps_time import GPS_EPOCH, gps_seconds
from tuner.types.records import DataError

START = datetime(2022, 3, 20, 23, 59, 50, tzinfo=UTC)  # over midnight
SECONDS = 40
LAT, LON = 47.0 + 2e-5 * np.arange(SECONDS), 8.0 + 3e-5 * np.arange(SECONDS)
HEIGHT = 430.0 + 0.5 * np.arange(SECONDS)
NORTH, EAST, DOWN = 2.22, 2.28, -0.5
IMU_RATE = 20


def imu(folder, first):
    t = first - 2.0 + np.arange((SECONDS + 4) * IMU_RATE) / IMU_RATE
    rng = np.random.default_rng(2)
    rows = np.column_stack(
        [t, rng.normal(0, 1e-3, (len(t), 3)), rng.normal(0, 1e-2, (len(t), 3)) + np.array([0, 0, -9.81])]
    )
    header = (
        "t [s],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2]"
    )
    np.savetxt(folder / "imu.csv", rows, delimiter=",", header=header, comments="", fmt="%.6f")


def rtklib(folder, *, week=False):
    lines = [
        "% program   : RTKPOST",
        "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns ...",
    ]
    for k in range(SECONDS):
        gps = gps_seconds(START) + k
        when = GPS_EPOCH + timedelta(seconds=gps)
        stamp = f"{int(gps // 604800)} {gps % 604800:.3f}" if week else f"{when:%Y/%m/%d %H:%M:%S}.000"
        lines.append(
            f"{stamp} {LAT[k]:.9f} {LON[k]:.9f} {HEIGHT[k]:.4f} 1 9 0.0100 0.0200 0.0300 0 0 0 0.00 9.9 "
            f"{NORTH:.5f} {EAST:.5f} {-DOWN:.5f} 0.05 0.06 0.07 0 0 0"
        )
    (folder / "rover.pos").write_text("\n".join(lines) + "\n")


def nmea(folder):
    def sentence(body):
        check = 0
        for c in body:
            check ^= ord(c)
        return f"${body}*{check:02X}\r\n"

    def angle(value, digits):
        return f"{int(value):0{digits}d}{60 * (value % 1):010.7f}"

    knots = math.hypot(NORTH, EAST) / (1852 / 3600)
    course = math.degrees(math.atan2(EAST, NORTH))
    out = []
    for k in range(SECONDS):
        when = START + timedelta(seconds=k)
        place = f"{angle(LAT[k], 2)},N,{angle(LON[k], 3)},E"
        clock = f"{when:%H%M%S}.00"
        out.append(sentence(f"GPGGA,{clock},{place},4,10,0.8,{HEIGHT[k] - 48.0:.4f},M,48.0,M,1.0,0000"))
        out.append(sentence(f"GPRMC,{clock},A,{place},{knots:.6f},{course:.6f},{when:%d%m%y},,,A"))
        out.append(sentence(f"GPGST,{clock},1.0,0.0,0.0,0.0,0.01,0.02,0.03"))
    (folder / "rover.nmea").write_text("".join(out))


def ubx(folder):
    from pyubx2 import SET, UBXMessage  # noqa: F401

    out = b""
    for k in range(SECONDS):
        when = START + timedelta(seconds=k)
        message = UBXMessage(
            "NAV", "NAV-PVT", 0,
            iTOW=0, year=when.year, month=when.month, day=when.day, hour=when.hour, min=when.minute,
            second=when.second, validDate=1, validTime=1, nano=0, fixType=3, gnssFixOk=1, numSV=10,
            lat=LAT[k], lon=LON[k], height=round(1e3 * HEIGHT[k]), hAcc=10, vAcc=30, sAcc=50,
            velN=round(1e3 * NORTH), velE=round(1e3 * EAST), velD=round(1e3 * DOWN),
        )  # fmt: skip
        out += message.serialize()
    (folder / "rover.ubx").write_bytes(out)


WRITERS = {"rtklib": rtklib, "week": lambda folder: rtklib(folder, week=True), "nmea": nmea, "ubx": ubx}
SOLUTION = {"rtklib": 4, "week": 4, "nmea": 4, "ubx": 1}
LIBRARY = {"nmea": "pynmeagps", "ubx": "pyubx2"}
GPS_START = gps_seconds(START)
CLOCKS = {
    "GPS seconds of the week": GPS_START % 604800,
    "UNIX time": START.timestamp(),
    "GPS time since 1970, as RTKLIB does": START.timestamp() + 18,
    "GPS time": GPS_START,
    "seconds of the day": (GPS_START - 18) % 86400,
}


def test_gps_time_is_18_s_ahead_of_utc_since_2017_and_weeks_count_from_1980():
    """GPS week 2202 began on 20 March 2022 at 0 h GPS time."""
    assert gps_seconds(datetime(2022, 3, 20, tzinfo=UTC)) == 2202 * 604800 + 18
    assert gps_seconds(datetime(2016, 6, 1, tzinfo=UTC)) % 1 == 0
    assert gps_seconds(datetime(2016, 12, 31, 23, 59, 59, tzinfo=UTC)) + 2 == gps_seconds(
        datetime(2017, 1, 1, tzinfo=UTC)
    )


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("clock", CLOCKS)
def test_fixes_come_back_on_the_clock_of_the_inertial_record(kind, clock, tmp_path):
    if kind in LIBRARY:
        pytest.importorskip(LIBRARY[kind])
    imu(tmp_path, CLOCKS[clock])
    WRITERS[kind](tmp_path)
    drive = read_drive(tmp_path)
    assert len(drive.gnss) == SECONDS
    np.testing.assert_allclose(drive.gnss.t, 2.0 + np.arange(SECONDS), atol=1e-3)
    np.testing.assert_allclose(np.degrees(drive.gnss.llh[:, 0]), LAT, atol=2e-9)
    np.testing.assert_allclose(np.degrees(drive.gnss.llh[:, 1]), LON, atol=2e-9)
    np.testing.assert_allclose(drive.gnss.llh[:, 2], HEIGHT, atol=1e-3)
    np.testing.assert_allclose(drive.gnss.vel_n[:, :2], [[NORTH, EAST]] * SECONDS, atol=1e-4)
    if kind == "nmea":
        assert np.isnan(drive.gnss.vel_n[:, 2]).all()
    else:
        np.testing.assert_allclose(drive.gnss.vel_n[:, 2], DOWN, atol=1e-4)
    np.testing.assert_allclose(drive.gnss.position_sd[:, 2], 0.03, rtol=1e-6)
    assert any(clock in note for note in drive.notes)
    assert (drive.gnss.solution == SOLUTION[kind]).all()


def test_a_record_on_another_clock_is_refused_with_the_spans(tmp_path):
    imu(tmp_path, 5.0)
    rtklib(tmp_path)
    with pytest.raises(
        DataError, match=r"rover\.pos: expected fixes of the time of the inertial record, 3\.0 …"
    ):
        read_drive(tmp_path)


def test_other_coordinates_and_two_files_are_refused(tmp_path):
    imu(tmp_path, CLOCKS["UNIX time"])
    (tmp_path / "a.pos").write_text("%  GPST  x-ecef(m) y-ecef(m)\n2022/03/20 00:00:00.0 1 2 3 1 9\n")
    with pytest.raises(DataError, match="set the solution format to Lat/Lon/Height"):
        read_drive(tmp_path)
    rtklib(tmp_path)
    with pytest.raises(DataError, match=r"found a\.pos, rover\.pos"):
        read_drive(tmp_path)
