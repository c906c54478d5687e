"""What a filter cannot be configured from, and what is not the sensor's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.noise import GaussMarkov, NoiseModel, White
from tuner import choose, compare, tune
from tuner.catalogue.grades import grade_identification, load_grade
from tuner.exporters import export, withheld
from tuner.formats.noise_yaml import ON_LIMIT
from tuner.identification import identify
from tuner.identification.identify_source import identify_source
from tuner.pipeline import configure, exports_of
from tuner.report.result_set import tune_files
from tuner.report.sensor_answers import choice_answer, comparison_answer, steadiest
from tuner.report.terminal import fitted
from tuner.report.tune_answer import withheld_lines
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.synthesis.sufficient import decisive_limits, lacking_slow_bias, unstated_terms, with_terms_of_sheet
from tuner.tune_result import LogResult, TuneInputs, TuneResult
from tuner.types import BoundUsed, ChannelNoise, Identification, Quantity
from tuner.types.borrowed import borrowed, borrowed_words
from tuner.types.records import DataError

SHEET = """format: tuner-datasheet/1
name: whiteonly
title: Sheet of white noise alone
kind: typical
rate: 100
reference: made by hand
gyro:
  noise_density: {value: 2.8, unit: mdeg/s/√Hz, sided: one}
  turn_on_sd: {value: 0.5, unit: deg/s}
accel:
  noise_density: {value: 70, unit: µg/√Hz, sided: one}
"""


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "whiteonly.yaml"
    path.write_text(SHEET, encoding="utf-8")
    return path


def test_a_sheet_without_a_slow_bias_lacks_it_for_each_sensor(sheet):
    found = lacking_slow_bias(identify_source(sheet))
    assert found.keys() == {"gyro", "accel"}
    # The range is that of named built-in sheets, in the unit and convention of a sheet (Allan minimum).
    assert "usual is 0.50 to 10 deg/h, the Allan minimum, by the built-in sheets" in found["gyro"]
    assert "icm20602" in found["gyro"]
    assert "µg" in found["accel"]


def test_settings_and_the_noise_that_they_are_made_from_agree(sheet):
    for source in (sheet, "rlg", "icm20602", "fog"):
        noise = identify_source(source)
        assert lacking_slow_bias(synthesize(noise)) == lacking_slow_bias(noise)


def test_a_sheet_with_bias_instability_alone_is_written(sheet):
    sheet.write_text(SHEET + "  bias_instability: {value: 40, unit: µg}\n", encoding="utf-8")
    assert lacking_slow_bias(identify_source(sheet)).keys() == {"gyro"}
    noise = identify_source("icm20602")  # B and no K
    assert withheld(synthesize(noise)) is None
    assert export(synthesize(noise), "kalibr")


def test_tune_writes_no_file_from_such_a_sheet_and_says_why(sheet):
    result = tune(sheet)
    assert result.exports == {}
    assert set(result.withheld) == {"noise.yaml", "kalibr.yaml", "kf-gins.yaml"}
    assert all("record 3 h at rest" in why for why in result.withheld.values())
    assert not any(name.endswith(".yaml") for name in tune_files(result))


def test_compare_and_choose_give_such_a_sheet_no_rank(sheet):
    found = compare("icm20602", sheet)
    assert found.drift[0] is not None
    assert found.drift[1] is None
    assert set(found.unranked) == {"whiteonly"}
    assert any(
        "whiteonly has no rank" in text for text in comparison_answer(found).parts if isinstance(text, str)
    )
    assert "rlg" not in {one.name for one in choose().ranking}  # its gyroscopes state white noise alone


NUMBERS = {
    "gyro": {
        "noise_density": "{value: 0.007, unit: deg/s/√Hz}",
        "bias_instability": "{value: 8, unit: deg/h}",
        "random_walk": "{value: 4, unit: deg/h/√h}",
        "turn_on_sd": "{value: 0.5, unit: deg/s}",
    },
    "accel": {
        "noise_density": "{value: 0.06, unit: m/s/√h}",
        "bias_instability": "{value: 40, unit: µg}",
        "random_walk": "{value: 20, unit: ug/√h}",
        "turn_on_sd": "{value: 3, unit: mg}",
    },
}
SLOW = ("bias_instability", "random_walk")


@pytest.fixture
def sheet_of(tmp_path):
    """Return the function that writes a sheet with some entries of each sensor."""

    def write(name, **entries):
        parts = (
            f"{sensor}:\n" + "".join(f"  {one}: {NUMBERS[sensor][one]}\n" for one in chosen)
            for sensor, chosen in entries.items()
        )
        path = tmp_path / f"{name}.yaml"
        head = f"format: tuner-datasheet/1\nname: {name}\nrate: 100\n"
        path.write_text(head + "".join(parts), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("dialect", ["kf-gins", "kalibr", "px4"])
@pytest.mark.parametrize("gyro", [(), SLOW[:1], SLOW[1:], SLOW])
@pytest.mark.parametrize("accel", [(), SLOW[:1], SLOW[1:], SLOW])
def test_of_a_sheet_either_a_slow_term_of_each_sensor_is_known_or_nothing_is_written(
    sheet_of, gyro, accel, dialect
):
    """A sheet with one slow term was written as if the other were zero, without a word."""
    white = ("noise_density", "turn_on_sd")
    config = synthesize(identify_source(sheet_of("partial", gyro=white + gyro, accel=white + accel)))
    unknown = {"bias instability": SLOW[0], "bias random walk": SLOW[1]}
    lost = [words for words, name in unknown.items() if name not in gyro or name not in accel]
    if not (gyro and accel):
        with pytest.raises(DataError, match="neither bias instability nor bias random walk") as refused:
            export(config, dialect)
        assert "\n" not in str(refused.value)
        return
    text = export(config, dialect)
    assert (f"# {' and '.join(lost)} not stated: true errors are at least" in text) == bool(lost)
    assert unstated_terms(config) == tuple(lost)


def test_a_sheet_without_bias_instability_has_no_rank(sheet_of):
    """A sheet from which the bias instability was deleted drifted 15 m in place of 31 m, and was the steadiest."""
    without = ("noise_density", "random_walk", "turn_on_sd")
    short, whole = sheet_of("short", gyro=without, accel=without), sheet_of("whole", **NUMBERS)
    found = compare(short, whole)
    assert found.drift[0].free[60.0] < found.drift[1].free[60.0]
    assert steadiest(found) == 1
    (verdict, *_) = comparison_answer(found).parts
    assert verdict.endswith("m or more (no rank: its bias instability is not stated)")
    assert verdict.index("by: whole") < verdict.index("; short")


def test_a_log_whose_limits_decide_its_drift_has_no_rank(sheet_of):
    """The same noise drifted 41 m of a log of a minute, 14 m of one of ten, and nothing said why."""
    densities = {"gyro": 1e-4, "accel": 2e-3}
    axes = {f"{s}_{a}": NoiseModel((White(d),)) for s, d in densities.items() for a in "xyz"}
    still, _ = simulate(axes, duration=60.0, rate=50.0, seed=2)
    found = compare(identify(still), sheet_of("whole", **NUMBERS))
    assert steadiest(found) == 1
    (verdict, *rest) = comparison_answer(found).parts
    assert verdict.endswith("m (no rank: half of limits is ASSUMED)")
    assert any("not seen, half of the limit is ASSUMED" in str(part) for part in rest)


def test_a_sensor_that_is_not_there_is_named(sheet_of):
    """A sheet of gyroscopes alone was missing from the ranks, and nothing said why."""
    found = compare(sheet_of("gyros", gyro=NUMBERS["gyro"]), "icm20602")
    assert found.drift[0] is None
    assert found.unranked == {"gyros": "accelerometers of three axes are needed, found fewer"}


def test_grades_of_which_a_term_is_unknown_keep_a_limit_at_most():
    """A sheet without a bias random walk kept a limit as if that were zero: 5 of 12 stay within, adis16465 yes."""
    found = choose(60.0, 20.0)
    told = fitted(choice_answer(found))
    assert told[0].startswith("Verdict: at most 5 of 12 built-in sensors")
    assert any(line.split()[:4] == ["adis16465", "≥", "11", "open"] for line in told)
    assert any(line.split()[:4] == ["bmi088", "≥", "29", "no"] for line in told)


def test_a_short_log_states_limits_of_what_it_does_not_show():
    records, _ = simulate({"gyro_x": NoiseModel([White(1e-4)])}, duration=20.0, rate=100.0, seed=1)
    assert unstated_terms(identify(records)) == ()


def test_terms_of_a_built_in_sensor_are_named_by_axis():
    noise = grade_identification(load_grade("icm20602"))
    gyros = Identification(
        noise.source, {a: c for a, c in noise.channels.items() if a.startswith("gyro")}, ()
    )
    config = synthesize(gyros, complete=load_grade("mpu9250"))
    assert borrowed(config) == dict.fromkeys(("accel_x", "accel_y", "accel_z"), "mpu9250")
    (words,) = borrowed_words(config)
    assert words.startswith("noise of accel_x, accel_y, accel_z is ASSUMED from the built-in sensor mpu9250")
    assert f"# {words}" in export(config, "kalibr")
    assert borrowed(synthesize(noise)) == {}


def test_noise_yaml_marks_what_is_not_stated_and_what_is_assumed():
    # Until now a term that a sheet does not state was a "none" behind its 0, like a measured one.
    noise = identify_source("icm20602")  # states B, not K
    text = export(synthesize(noise), "native")
    assert text.count("random_walk_density: 0.0  # rad/s/√s; not stated: left out") == 3
    assert "ASSUMED" not in text
    gyros = Identification(
        noise.source, {a: c for a, c in noise.channels.items() if a.startswith("gyro")}, ()
    )
    text = export(synthesize(gyros, complete=load_grade("mpu9250")), "native")
    lines = [line for line in text.splitlines() if "white_density" in line]
    assert ["ASSUMED from mpu9250, not yours" in line for line in lines] == [False] * 3 + [True] * 3


AXES = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]


@pytest.fixture(scope="module")
def short():
    """A minute of white noise at rest: of everything slow there is a limit alone."""
    records, _ = simulate(dict.fromkeys(AXES, NoiseModel([White(1e-4)])), duration=60.0, rate=20.0, seed=3)
    return records


def test_a_limit_decides_by_what_it_adds_to_the_measured_terms_alone():
    """N²t + K²t³/3 after a minute: K triples the sd where K²·60²/3 = 8 N²; B at its limit hides nothing."""
    walk = np.sqrt(8.0 * 3.0 / 60.0**2)
    channel = ChannelNoise("gyro_x", "rad/s", 1.0, (), 0.5 * walk, 0.0)
    config = synthesize(identify_source("fog"))
    limits = (BoundUsed(Quantity("gyro_x", "random_walk.density"), 0.5, ""),)
    made = replace(config, channels={"gyro_x": channel}, inflations=limits)
    ((_, ratio),) = decisive_limits(made)
    assert ratio == pytest.approx(3.0)
    both = replace(
        made,
        channels={"gyro_x": replace(channel, markov=(GaussMarkov(1.0, 200.0),))},
        inflations=(*limits, BoundUsed(Quantity("gyro_x", "bias_instability.level"), 0.5, "")),
    )
    assert [one.quantity.field for one, _ in decisive_limits(both)] == [
        "random_walk.density",
        "bias_instability.level",
    ]
    assert decisive_limits(both)[0][1] == pytest.approx(3.0)
    small = replace(made, channels={"gyro_x": replace(channel, random_walk_density=0.1 * walk)})
    assert not decisive_limits(small)


def test_half_of_a_limit_that_decides_the_drift_is_in_our_own_file_alone(short):
    """Logs of 20 to 300 s were written for any program with up to 12 × the drift of a minute."""
    config = synthesize(identify(short, arma=None))
    assert ON_LIMIT in export(config, "native")
    with pytest.raises(DataError, match=r"for kalibr: .*not seen.*--datasheet NAME.*; a log of \S+ h"):
        export(config, "kalibr")
    assert withheld(config) is None


def test_a_sheet_supplies_what_a_short_log_does_not_show(short):
    found = identify(short, arma=None)
    config = synthesize(found)
    axes = [one.quantity.owner for one, _ in decisive_limits(config)]
    sheet = grade_identification(load_grade("stim300"))
    lent = with_terms_of_sheet(found, axes, sheet)
    made = synthesize(lent)
    assert not decisive_limits(made)
    assert "gyroscope_random_walk" in export(made, "kalibr")
    assert borrowed_words(made)[0].endswith("ASSUMED from the sheet of stim300, not yours")
    for axis in axes:  # white noise stays that of the log, and nothing is above a limit of the log
        assert made.channels[axis].white_density == config.channels[axis].white_density
        limits = {t.name: c.upper for t in found.channels[axis].terms for c in t.coefficients.values()}
        for term in lent.channels[axis].terms:
            size = next(iter(term.coefficients.values()))
            assert size.value is None or not limits.get(term.name) or size.value <= limits[term.name]
    white = replace(sheet, channels={a: replace(c, terms=c.terms[:1]) for a, c in sheet.channels.items()})
    assert with_terms_of_sheet(found, axes, white).channels == found.channels


def test_a_short_log_says_what_would_do_and_a_sheet_does_it(short):
    noise = LogResult(identify(short, arma=None), None, {}, short)

    def configured(sheet):
        inputs = TuneInputs("short", short, None, None, None)
        how = {"calibration": None, "complete": None, "conservative": False, "horizon": 1000.0, "seed": 0}
        return configure(inputs, noise, sheet=sheet, **how)[0]

    config = configured(None)
    exports, kept = exports_of(config, ["vins"])
    assert list(exports) == ["noise.yaml"]
    assert kept.keys() == {"kalibr.yaml", "kf-gins.yaml", "vins.txt"}
    made = TuneResult(
        "short", short, noise.identification, *[None] * 3, config, None, {}, {}, exports, withheld=kept
    )
    (line,) = withheld_lines(made)
    assert line.startswith(
        "Not written: vins.txt, kalibr.yaml, kf-gins.yaml: `tuner tune LOG --datasheet NAME`"
    )
    assert not exports_of(configured(grade_identification(load_grade("stim300"))), ["vins"])[1]
