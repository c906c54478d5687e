"""Files as instruments, applications and spreadsheets write them hold the samples that were put in."""

import zipfile

import numpy as np
import pytest

from tuner.readers import read
from tuner.readers.drive import read_if_drive
from tuner.types.records import DataError

RATE, N = 100.0, 600
RNG = np.random.default_rng(3)
T = np.arange(N) / RATE
GYRO = RNG.normal(0.0, 1e-3, (N, 3))
ACCEL = RNG.normal(0.0, 1e-2, (N, 3)) + np.array([0.0, 0.0, 9.81])
EPOCH = 1_700_000_000_000_000_000


def table(path, header, rows, separator=",", above=""):
    lines = [separator.join(x if isinstance(x, str) else f"{x:.12g}" for x in row) for row in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(above + header + "\n" + "\n".join(lines) + "\n")
    return path


def spreadsheet(folder):
    """Semicolons and decimal commas."""
    header = "Zeit [s];gyro_x [deg/s];gyro_y [deg/s];gyro_z [deg/s];accel_x [g];accel_y [g];accel_z [g]"
    rows = np.column_stack([T, np.degrees(GYRO), ACCEL / 9.80665])
    path = table(folder / "excel.csv", header, rows, ";")
    return path.write_text(path.read_text().replace(".", ",")) and path


def xsens(folder):
    above = "// General information:\n// Update Rate: 100.0Hz\n"
    header = "PacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"
    rows = [(str(i), *ACCEL[i], *GYRO[i]) for i in range(N)]
    return table(folder / "MT.txt", header, rows, "\t", above)


def settings_above(folder):
    """Settings of a logger as pairs, the sampling frequency by its symbol."""
    rows = [(*ACCEL[i], *GYRO[i]) for i in range(N)]
    header = "ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]"
    return table(folder / "log.csv", header, rows, ",", "Fs,100\nLogging Type,1\nWaiting time,-1\n")


def xsens_ticks(folder):
    """Nothing but the maker's name says that the stamps are ticks of 10 kHz."""
    header = "SampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"
    rows = [(str(round(1e4 * T[i])), *ACCEL[i], *GYRO[i]) for i in range(N)]
    return table(folder / "MT.txt", header, rows, "\t")


def vectornav(folder):
    names = [f"imuGroup.{kind}.c[{i}]" for kind in ("gyro", "accel") for i in range(3)]
    rows = [(str(round(1e9 * T[i])), *GYRO[i], *ACCEL[i]) for i in range(N)]
    return table(folder / "vn.csv", ",".join(["imuGroup.timeStartup [ns]", *names]), rows)


def sbg(folder):
    """Rates beside increments."""
    names = [f"{kind}{axis}" for kind in ("accel", "gyro", "deltaVel", "deltaAngle") for axis in "XYZ"]
    rows = [
        (str(round(1e6 * T[i])), *ACCEL[i], *GYRO[i], *ACCEL[i] / RATE, *GYRO[i] / RATE) for i in range(N)
    ]
    return table(folder / "sbg.txt", "\t".join(["timestamp [us]", *names]), rows, "\t")


def euroc(folder):
    names = [f"w_RS_S_{a} [rad s^-1]" for a in "xyz"] + [f"a_RS_S_{a} [m s^-2]" for a in "xyz"]
    rows = [(str(EPOCH + round(1e9 * T[i])), *GYRO[i], *ACCEL[i]) for i in range(N)]
    table(folder / "mav0/imu0/data.csv", ",".join(["#timestamp [ns]", *names]), rows)
    return folder


def euroc_unit(folder):
    """The folder of the unit alone, where a shell completes the path to."""
    return euroc(folder) / "mav0" / "imu0"


def phyphox(folder):
    for name, values, late in (("Gyroscope", GYRO, 0.003), ("Accelerometer", ACCEL, 0.0)):
        header = ",".join(['"Time (s)"', *(f'"{name} {a} (unit)"' for a in "xyz")])
        table(folder / f"{name}.csv", header, np.column_stack([T + late, values]))
    return folder


def sensor_logger(folder):
    """Axes from z to x; the calibrated gyroscope differs from the uncalibrated one."""
    uncalibrated = {"GyroscopeUncalibrated": GYRO, "Gyroscope": GYRO - 1.0, "TotalAcceleration": ACCEL}
    for name, values in uncalibrated.items():
        rows = [(str(EPOCH), T[i], *values[i, ::-1]) for i in range(N)]
        table(folder / f"{name}.csv", "time,seconds_elapsed,z,y,x", rows)
    return folder


def sensor_logger_of_2021(folder):
    """Stamps in ns since 1970 only; its accelerometer is without gravity."""
    for name, values in {
        "Gyroscope": GYRO,
        "AccelerometerUncalibrated": ACCEL,
        "Accelerometer": ACCEL - 9.81,
    }.items():
        rows = [(str(EPOCH + round(1e9 * T[i])), *values[i, ::-1]) for i in range(N)]
        table(folder / f"{name}.csv", "time,z,y,x", rows)
    return folder


def packed(folder):
    """The same as a ZIP."""
    sensor_logger(folder)
    with zipfile.ZipFile(folder / "log.zip", "w") as archive:
        for file in folder.glob("*.csv"):
            archive.write(file, file.name)
    return folder / "log.zip"


def kitti(folder):
    data = folder / "oxts/data"
    data.mkdir(parents=True)
    for i in range(N):
        fields = [*np.zeros(11), *ACCEL[i], *np.ones(3), *GYRO[i], *np.ones(10)]
        (data / f"{i:010d}.txt").write_text(" ".join(f"{x:.15g}" for x in fields))
    stamps = [f"2011-09-26 13:{2 + int(s // 60):02d}:{s % 60:012.9f}" for s in T]
    (folder / "oxts/timestamps.txt").write_text("\n".join(stamps) + "\n")
    return folder


WRITERS = (
    spreadsheet,
    xsens,
    settings_above,
    xsens_ticks,
    vectornav,
    sbg,
    euroc,
    euroc_unit,
    phyphox,
    sensor_logger,
    sensor_logger_of_2021,
    packed,
    kitti,
)


@pytest.mark.parametrize("write", WRITERS)
def test_the_samples_come_back(write, tmp_path):
    path = write(tmp_path)
    assert read_if_drive(path) is None
    gyro, accel = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-9, atol=1e-12)
    assert gyro.interval == pytest.approx(1.0 / RATE, rel=1e-6)


def test_units_in_the_names_of_phone_columns_are_read(tmp_path):
    """deg/s in the header was read as rad/s."""
    phyphox(tmp_path)
    header = ",".join(['"Time (s)"', *(f'"Gyroscope {a} (deg/s)"' for a in "xyz")])
    table(tmp_path / "Gyroscope.csv", header, np.column_stack([T, np.degrees(GYRO)]))
    np.testing.assert_allclose(read(tmp_path)[0].y, GYRO, rtol=1e-9)


def test_phone_sensors_of_different_rates_are_refused_with_the_way_out(tmp_path):
    phyphox(tmp_path)
    table(tmp_path / "Accelerometer.csv", "time,x,y,z", np.column_stack([T[:300] * 2.0, ACCEL[:300]]))
    with pytest.raises(DataError, match=r"not sampled together: .*one at a time"):
        read(tmp_path)


def test_the_uncalibrated_accelerometer_of_an_iphone_is_in_g(tmp_path):
    """It was refused until --accel-unit g was given."""
    sensor_logger(tmp_path)
    (tmp_path / "TotalAcceleration.csv").unlink()
    rows = [(str(EPOCH), T[i], *ACCEL[i, ::-1] / 9.80665) for i in range(N)]
    table(tmp_path / "AccelerometerUncalibrated.csv", "time,seconds_elapsed,z,y,x", rows)
    gyro, accel = read(tmp_path)
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-9, atol=1e-12)
    assert any("no unit" in note and note.endswith(": g") for note in gyro.notes)


def test_phone_sensors_that_lost_samples_of_their_own_are_paired_by_their_times(tmp_path):
    """An application that was paused left 85 s out of the gyroscope's file: refused as not sampled together."""
    phyphox(tmp_path)
    gyro, accel = (np.delete(np.arange(N), lost) for lost in (slice(200, 240), [300]))
    names = "time,x,y,z"
    table(tmp_path / "Gyroscope.csv", names, np.column_stack([T, GYRO])[gyro])
    table(tmp_path / "Accelerometer.csv", names, np.column_stack([T + 0.4 / RATE, ACCEL])[accel])
    rates, force = read(tmp_path)
    kept = np.setdiff1d(gyro, [300])
    place = np.rint(RATE * (rates.t - rates.t[0])).astype(int)
    known = np.isin(place, kept)
    np.testing.assert_allclose(rates.y[known], GYRO[place[known]], atol=1e-12)
    np.testing.assert_allclose(force.y[known], ACCEL[place[known]], atol=1e-9)
    assert known.sum() == len(kept)


@pytest.mark.parametrize("head", [b"$GNGGA,134355.50,4922.59358,N\r\n", b"\xb5b\x01\x07\0\0"])
def test_a_log_of_a_receiver_is_refused_as_such(head, tmp_path):
    """NMEA in a file named .ubx was taken for a table without gyros."""
    (tmp_path / "gps.ubx").write_bytes(40 * head)
    with pytest.raises(DataError, match="hold no inertial samples: put the file"):
        read(tmp_path / "gps.ubx")


def test_lines_that_a_windows_program_ended_twice_are_read(tmp_path):
    path = table(tmp_path / "log.csv", "GPST,Gx,Gy,Gz,Ax,Ay,Az", np.column_stack([T + 390884.0, GYRO, ACCEL]))
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\r\n"))
    gyro, accel = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-9)
    assert (gyro.t[0], len(accel)) == (pytest.approx(390884.0), N)


@pytest.mark.parametrize(("header", "separator"), [("Gyro. X", ","), ("time  Gyro. X  Gyro. Y", " ")])
def test_names_with_blanks_above_columns_without_them_are_names(header, separator, tmp_path):
    """One column has no separator that its name could be split by; aligned columns stand two blanks apart."""
    rows = np.column_stack([T, GYRO])[:, 1 if separator == "," else slice(0, 3)].reshape(N, -1)
    (log,) = read(table(tmp_path / "log.txt", header, rows, separator), rate=RATE, assume="si")
    assert log.axes[0] == "gyro_x"
    np.testing.assert_allclose(log.column("gyro_x"), GYRO[:, 0], rtol=1e-9)
