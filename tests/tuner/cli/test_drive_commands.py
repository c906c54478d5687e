"""`tuner diagnose DRIVE` and `tuner tune --drive` from end to end."""

import html
import json
import os
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner import pipeline
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run
from tuner.diagnosis.drive import ExaminedDrive
from tuner.diagnosis.drive.config_after_drive import config_after_drive
from tuner.diagnosis.drive.noise_scale_estimates import may_be_one, words
from tuner.formats import noise_yaml
from tuner.formats.logs import write_drive
from tuner.limits import SCREEN_LINES
from tuner.readers.source_kind import is_drive_by_form
from tuner.report.drive_diagnosis_tables import drive_diagnosis_answer, unnamed_noise
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.from_drive import UNKNOWN_UNIT_GRADE, config_of_drive, nearest_grade, stationary_noise
from tuner.types import (
    AppliedNoiseScale,
    Coefficient,
    Compensation,
    DriveDiagnosis,
    Finding,
    Gain,
    NoiseScaleEstimate,
    Quantity,
)

DELAY = 0.15
SETTINGS = ["gyro_white", "accel_white", "gyro_bias", "accel_bias", "position", "velocity"]


def late_drive(rate):
    """Minutes of city with late fixes: the delay shows by tens of standard deviations.

    Of five minutes alone it cannot be told whether biases or velocities look worse by it. The errors of the fixes are
    white, as reported: with errors that stay, which no fix reports, the settings must not be used.
    """
    made, _ = simulate_drive(
        load_grade("mpu9250"),
        TRAJECTORIES["city"](450.0),
        replace(load_gnss("spp"), correlated=()),
        rate=rate,
        seed=3,
        effects=[f"time_offset:delay={DELAY}"],
    )
    return made


@pytest.fixture(scope="module")
def drive():
    return late_drive(25.0)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Its fixes, which tell of the delay, do not depend on the rate of the samples; the time of the tests does."""
    path = tmp_path_factory.mktemp("drive") / "late.npz"
    write_drive(late_drive(12.5), path)
    return path


@pytest.fixture(scope="module")
def found(file):
    answer = file.with_name("found.json")
    where = ["--json", str(answer), "--page", str(file.with_name("found.html")), "--quiet"]
    assert run(["diagnose", str(file), "--config", "mpu9250", *where]) == 0
    return json.loads(answer.read_text())


def test_the_page_of_a_drive_has_a_picture_of_each_cause_and_of_the_noise_settings(file, found):
    page = html.unescape(file.with_name("found.html").read_text())
    causes = {one["cause"]: one["text"] for one in reversed(found["findings"])}
    assert causes
    for text in causes.values():
        assert f'alt="{text}"' in page
    assert "shown by the drive ÷ stated" in page


@pytest.fixture(scope="module")
def tuned(file):
    """Configuration without a static log, the closing check cut to two short flights."""
    patch = pytest.MonkeyPatch()
    patch.setattr(pipeline, "CHECK_RUNS", 2)
    patch.setattr(pipeline, "CHECK_DURATION", 300.0)
    folder = file.with_name("out")
    with redirect_stdout(StringIO()) as told:
        patch.chdir(file.parent)  # a path is never broken: those of this screen are short
        assert run(["tune", "--drive", file.name, "-o", folder.name, "--quiet"]) == 0
    (folder / "told.txt").write_text(told.getvalue(), encoding="utf-8")
    patch.undo()
    return folder


def test_tune_answers_on_a_drive_on_one_screen(tuned):
    told = (tuned / "told.txt").read_text(encoding="utf-8").splitlines()
    assert len(told) <= SCREEN_LINES
    assert told[1].startswith("Verdict: usable")
    assert max(map(len, told)) <= 80
    assert told[-1].lower().endswith("all tables: --verbose")  # behind "N more remarks and", if any are left


def test_the_hidden_delay_is_named(found):
    assert found["schema"] == "tuner.diagnosis/1"
    assert not found["quiet"]
    delay = next(f for f in found["findings"] if f["cause"] == "time_offset")
    assert delay["channels"] == ["gnss"]
    value, (low, high) = (delay["parameters"]["delay"][name] for name in ("value", "interval"))
    assert abs(value - DELAY) < 5.0 / 1.96 * 0.5 * (high - low)
    assert high - low < 0.05
    # 450 fixes at 12 m/s with 1.5 m and, at 1 m/s², 0.05 m/s: 1/√(450 (12²/1.5² + 1/0.05²)) = 2.2 ms; five of them.
    assert found["compensation"]["time_offset.delay"] == pytest.approx(DELAY, abs=0.011)


def test_the_gain_is_that_of_the_part_held_out(found):
    assert found["gain"]["split"] == "60/40"
    assert found["gain"]["nats"] > 0.0


def test_every_setting_has_its_inflation_explained(found):
    asked = {one["quantity"]: one for one in found["demands"]}
    assert list(asked) == SETTINGS
    for one in asked.values():
        assert one["stated"]["value"] > 0.0
        assert one["text"]
        assert one["identifiable"] or not one["causes"]
    assert any("time_offset" in one["causes"] for one in asked.values())
    # Once the delay is known, R is the true one: 300 fixes hold it to some 4 % and 2 %, four of them and more.
    for name in ("position", "velocity"):
        assert 0.8 < asked[name]["factor_with_findings"]["value"] < 1.25


def test_tune_writes_one_configuration_with_reasons(tuned):
    config = noise_yaml.load(tuned / "noise.yaml")
    assert config.compensation.value("time_offset", "delay") == pytest.approx(DELAY, abs=0.03)
    told = [i for i in config.inflations if i.quantity.owner == "gnss" and isinstance(i, AppliedNoiseScale)]
    assert len(told) == 2
    assert all(i.reason for i in told)
    assert noise_yaml.loads(noise_yaml.dumps(config)) == config
    result = json.loads((tuned / "result.json").read_text())
    assert result["schema"] == "tuner.result/1"
    assert [one["quantity"] for one in result["drive"]["demands"]] == SETTINGS
    assert "static diagnosis" in result["absent"]


def test_the_report_shows_the_drive(tuned):
    page = (tuned / "report.html").read_text()
    assert ">The drive</h2>" in page
    assert page.count("data:image/svg") >= 3
    for name in ("drive-innovations", "drive-consistency", "drive-finding-1-time_offset"):
        assert (tuned / f"{name}.svg").stat().st_size > 10_000


def test_tune_and_navigate_say_the_same_of_the_settings_written(tuned, file, capsys):
    here = json.loads((tuned / "result.json").read_text())["navigation"]
    answer = tuned / "navigated.json"
    assert run(["navigate", str(file), "--config", str(tuned / "noise.yaml"), "--json", str(answer)]) == 0
    there = json.loads(answer.read_text())
    assert here["consistent"] == there["consistent"]
    assert here["verdicts"] == there["verdicts"]
    told = capsys.readouterr().out
    assert "Verdict: " in told
    assert len(told.splitlines()) <= SCREEN_LINES
    assert max(map(len, told.splitlines())) <= 80
    stated = " ".join(json.loads(answer.read_text())["notes"])
    assert "stated in the settings, is taken out" in stated
    assert "no further delay of the fixes is taken out, as chance may make it" in stated
    assert "tuner diagnose" not in told


def test_advice_carries_the_options_of_the_run(tmp_path, capsys):
    """Told without --gnss, a diagnosis is of another receiver, and finds nothing."""
    made = late_drive(25.0)
    bare = np.full_like(made.gnss.position_sd, np.nan)
    path = tmp_path / "a drive.npz"
    write_drive(replace(made, gnss=replace(made.gnss, position_sd=bare, velocity_sd=bare)), path)
    own = ["--config", "mpu9250", "--gnss", "rtk"]
    assert run(["navigate", str(path), *own, "--lever-arm", "0,0,0"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert f"'{path}' {' '.join(own)}` looks for causes, without --lever-arm, which it has not" in told
    assert run(["diagnose", str(path), *own]) == 0
    assert "nothing contradicts" not in capsys.readouterr().out


def test_bad_input_is_one_line(tmp_path, file, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    log = tmp_path / "log.npz"
    np.savez(log, gyro=1e-3 * np.random.default_rng(1).standard_normal((400, 3)), t=np.arange(400) / 100.0)
    for arguments, told in (
        (["diagnose", str(empty)], "imu.csv"),
        (["diagnose", str(file), "--holdout", str(file)], "--holdout"),
        (["diagnose", str(file), "--config", "nothing"], "nothing"),
        (["diagnose", str(log), "--config", "mpu9250"], "--config"),
        (["diagnose", str(tmp_path / "absent.npz")], "absent.npz"),
        (["tune", "--drive", str(tmp_path / "absent.npz")], "absent.npz"),
    ):
        assert run([*arguments, "--quiet"]) == 2
        said = capsys.readouterr().err
        assert told in said
        assert said.count("\n") == 1


def test_a_drive_is_distinguished_from_a_log(tmp_path, file):
    np.savez(tmp_path / "log.npz", gyro=np.zeros((3, 3)))
    (tmp_path / "kf.yaml").write_text("imupath: a\ngnsspath: b\n")
    (tmp_path / "noise.yaml").write_text("format: tuner-noise/1\n")
    assert is_drive_by_form(file)
    assert is_drive_by_form(tmp_path)
    assert is_drive_by_form(tmp_path / "kf.yaml")
    assert not is_drive_by_form(tmp_path / "log.npz")
    assert not is_drive_by_form(tmp_path / "noise.yaml")
    assert not is_drive_by_form(Path("mpu9250"))


def test_white_noise_is_read_where_the_vehicle_stands(drive):
    at_rest = stationary_noise(drive)
    grade = load_grade("mpu9250")
    # The city stops at lights: 20 s and more, 2 · 20 / 0.25 / 3 degrees of freedom an axis, 10 % of sd: four of them.
    assert at_rest.seconds > 20.0
    for axis, white in at_rest.white.items():
        triad = grade.gyro if axis.startswith("gyro") else grade.accel
        assert white.value == pytest.approx(triad.white.value, rel=0.4)
    assert nearest_grade({axis: white.value for axis, white in at_rest.white.items()}) == "mpu9250"
    config = config_of_drive(drive, at_rest)
    assert "at rest" in config.notes[0]
    assert config.interval == pytest.approx(1.0 / 25.0)  # of the drive, not of the grade beside it


def test_without_velocities_positions_tell_where_the_vehicle_stands(drive):
    blind = replace(drive, gnss=replace(drive.gnss, vel_n=np.full_like(drive.gnss.vel_n, np.nan)))
    with_velocities, without = stationary_noise(drive), stationary_noise(blind)
    # Stops shorter than the positions have to be apart are not seen.
    assert 0.25 * with_velocities.seconds < without.seconds <= 1.1 * with_velocities.seconds
    for axis, white in with_velocities.white.items():
        assert without.white[axis].value == pytest.approx(white.value, rel=0.4)


def test_a_unit_that_never_stands_is_taken_for_a_noisy_one(drive):
    fast = replace(drive, gnss=replace(drive.gnss, vel_n=drive.gnss.vel_n + 20.0))
    found = stationary_noise(fast)
    assert not found.white
    config = config_of_drive(fast, found)
    assert UNKNOWN_UNIT_GRADE in config.notes[0]
    assert config.interval == pytest.approx(1.0 / 25.0)


def test_noise_scales_are_put_in_words():
    one, three = Coefficient.known(1.0, 0.9, 1.1, "1"), Coefficient.known(3.0, 2.5, 3.6, "1")
    bound = Coefficient.bounded(2.0, "1", "indistinguishable")
    assert may_be_one(one)
    assert may_be_one(bound)
    assert not may_be_one(three)
    estimate = NoiseScaleEstimate("gyro_white", 1e-3, "rad/s/√Hz", three, one, ("time_offset",), True, "")
    assert "once time offset is named" in words(estimate)
    assert "no known cause" in words(replace(estimate, named=three, causes=("unknown",)))
    assert "not identifiable" in words(replace(estimate, identifiable=False, causes=()))
    vibrating = replace(estimate, named=three, causes=("vibration",))
    assert "times as much in motion" in words(vibrating, 3.2)
    assert not unnamed_noise([estimate], [])  # it is as stated beside the findings
    unnamed = replace(estimate, named=three, causes=("unknown",))
    assert unnamed_noise([unnamed], []) == "Noise, true ÷ stated: gyro white × 3 (2.5 … 3.6) (unknown)"
    assert unnamed_noise([vibrating], []).endswith("(vibration)")


def test_noise_that_is_a_finding_is_told_once():
    """A factor stood on the line of the finding, and again on one of the noise."""
    small = Coefficient.known(0.00346, 0.003, 0.004, "1")
    one = NoiseScaleEstimate("position", 5.4, "m", small, small, ("gnss_noise_scale",), True, "")
    found = Finding("gnss_noise_scale", ("gnss",), "a statistic", 9.0, 1e-9, {}, "sds of the fixes")
    assert not unnamed_noise([one], [found])
    assert "R position × 0.00346" in unnamed_noise([one], [])


def test_findings_that_do_harm_are_not_taken_over(tuned):
    config = noise_yaml.load(tuned / "noise.yaml")
    before = replace(config, compensation=Compensation())
    gain = Gain("60/40", -1.0, -2.0, -50.0, user={"nis": (1.0, 9.0)})
    found = DriveDiagnosis((), before, config, gain=gain)
    assert not found.credited
    assert replace(found, gain=replace(gain, nats=5.0)).credited
    grown = {"outage_30s_horizontal_change_interval [m]": (1.0, 2.0)}
    assert not replace(found, gain=replace(gain, nats=5.0, user=grown)).credited
    hurt = config_after_drive(ExaminedDrive(_NoDrive(), None, found), kept=False)
    assert not hurt.compensation
    assert any("harm" in str(line) for line in drive_diagnosis_answer(found).whole)


def test_harm_done_by_the_findings_names_its_trial():
    """The page read "no configuration takes them over", and then "kept: with the findings", of another trial."""
    gain = Gain("60/40", -1.0, -2.0, -50.0, user={"nis": (1.0, 9.0)})
    (harm,) = [
        str(line)
        for line in drive_diagnosis_answer(DriveDiagnosis((), None, None, gain=gain)).whole
        if "harm" in str(line)
    ]
    assert "Trial of the findings alone" in harm
    assert "no configuration" not in harm


@dataclass(frozen=True)
class _NoDrive:
    source: str = "none"
    digest: str = ""


@pytest.mark.slow
@pytest.mark.skipif(
    "TUNER_DATA" not in os.environ, reason="TUNER_DATA does not name a folder with recordings"
)
def test_a_measured_cart_with_the_clock_of_a_pc(tmp_path, capsys):
    """Its stamps are those of a PC: fixes seem late by about a second."""
    path = Path(os.environ["TUNER_DATA"]) / "drives" / "stim300_rtk_20180419_smooth.npz"
    answer = tmp_path / "found.json"
    assert run(["diagnose", str(path), "--json", str(answer), "--quiet"]) == 0
    found = json.loads(answer.read_text())
    delay = next(f for f in found["findings"] if f["cause"] == "time_offset")["parameters"]["delay"]
    assert 0.0 < delay["interval"][0] < delay["interval"][1] < 2.5
    assert {one["quantity"] for one in found["demands"]} == set(SETTINGS)
    told = capsys.readouterr().out.splitlines()
    assert len(told) <= 10
    assert max(map(len, told)) <= 80


def test_an_explained_inflation_survives_the_file(tuned):
    config = noise_yaml.load(tuned / "noise.yaml")
    more = AppliedNoiseScale(
        Quantity("gyro", "white_density"), 2.0, "because", (1.5, 2.5), ("vibration", "unknown")
    )
    whole = replace(config, inflations=(*config.inflations, more))
    assert noise_yaml.loads(noise_yaml.dumps(whole)) == whole
