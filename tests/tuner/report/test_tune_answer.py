"""The answer of `tune`: verdict first, axes that agree in a row, marks with their legend, findings by their effect."""

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from rich.table import Table

from models.noise import GaussMarkov, NoiseModel, RandomWalk, White
from tuner.catalogue.grades import load_gnss
from tuner.diagnosis.drive.causes.base import ConstantCause
from tuner.diagnosis.drive.causes.registry import DRIVE_CAUSES
from tuner.diagnosis.drive.held_out_choice import HeldOutChoice
from tuner.diagnosis.drive.outage_errors import OutageErrors
from tuner.diagnosis.drive.predictive_score import PredictiveScore
from tuner.exporters import export
from tuner.exporters.header import RATIO
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import digits, in_customary
from tuner.formats.parameter_words import meaning_text
from tuner.formats.reference_words import wrong_times_text
from tuner.identification import identify
from tuner.identification.identify_source import identify_source
from tuner.invariants import violations
from tuner.limits import SCREEN_LINES, SHOWN_FINDINGS
from tuner.report.claims import claims_of
from tuner.report.document import document
from tuner.report.drive_answer import choice_parts, fixes_parts, found_text
from tuner.report.noise_table import (
    LEGEND,
    _read_off,
    entries_tables,
    legend,
    measured_table,
    states_tables,
    why_larger,
)
from tuner.report.terminal import fitted, text_of
from tuner.report.tune_answer import found_lines, settings_in_dialect, tune_answer
from tuner.simulation.static import simulate
from tuner.synthesis import synthesize
from tuner.synthesis.from_drive import load_config
from tuner.tune_result import TuneResult
from tuner.types import BoundUsed, Coefficient, Diagnosis, DriveDiagnosis, Enlargement, Finding, Unexplained
from tuner.types.borrowed import with_borrowed
from tuner.types.clock import Clock, Delay
from tuner.types.compensation import Compensation, Parameter
from tuner.types.consistency import Consistency, Outage, Score
from tuner.types.identification import TermEstimate
from tuner.types.inflation import Quantity
from tuner.types.prediction import (
    BlockSource,
    CurveComparison,
    MeasuredAllan,
    NoiseBlock,
    PredictedBlock,
)
from tuner.types.records import Gnss
from tuner.types.verdict import Severity, Verdict, VerdictCode

AXES = ("gyro_x", "gyro_y", "gyro_z")
ALIKE = NoiseModel([White(1e-4), RandomWalk(1e-6)])
NOISIER = NoiseModel([White(2e-4), RandomWalk(1e-6)])


SCORED = Consistency(
    None, (), (), None,
    (Outage(30.0, 2.0, 1.1, Score("outage 30 s", 3.0 * 1.76**2, 3, 3.0, (1.0, 6.0)), 1, (1.31, 2.67)),),
    {}, 0.0, False, (),
)  # fmt: skip


def made_choice(result):
    square = np.ones(4)
    score = PredictiveScore((OutageErrors(30.0, square, square, square),), 1.0, square, fixes_rms=1.5)
    pairs = {30.0: np.array([[4.0, 1.0], [9.0, 2.0], [4.0, 1.0]])}
    return HeldOutChoice(result.config, "with the findings", {}, score, score, pairs)


def answer_lines(result, directory, dialect=None, width=80):
    return fitted(tune_answer(result, directory, dialect), width)


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
    return TuneResult(
        "unit", records, noise, diagnosis, None, None, config, None, {}, absent, {"noise.yaml": "a text"}
    )


@pytest.mark.parametrize("width", [80, 120])
def test_the_answer_fits_a_terminal_and_leaves_nothing_out(result, width):
    lines = answer_lines(result, Path("out"), width=width)
    assert max(map(len, lines)) <= width
    assert len(lines) <= SCREEN_LINES
    assert "…" not in "".join(lines)
    assert lines[1].startswith("Verdict: usable")
    for said in (
        "gyro white noise, deg/√h",
        "In out: noise.yaml, report.html",
        "All tables: --verbose",
    ):
        assert said in "\n".join(lines)


def test_each_axis_has_its_measured_noise_with_its_interval(result):
    """N = 1e-4 rad/√s is 1e-4 · 60 · 180/π = 0.3438 deg/√h, twice that on y; 30 000 samples know it to 0.8 % (95 %)."""
    table = measured_table(result.identification)
    cells = {label: row for label, *row in zip(*(column.cells for column in table.columns), strict=True)}
    white = [float(cell.split()[0]) for cell in cells["gyro white noise, deg/√h"]]
    assert white == pytest.approx([0.3438, 0.6875, 0.3438], rel=0.03)
    assert all("±" in cell for cell in cells["gyro white noise, deg/√h"])
    assert [str(column.header) for column in table.columns] == ["", "measured x", "measured y", "measured z"]


def test_axes_that_are_alike_in_everything_share_a_column():
    config = synthesize(found := identify_source("mpu9250"))
    tables = measured_table(found), *entries_tables(config, ("kalibr.yaml", "kf-gins.yaml"))
    heads = [[str(column.header) for column in table.columns] for table in tables]
    assert heads[0] == ["", "stated, each axis"]
    assert heads[1] == ["kalibr.yaml, to enter", "one for all axes", "that is"]
    assert heads[2] == ["kf-gins.yaml, to enter", "each axis"]


def test_what_is_entered_is_what_the_files_have():
    """Keys and numbers of both files; beside those of one the customary ones, converted by hand."""
    config = synthesize(identify_source("mpu9250"))
    other = replace(config.channels["gyro_y"], white_density=2.0 * config.channels["gyro_y"].white_density)
    config = replace(config, channels={**config.channels, "gyro_y": other})
    pair, fading = (
        {row[0]: row[1:] for row in zip(*(column.cells for column in table.columns), strict=True)}
        for table in entries_tables(config, ("kalibr.yaml", "kf-gins.yaml"))
    )
    kalibr = yaml.safe_load(export(config, "kalibr"))
    for key, (value, customary) in pair.items():
        assert float(value.split()[0]) == pytest.approx(kalibr[key], rel=0.0005)
        if key == "gyroscope_random_walk":
            assert float(customary.split()[0]) == pytest.approx(np.rad2deg(kalibr[key]) * 216000.0, rel=0.005)
    noise = yaml.safe_load(export(config, "kf-gins"))["imunoise"]
    for name, cells in fading.items():
        key, _, unit = name.partition(", ")
        assert unit in ("deg/√h", "deg/h", "m/s/√h", "mGal", "h")
        written = np.atleast_1d(noise[key])
        assert [float(cell.split(":")[0]) for cell in cells if cell] == pytest.approx(written, rel=0.0005)


@pytest.mark.parametrize("limited", [(), ("gyro_y",), AXES])
def test_what_is_taken_for_a_limit_stands_beside_it(result, limited):
    """`half` stood behind numbers that were half of none on the screen."""
    hidden = Coefficient(None, None, 1e-6, "rad/s^1.5", "too short")
    bounds = [BoundUsed(Quantity(axis, "random_walk.density"), 0.5, "short") for axis in limited]
    config = replace(result.config, inflations=tuple(bounds))
    channels = {
        axis: replace(one, terms=(TermEstimate("random_walk", {"density": hidden}),))
        for axis, one in result.identification.channels.items()
    }
    found = replace(result.identification, channels=channels)
    table = measured_table(found, config)
    cells = [str(next(iter(column.cells))) for column in table.columns[1:]]
    limit, taken = (in_customary(value, "random_walk.density", "rad/s") for value in (1e-6, 0.5e-6))
    shown = {axis: f"< {digits(limit)}" + f" → {digits(taken)}" * (axis in limited) for axis in AXES}
    assert (
        cells == [shown[axis] for axis in AXES][: 3 if len(limited) == 1 else 1]
    )  # axes alike share a column
    assert ("→: in the settings, ASSUMED" in legend(table)) == bool(limited)
    assert "→" not in text_of([measured_table(found)])  # `identify` takes nothing


def test_of_many_findings_the_five_of_most_effect_stand_on_the_screen(result):
    one = result.diagnosis.findings[-1]
    causes = [
        (cause, axis) for cause in ("warmup", "temperature", "telegraph") for axis in ("gyro_x", "accel_y")
    ]
    found = [
        replace(one, cause=cause, channels=(axis,), parameters={}, drift={"60 s": (10.0 + i, 1.0)})
        for i, (cause, axis) in enumerate(causes)
    ]
    found += [replace(one, cause="burst", channels=("gyro_z",), parameters={}, drift={"60 s": (1.02, 1.0)})]
    many = replace(result, diagnosis=replace(result.diagnosis, findings=tuple(found)))
    lines = answer_lines(many, Path("tuner-out/a_log_of_usual_name"))
    text = "\n".join(lines)
    assert len(lines) <= SCREEN_LINES
    text = " ".join(text.split())
    assert text.count("1.0 m without this") == SHOWN_FINDINGS
    assert (
        text.index("15 m in 60 s") < text.index("14 m in 60 s") < text.index("11 m in 60 s")
    )  # by their effect
    assert "10 m in 60 s" not in text
    assert "1 more finding in report.html" in text
    assert "1 finding in report.html changes no setting by 5 % or more" in text
    lost = "motion faster than 0.22 Hz is lost, delay at least 0.7 s: record it unfiltered"
    low = replace(one, cause="lowpass", parameters={}, extension={"in_motion": lost})
    filtered = replace(many, diagnosis=replace(result.diagnosis, findings=(*found, low)))
    text = " ".join(" ".join(answer_lines(filtered, Path("out"))).split())
    assert "otion faster than 0.22 Hz is lost" in text  # what takes motion away comes first


@pytest.mark.parametrize("code", [VerdictCode.CORRELATED_INNOVATIONS, VerdictCode.OPTIMISTIC])
def test_a_wrong_reference_is_said_beneath_the_verdict_of_the_drive(result, code, monkeypatch):
    monkeypatch.setattr("tuner.report.tune_answer.fixes_parts", lambda *_, **__: [])
    numbers = {"ratio": 19.3, "correlation": 0.59, "lag": 10, "band": 0.13}
    verdict = Verdict(code, Severity.INCONSISTENT, "position", numbers)
    found = Consistency(None, (), (), None, (), {}, 0.0, False, (verdict,))
    wrong = wrong_times_text(20, 12.8, [(61.0, 121.0), (167.0, 228.0)], any_left=True)
    measured = SimpleNamespace(consistency=found, notes=("another", wrong), left_out=0.0)
    drive = SimpleNamespace(diagnosis=DriveDiagnosis((), None, None))
    lines = answer_lines(replace(result, measured=measured, drive=drive), Path("out"))
    assert "Reference wrong in 20 s: 121 s not judged by it" in lines
    assert len(lines) <= SCREEN_LINES
    assert max(map(len, lines)) <= 80


def test_one_reason_stands_for_all_numbers_that_are_larger_than_measured(result):
    """White noise alone had a reason; the random walk, 2 to 10 times the measured one, had none."""
    stated = f"# {RATIO}: position 0.91 to 1.00, position 10 s after the last fix 1.12"
    why = why_larger([stated, "noise: 1.0"])
    assert "few numbers stand for all terms, so most are larger" in why
    assert "errs by 0.91 to 1.12 × predicted" in why
    assert why_larger(["noise: 1.0"]) == ""  # nothing stands for another term
    # On a full screen there was no room for the reason.
    one = result.diagnosis.findings[-1]
    found = tuple(replace(one, channels=(axis,), drift={"60 s": (9.0, 1.0)}) for axis in AXES * 3)
    full = replace(
        result,
        diagnosis=replace(result.diagnosis, findings=found),
        exports={"kalibr.yaml": stated, "noise.yaml": ""},
    )
    assert why.replace(" ", "") in "".join(answer_lines(full, Path("out"))).replace(" ", "")
    # `--to kalibr` had no reason, `--to fastlio` that of Kalibr; a filter that has all states needs none.
    files = {
        "kalibr.yaml": f"{stated}\nnoise: 1.0\n",
        "mine.txt": "noise: 1.0\n",
        "fastlio.txt": f"# {RATIO}: position 0.77\nnoise: 1.0\n",
    }
    for dialect, said in (("kalibr", "0.91 to 1.12"), ("mine", ""), ("fastlio", "0.77 to 0.77")):
        lines = "".join(answer_lines(replace(full, exports=files), Path("out"), dialect))
        assert ("To enter: few" in lines) == bool(said)
        assert said.replace(" ", "") in lines.replace(" ", "")


def test_a_filter_named_shows_its_own_keys(result):
    text = (
        "# a comment\nnoise_density: 1e-4  # rad/s/√Hz, N; rms of x 1e-4, y 2e-4, z 1e-4, all samples of it\n"
    )
    lines = answer_lines(replace(result, exports={"mine.txt": text}), Path("out"), "mine")
    at = lines.index("out/mine.txt:")
    assert lines[at + 1] == "noise_density: 1e-4  # rad/s/√Hz, N"
    assert not any("kalibr.yaml" in line for line in lines)


def test_an_event_that_the_settings_leave_out_stands_behind_the_verdict(result):
    text = " ".join("\n".join(answer_lines(result, Path("out"))).split())
    assert (
        "Not in the settings, as it is no noise, but your filter meets it: step in gyro x (time 150.0" in text
    )
    assert text.index("Verdict") < text.index("Not in the settings") < text.index("white noise, deg")
    assert "Line in gyro" not in text  # a line changes no setting: it is in report.html
    assert "1 finding in report.html changes no setting" in text
    findings = result.diagnosis.findings
    several = replace(result, diagnosis=replace(result.diagnosis, findings=(*findings, findings[-1])))
    text = " ".join("\n".join(answer_lines(several, Path("out"))).split())
    assert "without fixes one axis drifts 31 m in 60 s, 12 m without this" in text  # two steps are noise
    assert "Not in the settings" not in text


def test_states_of_a_configuration_stand_with_their_times_and_what_rests_on_a_limit(result):
    (table,) = states_tables(result.config)
    rows = list(zip(*(column.cells for column in table.columns), strict=True))
    assert [row[0] for row in rows] == ["gyro x", "gyro y", "gyro z"]
    for (_, white, states, walk, _), channel in zip(rows, result.config.channels.values(), strict=True):
        assert float(white) == pytest.approx(np.rad2deg(channel.white_density) * 60.0, rel=0.005)
        limits = result.config.on_limit(channel.axis)
        assert walk.endswith("ASSUMED") == ("random_walk_density" in limits)
        assert states.count("ASSUMED") == len(channel.markov) * ("markov" in limits) or " at " in states


def test_signs_are_explained_where_they_stand(result):
    tables = measured_table(result.identification, result.config), *states_tables(result.config)
    cells = [str(cell) for table in tables for column in table.columns[1:] for cell in column.cells]
    for sign, text in LEGEND.items():
        stands = (
            sign in cells if sign == "–" else any(sign in cell for cell in cells)
        )  # as a dash it parts an interval
        assert (text in legend(*tables)) == stands


def test_axes_in_few_words():
    assert axes_text(["gyro_x", "gyro_z", "accel_y"]) == "gyro x z, accel y"
    assert axes_text(["gyro"]) == "gyro"


def test_what_a_drive_keeps_is_said(result):
    note = "the configuration stays as it began: no change predicts the last 40 % of the drive better"
    choice = HeldOutChoice(result.config, "as it began", note=note)
    text = "\n".join(answer_lines(replace(result, choice=choice), Path("out")))
    assert note in " ".join(text.split())


@pytest.mark.parametrize(
    ("cause", "figures", "said"),
    [
        (
            "velocity_lag", {"delay": (0.057, 0.041, 0.073, "s")},
            "Velocities are later than the positions beside them, by 0.057 ± 0.016 s, "
            "as behind a filter of the receiver",
        ),
        (
            "gnss_noise_scale",
            {
                "position_horizontal": (0.069, 0.065, 0.073, "1"),
                "velocity_horizontal": (0.57, 0.54, 0.60, "1"),
                "velocity_vertical": (0.37, 0.34, 0.40, "1"),
            },
            "Fixes do not err as assumed, positions horizontal 0.0690 ± 0.0040 × as much, "
            "velocities 0.37 to 0.57 × as much",
        ),
        (
            "bias_jump",
            {
                "time": (178.5, 175.0, 182.0, "s"),
                "x": (-6.6e-3, -1e-2, -3.3e-3, "m/s^2"),
                "z": (2.7e-3, 1e-3, 4.4e-3, "m/s^2"),
            },
            "A bias jumped, at 178.5 ± 3.5 s, by 275 to 673 µg",
        ),
        (
            "correlated_gnss", {"time_constant": (853.0, 389.0, 2910.0, "s")},
            "Errors of the positions stay from fix to fix, for some 853 (389 … 2910) s",
        ),
        (
            "clock_drift", {"rate": (-3.09e-4, -3.28e-4, -2.9e-4, "1")},
            "The clock of the fixes runs at another rate, their delay shrinks by 0.000309 ± 1.9e-05 s a second",
        ),
        (
            "velocity_scale", {"factor": (-0.02, -0.03, -0.01, "1")},
            "Velocities are not to scale, too small by 0.020 ± 0.010 of them",
        ),
        ("sensor_bias", {"accel_z": (-0.3325, -0.3413, -0.3237, "m/s^2")}, None),
        ("lever_arm", {}, "The antenna is not where the settings have it"),
    ],
)  # fmt: skip
def test_a_finding_of_a_drive_is_one_sentence_with_its_figures(cause, figures, said):
    """It ended in "as large as assumed: true ÷ assumed", in "late by the delay", or said "a bias jumped" alone."""
    known = {name: Coefficient.known(*one) for name, one in figures.items()}
    text = found_text(Finding(cause, ("gnss",), "a statistic", 9.0, 1e-9, known, ""), ranges=True)
    assert text == (said or "A constant bias is far beyond its prior, of accel z -33.91 ± 0.90 mg")


@pytest.mark.parametrize("cause", list(DRIVE_CAUSES.values()), ids=list(DRIVE_CAUSES))
def test_what_a_cause_of_a_drive_means_is_said_without_figures_too(cause):
    text = meaning_text(cause.meaning, {})
    assert text
    assert not re.search("[{}÷]|by the ", text)
    if issubclass(cause, ConstantCause):
        figures = {name: Coefficient.known(0.1, 0.09, 0.11, unit) for name, unit in cause.units.items()}
        each, ranges = (meaning_text(cause.meaning, figures, ranges=one) for one in (False, True))
        assert each.count("±") == len(figures)
        assert re.search(r"\d", ranges)


def test_a_delay_that_the_line_on_stamps_says_is_no_finding_again(result):
    """The screen said "Fixes are stamped 2.027 ± 0.059 s late" and, below, that they "are late by the delay"."""
    late = Finding(
        "time_offset", ("gnss",), "", 9.0, 1e-9, {"delay": Coefficient.known(0.2, 0.1, 0.3, "s")}, "late"
    )
    driven = SimpleNamespace(diagnosis=DriveDiagnosis((late,), result.config, result.config))
    found = replace(result, drive=driven, diagnosis=None)
    assert any("late, by" in line for line in found_lines(found)[0])
    taken_out = Compensation({Parameter("time_offset", "delay"): 0.2})
    config = replace(result.config, compensation=taken_out)
    assert found_lines(replace(found, config=config))[0] == []


def test_noise_that_the_settings_have_is_no_finding_again(result):
    """Read of one error of fixes: 0.14 m (R), 0.64 m (state), 1.3 to 3.1 m and 0.069 × as reported (findings)."""
    stays = Finding(
        "correlated_gnss", ("gnss",), "", 9.0, 1e-9, {"sd": Coefficient.known(2.0, 1.3, 3.1, "m")}, "stays"
    )
    driven = SimpleNamespace(diagnosis=DriveDiagnosis((stays,), result.config, result.config))
    found = replace(
        result, drive=driven, diagnosis=None, choice=replace(made_choice(result), kept="as it began")
    )
    assert any("stay from fix to fix" in line for line in found_lines(found)[0])
    assert found_lines(replace(found, choice=replace(found.choice, kept="with the findings")))[0] == []


def test_noise_in_motion_is_said_once(result):
    """The verdict said "accel × 2.5 (vibration)" and a line below "accelerometer 13 × that at rest"."""
    seen = SimpleNamespace(before_filter=(), mends=False, vibration={"accelerometer": (1.0, 13.0)})
    found = replace(result, examination=seen)
    line = "Noise in motion: accelerometer 13 × that at rest; Q needs what of it adds up"
    assert line in answer_lines(found, Path("out"))
    larger = Enlargement(Quantity("gyro_x", "white_density"), 2.5, "", ("vibration",))
    lines = answer_lines(replace(found, config=replace(result.config, inflations=(larger,))), Path("out"))
    assert "white noise of gyro x × 2.5 (vibration)" in re.sub(r"\s+", " ", " ".join(lines))
    assert not any(one.startswith("Noise in motion") for one in lines)


def test_errors_before_and_after_name_what_they_are_of(result):
    result = replace(
        result, choice=made_choice(result), measured=SimpleNamespace(consistency=SCORED, left_out=0.0)
    )
    text = text_of(choice_parts(result.choice, SCORED.outages))
    heads, with_fixes, unaided = (re.split(r" {2,}", line) for line in text.splitlines())
    assert heads == ["error, rms", "noise.yaml", "÷ pre-drive (95 %)", "÷ predicted (95 %)"]
    assert with_fixes == ["with fixes (last 40 %)", "1.00 m", "1.00", "(fixes alone 1.50 m)"]
    # Squares 4, 9, 4 became 1, 2, 1: roots of 4/17, and Student's interval of their differences 3, 7, 3 with 2 degrees.
    before, after = np.sqrt(17.0 / 3.0), np.sqrt(4.0 / 3.0)
    half = 4.303 * np.sqrt(16.0 / 3.0) / np.sqrt(3.0) / (before + after)
    low, high = (max(1.0 + (after - before + side * half) / before, 0.0) for side in (-1.0, 1.0))
    assert unaided[:2] == ["30 s without fixes", "2.00 m"]
    assert unaided[2] == f"{after / before:.2f} ({low:.2f} to {high:.2f})"
    assert unaided[3] == "1.76 (1.31 to 2.67)"
    alone = replace(
        result.choice.after, fixes_rms=None
    )  # without a reference it was called an error all the same
    distances = replace(result.choice, before=alone, after=alone)
    assert text_of(choice_parts(distances)).startswith("distance to fixes, rms")


def test_the_choice_of_settings_and_the_score_of_the_drive_have_one_number(result, monkeypatch):
    """60 s without fixes were 1.76 in the verdict and 0.93 in the table, 201 m in `tune` and 160 m in `navigate`."""
    chosen = replace(
        result, choice=made_choice(result), measured=SimpleNamespace(consistency=SCORED, left_out=0.0)
    )
    stated = {(one.quantity, one.place): one.value for one in claims_of(chosen).statements}
    assert stated["error, 30 s without fixes", "beside the choice"] == 2.0
    assert stated["÷ predicted, 30 s without fixes", "in the score"] == 1.76
    assert not violations(claims_of(chosen))
    other = [("30 s without fixes", "2.00 m", "", "0.93 (0.62 to 1.84)")]
    monkeypatch.setattr("tuner.report.claims.outage_rows", lambda *_: other)
    assert [text[:2] for text in violations(claims_of(chosen))] == ["8:"]


def test_sds_and_delay_of_the_fixes_stand_in_metres_and_seconds():
    """What a receiver reports and what the filter has stood as a factor alone, the delay in a file."""
    config = load_config("mpu9250", gnss=load_gnss("rtk"))
    scales = {"position_horizontal": 0.1, "position_vertical": 0.5}
    compensation = {f"gnss_noise_scale.{name}": factor for name, factor in scales.items()}
    lasting = replace(config.gnss, correlated=(GaussMarkov(0.6, 30.0),), correlated_down=2.0)
    config = replace(
        config,
        gnss=lasting,
        constants={"correlated_velocity": 0.07},
        compensation=Compensation.parse(
            {**compensation, "time_offset.delay": 0.1, "velocity_lag.delay": -0.05}
        ),
    )
    sds = np.tile([2.0, 2.0, 8.0], (5, 1))
    gnss = Gnss(np.arange(5.0), np.zeros((5, 3)), np.zeros((5, 3)), sds, 0.01 * sds)
    clock = Clock(Delay(0.1, 0.02 / 1.96), Delay(-0.05, 0.01 / 1.96))
    examined = SimpleNamespace(drive=SimpleNamespace(gnss=gnss, clock=clock))
    table, delay = fixes_parts(examined, config, written=True)
    rows, positions, velocities = (list(column.cells) for column in table.columns)
    assert rows[1:] == [
        "R of noise.yaml, with its states",
        "states for GNSS errors, as set: sd; time",
        "R of a filter without states",
    ]
    # No sd of a single fix stands for what lasts: GTSAM with 2.0 m was sure to a tenth of its error.
    assert positions == ["2.0, 8.0", "0.20, 4.0", "0.60, 1.2; 30 s", "by export --to kf-gins"]
    assert velocities == ["0.020, 0.080", "0.020, 0.080", "0.070, 0.070; 100 s", ""]
    assert delay.startswith("Fixes are stamped 0.100 ± 0.020 s late, velocities are 0.050 ± 0.010 s earlier")
    # It was taken out in one file, left in others, and nobody said where.
    assert delay.endswith("the recording still has it, so for another filter move its stamps")
    # The answer gave a single delay, ± 0.02 s, for a clock that drifts by 0.12 s.
    drifting = config.compensation.with_values({Parameter("clock_drift", "rate"): 0.03})
    _, delay = fixes_parts(examined, replace(config, compensation=drifting), written=True)
    assert delay.startswith("Fixes are stamped 0.040 s late at 0 s and 0.16 s late at 4 s, velocities are")
    unknown = SimpleNamespace(gnss=replace(gnss, velocity_sd=np.full((5, 3), np.nan)), clock=Clock())
    (table,) = fixes_parts(
        SimpleNamespace(drive=unknown),
        replace(config, compensation=Compensation()),
        written=True,
        mended=True,
    )
    # Sds five times too small were told to be five times as large in the file.
    assert next(iter(table.columns[0].cells)) == "reported by the receiver, mended"
    assert [str(next(iter(column.cells))).endswith("ASSUMED") for column in table.columns[1:]] == [
        False,
        True,
    ]


@pytest.mark.parametrize(
    "despite", ["", "innovations are 0.30 × predicted: settings that have them err 4.0 m"]
)
def test_settings_whose_innovations_contradict_them_give_the_reason(result, despite):
    square = np.ones(4)
    score = PredictiveScore((OutageErrors(30.0, square, square, square),), 1.0, square)
    choice = HeldOutChoice(result.config, "with the findings", {}, score, score, despite=despite)
    said = [part for part in choice_parts(choice) if isinstance(part, str)]
    assert said == [f"{despite[:1].upper()}{despite[1:]}"] * bool(despite)


def test_settings_of_an_autopilot_stand_with_unit_and_stock_value():
    config = synthesize(identify_source("mpu9250"))
    white = {axis: channel.white_density for axis, channel in config.channels.items()}
    config = replace(config, noise=white, noise_in_motion=white)
    exported = SimpleNamespace(exports={"px4.txt": export(config, "px4")}, withheld={})
    where, *lines = settings_in_dialect(exported, "px4", Path("out"))
    assert where == f"{Path('out') / 'px4.txt'}:"
    assert len(lines) == 6  # four settings, and two that keep their stock value
    assert all(len(line) <= 80 for line in lines)
    (gyro,) = (line for line in lines if "EKF2_GYR_NOISE" in line)
    assert gyro.endswith("# rad/s; N/√dt; stock 0.015")


def test_a_log_with_a_rest_is_not_called_explained(result):
    rest = Unexplained("shape of the spectrum", ("gyro_x",), 1e-9, 40.0, "", {})
    unnamed = replace(result, diagnosis=Diagnosis((), (rest,)))
    assert not any("Nothing was found" in line for line in answer_lines(unnamed, Path()))
    assert any(
        line.startswith("Not explained: shape of the spectrum in gyro x")
        for line in answer_lines(unnamed, Path())
    )


def test_a_finding_longer_than_the_answer_shows_its_beginning():
    words = "many " * 500
    lines = fitted(document(["Found:"], [words, "the next"], ["the end"]))
    assert len(lines) == SCREEN_LINES
    assert lines[1].startswith("many")
    assert lines[-3].endswith("…")
    assert lines[-2:] == ["the end", "1 more remark: --verbose"]


def test_a_command_of_several_lines_is_one_to_a_shell():
    """Pasted, it ended at the end of its first line."""
    words = ("export", "out/noise.yaml", "--drive", f"{'long' * 12}.npz", "-o", f"{'long' * 12}.yaml")
    lines = fitted(document(["said"]).then(*words))[1:]
    assert len(lines) > 1
    command = "\n".join(lines).removeprefix("Next: tuner")
    done = subprocess.run(["sh", "-c", f"printf '%s|'{command}"], capture_output=True, text=True, check=True)
    assert done.stdout == "|".join((*words, ""))


def test_no_line_ends_between_a_number_and_its_unit():
    text = "the settings reproduce the Allan deviation of the log from end to end within 24 % at every time"
    assert fitted(document([text]), 79)[0].endswith("within")


def test_terms_of_another_sensor_are_not_measured(result):
    """B and K of the nearest built-in sensor stood unmarked in the column of what was measured."""
    source = with_borrowed(result.identification.source, AXES, "mpu9250")
    sheet = Coefficient(1e-5, None, None, "rad/s")
    channels = {
        axis: replace(one, terms=(*one.terms[:1], TermEstimate("bias_instability", {"level": sheet})))
        for axis, one in result.identification.channels.items()
    }
    table = measured_table(replace(result.identification, source=source, channels=channels))
    cells = {label: row for label, *row in zip(*(column.cells for column in table.columns), strict=True)}
    assert [cell.split()[1:] for cell in cells["gyro bias instability B, deg/h"]] == [
        ["lent"]
    ]  # alike on all axes


def test_a_screen_without_room_leaves_out_the_tables_that_are_needed_least():
    """An answer on a log and a drive had 38 lines; one with three ramps had none of the noise, in 14."""
    tables = [Table(f"table {k}", box=None) for k in range(3)]
    for table in tables:
        for row in range(12):
            table.add_row(str(row))
    spare = [[(tables[2], "")], [(tables[0], "short 0")], [(tables[1], "")]]
    lines = fitted(document([*tables, "said"], spare=spare))
    assert len(lines) <= SCREEN_LINES
    assert lines[0].strip() == "table 0"
    assert any("table 1" in line for line in lines)
    assert not any("table 2" in line for line in lines)
    lines = fitted(document([*tables, *["said"] * 10], spare=spare))
    assert lines[0] == "short 0"
    assert any("table 1" in line for line in lines)


def test_white_noise_beside_a_fast_state_is_what_the_curve_shows():
    """A phone's filter: 1 deg/√h and a state of 0.5 s, together 3.2 at 10 s; "read off the curve" was told of the 1."""
    n, tau = 2.9e-4, np.geomspace(0.1, 1000.0, 41)
    block = NoiseBlock(n, (GaussMarkov(3.0 * n, 0.5),), 0.0)
    dof = dict.fromkeys(("white", "bias_instability", "random_walk"), 1000.0 / tau)
    curve = MeasuredAllan(0.1, 1e4, tau, block.allan_variance(tau, 0.1), dof)
    found = PredictedBlock(BlockSource.CURVE, block, curve, CurveComparison(tau, np.ones(41)), ())
    value = float(_read_off(found, "rad/s")["white.density"].split()[0])
    true = np.sqrt(n**2 + 2.0 * (3.0 * n) ** 2 * 0.5) * np.degrees(1.0) * 60.0
    assert value == pytest.approx(true, rel=0.1)
