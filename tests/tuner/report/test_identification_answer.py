"""The answer of `identify`: axes that agree in a row, its width, customary units of every size."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models.noise import NoiseModel, RandomWalk, White
from models.units import to_si
from tuner.cli import run
from tuner.consistency.choose_grade import GradeChoice, RankedGrade
from tuner.consistency.compare_sensors import compare
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import amount
from tuner.identification import identify
from tuner.identification.identify_channel import CURVE_DISAGREES
from tuner.identification.several_logs import pool
from tuner.identification.static_test_plan import plan_test
from tuner.limits import SCREEN_LINES
from tuner.report.alike_sentences import alike_sentences
from tuner.report.answer_layout import recording_text
from tuner.report.identification_answer import (
    identification_answer,
    pooled_answer,
    terms_too_short,
    warning_lines,
)
from tuner.report.sensor_answers import choice_answer, comparison_answer, plan_answer
from tuner.report.terminal import text_of
from tuner.report.terms_rows import single_row
from tuner.simulation.static import simulate
from tuner.synthesis.load_config import load_config
from tuner.types import Coefficient

AXES = ("gyro_x", "gyro_y", "gyro_z")


@pytest.fixture(scope="module")
def found():
    quiet, loud = (NoiseModel([White(n), RandomWalk(1e-6)]) for n in (1e-4, 2e-4))
    models = dict(zip(AXES, (quiet, loud, quiet), strict=True))
    return [identify(simulate(models, duration=120.0, rate=20.0, seed=s)[0], arma=None) for s in (3, 4)]


def lines(content):
    return text_of(content).splitlines()


def test_rows_that_repeat_a_stamp_are_said_first(found):
    """A driver sent 14 % of its messages twice: a note said so, the screen did not."""
    (sensor,) = found[0].source["sensors"]
    for rows, words in ((390, "390 rows repeat a stamp and are left out"), (20, "")):
        source = {**found[0].source, "sensors": [{**sensor, "repeated_rows": rows}]}
        assert ("repeat a stamp" in recording_text(replace(found[0], source=source))) is bool(words)
        assert words in recording_text(replace(found[0], source=source))


def test_each_axis_has_a_column_and_a_terminal_holds_the_answer(found):
    told = lines(identification_answer("log", found[0]))
    assert max(map(len, told)) <= 80
    assert len(told) <= 10
    (row,) = [line for line in told if line.startswith("gyro white noise, deg/√h")]
    # N = 1e-4 rad/√s is 1e-4 · 60 · 180/π = 0.344 deg/√h; 2400 samples give 1/√(2n) = 1.4 %, 95 % of five sd.
    assert float(row.split()[4]) == pytest.approx(0.34377, rel=0.073)
    assert row.count("±") == 3
    assert "--verbose" in told[-1]


def test_a_range_has_as_many_digits_as_tell_its_ends_apart():
    """0.1716 to 0.1721 read 0.172, without a range."""
    values = tuple(Coefficient(to_si(n, "deg/√h"), None, None, "") for n in (0.17161, 0.17214))
    row = single_row("x", "rad/s", [("white.density", values[0])])
    assert replace(row, coefficients={"white.density": values}).cell("white.density") == "0.1716 to 0.1721"


def test_logs_that_agree_are_said_to(found):
    told = lines(pooled_answer(pool(found), ["a", "b"]))
    assert told[0].startswith("2 logs pooled")
    assert max(map(len, told)) <= 80
    assert "from log to log" in " ".join(told) or "Logs differ" in " ".join(told)


@pytest.mark.parametrize(
    ("coefficient", "text"),
    [
        (Coefficient.known(4.848e-6, 4.4e-6, 5.3e-6, "rad/s"), "1.000 ± 0.093 deg/h"),
        (Coefficient.known(0.0349066, 0.034, 0.0358, "rad/s"), "2.000 ± 0.052 deg/s"),
        (Coefficient(9.80665e-6 * 20.0, None, None, "m/s^2"), "20.00 µg"),
        (Coefficient.bounded(9.80665e-3 * 3.0, "m/s^2", "short"), "below 3.00 mg"),
        (Coefficient.known(9.80665e-3, 9e-3, 1.06e-2, "m/s^2/K"), "1.000 ± 0.082 mg/K"),
        (Coefficient.known(2.9089e-4, 2.8e-4, 3e-4, "rad/s/√Hz"), "1.000 ± 0.034 deg/√h"),
        (Coefficient.known(12.5, 12.4, 12.6, "Hz"), "12.50 ± 0.10 Hz"),
        (Coefficient.known(3.0, 2.0, 4.0, "1"), "3.0 ± 1.0"),
        (Coefficient.known(339.0, 200.0, 663.0, "Hz"), "339 (200 … 663) Hz"),
        (Coefficient.known(5.0, 2.0, float("inf"), "s"), "5.00 (from 2.00) s"),
    ],
)
def test_a_number_is_told_in_a_unit_of_its_size(coefficient, text):
    assert amount(coefficient) == text


def test_the_table_of_a_comparison_and_of_a_choice_fit_a_terminal():
    told = lines(comparison_answer(compare("icm20602", "mpu9250")))
    assert max(map(len, told)) <= 80
    assert any(line.startswith("mpu9250 gyro x y z") for line in told)
    assert any(line.startswith("icm20602") and line.count("≥") == 6 for line in told)
    grade = RankedGrade("icm20602", load_config("icm20602", gnss="rtk"), 4.0)
    told = lines(choice_answer(GradeChoice(60.0, 2.0, "rtk", True, (grade,), grade, 0.5)))
    assert max(map(len, told)) <= 80
    assert "just stays within" in " ".join(told)
    ranking = tuple(replace(grade, name=f"grade{i}", error=0.5 * i) for i in range(1, 9))
    answer = choice_answer(GradeChoice(60.0, 2.0, "rtk", True, ranking, ranking[3], 0.5))
    (every,) = answer.more
    assert every.row_count == len(ranking)
    told = lines(answer)
    assert len(told) <= SCREEN_LINES
    assert "Verdict: at most 4 of 8 built-in sensors stay within 2 m" in " ".join(told)
    assert "The nearest:" in " ".join(" ".join(told).split())
    assert [line.split()[0] for line in told if line.startswith("grade")] == [
        "grade4",
        "grade5",
        "grade6",
    ]


def test_a_plan_names_what_it_leaves_out():
    """Of a log with limits alone it said "every term"."""
    told = " ".join(lines(plan_answer(plan_test("fog", hours=100.0), "gyro bias random walk")))
    assert "Not planned, as only limits are known: gyro bias random walk" in told
    assert "every term whose size is known" in told or "all but" in told


def test_the_part_of_a_log_that_is_used_is_named():
    whole = simulate({"gyro_x": NoiseModel([White(1e-4)])}, duration=120.0, rate=20.0, seed=5)[0][0]
    cut = identify([replace(whole, segments=((200, 1000), (1200, 2400)))], arma=None)
    assert ", 10 to 120 s of its clock in 2 parts" in " ".join(lines(identification_answer("log", cut)))
    assert " to " not in lines(identification_answer("log", identify([whole], arma=None)))[0]


def test_what_a_record_is_too_short_for_has_its_axes():
    """B known on two axes was said to be too short; R, which is measurement noise elsewhere, is the ramp."""
    lacking = Coefficient.bounded(1.0, "", "record too short: 1 hour needed")
    known = Coefficient.known(1.0, 0.9, 1.1, "")
    fields = {"bias_instability": "level", "random_walk": "density", "ramp": "rate"}

    def channel(axis, shown):
        terms = [
            SimpleNamespace(name=n, coefficients={c: known if n in shown else lacking})
            for n, c in fields.items()
        ]
        return SimpleNamespace(axis=axis, terms=terms)

    shown = dict.fromkeys(("accel_x", "accel_y"), ("bias_instability",))
    axes = (*AXES, "accel_x", "accel_y", "accel_z")
    found = SimpleNamespace(channels={axis: channel(axis, shown.get(axis, ())) for axis in axes})
    assert terms_too_short(found) == ("bias instability B (gyro, accel z), bias random walk, bias ramp")


def test_warnings_of_several_axes_are_one_with_their_ranges(found):
    channels = {
        axis: replace(
            one, warnings=(f"clusters shorter than 0.0{i} s follow no sum (a filter): longer ones",)
        )
        for i, (axis, one) in enumerate(found[0].channels.items(), 1)
    }
    warned = replace(found[0], channels=channels)
    said = f"Warning: {axes_text(list(channels))}: clusters shorter than 0.01 to 0.0{len(channels)} s follow no sum"
    assert warning_lines(warned) == [f"{said} (a filter): longer ones"]
    assert len(lines(identification_answer("log", warned))) <= SCREEN_LINES


def test_a_warning_that_the_table_has_settled_is_none(found):
    first = next(iter(found[0].channels))
    said = f"{CURVE_DISAGREES} (χ² = 90 on 9)"
    channels = {axis: replace(one, warnings=(said, "short log")) for axis, one in found[0].channels.items()}
    warned = replace(found[0], channels=channels)
    left = axes_text([axis for axis in channels if axis != first])
    assert set(warning_lines(warned, predicted=(first,))) == {
        f"Warning: {left}: {said}",
        f"Warning: {axes_text(list(channels))}: short log",
    }


def test_sentences_about_other_things_stay_apart():
    pairs = [
        ("χ² = 11.6 on 1, p = 0.0007", "gyro_x"),
        ("χ² = 20.8 on 1, p = 5e-06", "gyro_y"),
        ("the mean moved by −3 deg/h", "gyro_y"),
        ("the mean moved by −12 deg/h", "accel_z"),
        ("the mean moved", "accel_z"),
    ]
    assert alike_sentences(pairs) == [
        "gyro x y: χ² = 11.6 to 20.8 on 1, p = 5e-06 to 0.0007",
        "gyro y, accel z: the mean moved by −12 to −3 deg/h",
        "accel z: the mean moved",
    ]


def test_ranges_have_no_intervals():
    """Merged ends, "18.17 to 35.0 ± 0.47 to 5.4 Hz", are no interval of anything."""
    pairs = [
        ("cutoff 18.17 ± 0.47 Hz, quality 2.0 ± 0.1", "gyro_x"),
        ("cutoff 35.0 (22 … 37) Hz, quality 2.0 ± 0.1", "accel_x"),
    ]
    assert alike_sentences(pairs) == ["gyro x, accel x: cutoff 18.17 to 35.0 Hz, quality 2.0 ± 0.1"]


def test_times_of_an_answer_are_those_of_the_log_and_cut_it_to_the_same_part(tmp_path, capsys):
    """A log whose clock begins at 72477 s, moved for its first 15 s, cut before and after that by its own answer."""
    rng = np.random.default_rng(11)
    t = 72477.0 + np.arange(4000) / 50.0
    y = 1e-3 * rng.standard_normal((4000, 3))
    y[:750] += rng.standard_normal((750, 3))
    path = tmp_path / "moved.npz"
    np.savez(path, t=t, gyro=y)

    def answer(*more):
        words = ["identify", str(path), "--gyro-unit", "rad/s", "--arma", "off", *more]
        assert run(words) == 0
        return capsys.readouterr()

    whole = answer()
    found = re.search(r", (\S+) to (\S+) s of its clock", whole.out)
    begin, end = map(float, found.groups())
    assert 72492.0 <= begin < 72496.0
    assert end == pytest.approx(t[-1] + 0.02, abs=1e-6)
    part = answer("--begin", found[1], "--end", found[2])
    table = whole.out.index("gyro white noise")
    noise = part.out[part.out.index("gyro white noise") :]
    assert noise.replace(f" --begin={float(found[1])} --end={float(found[2])}", "") == whole.out[table:]
    assert "--begin=" in noise, "the command that follows is of the same part"
    assert "only 80 % of the samples are used" in " ".join(
        whole.out.split()
    )  # what is left out stands in the verdict
    # What is found in a part that is cut elsewhere has the same times.
    later = answer("--begin", "72480")
    assert re.search(r", (\S+) to (\S+) s of its clock", later.out).groups() == (found[1], found[2])
    assert f"at rest and alike: {found[1]} to {found[2]} s" in " ".join(later.err.split())
