"""What every command prints of a log: its answer on one screen, and no line wider than a terminal as it opens."""

from __future__ import annotations

import numpy as np
import pytest

from models.noise import NoiseModel, White
from tuner.cli import run
from tuner.formats.logs import write_log
from tuner.limits import SCREEN_LINES
from tuner.simulation.static import simulate

WHITE = ("--terms", "white", "--arma", "off")
COMMANDS = {
    "identify": ("identify", "{log}"),
    "identify, no units": ("identify", "{bare}", *WHITE),
    "identify two": ("identify", "{log}", "{other}", *WHITE),
    "identify --verbose": ("identify", "{log}", "{other}", *WHITE, "--verbose"),
    "diagnose": ("diagnose", "{bare}"),
    "diagnose --verbose": ("diagnose", "{bare}", "--verbose"),
    "curve": ("curve", "{log}", "--tau", "0.1,1"),
    "curve psd": ("curve", "{log}", "--estimator", "psd"),
    "compare": ("compare", "adis16405", "mpu9250"),
    "grades": ("compare",),
    "plan": ("plan", "mpu9250"),
    "fleet": ("fleet", "{log}", "{folder}/none.csv", "-o", "{folder}/fleet"),
    "dialects": ("export", "--list"),
    "check": ("check", "mpu9250", "--runs", "2", "--duration", "300"),
    "check --budget": ("check", "mpu9250", "--runs", "2", "--duration", "300", "--budget"),
}
LONGER = ("--verbose", "curve", "grades", "compare", "dialects", "--budget")
"""Commands that print tables: no answer of one screen."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    noise = {
        f"{sensor}_{axis}": NoiseModel([White(size * (1 + i))])
        for sensor, size in (("gyro", 1e-4), ("accel", 1e-3))
        for i, axis in enumerate("xyz")
    }
    made = {}
    for name, seed in (("log", 3), ("other", 4)):
        records, _ = simulate(noise, duration=52.0, rate=20.0, seed=seed)
        made[name] = folder / f"{name}.npz"
        write_log(records, made[name])
    table = np.column_stack([records[0].t, *(record.y for record in records)])
    names = ["t", *(axis for record in records for axis in record.axes)]
    made["bare"] = folder / "bare.csv"
    np.savetxt(made["bare"], table, delimiter=",", header=",".join(names), comments="", fmt="%.7g")
    (folder / "none.csv").write_text("nothing\n")
    return {**made, "folder": folder}


@pytest.mark.parametrize("name", COMMANDS)
def test_no_line_is_wider_than_a_terminal_and_an_answer_is_one_screen(name, logs, capsys, monkeypatch):
    monkeypatch.chdir(logs["folder"])  # a path is never broken: those of this test are short
    words = [word.format(**{**logs, "folder": "."}) for word in COMMANDS[name]]
    assert run([*(w.replace(f"{logs['folder']}/", "") for w in words), "--quiet"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told
    assert max(map(len, told)) <= 80
    if not any(part in name for part in LONGER):
        assert len(told) <= SCREEN_LINES, told
