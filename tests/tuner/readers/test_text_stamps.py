"""Dates, encodings and headers of spreadsheets and loggers: the stamps written are the stamps read."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tuner.readers import read
from tuner.readers.text_stamps import days_after

COUNT, RATE = 400, 50.0
START = datetime.datetime(2024, 5, 1, 23, 59, 57)
"""Midnight lies within: in 05/01 … 05/02 the month comes first."""
GYRO = np.random.default_rng(3).normal(0.0, 1e-3, (COUNT, 3))
FORMS: dict[str, Callable[[datetime.datetime], str]] = {
    "German": lambda d: f"{d:%d.%m.%Y %H:%M:%S},{d.microsecond // 1000:03d}",
    "American": lambda d: f"{d:%m/%d/%Y %I:%M:%S}.{d.microsecond // 1000:03d} {d:%p}",
    "British": lambda d: f"{d:%d/%m/%Y %H:%M:%S}.{d.microsecond // 1000:03d}",
    "MATLAB": lambda d: f"{d:%d-%b-%Y %H:%M:%S}.{d.microsecond // 1000:03d}",
    "slashes": lambda d: f"{d:%Y/%m/%d %H:%M:%S}.{d.microsecond // 1000:03d}",
    "zone": lambda d: f"{d:%Y-%m-%d %H:%M:%S}.{d.microsecond:06d}+02:00",
    "minutes": lambda d: f"{d:%M:%S}.{d.microsecond // 1000:03d}",
    "colons": lambda d: f"{d - datetime.timedelta(hours=1):%H:%M:%S}:{d.microsecond // 1000:03d}",
}


def written(path: Path, form: str, *, separator: str = ";", encoding: str = "utf-8") -> Path:
    stamps = (FORMS[form](START + datetime.timedelta(seconds=i / RATE)) for i in range(COUNT))
    rows = [
        separator.join([stamp, *map(repr, row)]) for stamp, row in zip(stamps, GYRO.tolist(), strict=True)
    ]
    header = separator.join(["Time", *(f"gyro_{a} [rad/s]" for a in "xyz")])
    path.write_bytes("\r\n".join([header, *rows, ""]).encode(encoding))
    return path


@pytest.mark.parametrize("form", FORMS)
def test_dates_as_people_write_them(tmp_path: Path, form: str) -> None:
    (record,) = read(written(tmp_path / "log.csv", form))
    np.testing.assert_allclose(np.diff(record.t), 1.0 / RATE, atol=1e-6)
    np.testing.assert_array_equal(record.y, GYRO)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
@pytest.mark.parametrize("separator", ["\t", ";"])
def test_text_of_spreadsheets(tmp_path: Path, encoding: str, separator: str) -> None:
    (record,) = read(written(tmp_path / "log.txt", "German", separator=separator, encoding=encoding))
    assert record.rate == pytest.approx(RATE)
    np.testing.assert_array_equal(record.y, GYRO)


def test_units_in_a_second_line_of_the_header(tmp_path: Path) -> None:
    lines = [f"{i / RATE},{','.join(map(repr, row))}" for i, row in enumerate((GYRO / 1e-3).tolist())]
    head = ["time,gyro_x,gyro_y,gyro_z", "s,mrad/s,mrad/s,mrad/s"]
    (tmp_path / "log.csv").write_text("\n".join(head + lines))
    (record,) = read(tmp_path / "log.csv")
    np.testing.assert_allclose(record.y, GYRO, rtol=1e-12)


def test_a_sensor_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    rows = np.column_stack([np.arange(COUNT) / RATE, GYRO, GYRO + 9.81])
    header = "t [s]," + ",".join(
        [f"gyro_{a} [rad/s]" for a in "xyz"] + [f"accel_{a}_furlongs" for a in "xyz"]
    )
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=header, comments="")
    (record,) = read(tmp_path / "log.csv")
    assert (
        "accel: none of its columns is read, as no known name or unit fits accel_x_furlongs"
        in record.notes[0]
    )
    assert record.contradicted[0].startswith("accel: none of its columns is read")


@pytest.mark.parametrize(("name", "unit"), [("millis", 1e-3), ("micros()", 1e-6), ("ms", 1e-3)])
def test_clocks_and_sensors_have_the_names_of_an_arduino(tmp_path: Path, name: str, unit: float) -> None:
    """``millis`` was no clock, and then one in 0.1 ms; GyX was no sensor."""
    rows = np.column_stack([np.rint(np.arange(COUNT) / RATE / unit), GYRO, GYRO + np.array([0.0, 0.0, 9.81])])
    header = f"{name}," + ",".join([f"Gy{a} [rad/s]" for a in "XYZ"] + [f"Ac{a} [m/s^2]" for a in "XYZ"])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=header, comments="")
    gyro, accel = read(tmp_path / "log.csv")
    assert gyro.rate == pytest.approx(RATE)
    assert accel.axes == ("accel_x", "accel_y", "accel_z")


@pytest.mark.parametrize(
    ("first", "day", "days"),
    [("05/01/2024", "05/02/2024", 1), ("31/01/2024", "01/02/2024", 1), ("1.3.2024", "28.2.2024", -2)],
)
def test_the_order_of_day_and_month_is_the_one_that_brings_dates_nearest(
    first: str, day: str, days: int
) -> None:
    assert days_after(first, day) == days
