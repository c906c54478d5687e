"""Identification and diagnosis of one log agree in the configuration; nothing is enlarged twice."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import yaml

from models.noise import BiasInstability, GaussMarkov, NoiseModel, RandomWalk, White
from tuner.cli import run
from tuner.formats.configuration import config_json, load_config
from tuner.identification import identify
from tuner.identification.identify import with_terms_found
from tuner.judgement import judge_noise
from tuner.pipeline import check_or_reason, identified_again, identify_and_diagnose
from tuner.segments.conditions import at_rest
from tuner.segments.stationary import parts_text
from tuner.simulation.static import simulate
from tuner.synthesis import inflate, synthesize
from tuner.synthesis.findings import (
    findings_for_config,
    judge_hidden,
    noisier_stretches,
    settled_inflations,
    terms_found,
    with_notes_on_findings,
)
from tuner.tune_result import TuneInputs
from tuner.types import Coefficient, Diagnosis, Enlargement, Finding, Quantity
from tuner.types.progress import silent
from tuner.types.records import Record

MODEL = NoiseModel([White(1e-4), RandomWalk(1e-6)])


def known(value, unit="SI"):
    return Coefficient.known(value, 0.9 * value, 1.1 * value, unit)


def finding(cause, inflations=(), **values):
    parameters = {name: known(v) for name, v in values.items()}
    extension = {"cause": cause, "joins": "noise model"}
    return Finding(
        cause, ("gyro_x",), "s", 9.0, 1e-9, parameters, cause, extension=extension, inflations=inflations
    )


@cache
def identified(model=MODEL, *hidden, seed=1):
    records, _ = simulate({"gyro_x": model}, duration=600.0, rate=100.0, seed=seed, effects=hidden)
    return records, identify(records, arma=None)


def with_findings(records, identification, diagnosis):
    found = with_terms_found(records, identification, terms_found(diagnosis))
    return with_notes_on_findings(found, diagnosis, records)


def test_a_line_found_is_identified_and_reaches_the_yaml():
    records, base = identified(MODEL, "line@gyro_x:frequency=12.5,amplitude=3e-4")
    found = Diagnosis((finding("line", frequency=12.5, amplitude=3e-4),), models={"gyro_x": MODEL})
    channel = with_findings(records, base, found).channels["gyro_x"]
    line = channel.term("sinusoid")
    # Amplitude errs by sd √(2/n) = 5.8e-6, frequency by √6/(π T) σ/(A √n)·… = 3e-5 Hz: more than five of them.
    assert line.coefficients["amplitude"].value == pytest.approx(3e-4, abs=3e-5)
    assert line.coefficients["frequency"].value == pytest.approx(12.5, abs=2e-4)
    assert {t.name for t in base.channels["gyro_x"].terms} < {t.name for t in channel.terms}
    noise = synthesize(with_findings(records, base, found), findings=findings_for_config(found))
    again = load_config(config_json(noise), source="again")
    assert again == noise
    assert again.findings[0]["cause"] == "line"
    assert any(t.name == "sinusoid" for t in again.channels["gyro_x"].identified)


def test_a_process_found_becomes_a_state_unless_it_is_one():
    slow = MODEL + GaussMarkov(5e-4, 2.0)
    records, base = identified(slow)
    assert base.channels["gyro_x"].term("gauss_markov").present
    same = Diagnosis((finding("gauss_markov", sd=5e-4, time_constant=2.0),), models={"gyro_x": slow})
    before, after = (one.channels["gyro_x"] for one in (base, with_findings(records, base, same)))
    assert [t.name for t in after.model.terms] == [t.name for t in before.model.terms]
    for mine, other in zip(after.model.terms, before.model.terms, strict=True):
        values = [[getattr(term, name) for name in term.PARAMETERS] for term in (mine, other)]
        assert values[0] == pytest.approx(values[1], rel=1e-3)
    telegraph = "telegraph@gyro_x:size=1e-3,dwell_low=4,dwell_high=4"
    records, _ = identified(NoiseModel([White(1e-4), BiasInstability(3e-5)]), telegraph)
    without = identify(records, terms=("white", "bias_instability"), arma=None)
    found = finding("telegraph", size=1e-3, dwell_low=4.0, dwell_high=4.0)
    after = with_findings(records, without, Diagnosis((found,))).channels["gyro_x"].term("gauss_markov")
    # Two levels ± size/2, dwells of 4 s: sd 5e-4, correlation time 2 s; 300 of those in the log.
    assert after.coefficients["sd"].value == pytest.approx(5e-4, rel=0.3)
    assert after.coefficients["time_constant"].value == pytest.approx(2.0, rel=0.5)


def test_a_process_the_data_do_not_allow_is_said_and_left_out():
    records, base = identified(MODEL)
    found = Diagnosis((finding("gauss_markov", sd=1e-6, time_constant=5.0),))
    after = with_findings(records, base, found).channels["gyro_x"]
    assert after.terms == base.channels["gyro_x"].terms
    assert "the data allow none" in after.warnings[-1]


def test_a_term_that_a_process_replaces_keeps_a_limit():
    """Telegraph noise looks like a random walk to the base terms; beside its process the walk is absent, not zero."""
    telegraph = "telegraph@gyro_x:size=1e-3,dwell_low=4,dwell_high=4"
    records, base = identified(NoiseModel([White(1e-4)]), telegraph)
    found = Diagnosis((finding("telegraph", size=1e-3, dwell_low=4.0, dwell_high=4.0),))
    after = with_findings(records, base, found).channels["gyro_x"]
    assert {"bias_instability", "random_walk"} <= {t.name for t in after.terms}
    for term in after.terms:
        if not term.present and term.name != "quantization":
            assert all(c.upper > 0.0 for c in term.coefficients.values())


def test_what_a_filter_meets_stays_in_the_identification_and_is_said():
    records, base = identified()
    found = Diagnosis((finding("temperature", slope=1e-5),), models={"gyro_x": MODEL})
    after = with_findings(records, base, found)
    assert after.channels == base.channels
    assert "gyro_x was identified with temperature in it" in after.notes[-1]
    assert "random walk density 12.4 deg/h/√h" in after.notes[-1]
    burst = Diagnosis((finding("burst", variance_ratio=3.5),), models={"gyro_x": MODEL})
    assert with_findings(records, base, burst).notes[-1] == "gyro_x was identified with burst in it"


def test_an_event_in_a_part_that_was_cut_is_not_in_the_identification():
    records, base = identified()
    begins = (replace(records[0], segments=((0, len(records[0]) // 2),)),)
    middle = records[0].t[len(records[0]) // 2]
    for start, said in ((middle - 50.0, True), (middle + 50.0, False)):
        burst = Diagnosis((finding("burst", start=start, duration=20.0),))
        notes = with_notes_on_findings(base, burst, begins).notes
        assert any("with burst in it" in note for note in notes) == said


def test_an_enlargement_is_relative_to_the_configuration():
    _, base = identified()
    config = synthesize(base)
    believed = config.channels["gyro_x"].white_density
    inflation = Enlargement(Quantity("gyro_x", "white_density"), 1.5, "lowpass: white density at the plateau")
    for first, wanted in ((NoiseModel([White(believed)]), 1.5), (NoiseModel([White(believed / 1.5)]), None)):
        found = Diagnosis((finding("lowpass", (inflation,), cutoff=25.0),), base={"gyro_x": first})
        settled = settled_inflations(found, config)
        after = inflate(config, settled)
        assert [i.factor for i in settled] == ([pytest.approx(wanted)] if wanted else [])
        assert after.channels["gyro_x"].white_density == pytest.approx(believed * (wanted or 1.0))


def test_a_stretch_of_noise_has_the_ratio_that_its_finding_states():
    """A variance ratio of 1.76, sd 1.33, stood as × 1.505: the base model of the diagnosis had the larger density."""
    _, base = identified()
    config = synthesize(base)
    model = NoiseModel([White(1.13 * config.channels["gyro_x"].white_density)])
    quantity = Quantity("gyro_x", "white_density")
    burst = Enlargement(quantity, 1.325, "burst: the noise while it lasts", time_share=0.0013)
    found = Diagnosis((finding("burst", (burst,), variance_ratio=1.756),), base={"gyro_x": model})
    assert [one.factor for one in settled_inflations(found, config)] == [1.325]
    records, _ = identified()
    half = (replace(records[0], segments=((0, len(records[0]) // 2),)),)
    late = finding("burst", (burst,), start=records[0].t[-1] - 9.0, duration=8.0, variance_ratio=4.0)
    (worst,) = settled_inflations(Diagnosis((late,), base={"gyro_x": model}), config, half)
    assert worst.factor == 2.0


def test_bursts_one_after_another_do_not_multiply():
    _, base = identified()
    config = synthesize(base)
    believed = config.channels["gyro_x"].white_density
    why = "burst: the noise while it lasts"
    bursts = tuple(
        Enlargement(Quantity("gyro_x", "white_density"), factor, why) for factor in (2.0, 3.0, 2.5)
    )
    found = Diagnosis(tuple(finding("burst", (one,), duration=10.0) for one in bursts))
    after = inflate(config, settled_inflations(found, config))
    assert after.channels["gyro_x"].white_density == pytest.approx(3.0 * believed)


def test_an_extension_of_the_noise_is_reported_with_all_its_terms():
    found = Diagnosis((finding("vibration", frequency=20.0),), models={"gyro_x": MODEL})
    (told,) = findings_for_config(found)
    assert NoiseModel.from_dict(told["extension"]["models"]["gyro_x"]) == MODEL


def test_the_key_is_the_judge():
    key = {"hidden": [{"cause": c, "channels": ["gyro_x"], "parameters": {}} for c in ("line", "step")]}
    line, step = judge_hidden(key, Diagnosis((finding("line"),)))
    assert (line["found"], step["found"]) == (True, False)
    assert step["named"] == ["line"]


def test_the_demo_says_whether_its_effect_was_found_and_writes_it_everywhere(tmp_path, capsys, monkeypatch):
    hidden = "line@gyro_x:frequency=12.5,amplitude=1e-3"

    def short(seed):
        return simulate({"gyro_x": MODEL}, duration=120.0, rate=100.0, seed=seed, effects=[hidden])

    monkeypatch.setattr("tuner.pipeline.demo", short)
    assert run(["tune", "-o", str(tmp_path), "--quiet"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "1 finding in report.html changes no setting" in out
    assert "line in gyro x is hidden in it: found" in out
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["hidden"][0]["found"]
    assert [f["cause"] for f in result["diagnosis"]["findings"]] == ["line"]
    assert json.loads((tmp_path / "key.json").read_text())["hidden"][0]["cause"] == "line"
    config = yaml.safe_load((tmp_path / "noise.yaml").read_text())
    assert [f["cause"] for f in config["findings"]] == ["line"]
    terms = config["sensors"]["gyro"]["gyro_x"]["identified"]
    assert [t["frequency"]["value"] for t in terms if t["term"] == "sinusoid"] == [
        pytest.approx(12.5, abs=1e-3)
    ]
    assert "<h3>Line in gyro x</h3>" in (tmp_path / "report.html").read_text()
    assert (tmp_path / "finding-1-line.svg").exists()


def test_a_log_too_short_for_a_diagnosis_is_tuned_and_says_so(tmp_path, capsys):
    records, _ = simulate({"gyro_x": MODEL}, duration=8.0, rate=100.0, seed=1)
    rows = [f"{t},{y:.9g}" for t, y in zip(records[0].t, records[0].y[:, 0], strict=True)]
    path = tmp_path / "short.csv"
    path.write_text("t,gyro_x\n" + "\n".join(rows) + "\n")
    assert run(["tune", str(path), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert "1024" in result["absent"]["diagnosis"]
    assert "diagnosis" not in result


def test_a_motion_that_only_the_diagnosis_finds_is_left_out_of_the_noise():
    motion = "motion@gyro_x:start=300,duration=20,sd=0.003"
    records, _ = simulate({"gyro_x": MODEL}, duration=600.0, rate=20.0, seed=2, effects=[motion])
    inputs = TuneInputs("unit", records, None, None, None)
    said = []
    found = identify_and_diagnose(inputs, terms=None, latitude=None, replicas=0, seed=0, progress=said.append)
    assert [one.cause for one in found.diagnosis.findings] == ["motion"]
    white = found.identification.channels["gyro_x"].term("white").coefficients["density"].value
    assert white == pytest.approx(1e-4, rel=0.03)  # 4 sds of 12 000 samples; 3e-4 with the motion in it
    assert not any("motion" in note for note in found.identification.notes)
    (record,) = found.still
    used = f"used: {parts_text(record, record.segments)}"  # the one that the screen has, after what stood still before
    assert said[-1].endswith(used)
    assert found.identification.notes[-1].endswith(used)
    assert all(stop <= 6000 or start >= 6400 for start, stop in record.segments)


def test_noise_that_is_larger_for_a_third_of_a_log_is_not_the_noise_of_the_sensor():
    """Three times as large in the last third: N of all samples is 1.9 times that of the quieter state."""
    rng = np.random.default_rng(6)
    y = 1e-3 * rng.standard_normal(30_000) * np.where(np.arange(30_000) < 20_000, 1.0, 3.0)
    record = Record("gyro", 0.01 * np.arange(30_000), y[:, None], ("gyro_x",), "rad/s", 0.01)
    inputs = TuneInputs("unit", (record,), None, None, None)
    found = identify_and_diagnose(inputs, terms=None, latitude=None, replicas=0, seed=0, progress=silent)
    assert [one.cause for one in found.diagnosis.findings] == ["burst"]
    white = found.identification.channels["gyro_x"].term("white").coefficients["density"].value
    assert white == pytest.approx(1e-4, rel=0.02)  # 4 sds of 20 000 samples
    config = synthesize(found.identification)
    (told,) = settled_inflations(found.diagnosis, config, found.still)
    assert told.factor == pytest.approx(3.0, rel=0.05)


def test_noise_that_is_larger_most_of_the_time_is_the_noise_of_the_sensor():
    """A phone's gyro was left 20 s of six hours beside a burst over 100 % of the time."""
    records, _ = identified()
    span = records[0].span
    for duration, left in ((0.4 * span, 1), (0.6 * span, 0)):
        burst = finding("burst", start=0.0, duration=duration, variance_ratio=9.0)
        assert len(noisier_stretches(Diagnosis((burst,)), records[0])) == left


def test_a_log_that_moved_nearly_all_the_time_keeps_its_noise():
    """Pieces of 10 samples at both ends are too few to identify, and none at all is no record."""
    records, _ = simulate({"gyro_x": MODEL}, duration=20.0, rate=100.0, seed=3)
    found = identify(records, terms=("white",))
    for start, duration, said in ((0.1, 19.8, True), (-1.0, 30.0, False)):
        moved = Diagnosis((), left_out=((start, start + duration),))
        still, kept = identified_again(records, found, moved, terms=("white",), latitude=None)
        assert still == records
        assert kept.channels is found.channels
        assert any("motion" in note for note in kept.notes) == said


def test_settings_are_those_of_samples_that_wrapped_put_back():
    """A register whose end is one sd from the mean, 16 % beyond it: N is that of the samples before."""
    rng = np.random.default_rng(31)
    y = 1e-3 * (-8.0 + np.mod(rng.standard_normal(6_000) + 8.0, 9.0))
    record = Record("gyro", 0.01 * np.arange(6_000), y[:, None], ("gyro_x",), "rad/s", 0.01)
    inputs = TuneInputs("unit", (record,), None, None, None)
    found = identify_and_diagnose(inputs, terms=None, latitude=None, replicas=0, seed=0, progress=silent)
    assert [one.cause for one in found.diagnosis.findings] == ["overflow"]
    white = found.identification.channels["gyro_x"].term("white").coefficients["density"].value
    assert white == pytest.approx(1e-4, rel=0.04)  # 4 sds; 2.8e-4 with the wrapped samples
    assert not any("overflow" in note for note in found.identification.notes)
    assert np.sum(found.still[0].y > 1e-3) > 900


def test_an_axis_that_is_frozen_for_long_has_the_noise_of_the_time_while_it_measured():
    """Zeros at both ends of y, 3 sds from its level: N of all samples is 0.7 times as large, and a bias moves."""
    y = 1e-3 * (3.0 + np.random.default_rng(32).standard_normal((12_000, 3)))
    y[:1200, 1] = y[-1200:, 1] = 0.0
    axes = ("gyro_x", "gyro_y", "gyro_z")
    still = at_rest((Record("gyro", 0.01 * np.arange(12_000), y, axes, "rad/s", 0.01),))
    assert still[0].segments == ((1200, 10_800),)
    found = identify(still, terms=("white",))
    for axis in axes:
        white = found.channels[axis].term("white").coefficients["density"].value
        assert white == pytest.approx(1e-4, rel=0.03)  # 4 sds of 9 600 samples
    assert "usable except: gyro y: frozen for 24 s of 120 s" in judge_noise(found, {}).text


def test_a_check_is_announced_only_where_one_is_made():
    records, _ = simulate({"gyro_x": MODEL}, duration=120.0, rate=20.0, seed=3)
    said: list[str] = []
    checked, why = check_or_reason(synthesize(identify(records)), seed=0, progress=said.append)
    assert checked is None
    assert "expected six axes" in why["consistency"]
    assert said == []


def test_a_mean_that_is_shown_is_not_said_to_be_missing():
    """A log of several poses has a mean of each axis, and together these are not as long as gravity."""
    axes = ("accel_x", "accel_y", "accel_z")
    rng = np.random.default_rng(5)
    record = Record(
        "accel", 0.05 * np.arange(4000), 1.0 + 0.01 * rng.standard_normal((4000, 3)), axes, "m/s^2", 0.05
    )
    reasons = synthesize(identify((record,))).initial.reasons
    assert {reasons[axis] for axis in axes} == {
        "the mean is not as long as gravity: ten times the bias instability"
    }
