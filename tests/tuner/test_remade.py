"""A configuration is a simulation: the noise and the findings in it are made again."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from models.noise import BiasInstability, NoiseModel, White
from tuner.agreement import agreed, findings_for_config
from tuner.cli import run
from tuner.diagnosis import diagnose
from tuner.exporters import native
from tuner.identification import identify
from tuner.remade import remade
from tuner.simulation import Channel, simulate
from tuner.synthesis import synthesize

NOISE = NoiseModel((White(1e-3), BiasInstability(2e-4)))
LINE = "line@gyro_x:frequency=7.3,amplitude=1e-3"
BURST = "burst@gyro_x:start=300,duration=100,variance_ratio=3"
FILTER = "lowpass@gyro_y:cutoff=10"


@pytest.fixture(scope="module")
def config():
    """Return the configuration of a log of two axes with a line and a burst in one, a filter in the other."""
    axes = dict.fromkeys(("gyro_x", "gyro_y"), Channel(NOISE))
    records, _ = simulate(axes, duration=1200.0, rate=50.0, seed=4, hidden=[LINE, BURST, FILTER])
    found = diagnose(records)
    assert sorted(f.cause for f in found.findings) == ["burst", "line", "lowpass"]
    identified = agreed(records, identify(records, arma=None), found, arma=None)
    return synthesize(identified, name="unit", findings=findings_for_config(found))


def test_findings_are_hidden_once(config):
    channels, hidden, notes = remade(native.loads(native.dumps(config)))
    assert sorted((h.effect.name, h.axes) for h in hidden) == [("burst", ("gyro_x",)), ("line", ("gyro_x",))]
    assert notes == ()
    assert "sinusoid" not in channels["gyro_x"].model.as_dict()
    assert "arma" in channels["gyro_y"].model.as_dict()  # the filter, in the noise


def test_what_is_made_again_is_diagnosed_again(config, tmp_path):
    path = tmp_path / "noise.yaml"
    native.dump(config, path)
    log, told = tmp_path / "again.npz", tmp_path / "found.json"
    assert run(["simulate", str(path), "--hours", "0.3333", "-o", str(log), "--seed", "5", "--quiet"]) == 0
    key = json.loads((tmp_path / "again.key.json").read_text())
    assert sorted(h["cause"] for h in key["hidden"]) == ["burst", "line"]
    assert run(["diagnose", str(log), "--quiet", "--json", str(told)]) == 0
    findings = json.loads(told.read_text())["findings"]
    assert {"burst", "line", "lowpass"} <= {f["cause"] for f in findings}  # hundreds of nats each
    (line,) = [f for f in findings if f["cause"] == "line"]
    assert line["parameters"]["frequency"]["value"] == pytest.approx(7.3, abs=1e-3)


def test_without_the_noise_of_the_findings_the_identified_terms_hold_the_line(config):
    bare = tuple({**finding, "extension": {}} for finding in config.findings)
    channels, hidden, _ = remade(replace(config, findings=bare))
    assert "sinusoid" in channels["gyro_x"].model.as_dict()
    assert "line" not in [h.effect.name for h in hidden]


def test_what_cannot_be_hidden_is_left_out_and_told(config):
    told = {"value": 1.0, "interval": [1.0, 1.0], "upper": None, "unit": "1"}
    more = [
        {"cause": "cross_axis", "channels": ["gyro_x", "gyro_y"], "parameters": {"correlation": told}},
        {"cause": "clipping", "channels": ["gyro_x"], "parameters": {"low": told}},
    ]
    found = tuple({**finding, "extension": {}} for finding in more)
    found += ({"cause": "time_offset", "joins": "preprocessing", "parameters": {"delay": 0.1}},)  # of a drive
    _, hidden, notes = remade(replace(config, findings=found))
    assert hidden == ()
    assert [note.split()[0] for note in notes] == ["time_offset", "cross_axis", "clipping"]


@pytest.mark.parametrize("arguments", [["--trajectory", "city"], ["--hide", "nonsense"]])
def test_refusals_are_one_line(config, tmp_path, capsys, arguments):
    path = tmp_path / "noise.yaml"
    native.dump(config, path)
    assert run(["simulate", str(path), "-o", str(tmp_path / "x.npz"), "--quiet", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "x.npz").exists()


def test_malformed_findings_are_one_line(config, tmp_path, capsys):
    path = tmp_path / "noise.yaml"
    path.write_text(native.dumps(config).replace("extension:", "extension: 3 #"), encoding="utf-8")
    assert run(["simulate", str(path), "-o", str(tmp_path / "x.npz"), "--quiet"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
