"""A log that is written and read again is equal to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.formats.logs import write_csv, write_log, write_npz
from tuner.types.records import DataError, Record


def records(n=50):
    rng = np.random.default_rng(0)
    t = np.arange(n) / 30.0
    celsius = 25.0 + rng.random(n)
    gyro = Record(
        "gyro", t, rng.standard_normal((n, 3)) * 1e-7, ("gyro_x", "gyro_y", "gyro_z"), "rad/s", 1 / 30.0
    )
    accel = Record(
        "accel",
        t,
        rng.random((n, 2)),
        ("accel_x", "accel_z"),
        "m/s^2",
        1 / 30.0,
        covariates={"temperature": celsius},
    )
    return gyro, accel, celsius


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_text_has_units_in_its_header_and_all_digits(tmp_path, name):
    gyro, accel, celsius = records()
    write_log((gyro, accel), tmp_path / name)
    header = np.loadtxt(tmp_path / name, delimiter=",", max_rows=1, dtype=str)
    axes = [f"gyro_{a} [rad/s]" for a in "xyz"] + [f"accel_{a} [m/s^2]" for a in "xz"]
    assert header.tolist() == ["t [s]", *axes, "temperature [degC]"]
    table = np.loadtxt(tmp_path / name, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table, np.column_stack([gyro.t, gyro.y, accel.y, celsius]))
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_npz_has_triads_and_single_axes(tmp_path):
    gyro, accel, celsius = records()
    write_log((gyro, accel), tmp_path / "log.npz")
    with np.load(tmp_path / "log.npz") as arrays:
        assert set(arrays) == {"t", "gyro", "gyro_unit", "accel_x", "accel_z", "accel_unit", "temperature"}
        np.testing.assert_array_equal(arrays["gyro"], gyro.y)
        np.testing.assert_array_equal(arrays["accel_z"], accel.y[:, 1])
        np.testing.assert_array_equal(arrays["temperature"], celsius)
        np.testing.assert_array_equal(arrays["t"], gyro.t)


def test_other_formats_and_clocks_are_refused(tmp_path):
    gyro, accel, _ = records()
    shorter, _, _ = records(40)
    with pytest.raises(
        DataError, match=r"expected a name that ends in \.csv, \.csv\.gz or \.npz, got 'log\.mat'"
    ):
        write_log((gyro, accel), tmp_path / "log.mat")
    for write in (write_csv, write_npz):
        with pytest.raises(ValueError, match="must share one clock"):
            write((shorter, accel), tmp_path / "log.csv")
        with pytest.raises(ValueError, match="must hold one record or more"):
            write((), tmp_path / "log.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz", "log.npz"])
def test_the_same_log_has_the_same_bytes(tmp_path, name, monkeypatch):
    """Packed files carry a time; theirs is fixed."""
    written = []
    for hour in (1.0, 2.0):
        monkeypatch.setattr("time.time", lambda hour=hour: 1.7e9 + 3600.0 * hour)
        write_log(records()[:2], tmp_path / name)
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1]
