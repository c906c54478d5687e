"""Files that break, lie about their size, or carry more than numbers: refused in one line, or read but for that."""

from __future__ import annotations

import gzip
import io
import json
import struct
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
import scipy.io
from pyarrow import parquet

from tuner.formats.documents import parse_json, parse_yaml
from tuner.readers import child_process, kf_gins_settings, npz_members, read, text
from tuner.readers.child_process import array_from_child, check_in_child
from tuner.readers.mat import list_mat
from tuner.types.one_line import LONGEST_LINE, printable
from tuner.types.records import DataError

COUNT = 400
T = 0.01 * np.arange(COUNT)
GYRO = np.random.default_rng(4).normal(0.0, 1e-3, (COUNT, 3))
HEADER = "t,gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"


def csv(path: Path, *, end: str = "\n", header: str = HEADER, more: str = "") -> Path:
    rows = [",".join(repr(v) for v in row) for row in np.column_stack([T, GYRO]).tolist()]
    path.write_bytes((end.join([header, *rows]) + end + more).encode())
    return path


def refused(path: Path, pattern: str) -> None:
    with pytest.raises(DataError, match=pattern):
        read(path)


# text ------------------------------------------------------------------------------------------------------


def test_a_carriage_return_alone(tmp_path: Path) -> None:
    refused(csv(tmp_path / "old.csv", end="\r"), "found a CR alone: convert the file")
    refused(csv(tmp_path / "one.csv", more="4.0,1,2\r3,4\n"), r"one.csv:402: .*found a CR alone")
    assert len(read(csv(tmp_path / "dos.csv", end="\r\n"))[0]) == COUNT


def test_a_file_that_still_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "_count_lines", lambda _: 301)
    np.testing.assert_array_equal(read(csv(tmp_path / "log.csv"))[0].y, GYRO[:300])


def test_an_endless_line(tmp_path: Path) -> None:
    refused(
        csv(tmp_path / "log.csv", more="1," * 3_000_000),
        "expected lines of up to 65536 bytes|expected 4 columns",
    )


def test_a_text_that_expands_beyond_measure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "_FREE_BYTES", 1 << 20)
    path = csv(tmp_path / "log.csv")
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(path.read_bytes() + b"\n" * 80_000_000))
    refused(tmp_path / "log.csv.gz", "expands to more than 200 times its size")


def test_control_characters_reach_no_message_and_no_note(tmp_path: Path) -> None:
    path = csv(tmp_path / "a\x1b[31m.csv", header=HEADER.replace("gyro_z", "\x1b]0;title\x07odd"))
    (record,) = read(path)
    assert all(text.isprintable() for text in (*record.notes, record.source))
    assert printable("a\x1b[31m\n\tb\ud800\x9b") == "a\ufffd[31m b\ufffd\ufffd"
    assert len(printable("x" * 10_000)) <= LONGEST_LINE + 3


# archives and binary files ---------------------------------------------------------------------------------


def npz(path: Path, **more: bytes) -> Path:
    np.savez(path, t=T, gyro=GYRO, gyro_unit="rad/s")
    with zipfile.ZipFile(path, "a") as archive:
        for name, content in more.items():
            archive.writestr(name.replace("_npy", ".npy"), content)
    return path


def test_members_that_are_no_arrays_are_left_out(tmp_path: Path) -> None:
    path = npz(
        tmp_path / "log.npz",
        readme=b"hello",
        bad_npy=b"\x93NUMPY\x01\x00v\x00nonsense",
        short_npy=b"\x93NUMPY",
    )
    (record,) = read(path)
    np.testing.assert_array_equal(record.y, GYRO)
    assert sum("was left out" in note for note in record.notes) == 3


def test_a_header_that_states_more_than_there_is(tmp_path: Path) -> None:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})
    path = npz(tmp_path / "log.npz", accel_npy=file.getvalue() + bytes(240))
    (record,) = read(path)
    assert any(
        "'accel' was left out: its header states 24000000000000 bytes" in note for note in record.notes
    )


def test_an_array_that_expands_beyond_measure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(npz_members, "FREE_BYTES", 1 << 16)
    np.savez_compressed(tmp_path / "log.npz", t=T, gyro=np.zeros((200_000, 3)))
    refused(tmp_path / "log.npz", "no gyro or accel column")


@pytest.mark.parametrize(("at", "value", "why"), [(6, 1, "encrypted"), (8, 99, "compression")])
def test_encryption_and_unknown_compression(tmp_path: Path, at: int, value: int, why: str) -> None:
    """The flags and the method of every member, in its own header and in the directory."""
    content = bytearray(npz(tmp_path / "log.npz").read_bytes())
    for begin, shift in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        place = -1
        while (place := content.find(begin, place + 1)) >= 0:
            struct.pack_into("<H", content, place + at + shift, value)
    (tmp_path / "log.npz").write_bytes(content)
    refused(tmp_path / "log.npz", "no gyro or accel column")


def test_objects_are_never_unpickled(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", t=T, gyro=np.array([{"a": 1}, None], dtype=object))
    refused(tmp_path / "log.npz", "no gyro or accel column")


def test_samples_of_hdf5_in_another_file_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(GYRO.tobytes())
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["accel"] = T, GYRO + np.array([0.0, 0.0, 9.8])
        file.create_dataset("gyro", GYRO.shape, "f8", external=[(str(tmp_path / "secret"), 0, GYRO.nbytes)])
        file["other"] = h5py.ExternalLink("elsewhere.h5", "/gyro")
    (record,) = read(tmp_path / "log.h5")
    assert record.name == "accel"
    assert any("'gyro' was left out: its samples lie in other files" in note for note in record.notes)


def test_structs_in_mat_files_are_named_by_their_path(tmp_path: Path) -> None:
    content = {
        "t": T, "imu": {"wb": GYRO, "n": np.arange(7, dtype=np.int16), "deep": {"x": np.eye(3, dtype=np.float32)}},
        "text": "a°b", "one": 4.5, "cells": np.array([1, "a"], dtype=object), "complex": np.array([1j, 2.0]),
    }  # fmt: skip
    for compressed in (False, True):
        scipy.io.savemat(tmp_path / "log.mat", content, do_compression=compressed)
        found = list_mat(tmp_path / "log.mat")
        assert set(found.shapes) == {"t", "imu/wb", "imu/n", "imu/deep/x"}
        assert {"text": "a°b", "one": 4.5}.items() <= found.meta.items()
        wanted = {"imu/wb": GYRO, "imu/n": np.arange(7), "imu/deep/x": np.eye(3), "t": T}
        for name, value in wanted.items():
            assert found.shapes[name] == value.shape


def test_a_mat_file_that_was_cut_off(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "log.mat", {"gyro": GYRO})
    whole = (tmp_path / "log.mat").read_bytes()
    (tmp_path / "log.mat").write_bytes(whole[:-100])
    refused(tmp_path / "log.mat", "cannot be read: .*is it damaged")


def test_parquet_with_large_whole_numbers(tmp_path: Path) -> None:
    table = pa.table({"t": T, "gyro_x_rads": GYRO[:, 0], "serial": np.full(COUNT, 2**64 - 1, np.uint64)})
    parquet.write_table(table.replace_schema_metadata({b"\xff\xfe": b"\xff"}), tmp_path / "log.parquet")
    np.testing.assert_array_equal(read(tmp_path / "log.parquet")[0].y[:, 0], GYRO[:, 0])


# children --------------------------------------------------------------------------------------------------


def test_a_library_that_hangs_crashes_or_fails_in_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    def hang() -> None:
        while True:
            pass

    with pytest.raises(DataError, match=r"log.h5: reading it does not end \(waited 0 s\)"):
        check_in_child("log.h5", hang, seconds=0.2)
    with pytest.raises(DataError, match=r"log.h5: cannot be read: the library ended the process"):
        check_in_child("log.h5", lambda: child_process.os.kill(child_process.os.getpid(), 11))
    with pytest.raises(DataError, match=r"log.h5: cannot be read: no such thing; is it damaged"):
        check_in_child("log.h5", lambda: (_ for _ in ()).throw(ValueError("no such\nthing")).__next__())
    np.testing.assert_array_equal(array_from_child("log.h5", (COUNT, 3), GYRO.dtype, lambda: GYRO), GYRO)


# documents -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ("a: " + "[" * 5000, "nested too deeply"),
        ("a: &a [*a]", "an entry that contains itself"),
        ("a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
            f"{new}: &{new} [{', '.join(10 * ['*' + old])}]\n" for old, new in zip("abcdefg", "bcdefgh", strict=True)
        ), "more than 1000000 entries"),
        ("a: " + "9" * 5000, "digits"),
        ("a: !!python/object:os.system x", "could not determine a constructor"),
        ("a: !!timestamp 2024-99-99", "month must be in"),
        ("a: \x1b[31m", "special characters are not allowed"),
    ],
)  # fmt: skip
def test_yaml_that_multiplies_or_breaks(content: str, found: str) -> None:
    with pytest.raises(DataError, match=f"mine.yaml: expected settings, got .*{found}"):
        parse_yaml(content, source="mine.yaml", expected="settings")


def test_dates_in_yaml_are_text() -> None:
    assert parse_yaml("name: 2024-01-01", source="", expected="") == {"name": "2024-01-01"}


@pytest.mark.parametrize("content", ["[" * 100_000, "9" * 5000])
def test_json_that_breaks(content: str) -> None:
    with pytest.raises(DataError, match=r"mine.json: expected JSON, got "):
        parse_json(content, source="mine.json")
    assert parse_json(json.dumps({"a": 1}), source="") == {"a": 1}


@pytest.mark.parametrize(("sd", "found"), [("1e200", "OverflowError"), ("1e-320", "must be positive")])
def test_settings_of_kf_gins_with_impossible_numbers(tmp_path: Path, sd: str, found: str) -> None:
    path = tmp_path / "kf-gins.yaml"
    path.write_text(
        f"imunoise: {{arw: [1, 1, 1], vrw: [1, 1, 1], gbstd: [{sd}, 1, 1], abstd: [1, 1, 1], corrtime: 1.0}}\n"
    )
    with pytest.raises(DataError, match=f"kf-gins.yaml: cannot be read as a YAML of KF-GINS.*{found}"):
        kf_gins_settings.load(path)


def test_a_refusal_says_why_arrays_were_left_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", gyro=np.full((9, 3), None))
    with pytest.raises(
        DataError, match=r"no gyro or accel column: .*'gyro' was left out: objects, not numbers"
    ):
        read(tmp_path / "log.npz")
