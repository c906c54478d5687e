"""What `tune` writes predicts the log it came from, causes of excess included; seeds are fixed."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tuner
from models.noise import GaussMarkov, NoiseModel, White
from tuner.formats import noise_yaml
from tuner.identification import identify
from tuner.report.result_set import tune_json
from tuner.report.tune_answer import tune_answer
from tuner.segments.conditions import at_rest
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.synthesis.prediction import hold_to_records
from tuner.types.prediction import BlockSource
from tuner.types.records import Record

INTERVAL, HOUR = 0.05, 3600.0
DATA = Path(os.environ.get("TUNER_DATA", "nowhere")) / "static"


def log(seed: int, bursts: bool) -> Record:
    """One hour of two gyros; the noise of one is ten times as large for 1 % of the time."""
    rng = np.random.default_rng(seed)
    model = NoiseModel((White(1e-4), GaussMarkov(2e-5, 100.0)))
    n = round(HOUR / INTERVAL)
    y = np.column_stack([model.sample(n, INTERVAL, rng) for _ in range(2)])
    if bursts:
        start = n // 2
        y[start : start + n // 100, 1] += 10.0 * rng.standard_normal(n // 100) * 1e-4 / np.sqrt(INTERVAL)
    t = np.arange(n) * INTERVAL
    return Record("gyro", t, y, ("gyro_x", "gyro_y"), "rad/s", INTERVAL, source="unit.npz")


@pytest.fixture(scope="module")
def result():
    return tuner.tune([log(5, bursts=True)])


def test_a_burst_is_not_in_the_settings(result):
    """The mean power N² (1 + 0.01 · 100) over the hour is that of two states: √2 of the noise of the quieter one.

    Settings are accepted within 0.8 … 1.25 of the measured deviation.
    """
    assert any(finding.cause == "burst" for finding in result.diagnosis.findings)
    for axis in ("gyro_x", "gyro_y"):
        assert 0.8 < result.config.channels[axis].white_density / 1e-4 < 1.25
        assert result.predictions[axis].passes


def test_the_noise_at_its_worst_is_advice_beside_the_settings(result):
    (worst,) = [one for one in result.config.worst_case if one.quantity.owner == "gyro_y"]
    assert worst.quantity.field == "white_density"
    true = 1e-4 * np.sqrt(101.0)
    written = result.config.channels["gyro_y"].white_density
    assert worst.factor * written == pytest.approx(true, rel=0.15)
    assert worst.time_share == pytest.approx(0.01, rel=0.1)
    stored = noise_yaml.loads(noise_yaml.dumps(result.config)).worst_case[0]
    assert stored.quantity == worst.quantity
    assert stored.time_share == pytest.approx(worst.time_share, rel=1e-4)
    told = "\n".join(map(str, tune_answer(result, Path("out")).whole))
    assert "for 1.0 % of the record, not in the settings" in told


def test_conservative_settings_use_the_worst_throughout():
    """Of this axis alone the burst is no part of the settings: its factor is that to the rest."""
    both = log(5, bursts=True)
    careful = tuner.tune([replace(both, y=both.y[:, 1:2], axes=("gyro_y",))], conservative=True)
    assert careful.config.channels["gyro_y"].white_density == pytest.approx(np.sqrt(101.0) * 1e-4, rel=0.15)
    assert careful.config.worst_case == ()


def test_the_comparison_is_part_of_the_result_and_of_the_file(result):
    content = json.loads(json.dumps(tune_json(result)))["prediction"]["gyro_x"]
    assert content["passes"] is True
    assert [f["seconds"] for f in content["forecasts"]] == [10.0, 60.0]  # the burst parts the hour
    tau, measured = np.array(content["allan"]["tau"]), np.array(content["allan"]["measured"])
    assert np.interp(1.0, tau, measured) == pytest.approx(1e-4, rel=0.05)
    stored = noise_yaml.loads(noise_yaml.dumps(result.config)).provenance["prediction"]["gyro_x"]
    assert stored["passes"] is True


def test_settings_that_do_not_predict_the_record_are_replaced_and_said():
    record = log(3, bursts=False)
    config = synthesize(tuner.identify([record]))
    wrong = {
        axis: noise.__class__(**{**vars(noise), "white_density": 3.0 * noise.white_density})
        for axis, noise in config.channels.items()
    }
    held, judged = hold_to_records(config.__class__(**{**vars(config), "channels": wrong}), [record])
    for axis, found in judged.items():
        assert found.source is BlockSource.CURVE
        assert held.channels[axis].white_density == pytest.approx(1e-4, rel=0.06)
        assert any(
            note.startswith(f"{axis}: the settings are fitted to the Allan curve") for note in held.notes
        )


def test_the_limit_of_an_axis_that_its_quantizer_limits_is_what_is_written():
    """The mean between two codes: their Allan curve has 6 % more white noise than the limit of its terms."""
    rng = np.random.default_rng(0)
    x = 3e-3 * rng.standard_normal(6000) + np.cumsum(1e-5 * rng.standard_normal(6000)) + 0.005
    record = Record(
        "gyro", 0.01 * np.arange(6000), 0.01 * np.rint(x / 0.01)[:, None], ("gyro_x",), "rad/s", 0.01,
        limiting_steps={"gyro_x": 0.01},
    )  # fmt: skip
    config, judged = hold_to_records(synthesize(identify([record], arma=None)), [record])
    assert not judged  # the curve of the codes is not what is written
    channel = config.channels["gyro_x"]
    (white,) = (term.coefficients["density"] for term in channel.identified if term.name == "white")
    assert channel.white_density == white.upper


def test_codes_that_hide_the_noise_decide_no_slow_term():
    """A gyro at one code: bias instability below 966 deg/h became settings of none, and simulated drives diverged."""
    rng = np.random.default_rng(4)
    record = Record(
        "gyro", 0.01 * np.arange(30000), 0.01 * np.rint(0.2 + 0.1 * rng.standard_normal((30000, 1))),
        ("gyro_x",), "rad/s", 0.01, limiting_steps={"gyro_x": 0.01},
    )  # fmt: skip
    before = synthesize(identify([record], arma=None))
    held, _ = hold_to_records(before, [record])
    assert held.channels["gyro_x"].markov == before.channels["gyro_x"].markov != ()
    assert held.channels["gyro_x"].random_walk_density == before.channels["gyro_x"].random_walk_density
    assert {one.quantity.field for one in held.inflations} >= {"white.density", "bias_instability.level"}


@pytest.mark.skipif(not DATA.is_dir(), reason="TUNER_DATA does not name a folder with recordings")
@pytest.mark.parametrize("name", ["adis16405_run1", pytest.param("galaxy_s5_static", marks=pytest.mark.slow)])
def test_measured_units_are_predicted(name):
    """Before, the accelerometers of the industrial unit got up to 12 times the Allan deviation that they show."""
    records = [record for record in tuner.read(DATA / f"{name}.npz") if record.name == "accel"]
    config, judged = hold_to_records(synthesize(tuner.identify(records, arma=None)), records)
    assert len(judged) == 3
    for axis, found in judged.items():
        assert found.passes, axis
        tau, variance = found.measured.tau, found.measured.variance
        own = found.block.model.allan_variance(tau, interval=found.measured.interval)
        at_ten_seconds = int(np.argmin(np.abs(tau - 10.0)))
        assert np.sqrt(own[at_ten_seconds] / variance[at_ten_seconds]) == pytest.approx(1.0, abs=0.3)
        assert config.channels[axis].white_density == found.block.white_density


def test_temperature_is_taken_out_where_nothing_predicts_the_samples_as_they_are():
    """Three poses with a mean each; 2 mm/s² a kelvin over cycles of 20 K: the slope is known to 1 % at worst."""
    rng = np.random.default_rng(8)
    interval, n = 1.0, 36_000
    t = interval * np.arange(n)
    celsius = 20.0 + 10.0 * np.sin(2.0 * np.pi * t / 5400.0)
    y = White(0.01).sample(n, interval, rng) + 2e-3 * celsius + np.repeat([0.0, 9.8, -9.8], n // 3)
    pieces = tuple((k * n // 3, (k + 1) * n // 3) for k in range(3))
    measured = celsius + 0.1 * rng.standard_normal(n)
    record = Record(
        "accel", t, y[:, None], ("accel_z",), "m/s^2", interval, pieces, {"temperature": measured}
    )
    config, judged = hold_to_records(synthesize(tuner.identify([record], arma=None)), [record])
    assert judged["accel_z"].passes
    assert config.channels["accel_z"].white_density == pytest.approx(0.01, rel=0.1)
    (note,) = [note for note in config.notes if "temperature is compensated" in note]
    slope = float(note.split("by ")[1].split(" ")[0])
    assert slope == pytest.approx(2e-3, rel=0.02)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="TUNER_DATA does not name a folder with recordings")
def test_a_tag_in_a_refrigerator_is_predicted_once_its_temperature_is_out():
    """Published slope of accel z: 0.0239 and 0.0244 m/s²/K in two poses."""
    records = at_rest(tuner.read(DATA / "cats_tag_temperature.npz"))
    config, judged = hold_to_records(synthesize(tuner.identify(records, arma=None)), records)
    assert all(found.passes for found in judged.values())
    (note,) = [n for n in config.notes if n.startswith("accel_z: the settings are for samples whose temp")]
    assert 0.0235 < float(note.split("by ")[1].split(" ")[0]) < 0.0248


@pytest.mark.parametrize(
    "effects",
    [
        ("vibration", "step"),
        ("spikes", "temperature"),
        ("telegraph", "line"),
        ("lowpass", "burst"),
        ("colour", "lattice"),
    ],
)
def test_settings_predict_logs_with_causes_in_pairs(effects):
    """`benchmarks/predictive_simulated.py` does the same for every pair."""
    model = NoiseModel((White(1e-4), GaussMarkov(2e-5, 100.0)))
    records, _ = simulate({"gyro_x": model}, duration=1200.0, rate=50.0, seed=8, effects=effects)
    (found,) = hold_to_records(synthesize(identify(records, arma=None)), records)[1].values()
    assert np.mean(np.abs(np.log(found.curve.ratio)) <= np.log(1.25)) >= 0.95
    assert 0.7 <= found.curve.ratio.min() <= found.curve.ratio.max() <= 1.4
    assert all(forecast.passes for forecast in found.forecasts)


def test_a_warm_up_that_no_settings_predict_is_taken_out_first():
    """The record less its signal is white noise of 1e-4: what a filter meets once the unit is warm."""
    model = NoiseModel((White(1e-4),))
    effect = "warmup@gyro_x:amplitude=2e-2,time_constant=60"
    records, _ = simulate({"gyro_x": model}, duration=1200.0, rate=20.0, seed=2, effects=[effect])
    config = synthesize(identify(records, arma=None))
    _, before = hold_to_records(config, records)
    assert not before["gyro_x"].passes
    signal = 2e-2 * np.exp(-(records[0].t - records[0].t[0]) / 60.0)
    after, found = hold_to_records(config, records, {"gyro_x": (("warmup",), signal)})
    assert found["gyro_x"].passes
    assert 0.9 < after.channels["gyro_x"].white_density / 1e-4 < 1.1
    assert any("without warmup" in note for note in after.notes)


def test_parts_at_different_levels_have_one_ramp() -> None:
    """After a motion the unit lies otherwise: the step between the parts is no drift."""
    rng = np.random.default_rng(41)
    t = 0.02 * np.arange(24_000)
    y = 0.01 * rng.standard_normal((24_000, 1)) + 1e-4 * t[:, None]
    y[13_000:] -= 1.0
    record = Record("accel", t, y, ("accel_x",), "m/s^2", 0.02, ((0, 12_000), (13_000, 24_000)))
    noise = identify([record], arma=None)
    assert noise.channels["accel_x"].term("ramp") is not None
    (judged,) = hold_to_records(synthesize(noise), [record])[1].values()
    assert judged.source is BlockSource.LIKELIHOOD
    assert judged.block.white_density == pytest.approx(0.01 * np.sqrt(0.02), rel=0.02)
