"""Simulation of a configuration: its noise and its findings are reproduced."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from models.noise import BiasInstability, NoiseModel, White
from models.trajectory.catalogue import city
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.cli import run
from tuner.diagnosis import diagnose
from tuner.formats import noise_yaml
from tuner.identification import identify
from tuner.identification.identify import with_terms_found
from tuner.readers.drive import read_drive
from tuner.simulation.drive import simulate_drive
from tuner.simulation.from_config import channels_of_config, drive_effects_of_config
from tuner.simulation.static import Channel, simulate
from tuner.synthesis import synthesize
from tuner.synthesis.findings import findings_for_config, terms_found
from tuner.types.records import DataError

NOISE = NoiseModel((White(1e-3), BiasInstability(2e-4)))
LINE = "line@gyro_x:frequency=7.3,amplitude=1e-3"
BURST = "burst@gyro_x:start=300,duration=100,variance_ratio=3"
FILTER = "lowpass@gyro_y:cutoff=10"


@pytest.fixture(scope="module")
def config():
    """Return the configuration of a log of two axes with a line and a burst in one, a filter in the other."""
    axes = dict.fromkeys(("gyro_x", "gyro_y"), Channel(NOISE))
    records, _ = simulate(axes, duration=1200.0, rate=50.0, seed=4, effects=[LINE, BURST, FILTER])
    found = diagnose(records)
    assert sorted(f.cause for f in found.findings) == ["burst", "line", "lowpass"]
    identified = with_terms_found(records, identify(records), terms_found(found))
    return synthesize(identified, name="unit", findings=findings_for_config(found))


def test_findings_are_hidden_once(config):
    channels, hidden, notes = channels_of_config(noise_yaml.loads(noise_yaml.dumps(config)))
    assert sorted((h.effect.name, h.axes) for h in hidden) == [("burst", ("gyro_x",)), ("line", ("gyro_x",))]
    assert notes == ()
    assert "sinusoid" not in channels["gyro_x"].model.as_dict()
    assert "arma" in channels["gyro_y"].model.as_dict()  # the filter, in the noise


def test_what_is_made_again_is_diagnosed_again(config, tmp_path):
    path = tmp_path / "noise.yaml"
    noise_yaml.dump(config, path)
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
    channels, hidden, _ = channels_of_config(replace(config, findings=bare))
    assert "sinusoid" in channels["gyro_x"].model.as_dict()
    assert "line" not in [h.effect.name for h in hidden]


@pytest.mark.slow
def test_telegraph_noise_is_made_again_with_its_levels():
    told = "telegraph@gyro_x:size=2e-3,dwell_low=30,dwell_high=20"
    records, _ = simulate({"gyro_x": Channel(NOISE)}, duration=1200.0, rate=10.0, seed=6, effects=[told])
    found = diagnose(records)
    assert [f.cause for f in found.findings] == ["telegraph"]
    unit = synthesize(identify(records, arma=None), findings=findings_for_config(found))
    channels, hidden, notes = channels_of_config(noise_yaml.loads(noise_yaml.dumps(unit)))
    assert [(h.effect.name, h.axes) for h in hidden] == [("telegraph", ("gyro_x",))]
    assert notes == ()
    # Its own process is gone; what is left is the noise beside it.
    before, after = found.models["gyro_x"], channels["gyro_x"].model
    assert len(after.terms) == len(before.terms) - 1
    again, _ = simulate(channels, duration=1200.0, rate=10.0, seed=7, effects=hidden)
    assert "telegraph" in [f.cause for f in diagnose(again).findings]  # hundreds of nats


def test_samples_repeated_in_all_axes_are_simulated_together():
    axes = dict.fromkeys(("gyro_x", "gyro_y"), Channel(NOISE))
    told = "duplicates@gyro_x+gyro_y:fraction=0.5"
    records, _ = simulate(axes, duration=300.0, rate=50.0, seed=8, effects=[told])
    found = diagnose(records)
    assert [(f.cause, f.channels) for f in found.findings] == [("duplicates", ("gyro_x", "gyro_y"))]
    unit = synthesize(identify(records, arma=None), findings=findings_for_config(found))
    channels, hidden, _ = channels_of_config(unit)
    assert [(h.effect.name, h.axes) for h in hidden] == [("duplicates", ("gyro_x", "gyro_y"))]
    again, _ = simulate(channels, duration=300.0, rate=50.0, seed=9, effects=hidden)
    held = np.diff(again[0].y, axis=0) == 0.0
    assert np.mean(held.all(axis=1)) == pytest.approx(0.5, abs=0.02)  # sd 0.004
    assert np.array_equal(held[:, 0], held[:, 1])


def test_what_cannot_be_simulated_is_left_out_and_reported(config):
    told = {"value": 1.0, "interval": [1.0, 1.0], "upper": None, "unit": "1"}
    more = [
        {"cause": "cross_axis", "channels": ["gyro_x", "gyro_y"], "parameters": {"correlation": told}},
        {"cause": "clipping", "channels": ["gyro_x"], "parameters": {"low": told}},
        {"cause": "attitude", "channels": ["gyro_x"], "parameters": {"tilt": told}},
    ]
    found = tuple({**finding, "extension": {}} for finding in more)
    found += ({"cause": "time_offset", "joins": "preprocessing", "parameters": {"delay": 0.1}},)  # of a drive
    _, hidden, notes = channels_of_config(replace(config, findings=found))
    assert hidden == ()
    assert [note.split()[0] for note in notes] == ["time_offset", "cross_axis", "clipping", "attitude"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["--trajectory", "moon"],
        ["--trajectory", "city"],
        ["--hide", "nonsense"],
        ["--hide", "step:time=1e9,size=1"],
    ],
)
def test_refusals_are_one_line(config, tmp_path, capsys, arguments):
    path = tmp_path / "noise.yaml"
    noise_yaml.dump(config, path)
    assert run(["simulate", str(path), "-o", str(tmp_path / "x.npz"), "--quiet", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "x.npz").exists()


def test_malformed_findings_are_one_line(config, tmp_path, capsys):
    path = tmp_path / "noise.yaml"
    path.write_text(noise_yaml.dumps(config).replace("extension:", "extension: 3 #"), encoding="utf-8")
    assert run(["simulate", str(path), "-o", str(tmp_path / "x.npz"), "--quiet"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def coefficient(value, unit="1"):
    return {"value": value, "interval": [0.9 * value, 1.1 * value], "upper": None, "unit": unit}


DRIVEN = (
    {"cause": "time_offset", "channels": ["gnss"], "parameters": {"delay": coefficient(0.2, "s")}},
    {"cause": "bias_jump", "channels": ["imu"], "parameters": {
        "time": coefficient(40.0, "s"), **{a: coefficient(0.5, "m/s^2") for a in "xyz"}}},
    {"cause": "correlated_gnss", "channels": ["gnss"], "parameters": {
        "sd": coefficient(1.0, "m"), "time_constant": coefficient(50.0, "s")}},
    {"cause": "sensor_bias", "channels": ["gyro_x"], "parameters": {"gyro_x": coefficient(1e-3)}},
    {"cause": "line", "channels": ["gyro_x"], "parameters": {
        "frequency": coefficient(7.3), "amplitude": coefficient(1e-2)},
     "extension": {"models": {"gyro_x": NoiseModel((White(1e-4),)).as_dict()}}},
    {"cause": "timing", "channels": ["gyro_x", "accel_z"], "parameters": {"jitter": coefficient(1e-4)}},
)  # fmt: skip
"""Findings of a drive, and of a static log, as a configuration carries them."""


@pytest.fixture(scope="module")
def six():
    """Return a configuration of six quiet axes with findings."""
    told = synthesize(
        grade_identification(load_grade("stim300")), gnss=replace(load_gnss("rtk"), correlated=())
    )
    return replace(told, interval=0.02, findings=DRIVEN)


def test_a_drive_is_made_of_a_configuration(six, tmp_path):
    path, out = tmp_path / "noise.yaml", tmp_path / "d.npz"
    noise_yaml.dump(six, path)
    command = ["simulate", str(path), "--trajectory", "city", "--hours", "0.03", "-o", str(out), "--quiet"]
    assert run([*command, "--hide", "lever_arm:x=1,y=0,z=0"]) == 0
    key = json.loads((tmp_path / "d.key.json").read_text())
    assert [one["cause"] for one in key["hidden"]] == ["time_offset", "bias_jump", "lever_arm", "line"]
    assert key["hidden"][1]["parameters"]["sensor"] == "accel"
    drive = read_drive(out)
    assert drive.gnss.t[0] == pytest.approx(0.02 + six.gnss.interval + 0.2, abs=0.05)
    assert 1.0 / np.median(np.diff(drive.imu_t)) == pytest.approx(50.0)
    # The line alone is far above the noise of a unit that stands.
    still = drive.rates[:500, 0]
    assert np.std(still) == pytest.approx(1e-2 / np.sqrt(2.0), rel=0.2)


def test_a_grade_and_its_configuration_make_like_drives(six):
    motion, receiver = city(60.0), load_gnss("rtk")
    ours = {axis: Channel(NoiseModel((White(1e-3),)), 0.0) for axis in six.channels}
    drive, key = simulate_drive(ours, motion, receiver, rate=50.0, seed=1, name="unit")
    truth, _ = simulate_drive(load_grade("stim300"), motion, receiver, rate=50.0, seed=2)
    sd = np.std(np.diff(drive.rates - truth.rates, axis=0), axis=0) / np.sqrt(2.0)
    np.testing.assert_allclose(sd[:3], 1e-3 * np.sqrt(50.0), rtol=0.15)  # 6 sigma of 3000 samples: 8 %
    assert key["source"] == "unit"
    with pytest.raises(DataError, match="accel_z missing"):
        simulate_drive({a: c for a, c in ours.items() if a != "accel_z"}, motion, receiver, rate=50.0, seed=1)


def test_findings_of_a_drive_that_cannot_be_simulated_are_reported(six):
    effects, notes = drive_effects_of_config(six, receiver=False)
    assert [e.name for e in effects] == ["time_offset", "bias_jump", "correlated_gnss"]
    assert notes == ()
    classes = {
        "cause": "gnss_noise_scale",
        "channels": ["gnss"],
        "parameters": {"position_edge_1": coefficient(2.0)},
    }
    _, notes = drive_effects_of_config(replace(six, findings=(classes,)), receiver=True)
    assert [note.split()[0] for note in notes] == ["gnss_noise_scale"]
    with pytest.raises(DataError, match="as tune writes them"):
        drive_effects_of_config(
            replace(six, findings=({"cause": "lever_arm", "channels": ["gnss"]},)), receiver=True
        )
    _, hidden, notes = channels_of_config(six, drive=True)
    assert [h.effect.name for h in hidden] == ["line"]
    assert [note.split()[0] for note in notes] == ["timing"]


@pytest.mark.parametrize("effect", ["step:time=70,size=1e-3", "burst:start=60,duration=5,variance_ratio=3"])
def test_an_effect_after_the_end_is_refused(effect, tmp_path, capsys):
    out = tmp_path / "x.npz"
    assert (
        run(["simulate", "stim300", "--hours", str(1 / 60), "--hide", effect, "-o", str(out), "--quiet"]) == 2
    )
    told = capsys.readouterr().err
    assert "within the record, 0 … 59.9" in told
    assert told.count("\n") == 1
    assert not out.exists()
    drive = ["simulate", "stim300", "--trajectory", "city", "--hours", "0.03", "-o", str(out), "--quiet"]
    assert run([*drive, "--hide", "bias_jump:time=2000,x=1"]) == 2
    assert "within the record" in capsys.readouterr().err
    assert not out.exists()
