"""A log format is one declaration in one file, of this project or of another package."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from models.registry import Registry, RegistryError
from tuner.cli import run
from tuner.readers import FORMATS, LogFormat, read
from tuner.types.records import DataError

PAGE = Path(__file__).parents[3] / "docs" / "extending" / "reader.md"
TEMPLATE = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL).group(1)
AXES = ("gyro_x", "gyro_y", "gyro_z")
T = 0.01 * np.arange(5000)
GYRO = np.random.default_rng(1).normal(0.0, 1e-3, (5000, 3))


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Lay a package with the template of the page, as pip would, and forget its format afterwards."""
    fresh: Registry[LogFormat] = Registry(
        "log format", "tuner.readers", name_of=lambda declared: declared.name
    )
    fresh.extend(FORMATS.values())
    (tmp_path / "other_logs.py").write_text(TEMPLATE, encoding="utf-8")
    facts = tmp_path / "other_logs-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: other-logs\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[tuner.readers]\njson-lines = other_logs:FORMAT\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "other_logs", raising=False)
    monkeypatch.setattr(sys.modules["tuner.readers.log_format"], "FORMATS", fresh)


@pytest.fixture
def lines(tmp_path: Path) -> Path:
    path = tmp_path / "log.jsonl"
    rows = (
        {"t": t, **dict(zip(AXES, row, strict=True))}
        for t, row in zip(T.tolist(), GYRO.tolist(), strict=True)
    )
    path.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return path


def test_the_template_is_a_reader_of_30_lines_at_most() -> None:
    assert len([line for line in TEMPLATE.splitlines() if line.strip()]) <= 30


@pytest.mark.usefixtures("package")
def test_a_log_of_another_package_is_read_like_the_others(lines: Path) -> None:
    (gyro,) = read(lines)
    np.testing.assert_array_equal(gyro.y, GYRO)
    assert gyro.interval == pytest.approx(0.01)
    assert gyro.unit == "rad/s"


@pytest.mark.usefixtures("package")
def test_a_log_of_another_package_reaches_the_commands(lines: Path, tmp_path: Path) -> None:
    out = tmp_path / "curve.json"
    assert run(["curve", str(lines), "--tau", "1", "--quiet", "--json", str(out)]) == 0
    deviation = json.loads(out.read_text())["channels"]["gyro_y"]["deviation"]
    assert deviation == pytest.approx([1e-4], rel=0.5)  # 1e-3 rad/s a sample at 100 Hz, 50 clusters


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize("ending", ["txt", "csv", "data"])
def test_a_log_of_another_package_is_recognized_before_it_is_taken_for_any_text(
    lines: Path, ending: str
) -> None:
    (gyro,) = read(lines.rename(lines.with_suffix(f".{ending}")))
    np.testing.assert_array_equal(gyro.y, GYRO)


@pytest.mark.usefixtures("package")
def test_a_damaged_log_of_another_package_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_text('{"t": 0}\n{"u": 1}\n')
    with pytest.raises(DataError, match=r"log\.jsonl: cannot be read as JSON lines: 't'; write"):
        read(path)


def save(path: Path, kind: str) -> None:
    if kind == "npz":
        np.savez(path, t=T, gyro=GYRO)
    elif kind == "mat":
        import scipy.io

        scipy.io.savemat(path, {"t": T, "gyro": GYRO})
    elif kind == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            file["t"], file["gyro"] = T, GYRO
    elif kind == "parquet":
        import pyarrow as pa
        from pyarrow import parquet

        columns = {"t": T, **{axis: GYRO[:, j] for j, axis in enumerate(AXES)}}
        parquet.write_table(pa.table(columns), path)
    else:
        np.savetxt(path, np.column_stack([T, GYRO]), delimiter=",", header="t," + ",".join(AXES))


@pytest.mark.parametrize("kind", ["npz", "mat", "hdf5", "parquet", "text"])
def test_a_file_without_a_known_ending_is_recognized_by_its_content(tmp_path: Path, kind: str) -> None:
    known = tmp_path / f"log{FORMATS[kind].suffixes[0]}"
    save(known, kind)
    renamed = shutil.copy(known, tmp_path / "log.data")
    (gyro,) = read(renamed)
    np.testing.assert_allclose(gyro.y, GYRO, rtol=1e-15)


@pytest.mark.parametrize("suffix", ["raw", "xlsx", "sqlite"])
def test_what_is_not_readable_says_which_formats_are(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(b"\x7fXYZ\0\0\1" * 50)
    with pytest.raises(DataError) as caught:
        read(path)
    known = ", ".join(f"{one.title} ({' '.join(one.suffixes)})" for one in FORMATS.values())
    assert "NPZ (.npz)" in known
    assert "text (.csv .tsv" in known
    assert (
        str(caught.value)
        == f"{path}: expected a log as {known}, got none of these; convert it to one of them"
    )


@pytest.mark.parametrize(
    ("name", "suffixes", "message"),
    [
        ("My Logs", (".x",), "expected a name of lower-case letters"),
        ("mine", ("X",), r"expected endings of file names such as \.csv"),
        ("mine", (), r"expected endings of file names such as \.csv"),
    ],
)
def test_an_incomplete_format_is_refused(name: str, suffixes: tuple[str, ...], message: str) -> None:
    with pytest.raises(RegistryError, match=message):
        FORMATS.add(LogFormat(name, "a title", suffixes, FORMATS["npz"].read))
