"""What cannot be read or done is refused: status 2, one line, nothing written."""

import os
from unittest.mock import Mock

import numpy as np
import pytest

from tuner.cli import COMMANDS, run


def refused(capsys, arguments):
    """Run a command that must fail: status 2, one line, no traceback, nothing on standard output."""
    assert run([str(a) for a in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("tuner: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


def write(path, text):
    path.write_text(text)
    return path


def csv(rows, header="t,gyro_x,gyro_y,gyro_z"):
    return header + "\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows) + "\n"


def noisy(n=2000, rate=100.0, scale=1e-3, seed=1):
    y = scale * np.random.default_rng(seed).standard_normal((n, 3))
    return np.column_stack([np.arange(n) / rate, y])


def mostly_nan():
    rows = noisy()
    rows[::2, 1:] = np.nan
    return rows


def text_in_a_number():
    lines = csv(noisy()).splitlines()
    lines[41] = lines[41].replace(lines[41].split(",")[1], "abc")
    return "\n".join(lines)


BAD = {
    "empty": "",
    "header only": "t,gyro_x,gyro_y,gyro_z\n",
    "one column": "t\n" + "\n".join(str(i) for i in range(100)),
    "text in a number": text_in_a_number(),
    "mostly NaN rows": csv(mostly_nan()),
    "constant data": csv(np.column_stack([np.arange(2000) / 100, np.ones((2000, 3))])),
    "too short": csv(noisy(3)),
    "unit off": csv(noisy(scale=1e6)),
    "unknown unit": csv(noisy(), "t,gyro_x [furlong/s],gyro_y [furlong/s],gyro_z [furlong/s]"),
}


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("command", ["tune", "identify"])
def test_bad_logs_are_refused_in_one_line(case, command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path / "bad.csv", BAD[case])
    message = refused(capsys, [command, path, "--quiet"])
    assert "bad.csv" in message
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]


def test_rows_in_no_order_are_to_be_sorted(tmp_path, capsys):
    """Read without its stamps, as was advised, such a log had K 40 times too small."""
    rows = np.random.default_rng(3).permutation(noisy())
    message = refused(capsys, ["identify", write(tmp_path / "bad.csv", csv(rows)), "--quiet"])
    assert "of its steps go back: sort the rows by time" in message


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to the superuser")
def test_a_folder_that_cannot_be_written_is_refused_at_once(tmp_path, capsys):
    tmp_path.chmod(0o500)
    assert f"found {tmp_path}, which cannot" in refused(
        capsys, ["tune", "--seed", "1", "-o", tmp_path / "out"]
    )


def test_an_error_of_the_system_names_the_file(tmp_path, capsys, monkeypatch):
    """It named a temporary file, or none."""
    path = write(tmp_path / "log.csv", csv(noisy()))
    for error, name in (
        (OSError(5, "Input/output error"), "log.csv"),
        (PermissionError(13, "Permission denied", str(tmp_path / ".tuner-1-a.yaml")), str(tmp_path)),
    ):
        monkeypatch.setattr("tuner.readers.read", Mock(side_effect=error))
        message = refused(capsys, ["identify", path, "--quiet"])
        assert message.endswith(f"{name}: {error.strerror}\n")


def test_a_refusal_is_one_line_also_where_messages_are_wanted(tmp_path, capsys):
    path = tmp_path / "empty.csv"
    path.write_text("")
    assert "empty" in refused(capsys, ["identify", path])
    assert "no such file" in refused(capsys, ["curve", tmp_path / "none.csv"])


def test_more_than_memory_holds_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "memory" in refused(capsys, ["simulate", "mpu9250", "--hours", "1e9"])
    assert list(tmp_path.iterdir()) == []


def test_the_place_of_bad_text_is_named(tmp_path, capsys):
    message = refused(capsys, ["identify", write(tmp_path / "bad.csv", text_in_a_number()), "--quiet"])
    assert "42" in message
    assert "abc" in message


@pytest.mark.parametrize(
    "arguments",
    [
        ["tune", "absent.csv"],
        ["tune", "--seed", "1", "--filter-timeout", "5"],
        ["check", "mpu9250", "--duration", "1e12"],
        ["check", "mpu9250", "--runs", "100000000"],
        ["identify", "absent.npz"],
        ["identify"],
        ["curve", "absent.csv"],
        ["plan", "nosuchgrade"],
        ["plan", "mpu9250", "--accuracy", "-1"],
        ["plan", "mpu9250", "--accuracy", "1e-300"],
        ["plan", "mpu9250", "--accuracy", "1e-160"],
        ["plan", "mpu9250", "--hours", "0"],
        ["compare", "mpu9250"],
        ["compare", "mpu9250", "nosuchgrade"],
        ["export", "mpu9250", "--to", "nosuchdialect"],
        ["export", "nosuchgrade", "--to", "kalibr"],
        ["export"],
        ["simulate", "nosuchgrade"],
        ["simulate", "mpu9250", "--hide", "nosucheffect"],
        ["tune", "--gnss", "nosuchgrade"],
        ["tune", "--terms", "nosuchterm"],
        ["identify", "absent.csv", "--terms", "ramp"],
        ["tune", "absent.csv", "--terms", "white,white"],
        ["fleet", "absent", "--terms", "random_walk,white,random_walk"],
        ["identify", "x.csv", "--json", "out.txt"],
        ["nosuchcommand"],
        ["tune", "--nosuchoption"],
    ],
)
def test_bad_usage_is_refused_in_one_line(arguments, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(capsys, [*arguments, "--quiet"] if arguments[0] in COMMANDS else arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_rate_is_refused(tmp_path, capsys):
    message = refused(
        capsys, ["identify", write(tmp_path / "log.csv", csv(noisy())), "--rate", "400", "--quiet"]
    )
    assert "--rate" in message


def test_a_configuration_that_is_none_is_refused(tmp_path, capsys):
    message = refused(capsys, ["export", write(tmp_path / "x.yaml", "format: other/1\n"), "--to", "kalibr"])
    assert "x.yaml" in message


def test_other_json_is_refused(tmp_path, capsys):
    for text in ("[]", "{}", "not json", '{"schema": "tuner.curve/1"}'):
        path = tmp_path / "other.json"
        path.write_text(text)
        assert "other.json" in refused(capsys, ["compare", "mpu9250", path])


@pytest.mark.parametrize(
    "arguments",
    [
        ["identify", "log.csv", "--page", "log.csv"],
        ["curve", "./log.csv", "--page=other name.csv"],
        ["plan", "log.csv", "--page", "log.csv"],
        ["export", "settings.yaml", "--to", "kalibr", "-o", "settings.yaml"],
        ["simulate", "settings.yaml", "--hours", "0.01", "-o", "settings.yaml"],
        ["compare", "mpu9250", "settings.yaml", "--page", "settings.yaml"],
    ],
)
def test_no_command_writes_over_its_input(arguments, tmp_path, capsys, monkeypatch):
    """`identify log.csv --page log.csv` made a page of the only log, `export` lost all states of a configuration."""
    monkeypatch.chdir(tmp_path)
    log = write(tmp_path / "log.csv", csv(noisy()))
    (tmp_path / "other name.csv").symlink_to(log)
    assert run(["export", "mpu9250", "--to", "native", "-o", "settings.yaml", "--quiet"]) == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert "expected another file to write" in refused(capsys, [*arguments, "--quiet"])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
