"""Wrong settings and arrays of a drive are refused in one line: file, place, expected, found."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tuner.cli import run
from tuner.readers.drive import read_drive
from tuner.types.named_cause import separated

PYTHON = (
    "could not convert", "object has no", "argument must be", "not subscriptable", "out of range", "broadcast",
    "Traceback", "None", "True", "Error", "ufunc", "allow_pickle", "inhomogeneous", "<U",
)  # fmt: skip
"""Words that say nothing to a user."""


def refused(path, tmp_path, capsys):
    """Return the one line with which `navigate` refuses a file, nothing written."""
    before = sorted(tmp_path.iterdir())
    answer = tmp_path / "answer.json"
    assert run(["navigate", str(path), "--config", "mpu9250", "--json", str(answer), "--quiet"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith(f"tuner: {path.parent}")
    told = captured.err.replace(str(path.parent), "")
    assert not any(word in told for word in PYTHON)
    assert sorted(tmp_path.iterdir()) == before
    return told


@pytest.fixture(scope="module")
def small(data):
    """A drive of few rows: what is refused is refused before it is used."""
    return {name: values[:50] for name, values in data.items()}


@pytest.mark.parametrize(
    ("meta", "words"),
    [
        (
            {"mounting_rpy_deg": "level"},
            "meta.mounting_rpy_deg: expected three numbers, [x, y, z], got 'level'",
        ),
        ({"mounting_rpy_deg": ["a", "b", "c"]}, "meta.mounting_rpy_deg[0]: expected a number, got 'a'"),
        ({"mounting_rpy_deg": {"roll": 1}}, "meta.mounting_rpy_deg: expected three numbers"),
        ({"mounting_rpy_deg": [1, 2]}, "expected three numbers, [x, y, z], got [1, 2]"),
        ({"mounting_rpy_deg": [[1, 2, 3]]}, "expected three numbers"),
        ({"mounting_rpy_deg": [1, [2, 3], 4]}, "meta.mounting_rpy_deg[1]: expected a number, got [2, 3]"),
        ({"mounting_rpy_deg": [1, None, 2]}, "meta.mounting_rpy_deg[1]: expected a number, got null"),
        ({"mounting_rpy_deg": [1, float("nan"), 2]}, "expected a number, got nan"),
        ({"mounting_rpy_deg": [True, False, True]}, "expected a number, got true"),
        ({"lever_arm_frd_m": "1,2,3"}, "meta.lever_arm_frd_m: expected three numbers"),
        ({"lever_arm_frd_m": 1.0}, "meta.lever_arm_frd_m: expected three numbers"),
        (
            {"lever_arm_frd_m": [850.0, 0.0, -200.0]},
            "expected three numbers up to 100, got [850.0, 0.0, -200.0]",
        ),
        ({"imu_frame": 3}, "meta.imu_frame: expected text, got 3"),
        ({"imu_frame": ["FRD"]}, "meta.imu_frame: expected text, got ['FRD']"),
        ([1], "meta: expected a mapping, got [1]"),
        (4, "meta: expected a mapping, got 4"),
        (None, "meta: expected a mapping, got null"),
    ],
)
def test_settings_of_an_npz(small, tmp_path, capsys, meta, words):
    path = tmp_path / "wrong.npz"
    np.savez(path, meta=np.array(json.dumps(meta)), **small)
    assert words in refused(path, tmp_path, capsys)


@pytest.mark.parametrize("frame", ["FRD after mounting", "frd", "FRD, turned"])
def test_a_remark_behind_the_frame_leaves_the_frame_known(data, tmp_path, frame):
    path = tmp_path / "drive.npz"
    np.savez(path, meta=np.array(json.dumps({"imu_frame": frame})), **data)
    read = read_drive(path)
    np.testing.assert_allclose(read.mounting, np.eye(3), atol=1e-12)
    assert not any("frame" in note for note in read.notes)


def test_an_unknown_frame_is_a_named_cause(data, tmp_path):
    path = tmp_path / "drive.npz"
    np.savez(path, meta=np.array(json.dumps({"imu_frame": "unknown, z up"})), **data)
    (cause,), _ = separated(read_drive(path).notes)
    assert cause.startswith("The file calls the axes of the unit 'unknown, z up', which is none of FRD FLU")
    assert "(certain): attitudes are those of the unit" in cause


def test_stated_angles_need_no_frame(data, tmp_path):
    path = tmp_path / "drive.npz"
    meta = {"imu_frame": "along the case", "mounting_rpy_deg": [0.0, 0.0, 90.0]}
    np.savez(path, meta=np.array(json.dumps(meta)), **data)
    read = read_drive(path)
    assert read.mounting is not None
    assert not any("frame" in note for note in read.notes)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"meta": np.array("{oops")}, "meta: expected JSON, got '{oops'"),
        ({"meta": np.arange(3.0)}, "meta: expected one text of JSON, got an array of shape (3,)"),
        (
            {"meta": np.array({"imu_frame": "FRD"}, dtype=object)},
            "meta: expected an array of numbers or a text",
        ),
        ({"imu_t": np.full(50, "x")}, "in imu_t, got shape (50,), text"),
        ({"gnss_t": np.zeros((5, 10))}, "in gnss_t, got shape (5, 10)"),
        ({"gnss_vned": np.zeros((50, 2))}, "in gnss_vned, three a stamp of gnss_t, got shape (50, 2)"),
        (
            {"gnss_vned": np.full((50, 3), "1")},
            "in gnss_vned, three a stamp of gnss_t, got shape (50, 3), text",
        ),
        ({"gnss_pstd": np.zeros(50)}, "in gnss_pstd, three a stamp of gnss_t, got shape (50,)"),
        ({"ref_rpy": np.zeros((5, 3))}, "in ref_rpy, three a stamp of ref_t, got shape (5, 3)"),
        (
            {"gyro": np.zeros((50, 3), dtype=complex)},
            "in gyro, three a stamp of imu_t, got shape (50, 3), type complex",
        ),
    ],
)
def test_arrays_of_an_npz(small, tmp_path, capsys, arrays, words):
    path = tmp_path / "wrong.npz"
    np.savez(path, **{**small, **arrays})
    assert words in refused(path, tmp_path, capsys)


@pytest.mark.parametrize("content", [b"", b"no archive", b"part"])
def test_what_is_no_npz(small, tmp_path, capsys, content):
    path = tmp_path / "wrong.npz"
    np.savez(path, **small)
    path.write_bytes(path.read_bytes()[:5000] if content == b"part" else content)
    assert "cannot be read as NPZ: expected an archive of arrays" in refused(path, tmp_path, capsys)


def test_a_text_of_bytes_is_read(data, tmp_path):
    from tuner.readers.drive import read_drive

    path = tmp_path / "bytes.npz"
    np.savez(path, meta=np.array(b'{"lever_arm_frd_m": [1, 2, 3]}'), **data)
    assert read_drive(path).lever_arm == (1.0, 2.0, 3.0)


def _folder(path, data, header):
    """Write a drive as a folder; `header` replaces names of gnss.csv."""
    path.mkdir()
    imu = np.column_stack([data["imu_t"], data["gyro"], data["accel"]])
    names = "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(path / "imu.csv", imu, delimiter=",", header=names, comments="")
    fixes = np.column_stack([data["gnss_t"], data["gnss_llh"], data["gnss_vned"]])
    np.savetxt(path / "gnss.csv", fixes, delimiter=",", header=header, comments="")
    return path


def test_units_in_brackets_are_used(data, tmp_path):
    from tuner.readers.drive import read_drive

    factor = np.array([1e-3, np.degrees(1.0), 1.0, 0.3048, 1.0 / 3.6, 1852.0 / 3600.0, 0.44704])
    names = ("gnss_t", "gnss_llh", "gnss_vned")
    columns = np.column_stack([data[name] for name in names]) / factor
    other = {**data, "gnss_t": columns[:, 0], "gnss_llh": columns[:, 1:4], "gnss_vned": columns[:, 4:]}
    header = "t [ms],lat [rad],lon [deg],height [ft],vn [km/h],ve [kn],vd [mph]"
    plain = read_drive(_folder(tmp_path / "plain", data, "t,lat,lon,height,vn,ve,vd")).gnss
    found = read_drive(_folder(tmp_path / "other", other, header)).gnss
    for name in ("t", "llh", "vel_n"):
        np.testing.assert_allclose(getattr(found, name), getattr(plain, name), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("unit", ["parsec", "m", "km/h/s"])
def test_units_that_are_none_are_refused(data, tmp_path, capsys, unit):
    path = _folder(tmp_path / "drive", data, f"t,lat,lon,height,vn [{unit}],ve,vd")
    told = refused(path, tmp_path, capsys)
    assert f"column 'vn [{unit}]': expected one of the units m/s, cm/s, mm/s, km/h, kn, mph, ft/s" in told


@pytest.fixture
def settings(small, tmp_path):
    """Return the function that writes a YAML of KF-GINS with other entries, its files beside it."""
    increments = np.column_stack([small["imu_t"], 0.02 * small["gyro"], 0.02 * small["accel"]])
    np.savetxt(tmp_path / "imu.txt", increments)
    np.savetxt(
        tmp_path / "gnss.txt", np.column_stack([small["gnss_t"], small["gnss_llh"], small["gnss_pstd"]])
    )
    (tmp_path / "words.txt").write_text("1 2 three 4 5 6 7\n", encoding="utf-8")
    (tmp_path / "nothing.txt").write_text("", encoding="utf-8")
    (tmp_path / "ragged.txt").write_text("1 2 3 4 5 6 7\n1 2 3\n", encoding="utf-8")

    def write(**other):
        plain = {
            "imupath": "imu.txt",
            "gnsspath": "gnss.txt",
            "imudatarate": 50,
            "antlever": [0.5, -0.3, -1.2],
        }
        path = tmp_path / "wrong.yaml"
        path.write_text(json.dumps({**plain, **other}), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"imudatarate": "fast"}, "imudatarate: expected a positive number, got 'fast'"),
        ({"imudatarate": 0}, "imudatarate: expected a positive number, got 0"),
        ({"imudatarate": -50}, "imudatarate: expected a positive number, got -50"),
        ({"imudatarate": [50]}, "imudatarate: expected a positive number, got [50]"),
        ({"imudatarate": True}, "imudatarate: expected a positive number, got true"),
        ({"antlever": "x"}, "antlever: expected three numbers, [x, y, z], got 'x'"),
        ({"antlever": [1, 2]}, "antlever: expected three numbers, [x, y, z], got [1, 2]"),
        ({"antlever": [1, 2, 3, 4]}, "antlever: expected three numbers"),
        ({"antlever": ["a", 1, 2]}, "antlever[0]: expected a number, got 'a'"),
        ({"antlever": {"x": 1}}, "antlever: expected three numbers"),
        ({"antlever": [float("inf"), 0, 0]}, "antlever[0]: expected a number"),
        ({"antlever": 3}, "antlever: expected three numbers"),
        ({"starttime": "noon"}, "starttime: expected a number, got 'noon'"),
        ({"initgyrbias": [1, 2]}, "initgyrbias: expected three numbers"),
        ({"imupath": 3}, "imupath: expected text, got 3"),
        ({"imupath": None}, "imupath: expected text, got null"),
        ({"gnsspath": "absent.txt"}, "absent.txt: expected this file, which wrong.yaml names"),
        ({"gnsspath": "words.txt"}, "words.txt"),
        ({"gnsspath": "nothing.txt"}, "nothing.txt"),
        ({"gnsspath": "ragged.txt"}, "GNSS: 1 of 2 rows are not numbers"),
    ],
)
def test_settings_of_kf_gins(settings, tmp_path, capsys, other, words):
    assert words in refused(settings(**other), tmp_path, capsys)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"- a\n- b\n", "expected a YAML of KF-GINS with imupath and gnsspath"),
        (b"", "expected a YAML of KF-GINS with imupath and gnsspath"),
        (b"imupath:\t[\n", "in line 1, column 9"),
        (b"\xff\xfe\x00", "got no text from byte 1 on"),
        (b"a: !!python/object:os.system x\n", "expected a YAML of KF-GINS, got "),
    ],
)
def test_what_is_no_yaml(tmp_path, capsys, content, words):
    path = tmp_path / "wrong.yaml"
    path.write_bytes(content)
    assert words in refused(path, tmp_path, capsys)
