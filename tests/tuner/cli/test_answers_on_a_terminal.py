"""What every command prints: its answer on one screen, no line wider than a terminal as it opens, what follows."""

from __future__ import annotations

import shlex

import click
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
    "compare --verbose": ("compare", "adis16405", "mpu9250", "--verbose"),
    "grades": ("compare",),
    "plan": ("plan", "mpu9250"),
    "fleet": ("fleet", "{log}", "{folder}/none.csv", "-o", "{folder}/fleet"),
    "choose": ("choose", "--outage", "10", "--error", "1"),
    "tune a sheet": ("tune", "mpu9250", "-o", "sheet"),
    "tune": ("tune", "{log}", *WHITE[:2], "-o", "tuned"),
    "score": ("score", "{folder}/estimate.csv", "--truth", "{folder}/truth.csv"),
    "dialects": ("export", "--list"),
    "dialects of": ("export", "mpu9250"),
    "check": ("check", "mpu9250", "--runs", "2", "--duration", "300"),
    "check --engine": ("check", "mpu9250", "--runs", "2", "--duration", "60", "--engine", "filterpy"),
    "check --budget": ("check", "mpu9250", "--runs", "2", "--duration", "300", "--budget"),
}
LONGER = ("--verbose", "curve", "grades", "dialects", "--budget")
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
    (folder / "estimate.csv").write_text(
        "t,n,e,d,sd_n,sd_e,sd_d\n" + "".join(f"{k},{k % 3},{k % 5},0,2,2,1\n" for k in range(200))
    )
    (folder / "truth.csv").write_text("t,n,e,d\n" + "".join(f"{k},1,2,0\n" for k in range(200)))
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


FOLLOWED = (
    "identify",
    "identify two",
    "diagnose",
    "curve",
    "compare",
    "choose",
    "plan",
    "tune",
    "tune a sheet",
    "score",
    "fleet",
)


@pytest.mark.parametrize("name", FOLLOWED)
def test_an_answer_ends_with_a_command_that_works_when_pasted(name, logs, capsys, monkeypatch):
    """The options that read the log were left out: `identify --rate 20` was followed by a `tune` that was refused."""
    monkeypatch.chdir(logs["folder"])
    words = [word.format(**{**logs, "folder": "."}) for word in COMMANDS[name]]
    assert run([*(w.replace(f"{logs['folder']}/", "") for w in words), "--quiet"]) == 0
    said = click.unstyle(capsys.readouterr().out).partition("Next: tuner ")[2].replace(" \\\n", "")
    following = shlex.split(said.partition("\n")[0])
    quick = {"tune": ["-o", "next", "--terms", "white"], "diagnose": [], "score": []}
    assert run([*following, *quick.get(following[0], []), "--quiet"]) == 0


def test_what_was_stated_of_a_log_is_stated_in_the_command_that_follows(logs, capsys, monkeypatch):
    monkeypatch.chdir(logs["folder"])
    stated = ["--gyro-unit=rad/s", "--accel-unit=m/s^2", "--columns=gyro_x=gyro_x,t=t"]
    assert run(["identify", "bare.csv", *stated, *WHITE, "--quiet"]) == 0
    (line,) = [one for one in capsys.readouterr().out.replace(" \\\n", "").splitlines() if "Next:" in one]
    assert set(stated) < set(shlex.split(line))


@pytest.mark.parametrize("name", ["identify", "diagnose", "compare", "choose", "fleet"])
def test_verbose_begins_with_the_answer(name, logs, capsys, monkeypatch):
    """Verbose of `identify` said neither the recording nor the verdict."""
    monkeypatch.chdir(logs["folder"])
    words = [
        word.format(**{**logs, "folder": "."}).replace(f"{logs['folder']}/", "") for word in COMMANDS[name]
    ]
    told = []
    for more in ([], ["--verbose"]):
        assert run([*words, *more, "--quiet"]) == 0
        told.append(capsys.readouterr().out.splitlines())
    first = next(k for k, line in enumerate(told[0]) if line.startswith("Verdict: ")) + 1
    assert told[1][:first] == told[0][:first]
    assert len(told[1]) >= len(told[0])
    assert "--verbose" not in told[1][-1]
