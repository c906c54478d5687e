"""Logs that cannot be used are refused in one line: place, expected, found, remedy."""

from __future__ import annotations

import gzip
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.tuner.readers.plain_logs import ACCEL, COUNT, GYRO, HEADER, T, refused, rows, write
from tuner.identification.identify_source import identify_log
from tuner.readers import parse_columns, read
from tuner.types.records import DataError


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


@pytest.mark.parametrize("name", ["log.csv", "log.parquet", "log"])
def test_a_pointer_of_git_lfs_is_told_as_such(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(
        "version https://git-lfs.github.com/spec/v1\noid sha256:a7dd\nsize 8051162\n"
    )
    refused(tmp_path / name, "git lfs pull")


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


def test_stamps_of_an_unknown_form_can_be_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", [line.replace(",", "s,", 1) for line in rows()])
    refused(path, "expected a number in column 't', .*leave the column out by --columns t=none --rate HZ")
    gyro, accel = read(path, columns={"t": "none"}, rate=100.0)
    assert len(gyro) == len(accel) == COUNT


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
        ("accel", 1e-3, "no reading fits"),
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
        ({"rate": -1.0}, "read: rate: expected a positive number"),
        ({"gyro_scale": float("nan")}, "read: gyro_scale: expected a number or None, found nan"),
        ({"gyro_scale": 0.0}, "read: gyro_scale: expected a positive number"),
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
        write(tmp_path / "log.csv", rows(), header),
        r"gyro: unknown unit 'furlong/h': expected one of rad/s.*--gyro-scale X with the rad/s in one 'furlong/h'",
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
    for name, module in (("log.h5", "h5py"), ("log.parquet", "pyarrow")):
        (tmp_path / name).write_bytes(b"x")
        monkeypatch.setitem(sys.modules, module, None)
        refused(tmp_path / name, "which is not installed: .* -m pip install '?" + module)


def test_mapping_that_is_none() -> None:
    with pytest.raises(DataError, match="expected NAME=COLUMN, found 'gyro'"):
        parse_columns("gyro")


@pytest.mark.parametrize(
    ("log", "options", "pattern"),
    [
        (
            np.ones((9, 3)),
            {},
            r"a dict of arrays, found numpy.ndarray of shape \(9, 3\): .*\{'gyro': array\}",
        ),
        (np.ones((9, 6)), {}, r"'gyro': array\[:, :3\], 'accel': array\[:, 3:\]"),
        (
            [{"gyro": GYRO}, {"gyro": GYRO}],
            {},
            r"expected one log, found a list of 2: .* import pool; pool\(",
        ),
        ({"gyro": GYRO}, {}, 'no rate: pass rate=HZ, or columns={"t": "NAME"}, of'),
        ({"gyro": GYRO, "accel": 0.1 * ACCEL}, {"rate": 100.0}, 'pass accel_unit="g", gyro_unit="deg/s", or'),
        (
            {"gyro": GYRO},
            {"rate": 100.0, "gyro_unit": "rad/s", "arma": "off"},
            "identify: arma: expected 'bic' or 'aic' or None, found 'off'",
        ),
    ],
)
def test_python_is_answered_in_python(log: object, options: dict[str, object], pattern: str) -> None:
    with pytest.raises(ValueError, match=pattern) as refusal:
        identify_log(log, **options)  # type: ignore[arg-type]
    assert "--" not in str(refusal.value)


def test_names_that_are_not_known_are_not_guessed(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Zeit;Drehrate X;Drehrate Y\n0,00;0,001;0,002\n0,01;0,002;0,001\n")
    with pytest.raises(DataError, match=r"found Zeit, Drehrate X, Drehrate Y; .* 'gyro_x=NAME'$"):
        read(path)
