"""A lever arm that a user states is used as stated by `navigate`, `tune --drive` and `export --drive`."""

from __future__ import annotations

from dataclasses import replace

import pytest
import yaml

import tuner
from tuner import pipeline
from tuner.cli import run
from tuner.exporters.judged_drive import export_drive
from tuner.formats import noise_yaml
from tuner.navigation.compensation import AS_STATED, LEVER_ARM, with_stated_arm
from tuner.readers.drive import read_drive
from tuner.types import Compensation
from tuner.types.records import DataError

STATED = (0.5, -0.3, -1.2)
MOUNTED = {"mounting_rpy_deg": (180.0, 3.0, 100.0)}


@pytest.fixture(scope="module")
def silent(data, saved, tmp_path_factory):
    """The drive of a unit whose mounting is stated and whose lever arm is not."""
    return saved(tmp_path_factory.mktemp("silent") / "silent.npz", data, **MOUNTED)


@pytest.fixture
def corrected(configuration, tmp_path):
    """Settings that a drive without a stated lever arm moved by what it showed of it."""
    path = tmp_path / "noise.yaml"
    moved = Compensation.parse({"lever_arm.x": 0.4, "lever_arm.z": 1.1})
    path.write_text(noise_yaml.dumps(replace(configuration(), compensation=moved)), encoding="utf-8")
    return path


def command(verb, file, folder, *more):
    """Run a command on a drive."""
    words = {
        "navigate": ["navigate", str(file), "--config", "mpu9250"],
        "tune": ["tune", "--drive", str(file), "-o", str(folder / "out")],
        "export": [
            *("export", "mpu9250", "--to", "kf-gins"),
            *("--drive", str(file), "-o", str(folder / "k.yaml")),
        ],
    }
    return run([*words[verb], *more])


@pytest.mark.parametrize("verb", ["navigate", "tune", "export"])
@pytest.mark.parametrize(
    ("arm", "expected"),
    [
        ("1,2", "expected three numbers with commas between"),
        ("1,nan,0", "expected three numbers with commas between"),
        ("1,0,850", "--lever-arm 1,0,850: expected 100 m at most"),
    ],
)
def test_the_same_arms_are_refused_by_all_commands(silent, tmp_path, capsys, verb, arm, expected):
    """`tune` and `export` did not know the option."""
    assert command(verb, silent, tmp_path, "--lever-arm", arm) == 2
    told = capsys.readouterr().err.splitlines()
    assert expected in told[-1]
    assert "--lever-arm" in told[-1]


@pytest.mark.parametrize("verb", ["navigate", "tune", "export"])
def test_an_arm_in_axes_that_nothing_states_is_refused(data, saved, tmp_path, capsys, verb):
    """`navigate` left a stated arm aside and estimated another."""
    file = saved(tmp_path / "unknown.npz", data)
    assert command(verb, file, tmp_path, "--lever-arm", "1,0,0") == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert "--lever-arm 1,0,0: expected a drive that states the axes of the unit" in told
    assert ("--imu-frame" in told) == (verb == "navigate")


@pytest.mark.parametrize(
    "words", [["tune"], ["export", "mpu9250", "--to", "kf-gins"], ["export", "mpu9250", "--to", "kalibr"]]
)
def test_an_arm_without_a_drive_is_refused(capsys, words):
    assert run([*words, "--lever-arm", "1,0,0"]) == 2
    (told,) = capsys.readouterr().err.splitlines()
    assert "lever-arm: expected" in told.replace("_", "-")
    assert "--drive" in told


def test_the_file_for_kf_gins_has_the_arm_as_stated(silent, corrected, tmp_path, capsys):
    """What an earlier drive showed was added to it: 0.9 and -0.1 m where 0.5 and -1.2 m were measured."""
    out = tmp_path / "k.yaml"
    words = ["export", str(corrected), "--to", "kf-gins", "--drive", str(silent), "-o", str(out)]
    assert run([*words, "--lever-arm", "0.5,-0.3,-1.2"]) == 0
    assert tuple(yaml.safe_load(out.read_text(encoding="utf-8"))["antlever"]) == STATED
    assert AS_STATED in capsys.readouterr().err


def test_navigate_uses_the_arm_as_stated(silent, corrected, capsys):
    """It added to the stated arm what an earlier drive showed beside none."""
    words = ["navigate", str(silent), "--config", str(corrected), "--verbose"]
    assert run([*words, "--lever-arm", "0.5,-0.3,-1.2"]) == 0
    assert AS_STATED in " ".join(capsys.readouterr().out.split())


def test_settings_move_no_arm_that_is_stated(configuration):
    config = replace(
        configuration(),
        compensation=Compensation.parse({"lever_arm.y": 0.3, "time_offset.delay": 0.1}),
        constants={LEVER_ARM: 1.0, "gyro_scale": 1e-3},
    )
    assert with_stated_arm(config, None) == (config, ())
    left, _ = with_stated_arm(config, STATED)
    assert left.compensation.as_text() == {"time_offset.delay": 0.1}
    assert left.constants == {"gyro_scale": 1e-3}


def test_tune_filters_the_drive_with_the_arm_as_stated(silent, monkeypatch):
    """An arm of 1.3 m that its user knows was estimated from zero."""
    monkeypatch.setattr(pipeline, "CHECK_RUNS", 2)
    monkeypatch.setattr(pipeline, "CHECK_DURATION", 300.0)
    result = tuner.tune(drive=silent, lever_arm=STATED)
    assert LEVER_ARM not in (*result.config.compensation.causes, *result.config.constants)
    assert result.measured.settings.lever_arm == STATED
    assert LEVER_ARM not in result.measured.estimates


@pytest.mark.parametrize("arm", [(1.0, 2.0), (1.0, float("nan"), 0.0), (1.0, 0.0, 850.0), "1,2,3"])
def test_functions_refuse_what_the_option_refuses(silent, arm):
    with pytest.raises(DataError, match=r"lever.arm"):
        tuner.tune(drive=silent, lever_arm=arm)


def test_the_export_of_a_drive_refuses_what_the_option_refuses(silent):
    with pytest.raises(DataError, match="expected 100 m at most"):
        export_drive(read_drive(silent), "mpu9250", lever_arm=(1.0, 0.0, 850.0))
