"""The answer of `tune`: its width, rows of axes that agree, marks with their legend, findings by what they change."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from models.noise import GaussMarkov, NoiseModel, RandomWalk, White
from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
from tuner.diagnosis.drive.outage_errors import OutageErrors
from tuner.diagnosis.drive.predictive_score import PredictiveScore
from tuner.exporters import export
from tuner.formats.reference_words import wrong_times_text
from tuner.identification import identify
from tuner.identification.identify_source import identify_source
from tuner.report.answer_layout import BOUNDED, MAX_LINES, filled
from tuner.report.diagnosis_answer import diagnosis_answer
from tuner.report.drive_answer import choice_lines, finding_lines
from tuner.report.settings_rows import Setting, axes_text, settings_rows
from tuner.report.tune_answer import answer_lines, settings_in_dialect, verdict_line
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.tune_result import TuneResult
from tuner.types import Coefficient, Diagnosis, Finding, Unexplained
from tuner.types.consistency import Consistency
from tuner.types.verdict import Explanation, ExplanationKind, Severity, Verdict, VerdictCode

AXES = ("gyro_x", "gyro_y", "gyro_z")
ALIKE = NoiseModel([White(1e-4), RandomWalk(1e-6)])
NOISIER = NoiseModel([White(2e-4), RandomWalk(1e-6)])


@pytest.fixture(scope="module")
def result():
    models = dict(zip(AXES, (ALIKE, NOISIER, ALIKE), strict=True))
    records, _ = simulate(models, duration=600.0, rate=50.0, seed=7)
    noise = identify(records, arma=None)
    step = Finding(
        "step", ("gyro_x",), "a statistic", 9.0, 1e-9, {"time": Coefficient.known(150.0, 149.0, 151.0, "s")},
        "step in gyro_x", drift={"60 s": (31.0, 12.0)},
    )  # fmt: skip
    lines = tuple(replace(step, cause="line", channels=(a,), parameters={}, drift={}) for a in AXES)
    config = synthesize(noise, name="unit")
    absent = {"consistency": "unit: expected GNSS figures, found none; name a receiver (--gnss GRADE)"}
    diagnosis = Diagnosis((*lines, step), base=models, models=models)
    return TuneResult("unit", records, noise, diagnosis, None, None, config, None, {}, absent, {})


def test_axes_whose_intervals_overlap_share_a_row(result):
    rows = settings_rows(result.config)
    # N of 1e-4 and 2e-4 is known to 0.4 % each (1/√(2n), 30 000 samples): the outer axes agree, the middle one cannot.
    assert [row.axes for row in rows] == [("gyro_x", "gyro_z"), ("gyro_y",)]
    for row in rows:
        own = [result.config.channels[axis].white_density for axis in row.axes]
        assert len(row.white.used) == len(own)
        assert row.white.low <= min(row.white.used) <= max(row.white.used) <= row.white.high


def test_the_answer_fits_a_terminal_and_leaves_nothing_out(result):
    lines = answer_lines(result, Path("out"))
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 10
    assert "…" not in "".join(lines)
    assert "ilter not simulated (--gnss GRADE does)" in lines[0]
    for said in ("gyro x z", "gyro y", "deg/√h", "out/report.html"):
        assert said in "\n".join(lines)


def test_six_axes_that_differ_and_many_findings_take_ten_lines(result):
    # One row an axis, two findings and more, bounds and fitted rows: what a real log of six different axes has.
    axes = [f"{sensor}_{letter}" for sensor in ("gyro", "accel") for letter in "xyz"]
    first = result.config.channels["gyro_x"]
    channels = {
        axis: replace(first, axis=axis, unit="rad/s" if axis < "b" else "m/s^2", white_density=1e-4 * 2.0**i,
                      random_walk_density=1e-6 * 2.0**i, identified=())
        for i, axis in enumerate(axes)
    }  # fmt: skip
    one = result.diagnosis.findings[-1]
    found = [
        replace(one, cause=cause, channels=(a,), parameters={}) for cause in ("step", "line") for a in axes
    ]
    found += [replace(one, cause="telegraph", drift={"1000 s": (2557.0, 684.0)}, parameters={})]
    many = replace(result, config=replace(result.config, channels=channels),
                   diagnosis=replace(result.diagnosis, findings=tuple(found)))  # fmt: skip
    noise = result.identification
    warned = {
        axis: replace(
            c, warnings=("clusters shorter than 2 s follow no sum of noise terms (so)", "another warning")
        )
        for axis, c in noise.channels.items()
    }
    many = replace(many, identification=replace(noise, channels=warned))
    lines = answer_lines(many, Path("tuner-out/a_log_of_usual_name"))
    assert len(lines) <= 10
    assert "2 warnings" in lines[-1]
    assert max(map(len, lines)) <= 80
    assert all(any(line.startswith(axis.replace("_", " ")) for line in lines) for axis in axes)
    assert "telegraph" in "\n".join(lines).lower()
    assert "more" in lines[-1]
    lost = "motion faster than 0.22 Hz is lost, delay at least 0.7 s: record it unfiltered"
    filters = [
        replace(one, cause="lowpass", channels=(a,), parameters={}, extension={"in_motion": lost})
        for a in axes
    ]
    filtered = replace(many, diagnosis=replace(result.diagnosis, findings=(*found, *filters)))
    lines = answer_lines(filtered, Path("tuner-out/a_log_of_usual_name"))
    assert len(lines) <= 10
    assert "Motion faster than 0.22 Hz is lost" in "\n".join(lines)


@pytest.mark.parametrize("code", [VerdictCode.CORRELATED_INNOVATIONS, VerdictCode.OPTIMISTIC])
def test_a_wrong_reference_is_said_beneath_the_verdict_of_the_drive(result, code):
    numbers = {"ratio": 19.3, "correlation": 0.59, "lag": 10, "band": 0.13}
    verdict = Verdict(code, Severity.INCONSISTENT, "position", numbers)
    found = Consistency(None, (), (), None, (), {}, 0.0, False, (verdict,))
    wrong = wrong_times_text(20, 12.8, [(61.0, 121.0), (167.0, 228.0)], any_left=True)
    measured = SimpleNamespace(consistency=found, notes=("another", wrong))
    drive = SimpleNamespace(diagnosis=SimpleNamespace(findings=(), unexplained=()))
    lines = answer_lines(replace(result, measured=measured, drive=drive), Path("out"))
    assert lines[1] == "Reference wrong in 20 s: 121 s not judged by it"
    assert len(lines) <= 10
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(("time", "said"), [(3.0, True), (300.0, False)])
def test_white_noise_that_a_fast_state_carries_is_said(result, time, said):
    """N² + 2σ²T is the white noise of a filter without the state: 9 N² here, 3 times N."""
    channels = {
        axis: replace(one, markov=(GaussMarkov(2.0 * one.white_density / np.sqrt(time), time),))
        for axis, one in result.config.channels.items()
    }
    fast = replace(result, config=replace(result.config, channels=channels))
    lines = answer_lines(fast, Path("out"))
    assert ("N counts with the 3 s state; for N and K alone: --to DIALECT" in lines) == said
    assert "N counts" in "\n".join(lines) or not said
    assert not any("N counts" in line for line in answer_lines(result, Path("out")))


def test_a_filter_named_shows_its_own_keys(result):
    text = (
        "# a comment\nnoise_density: 1e-4  # rad/s/√Hz, N; rms of x 1e-4, y 2e-4, z 1e-4, all samples of it\n"
    )
    lines = answer_lines(replace(result, exports={"mine.txt": text}), Path("out"), "mine")
    at = lines.index("out/mine.txt:")
    assert lines[at + 1] == "noise_density: 1e-4  # rad/s/√Hz, N"
    assert not any("deg/√h" in line for line in lines)


def test_the_finding_that_moves_the_position_most_stands_first(result):
    text = " ".join("\n".join(answer_lines(result, Path("out"))).split())
    assert "drift after 60 s 31 → 12 m without it" in text
    assert text.index("Step in gyro x") < text.index("Line in gyro x y z")


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        (Setting((20.0,), 18.0, 22.0), "20.0 ± 2.0"),
        (Setting((20.0,)), "20.0"),
        (Setting((20.0, 30.0)), "20.0 to 30.0"),
        (Setting((32.5,), 0.0, 65.0, bounded=True), "32.5*"),
    ],
)
def test_a_setting_shows_its_interval_or_that_it_has_none(setting, text):
    assert setting.text == text


def test_a_star_is_explained_where_it_stands(result):
    text = "\n".join(answer_lines(result, Path("out")))
    assert ("*" in text.replace(BOUNDED, "")) == (BOUNDED in text)


def test_a_verdict_names_one_explanation_and_counts_the_others(result):
    missing = Explanation(ExplanationKind.MISSING_FASTER, "gyro bias noise", 1.0, (0.7, 1.2), 3.0, 3.0)
    verdict = Verdict(VerdictCode.EXPLAINED, Severity.EXPLANATION, explanations=(missing,) * 4)
    check = SimpleNamespace(consistency=SimpleNamespace(consistent=False, verdicts=(verdict,)))
    text = verdict_line(replace(result, check=check))
    assert text.count("is missing") == 1
    assert "(3 more on the page explain them as well)" in text


@pytest.mark.parametrize(
    ("longest", "said"), [(0.906, "the 0.167 h up to τ = 0.91 s"), (20.0, "the log on every axis")]
)
def test_a_verdict_says_how_far_a_short_log_was_compared(result, longest, said):
    curve = SimpleNamespace(tau=(0.2, longest))
    short = replace(result, predictions=dict.fromkeys(AXES, SimpleNamespace(passes=True, curve=curve)))
    assert f"Predicts {said}" in verdict_line(short)
    assert ("too short to show" in verdict_line(short)) == (longest < 10.0)


def test_axes_in_few_words():
    assert axes_text(["gyro_x", "gyro_z", "accel_y"]) == "gyro x z, accel y"
    assert axes_text(["gyro"]) == "gyro"


def test_what_a_drive_keeps_is_said(result):
    note = "the configuration stays as it began: no change predicts the last 40 % of the drive better"
    choice = HeldOutChoice(result.config, "as it began", note=note)
    text = "\n".join(answer_lines(replace(result, choice=choice), Path("out")))
    assert note in " ".join(text.split())


@pytest.mark.parametrize(
    "words", ["short", "stamps of positions and velocities are late by the delay, early where it is less"]
)
def test_a_finding_of_a_drive_has_its_size_and_interval(words):
    late = Finding(
        "time_offset", ("gnss",), "a statistic", 9.0, 1e-9, {"delay": Coefficient.known(-0.199, -0.219, -0.178, "s")},
        f"time_offset in gnss: {words} (delay)",
    )  # fmt: skip
    for shortest in (False, True):  # without room it read "late by the delay", and no number
        (line,) = finding_lines([late], None, shortest=shortest)
        assert line.startswith(f"Found: {words.partition(' by ')[0]}")
        assert "-0.199 ± 0.021 s" in line


def test_sds_of_fixes_that_are_wrong_have_their_factor_in_one_line():
    """It read "errors of the fixes are not as large as reported: true ÷ reported", and no number."""
    factors = {
        f"{name}_{way}": Coefficient.known(2.46, 2.20, 2.76, "1")
        for name in ("position", "velocity")
        for way in ("horizontal", "vertical")
    }
    wrong = Finding(
        "gnss_noise_scale", ("gnss",), "a statistic", 9.0, 1e-9, factors,
        "gnss_noise_scale in gnss: errors of the fixes are not as large as reported: true ÷ reported (position 2.46)",
    )  # fmt: skip
    (line,) = finding_lines([wrong], None, shortest=True)
    assert "position horizontal 2.46 ± 0.28" in line
    assert len(line) <= 80


def test_errors_before_and_after_name_the_part_of_the_drive_they_are_of(result):
    square = np.ones(4)
    score = PredictiveScore((OutageErrors(30.0, square, square, square),), 1.0, square)
    choice = HeldOutChoice(
        result.config,
        "with the findings",
        {},
        score,
        score,
        {30.0: np.array([[4.0, 1.0], [9.0, 2.0], [4.0, 1.0]])},
        score.outages,
    )
    for brief in (False, True):
        line, ratios = choice_lines(choice, shorter=brief, shortest=brief)
        assert line.index("last 40 %") < line.index("1.00") < line.index("whole drive") < line.index("30 s")
        # Four windows of a right prediction, one component each: the roots of 4 over quantiles of χ² with 4 degrees.
        assert "0.60 … 2.9" in ratios
    pairs = np.array([[8.67, 4.23]] * 3) ** 2  # two lines made eleven of an answer
    long = replace(choice, outages=dict.fromkeys((10.0, 30.0, 60.0), pairs))
    line = choice_lines(long, shorter=True, shortest=True, intervals_alone=True)[0]
    assert len(line) <= 80
    assert "1.0→1.0; all, unaided 10,30,60 s 8.7→4.2, 8.7→4.2, 8.7→4.2" in line


@pytest.mark.parametrize(
    "despite", ["", "innovations are 0.30 × predicted: settings that have them err 4.0 m"]
)
def test_settings_whose_innovations_contradict_them_give_the_reason(result, despite):
    square = np.ones(4)
    score = PredictiveScore((OutageErrors(30.0, square, square, square),), 1.0, square)
    choice = HeldOutChoice(result.config, "with the findings", {}, score, score, despite=despite)
    for brief in (False, True):
        lines = choice_lines(choice, shorter=brief, shortest=brief)
        assert [line for line in lines if line.startswith("Innovations are 0.30")] == lines[:1] * bool(
            despite
        )


def test_settings_of_an_autopilot_stand_with_unit_and_stock_value():
    config = synthesize(identify_source("mpu9250"))
    white = {axis: channel.white_density for axis, channel in config.channels.items()}
    config = replace(config, noise=white, noise_in_motion=white)
    exported = SimpleNamespace(exports={"px4.txt": export(config, "px4")}, withheld={})
    where, *lines = settings_in_dialect(exported, "px4", Path("out"))
    assert where == f"{Path('out') / 'px4.txt'}:"
    assert len(lines) == 4
    assert all(len(line) <= 80 for line in lines)
    (gyro,) = (line for line in lines if "EKF2_GYR_NOISE" in line)
    assert gyro.endswith("# rad/s; N/√dt; stock 0.015")


def test_settings_of_an_autopilot_keep_the_limit_that_they_rest_on():
    remark = "rad/s²; K/√dt; rests on a 95 % limit: x, y, z; the same on all axes; stock 0.001"
    text = f"# EKF2_GYR_B_NOISE: {remark}\n1\t1\tEKF2_GYR_B_NOISE\t2.39343e-05\t9\n"
    (_, line) = settings_in_dialect(
        SimpleNamespace(exports={"px4.txt": text}, withheld={}), "px4", Path("out")
    )
    assert line == "1 1 EKF2_GYR_B_NOISE 2.39343e-05 9  # rad/s²; rests on a 95 % limit: x, y, z"
    # The longest key of Kalibr has no room for the axes.
    text = "accelerometer_random_walk: 0.000381866  # m/s³/√Hz, K; rests on a 95 % limit: x, y, z; rms of x 0.0001975"
    (_, line) = settings_in_dialect(
        SimpleNamespace(exports={"kalibr.yaml": text}, withheld={}), "kalibr", Path("out")
    )
    assert line == "accelerometer_random_walk: 0.000381866  # m/s³/√Hz, K; rests on a 95 % limit"


def test_a_log_with_a_rest_is_not_called_explained(result):
    rest = Unexplained("shape of the spectrum", ("gyro_x",), 1e-9, 40.0, "", {})
    unnamed = replace(result, diagnosis=Diagnosis((), (rest,)))
    assert not any("Found nothing" in line for line in answer_lines(unnamed, Path()))
    assert any("No cause is named" in line for line in answer_lines(unnamed, Path()))


def test_a_finding_longer_than_the_answer_shows_its_beginning(result):
    idle = replace(result.diagnosis.findings[-1], drift={"60 s": (12.0, 12.0)})
    words = "many " * 200
    answer = filled(["Found:"], [words, "the next"])
    assert len(answer) <= MAX_LINES
    assert answer[1].startswith("many")
    assert answer[-2].endswith("…")
    assert diagnosis_answer(Diagnosis((idle,)))[0].startswith("Nothing found that moves the position")
