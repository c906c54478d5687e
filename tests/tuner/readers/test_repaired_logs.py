"""What is wrong with single samples, rows or stamps is repaired, counted and reported."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.tuner.readers.plain_logs import ACCEL, COUNT, GYRO, HEADER, T, notes, refused, rows, write
from tuner.readers import read
from tuner.readers.value_checks import limiting_step


def test_order_duplicates_and_gaps_are_repaired_and_counted(tmp_path: Path) -> None:
    lines = rows()
    lines[10], lines[11] = lines[11], lines[10]
    lines.insert(50, lines[49])
    del lines[701:811]
    path = write(tmp_path / "log.csv", lines)
    gyro, _ = read(path)
    said = "; ".join(gyro.notes)
    assert "1 rows were out of order" in said
    assert "1 rows with a duplicate stamp were dropped" in said
    assert "1 gaps with 110 missing samples" in said
    assert gyro.segments == ((0, 700), (700, 890))
    np.testing.assert_array_equal(gyro.y, np.delete(GYRO, np.s_[700:810], axis=0))
    np.testing.assert_allclose(gyro.t, np.delete(T, np.s_[700:810]), atol=1e-9)
    expected = {"gap_count": 1.0, "missing": 110.0, "duplicates": 1.0, "disordered": 1.0, "bridged": 0.0}
    assert expected.items() <= dict(gyro.timing).items()


def test_streams_that_start_at_different_times(tmp_path: Path) -> None:
    gyro, accel = GYRO.copy(), ACCEL.copy()
    gyro[:200], accel[900:] = np.nan, np.nan
    record, _ = read(write(tmp_path / "log.csv", rows(gyro=gyro, accel=accel)))
    np.testing.assert_array_equal(record.y, GYRO[200:900])
    assert any("300 rows before or after" in note for note in record.notes)


def test_a_few_nan_rows(tmp_path: Path) -> None:
    gyro = GYRO.copy()
    gyro[[100, 101, 500], [0, 1, 2]] = [np.nan, np.inf, -np.inf]
    assert "3 rows with NaN or infinity" in notes(write(tmp_path / "log.csv", rows(gyro=gyro)))


def test_short_row_counts_as_missing(tmp_path: Path) -> None:
    lines = rows()
    lines[400] = "4.0,1.0"
    assert "1 rows with NaN or infinity" in notes(write(tmp_path / "log.csv", lines))


@pytest.mark.parametrize(("gyro", "accel"), [(1e9, 0.0), (9e4, 0.0), (12.0, 0.0), (0.0, -1e12), (0.0, 20.0)])
@pytest.mark.parametrize("place", [0, 1, 700, COUNT - 1])
def test_a_reading_that_no_sensor_makes_is_taken_out_and_counted(
    tmp_path: Path, gyro: float, accel: float, place: int
) -> None:
    """Broken cells of 1000 noise sds and more; the samples beside them stay."""
    y, f = GYRO.copy(), ACCEL.copy()
    y[place, 1] += gyro
    f[place, 1] += accel
    record, other = read(write(tmp_path / "log.csv", rows(gyro=y, accel=f)))
    count, size = (record.broken | other.broken)["gyro_y" if gyro else "accel_y"]
    assert count == 1
    assert size == pytest.approx(abs(gyro + accel), rel=0.01)
    assert np.abs(record.y).max() < 0.1
    assert np.abs(other.y).max() < 10.0
    axis = "gyro_y" if gyro else "accel_y"
    assert any(
        re.match(
            rf"1 rows hold a reading more than 200 noise sds .*first: {axis} \S+ in data row {place + 1}\)", n
        )
        for n in record.notes
    )


def test_broken_readings_at_even_distances_leave_the_rate(tmp_path: Path) -> None:
    """Stamps of the rows left out count: else a sample lost every 110 looks like a slower clock of few digits."""
    gyro = GYRO.copy()
    gyro[100::110, 1] = 9e4
    record, _ = read(write(tmp_path / "log.csv", rows(gyro=gyro)))
    assert record.rate == pytest.approx(100.0, rel=1e-9)
    assert (record.timing["missing"], len(record)) == (9.0, COUNT)


def test_rows_of_zeros_are_dropouts_and_no_motion(tmp_path: Path) -> None:
    gyro, accel = GYRO.copy(), ACCEL.copy()
    gyro[50::200], accel[50::200] = 0.0, 0.0
    _, record = read(write(tmp_path / "log.csv", rows(gyro=gyro, accel=accel)))
    assert record.timing["missing"] == 5.0
    np.testing.assert_allclose(record.y.std(axis=0), ACCEL.std(axis=0), rtol=0.02)


def test_more_than_one_percent_of_broken_cells(tmp_path: Path) -> None:
    y = GYRO.copy()
    y[5::50, 2] += 50.0
    refused(write(tmp_path / "log.csv", rows(gyro=y)), "20 of 1000 rows hold a reading .* more than 1 %")


@pytest.mark.parametrize("times", [2, 3, 10])
def test_readings_that_repeat_leave_the_noise_of_those_that_differ(tmp_path: Path, times: int) -> None:
    """A logger that is faster than its sensor: the steps that move are usual, however many do not."""
    y, f = (np.repeat(one[::times], times, axis=0)[:COUNT] for one in (GYRO, ACCEL))
    assert "reading more" not in notes(write(tmp_path / "log.csv", rows(gyro=y, accel=f)))
    y[501, 1] += 12.0
    assert "1 rows hold a reading more than 200 noise sds" in notes(
        write(tmp_path / "b.csv", rows(gyro=y, accel=f))
    )


def test_motion_and_steps_are_no_broken_cells(tmp_path: Path) -> None:
    """Quiet sensors that are turned by 90° within 50 ms, and one whose bias jumps by 2000 noise sds."""
    f = np.array([0.1, -0.2, 9.8]) + np.random.default_rng(3).normal(0.0, 1e-4, (COUNT, 3))
    turn = np.clip((np.arange(COUNT) - 400) / 5.0, 0.0, 1.0)[:, None]
    f = (1.0 - turn) * f + turn * f[:, ::-1]
    y = np.random.default_rng(4).normal(0.0, 1e-4, (COUNT, 3)) + 0.2 * (np.arange(COUNT)[:, None] > 600)
    assert not [
        n for n in read(write(tmp_path / "log.csv", rows(gyro=y, accel=f)))[0].notes if "reading more" in n
    ]


def test_a_short_motion_is_no_broken_cell(tmp_path: Path) -> None:
    """A slow log of a unit that was turned for a second: one row moves on several axes, none of it is lost."""
    y, f = GYRO.copy(), ACCEL.copy()
    y[500] += [9.0, -4.0, 1.0]
    f[500] += [3.0, 8.0, -9.0]
    record, _ = read(write(tmp_path / "log.csv", rows(gyro=y, accel=f)))
    np.testing.assert_array_equal(record.y, y)
    y[500] += 1e6
    assert "1 rows hold a reading more than 200 noise sds" in notes(
        write(tmp_path / "b.csv", rows(gyro=y, accel=f))
    )


def test_an_axis_that_slips_once_holds_no_noise(tmp_path: Path) -> None:
    gyro = GYRO * np.array([1.0, 0.0, 1.0])
    gyro[500:, 1] = 1e-3
    record, _ = read(write(tmp_path / "log.csv", rows(gyro=gyro)))
    assert record.axes == ("gyro_x", "gyro_z")
    assert any("1 axes that change fewer than 16 times hold no noise" in note for note in record.notes)


@pytest.mark.parametrize("place", [0.0, 0.25, 0.5])
@pytest.mark.parametrize(
    ("sd", "limited"), [(0.15, True), (0.2, True), (0.25, True), (0.5, False), (1.0, False)]
)
def test_noise_below_the_step_of_a_quantizer_is_known_as_a_bound(
    tmp_path: Path, sd: float, limited: bool, place: float
) -> None:
    """What a quantizer leaves of 0.2 steps is 45 % low to 150 % high, by the place of the mean; the bound holds."""
    step, count = 1e-3, 20_000
    y = np.rint(np.random.default_rng(5).normal(place, sd, count)) * step
    np.savez(tmp_path / "log.npz", t=0.01 * np.arange(count), gyro_x=y, gyro_unit="rad/s")
    said = notes(tmp_path / "log.npz")
    found = re.search(r"hide noise below (\S+); its white noise is known as a limit only", said)
    assert (found is not None) == limited
    assert found is None or sd * step <= float(found[1])
    assert "√Hz" not in said  # how large it may be is a matter of all its codes


def test_constant_axis_is_left_out(tmp_path: Path) -> None:
    gyro = GYRO * np.array([1.0, 0.0, 1.0])
    record, _ = read(write(tmp_path / "log.csv", rows(gyro=gyro)))
    assert record.axes == ("gyro_x", "gyro_z")
    assert any("constant from first to last sample and left out: gyro_y" in note for note in record.notes)


def test_missing_temperature_is_interpolated(tmp_path: Path) -> None:
    lines = [f"{row},{20 + i / 100 if i % 10 == 0 else ''}" for i, row in enumerate(rows())]
    record, _ = read(write(tmp_path / "log.csv", lines, HEADER + ",temperature [degC]"))
    np.testing.assert_allclose(record.covariates["temperature"][:991], 20 + np.arange(991) / 100, rtol=1e-12)
    assert any("temperature: 900 missing values were interpolated" in note for note in record.notes)


def test_temperature_in_kelvin(tmp_path: Path) -> None:
    lines = [f"{row},{293.15 + i / 1000!r}" for i, row in enumerate(rows())]
    record, _ = read(write(tmp_path / "log.csv", lines, HEADER + ",imu_temp [K]"))
    np.testing.assert_allclose(record.covariates["temperature"], 20.0 + np.arange(COUNT) / 1000, atol=1e-9)


def test_the_choice_of_the_first_of_two_clocks_is_reported(tmp_path: Path) -> None:
    lines = [f"{row},{2.0 * i}" for i, row in enumerate(rows())]
    record, _ = read(write(tmp_path / "log.csv", lines, HEADER + ",timestamp"))
    assert record.rate == pytest.approx(100.0)
    assert any("t is 't'; --columns t=… chooses timestamp" in note for note in record.notes)


def test_samples_that_saturate_in_a_shake_are_no_codes_of_a_quantizer() -> None:
    rng = np.random.default_rng(4)
    rate = rng.normal(0.0, 1e-3, 40_000)
    rate[20_000:20_200] = np.clip(rng.normal(0.0, 4.0, 200), -2.0, 2.0)  # most of them at the two ends
    assert limiting_step(rate) is None
    between_codes = 0.01 + rng.normal(0.0, 1e-3, 40_000)
    assert limiting_step(np.round(between_codes / 0.02) * 0.02) == pytest.approx(0.02)
