"""Forms of logs that public reports describe and that were refused or misread; `tests/cases` names the reports."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.readers import read
from tuner.readers.words import as_signed
from tuner.types.records import DataError

RATE = 100.0
N = 3000


@pytest.fixture
def samples():
    """Rates, rad/s, and specific forces, m/s², of a unit at rest."""
    x = np.random.default_rng(5).standard_normal((N, 6))
    return x[:, :3] * 1.2e-3 + [0.004, -0.003, 0.006], x[:, 3:] * 0.015 + [0.12, -0.21, 9.79]


def written(path, head, columns, *, fmt="%.9g", sep=","):
    """Write columns under a head and return what is read of them, by sensor."""
    np.savetxt(path, np.column_stack(columns), header=head, comments="", fmt=fmt, delimiter=sep)
    return {record.name: record for record in read(path)}


def test_axes_may_stand_before_their_sensor(samples, tmp_path):
    head = "time [s],xacc [m/s^2],yacc [m/s^2],zacc [m/s^2],xgyro [rad/s],ygyro [rad/s],zgyro [rad/s]"
    found = written(tmp_path / "log.csv", head, [np.arange(N) / RATE, samples[1], samples[0]])
    np.testing.assert_allclose(found["gyro"].y, samples[0], rtol=1e-6)


@pytest.mark.parametrize(("name", "scale"), [("IMUTime", 1.0), ("ts_ms", 1e3)])
def test_clocks_are_known_by_their_names(samples, tmp_path, name, scale):
    gyro, accel = samples
    head = f"{name},gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s^2],ay [m/s^2],az [m/s^2]"
    found = written(tmp_path / "log.csv", head, [scale * np.arange(N) / RATE, gyro, accel])
    assert found["gyro"].interval == pytest.approx(1.0 / RATE)
    np.testing.assert_allclose(found["accel"].y, accel, rtol=1e-6)


def test_a_temperature_is_no_clock(samples, tmp_path):
    _, accel = samples
    head = "Time [s],ax [m/s^2],ay [m/s^2],az [m/s^2],T(°)"
    found = written(tmp_path / "log.csv", head, [np.arange(N) / RATE, accel, np.full(N, 26.1)])
    assert found["accel"].interval == pytest.approx(1.0 / RATE)


def test_names_may_stand_three_rows_above_the_numbers(samples, tmp_path):
    gyro, accel = samples
    names = ["Timestamp_Unix", *(f"Accel_LN_{a}" for a in "XYZ"), *(f"Gyro_{a}" for a in "XYZ")]
    rows = [f"S_86A5_{n}_CAL" for n in names], ["CAL"] * 7, ["ms", *["m/(s^2)"] * 3, *["deg/s"] * 3]
    head = "\n".join("\t".join(row) for row in rows)
    t = 1.62e12 + 1e3 * np.arange(N) / RATE
    found = written(tmp_path / "log.csv", head, [t, accel, np.rad2deg(gyro)], fmt="%.4f", sep="\t")
    np.testing.assert_allclose(found["gyro"].y, gyro, atol=2e-6)
    np.testing.assert_allclose(found["accel"].y, accel, atol=1e-4)


def test_the_head_of_a_blackbox_log_states_its_scales(samples, tmp_path):
    gyro, accel = samples
    head = '"acc_1G","2048"\n"gyro_scale","0x3f800000"\n"loopIteration","time"'
    head += "".join(f',"{n}[{i}]"' for n in ("gyroADC", "accSmooth") for i in range(3))
    columns = [np.arange(N), 1e6 * np.arange(N) / RATE, np.rad2deg(gyro), np.round(accel / 9.80665 * 2048)]
    found = written(tmp_path / "log.csv", head, columns)
    np.testing.assert_allclose(found["gyro"].y, gyro, rtol=1e-6)
    np.testing.assert_allclose(found["accel"].y, accel, atol=0.003)


def test_dates_may_have_two_digits_of_the_year(samples, tmp_path):
    lines = ["Time,ax [m/s^2],ay [m/s^2],az [m/s^2]"]
    for i, row in enumerate(samples[1]):
        seconds = 59 * 60 + i / RATE
        clock = f"{23 + int(seconds // 3600):02d}:{int(seconds // 60) % 60:02d}:{seconds % 60:012.9f}"
        day = "02/17/22" if seconds < 3600 else "02/18/22"
        lines.append(f"{day} {clock.replace('24:', '00:')}," + ",".join(f"{v:.7g}" for v in row))
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert read(tmp_path / "log.csv")[0].interval == pytest.approx(1.0 / RATE)


def test_rows_that_name_their_sensor_are_read(samples, tmp_path):
    gyro, accel = samples
    lines = ["# accelerometer,timestamp,x,y,z", "# gyroscope,timestamp,x,y,z"]
    for i in range(N):
        for word, row, late in (("accelerometer", accel[i], 0), ("gyroscope", gyro[i], 350000)):
            lines.append(f"{word},{61423000000000 + 10**7 * i + late}," + ",".join(f"{v:.9g}" for v in row))
        lines.append(f"magnetometer,{61423000000000 + 10**7 * i},1,2,3")
    (tmp_path / "log.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = {record.name: record for record in read(tmp_path / "log.txt")}
    np.testing.assert_allclose(found["gyro"].y, gyro, rtol=1e-6)
    np.testing.assert_allclose(found["accel"].y, accel, rtol=1e-6)


def test_names_without_values_are_said_to_be(tmp_path):
    np.savetxt(tmp_path / "log.csv", np.arange(N) / RATE, header="Timestamp,X,Y,Z", comments="")
    with pytest.raises(DataError, match="the header names 4 columns, the row below it has 1"):
        read(tmp_path / "log.csv")


def test_a_column_that_stands_twice_is_said_to(tmp_path, samples):
    """Both rows of the table were measured, and equal to the last digit."""
    gyro, accel = samples
    accel = np.column_stack([accel[:, 0], accel[:, 0], accel[:, 2]])
    rows = np.column_stack([np.arange(N) / RATE, gyro, accel])
    header = (
        "t [s],"
        + ",".join(f"gyro_{x} [rad/s]" for x in "xyz")
        + ","
        + ",".join(f"accel_{x} [m/s^2]" for x in "xyz")
    )
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=header, comments="")
    for record in read(tmp_path / "log.csv"):
        assert record.contradicted == ("accel x y, one column twice: they agree sample for sample",)


def test_a_file_without_numbers_is_told_from_one_whose_columns_do_not_match(tmp_path):
    """The last line that was looked at ended after its stamp: a row of one column, of missing values none."""
    (tmp_path / "log.csv").write_text(
        "t,gyro_x,gyro_y,gyro_z\n" + "0.0000,nan,nan,nan\n" * 6000, encoding="utf-8"
    )
    with pytest.raises(
        DataError, match=r"no row is mostly numbers: .* found 't,gyro_x.*then '0.0000,nan,nan,nan'"
    ):
        read(tmp_path / "log.csv")


def test_unsigned_and_exchanged_words_are_read_as_they_are(samples):
    counts = np.round(samples[0] * 5e4).astype(int)
    axes = [("gyro_x", "gyro_y", "gyro_z")]
    for read_as, word in (
        (counts & 0xFFFF, "signed words"),
        (counts.astype(np.int16).byteswap(), "high and low byte exchanged"),
    ):
        (back,), said = as_signed([read_as.astype(float)], axes)
        np.testing.assert_array_equal(back, counts)
        assert word in said[0]
    (same,), said = as_signed([counts.astype(float)], axes)
    np.testing.assert_array_equal(same, counts)
    assert not said


def test_a_constant_axis_says_nothing_of_a_unit(samples, tmp_path):
    """Two axes that hold 57 and −25 rad/s: "the unit rad/s is wrong: pass --gyro-unit mrad/s", N 1000 × too small."""
    gyro, accel = samples
    gyro[:, 1], gyro[:, 2] = 56.8157043, -25.1048164
    head = "t,gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s^2],ay [m/s^2],az [m/s^2]"
    found = written(tmp_path / "log.csv", head, [np.arange(N) / RATE, gyro, accel])
    assert found["gyro"].axes == ("gyro_x",)
    assert "gyro y z, left out: constant, dead or no measurement" in found["gyro"].contradicted


def test_gravity_goes_before_a_unit_that_a_user_states(samples, tmp_path):
    head = "t,ax,ay,az"
    np.savetxt(
        tmp_path / "log.csv",
        np.column_stack([np.arange(N) / RATE, samples[1]]),
        header=head,
        comments="",
        delimiter=",",
    )
    with pytest.raises(
        DataError,
        match=r"9\.79 × gravity: the unit g is wrong by 9\.79x, as m/s\^2 read as g: pass --accel-unit m/s",
    ):
        read(tmp_path / "log.csv", accel_unit="g")


@pytest.mark.parametrize(("unit", "size"), [("1/131 deg/s", 1.0 / 131.0), ("0.0625 deg/s", 0.0625)])
def test_a_unit_may_state_the_size_of_a_count(samples, tmp_path, unit, size):
    gyro, accel = samples
    counts = np.rint(np.degrees(gyro) / size)
    head = ",".join(["t [s]", *(f"g{a} [{unit}]" for a in "xyz"), *(f"a{a} [m/s^2]" for a in "xyz")])
    found = written(tmp_path / "log.csv", head, [np.arange(N) / RATE, counts, accel])
    np.testing.assert_allclose(found["gyro"].y, np.radians(size * counts), rtol=1e-6)


@pytest.mark.parametrize("unit", ["1/0 deg/s", "0 deg/s", "1e400 deg/s"])
def test_a_size_of_no_count_is_refused(samples, tmp_path, unit):
    head = ",".join(["t [s]", *(f"g{a} [{unit}]" for a in "xyz"), *(f"a{a} [m/s^2]" for a in "xyz")])
    with pytest.raises(DataError, match="unknown unit"):
        written(tmp_path / "log.csv", head, [np.arange(N) / RATE, *samples])
