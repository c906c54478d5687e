"""Bad input is repaired and counted, or refused in one line: place, expected, found, remedy."""

from __future__ import annotations

import gzip
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from tuner.readers import is_curve, parse_columns, read, read_curve
from tuner.types.records import DataError

COUNT = 1000
T = 0.01 * np.arange(COUNT)
RNG = np.random.default_rng(2)
GYRO = RNG.normal(0.0, 1e-2, (COUNT, 3))
ACCEL = RNG.normal(0.0, 0.02, (COUNT, 3)) + np.array([0.1, -0.2, 9.8])
HEADER = "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"


def rows(t: np.ndarray = T, gyro: np.ndarray = GYRO, accel: np.ndarray = ACCEL) -> list[str]:
    return [",".join(repr(v) for v in row) for row in np.column_stack([t, gyro, accel]).tolist()]


def write(path: Path, lines: list[str], header: str = HEADER) -> Path:
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def refused(path: Path, pattern: str, **options: object) -> str:
    with pytest.raises(DataError, match=pattern) as caught:
        read(path, **options)  # type: ignore[arg-type]
    message = str(caught.value)
    assert "\n" not in message
    return message


# refused ---------------------------------------------------------------------------------------------------


def test_no_file(tmp_path: Path) -> None:
    refused(tmp_path / "nowhere.csv", "nowhere.csv: no such file")
    refused(tmp_path, "expected a file, or a folder of EuRoC, .* found a folder without")


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", HEADER.encode(), b"\0\1\2" * 50, b"hello world, this is a letter\n"]
)
def test_nothing_readable(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    refused(path, r"log\.csv: .*expected")


@pytest.mark.parametrize("name", ["log.npz", "log.mat", "log.h5", "log.parquet", "log.csv.gz"])
def test_damaged_binary(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"certainly nothing of that kind")
    refused(path, "cannot be read")


@pytest.mark.parametrize("row", [0, 17, COUNT - 1])
@pytest.mark.parametrize("piece", [None, 2000])
def test_text_in_numbers_is_located(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, row: int, piece: int | None
) -> None:
    if piece is not None:
        monkeypatch.setattr("tuner.readers.text.BYTES_AT_ONCE", piece)
    lines = rows()
    cells = lines[row].split(",")
    cells[3] = "oops"
    lines[row] = ",".join(cells)
    lines[5:5] = ["", "# remark"]
    path = write(tmp_path / "log.csv", lines)
    at = path.read_text().splitlines().index(",".join(cells)) + 1
    message = refused(path, "expected a number")
    assert f"{path}:{at}:4: expected a number in column 'gyro_z', found 'oops'" in message


def test_too_many_cells_are_located(tmp_path: Path) -> None:
    lines = rows()
    lines[99] = lines[99].replace(".", ",", 1)
    refused(write(tmp_path / "log.csv", lines), r"log\.csv:101: expected 7 columns, found 8")


def test_more_than_one_percent_unreadable(tmp_path: Path) -> None:
    gyro = GYRO.copy()
    gyro[::50, 1] = np.nan
    refused(write(tmp_path / "log.csv", rows(gyro=gyro)), "19 of 999 rows hold NaN.*more than 1 %")


@pytest.mark.parametrize(
    ("sensor", "factor", "hint"),
    [
        ("accel", 1 / 9.80665e-3, "accel-unit mg"),
        ("accel", 0.005, "accel-unit m/s"),
        ("accel", 1e-3, "accel-unit"),
        ("gyro", 648000 / np.pi, "gyro-unit deg/h"),
    ],
)
def test_unit_off_by_more_than_100(tmp_path: Path, sensor: str, factor: float, hint: str) -> None:
    gyro, accel = (GYRO * factor, ACCEL) if sensor == "gyro" else (GYRO, ACCEL * factor)
    refused(write(tmp_path / "log.csv", rows(0.5 * T, gyro, accel)), f"{sensor} reads .*{hint}")


def test_all_axes_constant(tmp_path: Path) -> None:
    refused(write(tmp_path / "log.csv", rows(gyro=0 * GYRO, accel=0 * ACCEL + 9.8)), "every axis is constant")


@pytest.mark.parametrize("count", [1, 2])
def test_too_short_for_one_allan_point(tmp_path: Path, count: int) -> None:
    refused(write(tmp_path / "log.csv", rows()[:count]), "one Allan point needs 3")


def test_one_column(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", [str(v) for v in range(10)], header="t")
    refused(path, "no gyro or accel column")
    path = write(tmp_path / "log.csv", [str(v) for v in range(10)], header="gyro_x")
    refused(path, "no time column and no rate: pass --rate")


def test_no_header(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows()))
    refused(path, "no gyro or accel column.*--columns")


@pytest.mark.parametrize(
    ("options", "pattern"),
    [
        ({"gyro_unit": "furlong"}, "--gyro-unit: unknown unit 'furlong': expected one of rad/s, deg/s"),
        ({"accel_unit": "deg/s"}, "--accel-unit: unknown unit 'deg/s': expected one of m/s"),
        ({"rate": 200.0}, "the stamps give 100 Hz, --rate says 200 Hz"),
        ({"rate": -1.0}, "--rate: expected a positive number"),
        ({"gyro_scale": float("nan")}, "--gyro-scale: expected a positive number"),
        ({"columns": {"gyro": "nothing"}}, "no column 'nothing': found t, gyro_x"),
        ({"columns": {"gyro_x": "gyro_x", "pressure": "nothing"}}, "no column 'nothing'"),
        ({"columns": {"gyro": "gyro_x[0:3]"}}, "has one column and cannot be sliced"),
    ],
)
def test_bad_options(tmp_path: Path, options: dict[str, object], pattern: str) -> None:
    refused(write(tmp_path / "log.csv", rows()), pattern, **options)


def test_unknown_unit_in_header(tmp_path: Path) -> None:
    header = HEADER.replace("gyro_x", "gyro_x [furlong/h]")
    refused(write(tmp_path / "log.csv", rows(), header), "different units")
    header = re.sub(r"(gyro_.)", r"\1 [furlong/h]", HEADER)
    refused(
        write(tmp_path / "log.csv", rows(), header), "gyro: unknown unit 'furlong/h': expected one of rad/s"
    )


def test_same_column_twice(tmp_path: Path) -> None:
    refused(write(tmp_path / "log.csv", rows(), HEADER.replace("gyro_y", "gyro_x")), "'gyro_x' appears twice")


def test_equal_candidates(tmp_path: Path) -> None:
    header = "t,a_gyro_x,b_gyro_x,c_gyro_x,p_accel_x,q_accel_x,r_accel_x"
    refused(
        write(tmp_path / "log.csv", rows(), header),
        "several columns could be gyro_x: a_gyro_x, b_gyro_x.*--columns",
    )


def test_clock_that_was_reset(tmp_path: Path) -> None:
    refused(write(tmp_path / "log.csv", rows(np.where(T < 5, T, T - 5))), "time runs backwards at row 501")
    refused(write(tmp_path / "log.csv", rows(0 * T)), "the time column is constant")


def test_archive_that_breaks_off(tmp_path: Path) -> None:
    whole = gzip.compress(("\n".join([HEADER, *rows()])).encode())
    path = tmp_path / "log.csv.gz"
    path.write_bytes(whole[: len(whole) // 2])
    refused(path, "cannot be read")


def test_lengths_that_differ(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", gyro=GYRO, accel=ACCEL[:-1], t=T)
    refused(tmp_path / "log.npz", "columns must have one length")


def test_a_temperature_of_another_length(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", gyro=GYRO, t=T, temperature=T[:-1])
    refused(
        tmp_path / "log.npz", f"temperature: expected a value for each of {len(T)} samples, got {len(T) - 1}"
    )


def test_counts_without_scale(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", gyro_counts=np.rint(GYRO * 1e4).astype(np.int16), t=T)
    refused(tmp_path / "log.npz", "holds counts: pass --gyro-scale")


def test_streams_without_overlap(tmp_path: Path) -> None:
    gyro, accel = GYRO.copy(), ACCEL.copy()
    gyro[:600], accel[500:] = np.nan, np.nan
    refused(write(tmp_path / "log.csv", rows(gyro=gyro, accel=accel)), "do not overlap")


def test_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, module, extra in (("log.h5", "h5py", "hdf5"), ("log.parquet", "pyarrow", "parquet")):
        (tmp_path / name).write_bytes(b"x")
        monkeypatch.setitem(sys.modules, module, None)
        refused(tmp_path / name, rf"install the extra '{extra}'")


def test_mapping_that_is_none() -> None:
    with pytest.raises(DataError, match="expected NAME=COLUMN, found 'gyro'"):
        parse_columns("gyro")


# repaired and counted --------------------------------------------------------------------------------------


def notes(path: Path, **options: object) -> str:
    return "; ".join(read(path, **options)[0].notes)  # type: ignore[arg-type]


def test_order_duplicates_and_gaps_are_repaired_and_counted(tmp_path: Path) -> None:
    lines = rows()
    lines[10], lines[11] = lines[11], lines[10]
    lines.insert(50, lines[49])
    del lines[701:801]
    path = write(tmp_path / "log.csv", lines)
    gyro, _ = read(path)
    said = "; ".join(gyro.notes)
    assert "1 rows were out of order" in said
    assert "1 duplicate rows were dropped" in said
    assert "1 gaps with 100 missing samples" in said
    assert gyro.segments == ((0, 700), (700, 900))
    np.testing.assert_array_equal(gyro.y, np.delete(GYRO, np.s_[700:800], axis=0))
    np.testing.assert_allclose(gyro.t, np.delete(T, np.s_[700:800]), atol=1e-9)
    expected = {"gap_count": 1.0, "missing": 100.0, "duplicates": 1.0, "disordered": 1.0, "bridged": 0.0}
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
    assert np.abs(record.y).max() < 0.1
    assert np.abs(other.y).max() < 10.0
    axis = "gyro_y" if gyro else "accel_y"
    assert any(
        re.match(
            rf"1 rows hold a reading more than 200 noise sds .*first: {axis} \S+ in data row {place + 1}\)", n
        )
        for n in record.notes
    )


def test_more_than_one_percent_of_broken_cells(tmp_path: Path) -> None:
    y = GYRO.copy()
    y[5::50, 2] += 50.0
    refused(write(tmp_path / "log.csv", rows(gyro=y)), "20 of 1000 rows hold a reading .* more than 1 %")


def test_motion_and_steps_are_no_broken_cells(tmp_path: Path) -> None:
    """Quiet sensors that are turned by 90° within 50 ms, and one whose bias jumps by 2000 noise sds."""
    f = np.array([0.1, -0.2, 9.8]) + RNG.normal(0.0, 1e-4, (COUNT, 3))
    turn = np.clip((np.arange(COUNT) - 400) / 5.0, 0.0, 1.0)[:, None]
    f = (1.0 - turn) * f + turn * f[:, ::-1]
    y = RNG.normal(0.0, 1e-4, (COUNT, 3)) + 0.2 * (np.arange(COUNT)[:, None] > 600)
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


@pytest.mark.parametrize(
    ("sd", "limited"), [(0.15, True), (0.2, True), (0.25, True), (0.5, False), (1.0, False)]
)
def test_noise_below_the_step_of_a_quantizer_is_known_as_a_bound(
    tmp_path: Path, sd: float, limited: bool
) -> None:
    """The sd of what a quantizer leaves of 0.2 steps is 41 % low; the bound that is told holds."""
    step, count = 1e-3, 20_000
    y = np.rint(RNG.normal(0.0, sd, count)) * step
    np.savez(tmp_path / "log.npz", t=0.01 * np.arange(count), gyro_x=y, gyro_unit="rad/s")
    found = re.search(r"at most (\S+) rad/s/√Hz", notes(tmp_path / "log.npz"))
    assert (found is not None) == limited
    assert found is None or sd * step * 0.1 <= float(found[1])


def test_constant_axis_is_left_out(tmp_path: Path) -> None:
    gyro = GYRO * np.array([1.0, 0.0, 1.0])
    record, _ = read(write(tmp_path / "log.csv", rows(gyro=gyro)))
    assert record.axes == ("gyro_x", "gyro_z")
    assert any("1 constant axes were left out: gyro_y" in note for note in record.notes)


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


def test_noise_without_gravity_is_taken_as_si_only_where_that_is_stated(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(accel=ACCEL - ACCEL.mean(axis=0)))
    refused(path, "accel reads .* where gravity is 9.81, and nothing states its unit.*--assume si")
    assert "accel: m/s^2 assumed, as --assume si says" in notes(path, assume="si")
    assert "unit could not be checked" in notes(path, accel_unit="m/s^2")


# units that nothing states ---------------------------------------------------------------------------------


def cure(message: str) -> dict[str, object]:
    """The options that a message says to pass, as arguments of `read`."""
    found = re.findall(r"--(accel|gyro)-(unit|scale) ([\w/^.]+)", message.split(", or --")[0])
    return {f"{sensor}_{what}": value if what == "unit" else float(value) for sensor, what, value in found}


@pytest.mark.parametrize(
    ("unit", "size"),
    [("g", 9.80665), ("mg", 9.80665e-3), ("cm/s^2", 0.01), ("ft/s^2", 0.3048), ("m/s", 100.0)],
)
def test_accelerometers_in_another_unit_are_refused_with_it(tmp_path: Path, unit: str, size: float) -> None:
    path = write(tmp_path / "log.csv", rows(accel=ACCEL / size))
    message = refused(path, f"--accel-unit {re.escape(unit)}, or --assume si")
    gyro_unit = "rad" if unit == "m/s" else "rad/s"
    factor = 0.01 if unit == "m/s" else 1.0
    path = write(tmp_path / "log.csv", rows(gyro=GYRO * factor, accel=ACCEL / size))
    _, accel = read(path, **cure(message), gyro_unit=gyro_unit)  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-9)


def test_counts_of_an_accelerometer_are_refused_with_their_scale(tmp_path: Path) -> None:
    counts = np.rint(ACCEL / 9.80665 * 8192)
    message = refused(
        write(tmp_path / "log.csv", rows(accel=counts)), r"--accel-unit g --accel-scale .*1 / 8192"
    )
    _, accel = read(tmp_path / "log.csv", **cure(message), gyro_unit="rad/s")  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL, atol=9.81 / 8192)


def test_gyroscopes_beside_accelerometers_in_g_are_not_assumed(tmp_path: Path) -> None:
    quiet = RNG.normal(1e-3, 1e-3, (COUNT, 3))
    path = write(tmp_path / "log.csv", rows(gyro=quiet, accel=ACCEL / 9.80665))
    refused(
        path, "accel is in g, and nothing states the unit of gyro: pass --gyro-unit deg/s", accel_unit="g"
    )


@pytest.mark.parametrize("size", [1e-100, 1e-300])
def test_a_signal_that_no_sensor_resolves(tmp_path: Path, size: float) -> None:
    header = re.sub(r"(gyro_.)", r"\1 [rad/s]", HEADER)
    refused(write(tmp_path / "log.csv", rows(gyro=GYRO * size), header), "which no sensor resolves")


@pytest.mark.parametrize("white", [0.002, 0.01, 0.03])
def test_gyroscopes_in_degrees_are_refused_with_the_unit(tmp_path: Path, white: float) -> None:
    """White noise of built-in MEMS gyroscopes, deg/s/√Hz, is more than any sensor has in rad/s/√Hz."""
    y = RNG.normal(0.1, white * 10.0, (COUNT, 3))
    message = refused(write(tmp_path / "log.csv", rows(gyro=y)), "--gyro-unit deg/s, or --assume si")
    gyro, _ = read(tmp_path / "log.csv", **cure(message))  # type: ignore[arg-type]
    np.testing.assert_allclose(gyro.y, np.deg2rad(y), rtol=1e-9)
    assert "gyro: rad/s assumed, as --assume si says" in notes(tmp_path / "log.csv", assume="si")


def test_the_step_of_a_gyroscope_tells_its_unit(tmp_path: Path) -> None:
    """A quiet gyroscope of ± 250 deg/s in 16 bits: noise and bias alone would allow both units."""
    degrees = np.rint(RNG.normal(0.0, 1.5, (COUNT, 3))) / 131.0
    path = write(tmp_path / "log.csv", rows(gyro=degrees))
    refused(path, "multiples of a step that gyroscopes have in deg/s.*--gyro-unit deg/s")
    assert "the step of its samples" in notes(write(tmp_path / "log.csv", rows(gyro=np.deg2rad(degrees))))


def test_a_gyroscope_that_turns_as_the_earth_tells_its_unit(tmp_path: Path) -> None:
    earth = np.rad2deg(7.292115e-5) * np.array([0.6, 0.0, -0.8])
    path = write(tmp_path / "log.csv", rows(gyro=RNG.normal(0.0, 1e-3, (COUNT, 3)) + earth))
    refused(path, "turns as the Earth does in deg/s.*--gyro-unit deg/s")


def test_an_open_unit_is_assumed_with_what_another_would_change(tmp_path: Path) -> None:
    gyro, _ = read(write(tmp_path / "log.csv", rows(gyro=RNG.normal(1e-3, 1e-3, (COUNT, 3)))))
    assert "gyro: rad/s assumed, as nothing states the unit" in gyro.assumptions[0]
    assert "in deg/s 57.3 times too large" in gyro.assumptions[0]
    assert gyro.notes[: len(gyro.assumptions)] == gyro.assumptions


def test_a_stated_unit_that_gravity_contradicts_is_refused(tmp_path: Path) -> None:
    header = re.sub(r"(accel_.)", r"\1 [m/s^2]", HEADER)
    path = write(tmp_path / "log.csv", rows(accel=ACCEL / 9.80665), header)
    message = refused(path, r"unit m/s\^2 is wrong by 10x|unit m/s\^2 is wrong by 9.8")
    _, accel = read(path, **cure(message), gyro_unit="rad/s")  # type: ignore[arg-type]
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-9)


def test_rates_beside_increments_are_not_assumed(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", rows(gyro=GYRO * 0.01, accel=ACCEL * 0.01))
    refused(path, "accel is in m/s, an increment.*--gyro-unit rad or deg", accel_unit="m/s")


def test_an_index_in_brackets_is_no_unit(tmp_path: Path) -> None:
    """The names of PX4: ``gyro_rad[0]`` is the x axis in rad/s."""
    names = [f"gyro_rad[{j}]" for j in range(3)] + [f"accelerometer_m_s2[{j}]" for j in range(3)]
    gyro, accel = read(write(tmp_path / "log.csv", rows(), ",".join(["t", *names])))
    np.testing.assert_array_equal(gyro.y, GYRO)
    np.testing.assert_array_equal(accel.y, ACCEL)
    assert gyro.assumptions[0].startswith("gyro: rad/s assumed")


def test_columns_that_are_left_out_are_named(tmp_path: Path) -> None:
    lines = [f"{row},1,2" for row in rows()]
    assert "columns not used: status, mag_x" in notes(
        write(tmp_path / "log.csv", lines, HEADER + ",status,mag_x")
    )


# curves ----------------------------------------------------------------------------------------------------


def test_curve(tmp_path: Path) -> None:
    path = write(tmp_path / "c.csv", ["4,1,10", "1,2,30", "2,1.5,20"], "tau,deviation [deg/h],dof")
    assert is_curve(path)
    curve = read_curve(path)
    np.testing.assert_array_equal(curve.tau, [1, 2, 4])
    np.testing.assert_allclose(curve.deviation()[:, 0], np.deg2rad([2, 1.5, 1]) / 3600, rtol=1e-12)
    np.testing.assert_array_equal(curve.dof[:, 0], [30, 20, 10])
    assert (curve.unit, curve.axes) == ("rad/s", ("gyro",))
    assert not is_curve(write(tmp_path / "log.csv", rows()))
    assert not is_curve(tmp_path / "nowhere.csv")


def test_curve_of_an_accelerometer_without_dof(tmp_path: Path) -> None:
    curve = read_curve(write(tmp_path / "c.csv", ["1,2", "2,1"], "tau,adev [mg]"))
    assert (curve.unit, curve.axes) == ("m/s^2", ("accel",))
    assert np.isnan(curve.dof).all()


@pytest.mark.parametrize(
    ("lines", "header", "pattern"),
    [
        (["1,2", "2,-1"], "tau,deviation", "data row 2: expected a positive deviation, found -1"),
        (["1,2", "2,x"], "tau,deviation", ":3:2: expected a number in column 'deviation', found 'x'"),
        (["1,2", "1,3"], "tau,deviation", "at least two different tau"),
        (["1,2", "2,3"], "tau,value", "no column 'deviation': expected tau,deviation"),
        (["1,2", "2,3"], "tau,deviation [V]", "unknown unit 'V'"),
    ],
)
def test_bad_curves(tmp_path: Path, lines: list[str], header: str, pattern: str) -> None:
    with pytest.raises(DataError, match=pattern):
        read_curve(write(tmp_path / "c.csv", lines, header))
