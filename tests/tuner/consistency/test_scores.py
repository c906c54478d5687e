"""Consistency scores of the error-state filter on sensors with and without the configured noise.

Chance of a false failure below 1e-4 where statistics decide.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from models.noise import GaussMarkov
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.cli import run
from tuner.consistency.check import check
from tuner.consistency.scores import evaluate, innovation_scores, score
from tuner.navigation.data import USED, WITHHELD, Fixes
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import sensor_of_config, sensor_of_grade
from tuner.simulation.monte_carlo import Runs, simulate
from tuner.simulation.scenario import outage_windows, scenario
from tuner.synthesis import synthesize
from tuner.synthesis.load_config import load_config


def test_few_groups_do_not_pretend():
    rng = np.random.default_rng(5)
    shared = rng.standard_normal((4, 1)) ** 2 * np.ones((4, 1000))
    assert score("x", list(shared), 1).effective < 40.0
    free = rng.standard_normal((40, 100)) ** 2
    assert score("x", list(free), 1).effective > 1000.0


def test_innovations_of_refused_fixes_do_not_count():
    z, s = np.ones((10, 6)), np.tile(np.eye(6), (10, 1, 1))
    z[3] = 100.0
    use = np.ones((10, 2), dtype=np.int64)
    use[3] = 2
    (nis, position, _) = innovation_scores([z], [s], [use])
    assert nis.mean == pytest.approx(6.0)
    assert position.mean == pytest.approx(3.0)


def configuration(grade="mpu9250", receiver="spp"):
    return synthesize(grade_identification(load_grade(grade)), gnss=load_gnss(receiver))


def scaled(config, *, q=1.0, r=1.0, memory=1.0, rungs=None):
    channels = {
        axis: replace(
            c,
            white_density=c.white_density * np.sqrt(q),
            random_walk_density=c.random_walk_density * np.sqrt(q),
            markov=tuple(GaussMarkov(m.sd * np.sqrt(q), m.time_constant * memory) for m in c.markov[:rungs]),
        )
        for axis, c in config.channels.items()
    }
    receiver = replace(config.gnss, position_sd=tuple(np.sqrt(r) * x for x in config.gnss.position_sd))
    return replace(config, channels=channels, gnss=receiver)


@pytest.fixture(scope="module")
def town():
    return scenario(TRAJECTORIES["city"](1500.0), load_gnss("spp"), 0.02)


def scored(settings_of, town, *, runs=12, seed=11):
    truth = sensor_of_config(configuration())
    return evaluate(simulate(filter_settings(settings_of), truth, town, runs=runs, seed=seed), town.outages)


def test_a_filter_is_consistent_on_its_own_sensor(town):
    found = scored(configuration(), town)
    assert found.consistent, [s for s in found.scores if not s.consistent]
    assert 0.9 < found.nees.ratio < 1.1
    assert [outage.seconds for outage in found.outages] == [10.0, 30.0, 60.0, 300.0]
    assert found.gated < 1e-3


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"q": 0.1}, {"gyro_bias", "accel_bias"}),
        ({"r": 0.3}, {"nis_position"}),
        ({"rungs": 1}, {"gyro_bias", "accel_bias"}),
    ],
    ids=["Q", "R", "ladder"],
)
def test_wrong_filter_is_flagged_where_it_is_wrong(town, changes, names):
    found = scored(scaled(configuration(), **changes), town)
    bad = {s.name for s in found.scores if not s.consistent}
    assert names <= bad
    assert not found.consistent
    if "q" in changes:
        # The innovations of position hardly show it.
        assert "nis_position" not in bad
        assert max(outage.score.ratio for outage in found.outages) > 2.0


def test_runs_do_not_depend_on_threads(town):
    a = simulate(filter_settings(configuration()), sensor_of_config(configuration()), town, runs=3, seed=5)
    b = simulate(filter_settings(configuration()), sensor_of_config(configuration()), town, runs=2, seed=5)
    np.testing.assert_array_equal(a.error[:2], b.error)


def test_truth_of_another_sensor_is_noticed():
    config = configuration("adis16465", "dgnss")
    found = check(config, TRAJECTORIES["city"](600.0), truth=sensor_of_grade(load_grade("mpu9250")), runs=6)
    assert not found.consistency.consistent
    assert found.consistency.nees.ratio > 1.5
    assert found.consistency.verdicts


def test_outage_windows_fit():
    assert outage_windows(1000.0).shape == (0, 2)
    np.testing.assert_allclose(outage_windows(2200.0), [[900.0, 1200.0], [1800.0, 2100.0]])


@pytest.mark.parametrize("interval", [1.0, 1.0 - 1e-9, 1.0 + 1e-9, 1.001, 0.3, 9.7])
def test_no_fix_behind_an_outage_is_scored_as_within_it(interval):
    """A fix of 1200.000001 s was used, and gave "position after 300 s without fixes" 5.53 m below 53.2 m after 60 s."""
    t, windows = interval * np.arange(1, int(2500.0 / interval)), outage_windows(2500.0)
    zeros = np.zeros((len(t), 3))
    withheld = Fixes(t, np.arange(len(t)), zeros, zeros, np.ones((len(t), 6))).without(windows).withheld
    error = np.random.default_rng(1).standard_normal((2, len(t), 15)) + 100.0 * withheld[:, None]
    unit = np.broadcast_to(np.eye(15), (2, len(t), 15, 15))
    use = np.tile(np.where(withheld, WITHHELD, USED)[:, None], (2, 1, 2))
    none = np.zeros((2, len(t), 0))
    found = evaluate(
        Runs(t, error, unit, error[..., :6], unit[..., :6, :6], use, none, none[..., None]), windows
    )
    assert [one.seconds for one in found.outages] == [10.0, 30.0, 60.0, 300.0]
    assert all(one.rms == pytest.approx(100.0 * 3**0.5, rel=0.1) for one in found.outages)


def test_check_from_the_command_line(tmp_path, capsys):
    file = tmp_path / "check.json"
    arguments = ["check", "stim300", "--gnss", "rtk", "--runs", "4", "--duration", "300", "--quiet"]
    assert run([*arguments, "--json", str(file)]) == 0
    content = json.loads(file.read_text(encoding="utf-8"))
    assert content["schema"] == "tuner.consistency/1"
    assert content["nees"]["dof"] == 15
    assert content["consistent"] is True
    assert "\nVerdict: too short to judge" in capsys.readouterr().out  # four runs of five minutes
    assert run([*arguments, "--truth", "mpu9250", "--strict"]) == 1
    capsys.readouterr()
    for bad in (
        ["check", "nothing"],
        ["check", "stim300", "--trajectory", "moon"],
        ["check", "stim300", "--duration", "nan"],
        ["check", "stim300", "--duration", "inf"],
        ["check", "stim300", "--seed", "-1"],
    ):
        assert run(bad) == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("runs", [2, 3, 5, 16, 40])
def test_few_runs_seldom_reject_a_consistent_filter(runs):
    """4000 honest scores whose 60 squares go together in time: 0.07 % each side wanted, at most 0.35 % here."""
    rng = np.random.default_rng(runs)
    slow = rng.standard_normal((4000, runs, 1, 3))
    squares = np.sum((0.9**0.5 * slow + 0.1**0.5 * rng.standard_normal((4000, runs, 60, 3))) ** 2, axis=-1)
    wrong = sum(not score("x", list(one), 3).consistent for one in squares)
    assert wrong <= 14


def test_two_runs_tell_a_filter_that_is_far_off():
    """Squares ten times too large."""
    errors = np.random.default_rng(1).standard_normal((2, 60, 15)) * 10.0**0.5
    assert not score("x", list(np.sum(errors**2, axis=-1)), 15).consistent


def test_frequent_fixes_are_simulated_as_fewer_that_tell_as_much():
    """Four fixes a second of twice the sd are one of the sd: the same runs, with a quarter of the time and memory."""
    config = load_config("mpu9250", default_gnss="rtk")
    assert config.gnss is not None
    twice = {
        name: tuple(2.0 * sd for sd in getattr(config.gnss, name)) for name in ("position_sd", "velocity_sd")
    }
    often = replace(config, gnss=replace(config.gnss, interval=0.25, **twice))
    one, other = (check(c, TRAJECTORIES["city"](300.0), runs=2, seed=1) for c in (config, often))
    assert one.consistency == other.consistency
    assert [note for note in other.notes if note not in one.notes] == [
        "simulated with a fix every 1 s, as accurate as 4 fixes together"
    ]
