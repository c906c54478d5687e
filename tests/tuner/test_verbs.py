"""The verbs in Python: the same answers as the commands, frozen, silent, and without files."""

import json
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import FrozenInstanceError, replace
from io import StringIO

import numpy as np
import pytest

import tuner
from models.noise import NoiseModel, White
from models.trajectory.catalogue import TRAJECTORIES
from tuner import pipeline
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.cli import run
from tuner.cli.commands.options import stated_command
from tuner.formats import noise_yaml
from tuner.formats.logs import write_log
from tuner.report.result_set import write_tune_result
from tuner.simulation.drive import simulate_drive
from tuner.simulation.static import simulate
from tuner.types import Diagnosis, DriveDiagnosis
from tuner.types.records import DataError

LINE = "line@gyro_x:frequency=12.5,amplitude=1e-3"


@pytest.fixture(scope="module")
def short_check():
    """The closing check of tune cut to two short runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "CHECK_RUNS", 2)
        patch.setattr(pipeline, "CHECK_DURATION", 120.0)
        yield


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    """Two minutes of a gyro with a line, on file: what a verb does for one axis it does for six."""
    unit = tmp_path_factory.mktemp("log") / "unit.npz"
    arguments = ["simulate", "mpu9250", "--hours", "0.03", "--seed", "3", "--hide", LINE]
    assert run([*arguments, "-o", str(unit), "--quiet"]) == 0
    (gyro,) = (record for record in tuner.read(unit) if record.name == "gyro")
    path = unit.with_name("axis.npz")
    write_log([replace(gyro, y=gyro.y[:, :1], axes=gyro.axes[:1])], path)
    return path


@pytest.fixture(scope="module")
def drive():
    """Three minutes of city driving."""
    grade, motion = load_grade("mpu9250"), TRAJECTORIES["city"](180.0)
    return simulate_drive(grade, motion, load_gnss("spp"), rate=25.0, seed=3)[0]


@pytest.fixture(scope="module")
def steps():
    """What tune said to its callback."""
    return []


@pytest.fixture(scope="module")
def result(axis, short_check, steps, tmp_path_factory):
    """The result of tune, computed in silence, in an empty folder that must stay empty."""
    folder, printed = tmp_path_factory.mktemp("here"), StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed), redirect_stderr(printed):
        patch.chdir(folder)
        found = tuner.tune(axis, gnss="spp", complete="mpu9250", seed=4, progress=steps.append)
    assert list(folder.iterdir()) == []
    assert printed.getvalue() == ""
    return found


def test_every_verb_is_there_and_says_what_it_does():
    assert set(tuner.__all__) <= set(dir(tuner))
    for name in tuner.__all__:
        assert len(getattr(tuner, name).__doc__.splitlines()[0]) > 20
    with pytest.raises(AttributeError, match="'tuner' has no attribute 'drives'"):
        tuner.drives  # noqa: B018


def test_tune_in_python_is_the_command(result, axis, short_check, tmp_path):
    options = ["--gnss", "spp", "--complete", "mpu9250", "--seed", "4", "-o", str(tmp_path / "command")]
    arguments = ["tune", str(axis), *options]
    assert run([*arguments, "--quiet"]) == 0
    assert noise_yaml.load(tmp_path / "command" / "noise.yaml") == result.config
    write_tune_result(result, tmp_path / "python", stated_command(arguments))
    files = {path.name: path.read_bytes() for path in (tmp_path / "command").glob("*.*")}
    assert {path.name for path in (tmp_path / "python").glob("*.*")} == set(files)
    for name in (*result.exports, "result.json"):
        assert (tmp_path / "python" / name).read_bytes() == files[name]


def test_tune_judges_the_settings_of_its_file_digit_for_digit(result, tmp_path):
    path = tmp_path / "noise.yaml"
    path.write_text(result.exports["noise.yaml"], encoding="utf-8")
    assert noise_yaml.load(path) == result.config
    found = tuner.check(path, duration=120.0, runs=2, seed=4)
    assert found.consistency == result.check.consistency


def test_the_result_holds_every_part_and_is_frozen(result):
    assert result.name == "axis"
    assert [finding.cause for finding in result.diagnosis.findings] == ["line"]
    assert result.check is not None
    assert result.drive is None
    assert result.absent == {}
    assert set(result.exports) == {"noise.yaml", "kalibr.yaml", "kf-gins.yaml"}
    with pytest.raises(FrozenInstanceError):
        result.config = None
    with pytest.raises(TypeError):
        result.exports["noise.yaml"] = ""


def test_verbs_print_nothing_and_say_each_step_to_the_callback(result, steps, axis, capfd):
    assert any("identifying" in line for line in steps)
    assert any("diagnosing" in line for line in steps)
    tuner.compare(axis, "mpu9250", "stim300")
    assert capfd.readouterr() == ("", "")


def test_a_part_that_cannot_be_run_is_absent_with_its_reason(result, short_check):
    found = tuner.tune(result.identification)
    assert found.check is None
    assert "accel_z missing" in found.absent["consistency"]
    assert tuner.tune("stim300").absent == {"diagnosis": pipeline.NO_SAMPLES}  # with single-point fixes
    assert tuner.tune("stim300", gnss="spp").absent == {"diagnosis": pipeline.NO_SAMPLES}


def test_diagnose_takes_records_or_a_drive(axis, drive):
    assert isinstance(tuner.diagnose(tuner.read(axis)), Diagnosis)
    found = tuner.diagnose(drive, config="mpu9250")
    assert isinstance(found, DriveDiagnosis)
    assert found.noise_scales
    with pytest.raises(DataError, match=r"^diagnose: config: expected with a drive"):
        tuner.diagnose(tuner.read(axis), config="mpu9250")
    with pytest.raises(DataError, match="--holdout"):
        tuner.diagnose(drive, holdout=tuner.read(axis))


def test_check_takes_names_and_answers_as_the_command_does(tmp_path):
    found = tuner.check("mpu9250", "circle", duration=90.0, truth="adis16465", runs=3, seed=2)
    out = tmp_path / "check.json"
    arguments = ["check", "mpu9250", "--trajectory", "circle", "--duration", "90", "--truth", "adis16465"]
    assert run([*arguments, "--runs", "3", "--seed", "2", "--json", str(out), "--quiet"]) == 0
    content = json.loads(out.read_text())
    assert content["nis"]["mean"] == found.consistency.nis[0].mean
    assert content["consistent"] == found.consistency.consistent
    with pytest.raises(DataError, match="trajectory"):
        tuner.check("mpu9250", "nowhere")


def test_navigate_takes_a_drive_and_the_name_of_a_filter(drive):
    found = tuner.navigate(drive, "mpu9250")
    assert found.config.gnss.correlated == ()
    assert any("no receiver is named" in note for note in found.notes)
    named = tuner.navigate(drive, "mpu9250", gnss="spp")
    assert named.config.gnss == load_gnss("spp")


def test_compare_names_its_sources_and_refuses_one_alone(axis):
    noise = tuner.identify(tuner.read(axis), arma=None)
    table = tuner.compare(axis, noise, "mpu9250").noise
    assert table.names == ("axis", "axis", "mpu9250")
    white = next(row for row in table.axes["gyro_x"] if row.name == "white.density")
    assert white.values[0] == white.values[1]
    with pytest.raises(DataError, match="two sources"):
        tuner.compare("mpu9250")


def test_a_simulated_unit_stands_in_where_nothing_is_given(monkeypatch):
    def brief(seed):
        unit = {"gyro_x": NoiseModel((White(1e-4),))}
        return simulate(unit, duration=120.0, rate=100.0, seed=seed, effects=("spikes@gyro_x",))

    monkeypatch.setattr(pipeline, "demo", brief)
    found = tuner.tune(seed=7)
    assert found.name == "simulated-7"
    assert found.key["hidden"][0]["cause"] == "spikes"
    assert found.config.gnss == load_gnss("spp")


def test_identify_takes_a_path_and_only_what_stood_still(tmp_path):
    """Of a log with a motion the verb stated the noise of the motion; a path was taken for a sequence of records."""
    rng = np.random.default_rng(4)
    n, rate = 6000, 50.0
    columns = {f"gyro_{axis}": rng.normal(0.0, 1e-3, n) for axis in "xyz"}
    moved = slice(4000, 4600)
    for column in columns.values():
        column[moved] += 0.5 * np.sin(np.arange(600) / 20.0)
    path = tmp_path / "log.npz"
    np.savez(path, t=np.arange(n) / rate, **columns)
    noise = tuner.identify(path, arma=None, gyro_unit="rad/s", terms=["white"])
    for channel in noise.channels.values():
        # 5400 samples at rest hold N to 1 %.
        assert channel.term("white").coefficients["density"].value == pytest.approx(
            1e-3 / rate**0.5, rel=0.06
        )


def test_identify_plan_and_export_take_the_name_of_a_grade_as_their_commands_do():
    grade = tuner.identify("mpu9250")
    assert tuner.plan("mpu9250", hours=2.0, accuracy=0.1) == tuner.plan(grade, hours=2.0, accuracy=0.1)
    exported = tuner.export("mpu9250", "kalibr")
    assert exported == tuner.export(tuner.synthesize(grade), "kalibr")
    with pytest.raises(DataError, match="or a built-in grade"):
        tuner.export("mpu925", "kalibr")
