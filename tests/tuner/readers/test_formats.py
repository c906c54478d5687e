"""Every file format gives back what was written, in SI, whatever its names and units."""

from __future__ import annotations

import gzip
import hashlib
import json
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from packaging.version import Version
from pyarrow import parquet

from tuner.readers import parse_columns, read
from tuner.types.records import DataError

INTERVAL = 0.01
COUNT = 400
T = 5.0 + INTERVAL * np.arange(COUNT)
RNG = np.random.default_rng(1)
GYRO = RNG.normal(0.0, 1e-2, (COUNT, 3))
ACCEL = RNG.normal(0.0, 0.02, (COUNT, 3)) + np.array([0.1, -0.2, 9.8])
TEMPERATURE = np.linspace(20.0, 25.0, COUNT)
COLUMNS = {
    "t": T,
    **{f"gyro_{a}": GYRO[:, j] for j, a in enumerate("xyz")},
    **{f"accel_{a}": ACCEL[:, j] for j, a in enumerate("xyz")},
    "temperature": TEMPERATURE,
}
EXACT = 1e-14 if Version(pd.__version__) >= Version("3.1") else 2e-12
"""Relative error of numbers read from text: pandas before 3.1 converts them to one part in 10¹²."""


def text(columns: dict[str, np.ndarray], separator: str = ",") -> str:
    rows = zip(*columns.values(), strict=True)
    lines = [separator.join(columns), *(separator.join(repr(v.item()) for v in row) for row in rows)]
    return "\n".join(lines) + "\n"


def write_csv(path: Path, columns: dict[str, np.ndarray], separator: str = ",") -> Path:
    content = text(columns, separator).encode()
    path.write_bytes(gzip.compress(content) if path.suffix == ".gz" else content)
    return path


def write_npz(path: Path) -> Path:
    np.savez(path, t=T, gyro=GYRO, accel=ACCEL, temperature=TEMPERATURE)
    return path


def write_mat(path: Path) -> Path:
    scipy.io.savemat(path, {"t": T, "gyro": GYRO, "accel": ACCEL, "temperature": TEMPERATURE})
    return path


def write_navego(path: Path) -> Path:
    scipy.io.savemat(path, {"imu": {"t": T[:, None], "wb": GYRO, "fb": ACCEL, "temperature": TEMPERATURE}})
    return path


def write_hdf5(path: Path, *, turned: bool = False) -> Path:
    with h5py.File(path, "w") as file:
        for name, value in (("t", T), ("gyro", GYRO), ("accel", ACCEL), ("temperature", TEMPERATURE)):
            file[f"imu/{name}"] = value.T if turned else value
    return path


def write_matlab_73(path: Path) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in (
            ("t", T[:, None]),
            ("gyro", GYRO),
            ("accel", ACCEL),
            ("temperature", TEMPERATURE),
        ):
            file[name] = value.T
    header = b"MATLAB 7.3 MAT-file".ljust(124) + bytes((0x00, 0x02)) + b"IM"
    with path.open("r+b") as file:
        file.write(header)
    return path


def write_parquet(path: Path) -> Path:
    parquet.write_table(pa.table(COLUMNS), path)
    return path


WRITERS = {
    "log.csv": lambda p: write_csv(p, COLUMNS),
    "log.csv.gz": lambda p: write_csv(p, COLUMNS),
    "log.tsv": lambda p: write_csv(p, COLUMNS, "\t"),
    "semicolon.csv": lambda p: write_csv(p, COLUMNS, ";"),
    "blank.txt": lambda p: write_csv(p, COLUMNS, " "),
    "log.npz": write_npz,
    "log.mat": write_mat,
    "navego.mat": write_navego,
    "seven.mat": write_matlab_73,
    "bare.mat": write_hdf5,
    "log.h5": write_hdf5,
    "log.parquet": write_parquet,
}


@pytest.mark.parametrize("name", WRITERS)
def test_round_trip(tmp_path: Path, name: str) -> None:
    path = WRITERS[name](tmp_path / name)
    gyro, accel = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=EXACT)
    np.testing.assert_allclose(accel.y, ACCEL, rtol=EXACT)
    np.testing.assert_allclose(gyro.t, T, atol=1e-10)
    np.testing.assert_allclose(accel.covariates["temperature"], TEMPERATURE, rtol=EXACT)
    assert gyro.t is accel.t
    assert gyro.interval == pytest.approx(INTERVAL, rel=1e-9)
    assert (gyro.name, gyro.unit, accel.name, accel.unit) == ("gyro", "rad/s", "accel", "m/s^2")
    assert gyro.axes == ("gyro_x", "gyro_y", "gyro_z")
    assert gyro.segments == ((0, COUNT),)
    assert gyro.notes == gyro.assumptions
    assert [text.split(" assumed")[0] for text in gyro.notes] == ["gyro: rad/s", "accel: m/s^2"]
    assert gyro.source == name
    assert gyro.digest == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("deg/s", np.pi / 180),
        ("deg/h", np.pi / 648000),
        ("rad/s", 1.0),
        ("°/s", np.pi / 180),
        ("rad s^-1", 1.0),
        ("radian/second", 1.0),
        ("arcsec/s", np.pi / 648000),
    ],
)
@pytest.mark.parametrize("stated", ["header", "option"])
def test_gyro_units(tmp_path: Path, unit: str, factor: float, stated: str) -> None:
    header = f" [{unit}]" if stated == "header" else ""
    columns = {"t": T} | {f"gyro_{a}{header}": GYRO[:, j] / factor for j, a in enumerate("xyz")}
    path = write_csv(tmp_path / "log.csv", columns)
    (gyro,) = read(path, gyro_unit=None if header else unit)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-12)


@pytest.mark.parametrize(
    ("unit", "factor"), [("g", 9.80665), ("mg", 9.80665e-3), ("m/s²", 1.0), ("m/s2", 1.0), ("m/sec^2", 1.0)]
)
def test_accel_units(tmp_path: Path, unit: str, factor: float) -> None:
    columns = {"t": T} | {f"accel_{a} ({unit})": ACCEL[:, j] / factor for j, a in enumerate("xyz")}
    (accel,) = read(write_csv(tmp_path / "log.csv", columns))
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("rad", 1.0), ("deg", np.pi / 180), ("arcsec", np.pi / 648000)])
def test_increments_are_divided_by_the_interval(tmp_path: Path, unit: str, factor: float) -> None:
    columns = {"t": T} | {f"gyro_{a}": GYRO[:, j] * INTERVAL / factor for j, a in enumerate("xyz")}
    (gyro,) = read(write_csv(tmp_path / "log.csv", columns), gyro_unit=unit)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-8)
    assert any("increments" in note for note in gyro.notes)


def test_kf_gins_text(tmp_path: Path) -> None:
    path = tmp_path / "imu.txt"
    np.savetxt(path, np.column_stack([T, GYRO * INTERVAL, ACCEL * INTERVAL]), fmt="%.15g")
    gyro, accel = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-8)
    np.testing.assert_allclose(accel.y, ACCEL, rtol=1e-8)
    assert any("seven columns" in note for note in gyro.notes)


def test_euroc_text(tmp_path: Path) -> None:
    stamps = 1403636579758555392 + (np.arange(COUNT) * 5_000_000)
    path = tmp_path / "data.csv"
    names = [f"w_RS_S_{a} [rad s^-1]" for a in "xyz"] + [f"a_RS_S_{a} [m s^-2]" for a in "xyz"]
    columns = {"#timestamp [ns]": stamps} | dict(zip(names, np.hstack([GYRO, ACCEL]).T, strict=True))
    gyro, accel = read(write_csv(path, columns))
    assert gyro.interval == pytest.approx(0.005, rel=1e-8)
    np.testing.assert_allclose(np.hstack([gyro.y, accel.y]), np.hstack([GYRO, ACCEL]), rtol=EXACT)


@pytest.mark.parametrize(
    ("names", "factor"),
    [
        (("time_ns", "wx", "wy", "wz", "ax", "ay", "az"), 1e9),
        (("timestamp_us", "gyrX", "gyrY", "gyrZ", "accX", "accY", "accZ"), 1e6),
        (("Time (ms)", "GyroX", "GyroY", "GyroZ", "AccelX", "AccelY", "AccelZ"), 1e3),
        (
            (
                "time",
                *tuple(f"field.angular_velocity.{a}" for a in "xyz"),
                *tuple(f"field.linear_acceleration.{a}" for a in "xyz"),
            ),
            1.0,
        ),
        (("t", "imu_gx", "imu_gy", "imu_gz", "imu_ax", "imu_ay", "imu_az"), 1.0),
    ],
)
def test_names_of_others(tmp_path: Path, names: tuple[str, ...], factor: float) -> None:
    values = [T * factor, *GYRO.T, *ACCEL.T]
    gyro, accel = read(write_csv(tmp_path / "log.csv", dict(zip(names, values, strict=True))))
    assert gyro.interval == pytest.approx(INTERVAL, rel=1e-9)
    np.testing.assert_allclose(np.hstack([gyro.y, accel.y]), np.hstack([GYRO, ACCEL]), rtol=EXACT)


def test_unit_of_stamps_since_1970_is_known_by_size(tmp_path: Path) -> None:
    columns = COLUMNS | {"t": 1_700_000_000_000_000_000 + (np.arange(COUNT) * 10_000_000)}
    gyro, _ = read(write_csv(tmp_path / "log.csv", columns))
    assert gyro.interval == pytest.approx(INTERVAL, rel=1e-6)


def test_rate_stands_in_for_time(tmp_path: Path) -> None:
    columns = {name: value for name, value in COLUMNS.items() if name != "t"}
    gyro, _ = read(write_csv(tmp_path / "log.csv", columns), rate=50.0)
    np.testing.assert_array_equal(gyro.t, 0.02 * np.arange(COUNT))
    assert gyro.timing == {}


def test_meta_of_npz_states_rate_and_counts(tmp_path: Path) -> None:
    counts = np.rint(GYRO * 1e4).astype(np.int16)
    meta = json.dumps({"rate_hz": 200.0, "gyro_lsb_dps": 0.05})
    np.savez(tmp_path / "log.npz", gyro_counts=counts, meta=meta)
    (gyro,) = read(tmp_path / "log.npz")
    assert gyro.rate == pytest.approx(200.0)
    np.testing.assert_allclose(gyro.y, np.deg2rad(counts * 0.05), rtol=EXACT)


def test_unsigned_counts_are_centred(tmp_path: Path) -> None:
    counts = np.rint(GYRO * 1e4).astype(np.int16)
    np.savez(tmp_path / "log.npz", gyro_counts=(counts + 32768.0).astype(np.uint16), t=T)
    (gyro,) = read(tmp_path / "log.npz", gyro_scale=2e-3)
    np.testing.assert_allclose(gyro.y, counts * 2e-3, atol=1e-15)


def test_columns_map_slices_and_single_columns(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", imu0=np.hstack([ACCEL, GYRO]), clock=T * 1e3, baro=TEMPERATURE)
    mapped = parse_columns("gyro=imu0[3:6], accel_z=imu0[2], t=clock [ms], pressure=baro")
    gyro, accel = read(tmp_path / "log.npz", columns=mapped)
    np.testing.assert_array_equal(gyro.y, GYRO)
    np.testing.assert_array_equal(accel.y[:, 0], ACCEL[:, 2])
    assert accel.axes == ("accel_z",)
    assert gyro.interval == pytest.approx(INTERVAL, rel=1e-9)
    np.testing.assert_array_equal(gyro.covariates["pressure"], TEMPERATURE)


def test_too_many_columns_for_a_role(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", imu0=np.hstack([ACCEL, GYRO]), t=T)
    for name, value in (("gyro", "imu0"), ("gyro_x", "imu0[0:3]"), ("t", "imu0")):
        with pytest.raises(DataError, match=r"expected .*slice it, such as"):
            read(tmp_path / "log.npz", columns={name: value})
    with pytest.raises(DataError, match="'imu0' has columns 0 to 5"):
        read(tmp_path / "log.npz", columns={"gyro": "imu0[4:7]"})


def test_choice_between_arrays_is_reported(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", gyro_filtered=2 * GYRO, gyro_raw=GYRO, t=T)
    (gyro,) = read(tmp_path / "log.npz")
    np.testing.assert_array_equal(gyro.y, GYRO)
    assert any("gyro_raw" in note and "gyro_filtered" in note for note in gyro.notes)


def test_units_in_attributes_and_field_metadata(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["gyro"] = np.rad2deg(GYRO)
        file["gyro"].attrs["units"] = "deg/s"
        file.attrs["rate_hz"] = 100.0
    (gyro,) = read(tmp_path / "log.h5")
    np.testing.assert_allclose(gyro.y, GYRO, rtol=EXACT)
    fields = [pa.field("time", pa.timestamp("us"))]
    fields += [pa.field(f"gyro_{a}", pa.float32(), metadata={"unit": "deg/s"}) for a in "xyz"]
    arrays = [pa.array((np.arange(COUNT) * 10_000).astype("datetime64[us]"))]
    arrays += [pa.array(np.rad2deg(GYRO[:, j]).astype(np.float32)) for j in range(3)]
    parquet.write_table(pa.table(arrays, schema=pa.schema(fields)), tmp_path / "log.parquet")
    (gyro,) = read(tmp_path / "log.parquet")
    np.testing.assert_allclose(gyro.y, GYRO, rtol=2e-7)
    assert gyro.interval == pytest.approx(INTERVAL, rel=1e-9)


def test_comments_blank_lines_and_trailing_separators(tmp_path: Path) -> None:
    lines = text(COLUMNS).splitlines()
    lines = ["# made by a logger", lines[0] + ",", *(f"{line}," for line in lines[1:])]
    lines[10:10] = ["", "# a remark", ""]
    path = tmp_path / "log.csv"
    path.write_text("\r\n".join(lines))
    gyro, _ = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=EXACT)


def test_progress_runs_to_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tuner.readers.text.BYTES_AT_ONCE", 4096)
    path = write_csv(tmp_path / "log.csv", COLUMNS)
    seen: list[tuple[int, int]] = []
    gyro, _ = read(path, progress=lambda done, total: seen.append((done, total)))
    np.testing.assert_allclose(gyro.y, GYRO, rtol=EXACT)
    assert len(seen) > 3
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert seen[-1] == (path.stat().st_size,) * 2


def test_memory_is_the_arrays_and_little_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tuner.readers.text.BYTES_AT_ONCE", 1 << 16)
    count = 60_000
    columns = {name: np.resize(value, count) for name, value in COLUMNS.items()}
    path = write_csv(tmp_path / "log.csv", columns | {"t": 0.01 * np.arange(count)})
    tracemalloc.start()
    gyro, accel = read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    arrays = gyro.t.nbytes + gyro.y.nbytes + accel.y.nbytes + gyro.covariates["temperature"].nbytes
    assert peak < arrays + 40 * count + 3_000_000


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    order=st.permutations(list(COLUMNS)), rows=st.sets(st.integers(1, COUNT - 2), max_size=3), data=st.data()
)
def test_any_order_of_columns_and_a_few_nan(
    tmp_path: Path, order: list[str], rows: set[int], data: st.DataObject
) -> None:
    columns = {name: COLUMNS[name].copy() for name in order}
    for row in rows:
        name = data.draw(st.sampled_from([n for n in order if n != "temperature"]))
        columns[name][row] = data.draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    gyro, accel = read(write_csv(tmp_path / "log.csv", columns))
    kept = np.setdiff1d(np.arange(COUNT), list(rows))
    np.testing.assert_allclose(gyro.y[kept], GYRO[kept], rtol=EXACT)
    np.testing.assert_allclose(accel.y[kept], ACCEL[kept], rtol=EXACT)
    np.testing.assert_allclose(gyro.t, T, atol=1e-9)
    assert np.isfinite(gyro.y).all()
    if rows:
        assert any(f"{len(rows)} rows with NaN" in note for note in gyro.notes)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.one_of(
        st.binary(max_size=300),
        st.text(alphabet="t,gyro_x0123456789.\n-e#;[] ", max_size=300).map(str.encode),
    )
)
def test_any_bytes_are_read_or_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    for name in ("log.csv", "log.npz", "log.mat", "log.h5", "log.parquet", "log.csv.gz"):
        path = tmp_path / name
        path.write_bytes(content)
        message = ""
        try:
            read(path)
        except DataError as error:
            message = str(error)
        assert "\n" not in message


def test_a_header_of_western_windows(tmp_path: Path) -> None:
    columns = {"t [s]": T} | {f"gyro_{a} [°/s]": np.rad2deg(GYRO[:, j]) for j, a in enumerate("xyz")}
    path = write_csv(tmp_path / "log.csv", columns)
    path.write_bytes(path.read_text(encoding="utf-8").encode("cp1252"))
    (gyro,) = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-12)


def test_what_an_archive_states_in_bytes_and_as_a_rate_that_none_has(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, t=T, gyro=np.rad2deg(GYRO), gyro_unit=b"deg/s", accel=np.zeros((0, 3)))
    (gyro,) = read(path)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-12)
    assert any("array 'accel' of float64 and shape (0, 3) was left out" in note for note in gyro.notes)
    np.savez(path, gyro=GYRO, gyro_unit="rad/s", rate_hz=1e30)
    with pytest.raises(DataError, match=r"a rate of 1e\+30 Hz, which no inertial sensor has: pass --rate HZ"):
        read(path)
