"""`tuner diagnose` from end to end: the hidden effect is named, JSON has its schema, `--strict` sets the status."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from models.noise import NoiseModel, RandomWalk, White
from tuner.cli import run
from tuner.cli.commands.diagnose import _after_drive
from tuner.formats.logs import write_log
from tuner.simulation.static import simulate
from tuner.types import Diagnosis, DriveDiagnosis, Finding, Unexplained
from tuner.types.compensation import Compensation

RATE, DURATION = 100.0, 600.0
MODEL = NoiseModel([White(1e-4), RandomWalk(1e-6)])
LINE = "line@gyro_x:frequency=12.5,amplitude=2.5e-4"
"""A quarter of the white deviation of a sample: z = 0.25 √(60 000 / 2) = 43 deviations, 940 nats."""


def log(path, *hidden, seed, duration=DURATION):
    axes = {"gyro_x": MODEL, "gyro_y": MODEL}
    records, _ = simulate(axes, duration=duration, rate=RATE, seed=seed, effects=hidden)
    write_log(records, path)
    return path


@pytest.fixture(scope="module")
def lined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lined")
    first, second = log(folder / "a.npz", LINE, seed=1), log(folder / "b.npz", LINE, seed=2)
    file = folder / "found.json"
    arguments = [
        "diagnose",
        first,
        "--holdout",
        second,
        "--replicas",
        5,
        "--strict",
        "--json",
        file,
        "--quiet",
    ]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("tuner.report.result_views.draw_all", None)  # without --page no figure is drawn
        assert run([str(a) for a in arguments]) == 0
    return json.loads(file.read_text())


def test_the_hidden_line_is_named_with_its_parameters(lined):
    (finding,) = lined["findings"]
    assert finding["cause"] == "line"
    assert finding["channels"] == ["gyro_x"]
    frequency, amplitude = (finding["parameters"][name] for name in ("frequency", "amplitude"))
    # sd of the frequency √6/(π T z) = 3e-5 Hz and of the amplitude 1/z = 2.3 %: five of them.
    assert frequency["value"] == pytest.approx(12.5, abs=1.5e-4)
    assert amplitude["value"] == pytest.approx(2.5e-4, rel=0.12)
    assert frequency["unit"] == "Hz"
    assert not lined["quiet"]


def test_the_contract_holds(lined):
    assert lined["schema"] == "tuner.diagnosis/1"
    (finding,) = lined["findings"]
    assert {"p_value", "parameters", "gain", "alternatives", "text"} <= set(finding)
    for coefficient in finding["parameters"].values():
        low, high = coefficient["interval"]
        assert low <= coefficient["value"] <= high
    assert isinstance(lined["unexplained"], list)
    assert isinstance(lined["notes"], list)


def test_the_gain_is_measured_on_the_second_record(lined):
    gain = lined["findings"][0]["gain"]
    assert gain["split"] == "second record"
    likelihood = gain["held_out_log_likelihood_per_sample"]
    assert likelihood["after"] > likelihood["before"]
    assert set(gain["coverage"]) == {"allan", "psd"}


def test_a_clean_log_has_no_finding(tmp_path, capsys):
    assert run(["diagnose", str(log(tmp_path / "clean.npz", seed=4)), "--json", "-", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["quiet"]
    assert found["findings"] == []


def test_words_for_the_terminal(tmp_path, capsys):
    path = str(log(tmp_path / "lined.npz", LINE, seed=3, duration=60.0))
    assert run(["diagnose", path, "--quiet"]) == 0
    out = " ".join(capsys.readouterr().out.replace("\\\n", "").split())
    frequency = re.search(r"line in gyro x \(frequency (\S+) ±", out)
    assert frequency is not None
    assert float(frequency[1]) == pytest.approx(12.5, abs=1e-3)
    assert "Found, and changes noise and drift by less than 5 %: line in gyro x" in out
    assert "Verdict: usable: for the settings of a filter" in out
    assert f"Next: tuner tune {path}" in out
    assert "60/40" not in out
    assert run(["diagnose", path, "--quiet", "--verbose"]) == 0
    assert "60/40" in capsys.readouterr().out


def test_what_stays_unexplained_is_a_status_only_if_strict(tmp_path, capsys, monkeypatch):
    odd = Diagnosis((), (Unexplained("kurtosis of the residuals", ("gyro_x",), 1e-9),))
    monkeypatch.setattr("tuner.diagnosis.diagnose", lambda *_, **__: odd)
    path = str(log(tmp_path / "odd.npz", seed=5))
    assert run(["diagnose", path, "--quiet"]) == 0
    assert "Not explained: kurtosis of the residuals in gyro x" in capsys.readouterr().out
    assert run(["diagnose", path, "--strict", "--quiet"]) == 1


def drive_finding(cause, channels, consequence=""):
    return Finding(
        cause, channels, "", 9.0, 1e-9, {}, f"{cause}: words", consequence, {"joins": "preprocessing"}
    )


DELAYED = Compensation.parse({"time_offset.delay": 0.1})
JUMP = drive_finding("bias_jump", ("gyro",), "restart the filter at that time")
UNNAMED = Unexplained("correlation of innovations", ("drive",), 1e-9)


@pytest.mark.parametrize(
    ("findings", "unexplained", "config", "following"),
    [
        ((), (), "noise.yaml", "tuner navigate d.npz --config noise.yaml"),
        ((), (), None, "tuner tune --drive d.npz"),
        ((drive_finding("time_offset", ("gnss",)),), (), "noise.yaml", "tuner tune noise.yaml --drive d.npz"),
        ((drive_finding("gnss_outliers", ("gnss",)),), (), None, "tuner tune --drive d.npz"),
        ((JUMP,), (), "a.yaml", "restart the filter at that time; then tuner diagnose d.npz --config a.yaml"),
        ((), (UNNAMED,), "a.yaml", "tuner diagnose d.npz --config a.yaml --page diagnosis.html"),
    ],
)
def test_the_next_command_follows_from_the_diagnosis_of_a_drive(findings, unexplained, config, following):
    """Settings that nothing contradicts, and faults of a unit, were sent to be tuned, without the settings."""
    after = SimpleNamespace(compensation=DELAYED)
    found = DriveDiagnosis(findings, None, after, unexplained)
    assert _after_drive(found, "d.npz", config, None) == following


def test_a_log_too_short_is_refused_in_one_line(tmp_path, capsys):
    y = np.random.default_rng(1).standard_normal(200)
    path = tmp_path / "short.csv"
    path.write_text("t,gyro_x\n" + "\n".join(f"{i / 100},{v * 1e-3:.9g}" for i, v in enumerate(y)) + "\n")
    assert run(["diagnose", str(path), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert "short.csv" in error
    assert error.count("\n") == 1


def test_two_states_of_a_unit_differ_by_cause_and_entry(tmp_path, capsys):
    """The engine makes a line, twice the white noise and a shift of the mean; each moves what it must."""
    rest, _ = simulate({"gyro_x": MODEL}, duration=200.0, rate=50.0, seed=1)
    loud, _ = simulate(
        {"gyro_x": NoiseModel([White(2e-4), RandomWalk(1e-6)])},
        duration=200.0, rate=50.0, seed=2, effects=("line:frequency=12.5,amplitude=1e-3",),
    )  # fmt: skip
    write_log(rest, tmp_path / "rest.npz")
    write_log([type(r)(**{**vars(r), "y": r.y + 1e-3}) for r in loud], tmp_path / "engine.npz")
    file = tmp_path / "states.json"
    arguments = ["diagnose", tmp_path / "engine.npz", "--against", tmp_path / "rest.npz", "--json", file]
    assert run([str(a) for a in arguments]) == 0
    states = json.loads(file.read_text())
    assert states["schema"] == "tuner.states/1"
    found = {(one["cause"], one["entry"]) for one in states["differences"]}
    entry = "channels.gyro_x.{}".format
    assert found >= {
        ("line", None), ("noise", entry("white_density")), ("mean", entry("constant_sd")),
    }  # fmt: skip
    assert states["differences"][0]["place"]["frequency"]["value"] == pytest.approx(12.5, abs=1e-3)
    assert "line (frequency 12.5" in capsys.readouterr().out
