"""The error budget: shares that add up to the filter's own covariance, and the right source blamed."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from models.trajectories import TRAJECTORIES
from tuner.budget import attribute, error_budget, table
from tuner.cli import run
from tuner.consistency import evaluate
from tuner.grades import grade_identification, load_gnss, load_grade
from tuner.navigation import engine
from tuner.navigation.inputs import Fixes
from tuner.navigation.sensor import sensor_of_config
from tuner.navigation.settings import filter_settings
from tuner.navigation.simulate import scenario, simulate
from tuner.results import MarkovState
from tuner.synthesis import synthesize
from tuner.verdicts import explained


@pytest.fixture(scope="module")
def config():
    return synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))


@pytest.fixture(scope="module")
def town():
    return scenario(TRAJECTORIES["city"](1300.0), load_gnss("spp"), 0.02)


@pytest.fixture(scope="module")
def budget(config, town):
    return error_budget(filter_settings(config), town)


def test_sources_add_up_to_the_covariance_of_the_filter(budget, config, town):
    np.testing.assert_allclose(budget.variance.sum(axis=1), budget.total, rtol=1e-9)
    assert np.all(budget.variance > -1e-9 * budget.total[:, None])
    settings = filter_settings(config)
    from models.gnss import perfect_fixes

    llh, vel_n = perfect_fixes(town.motion, town.times)
    sd = np.tile([*config.gnss.position_sd, *config.gnss.velocity_sd], (len(town.times), 1))
    fixes = Fixes(town.times, town.after, llh, vel_n, sd).without(town.outages)
    flown = engine.run(settings, town.start, town.steps, fixes)
    np.testing.assert_allclose(np.einsum("kii->ki", flown.covariance), budget.total, rtol=1e-5)


def test_shares_are_shares(budget):
    cases = dict(table(budget))
    assert list(cases) == ["aided", "10 s without fixes", "60 s without fixes", "300 s without fixes"]
    for shares in cases.values():
        np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-9)
    aided, blind = cases["aided"], cases["60 s without fixes"]
    fixes = [budget.sources.index(name) for name in ("position fixes", "correlated fixes")]
    assert aided[fixes, 0].sum() > 0.5
    assert blind[fixes, 0].sum() < 0.05


def test_observed_states_shrink(budget):
    assert np.all(budget.information[:9] < 1.0)
    assert np.all(budget.information[9:] < 0.5)


def scaled(config, sensor, factor):
    channels = {
        axis: replace(c, markov=tuple(MarkovState(factor * m.sd, m.time_constant) for m in c.markov))
        if axis.startswith(sensor)
        else c
        for axis, c in config.channels.items()
    }
    return replace(config, channels=channels)


@pytest.mark.parametrize("factor", [1.0 / 3.0, 3.0])
def test_wrong_gyro_bias_noise_is_named(config, town, factor):
    believed = scaled(config, "gyro", factor)
    settings = filter_settings(believed)
    found = evaluate(simulate(settings, sensor_of_config(config), town, runs=12, seed=4), town.outages)
    assert not found.consistent
    causes = attribute(found, error_budget(settings, town))
    assert causes[0].source == "gyro bias noise"
    assert causes[0].ratio == pytest.approx(1.0 / factor, rel=0.35)
    sentence = explained(found, causes)[0]
    assert sentence.startswith("gyro bias noise (sd) about")
    assert ("too small" if factor < 1.0 else "too large") in sentence


def test_wrong_fixes_are_named(config, town):
    believed = replace(
        config,
        gnss=replace(
            config.gnss,
            position_sd=tuple(0.5 * x for x in config.gnss.position_sd),
            velocity_sd=tuple(0.5 * x for x in config.gnss.velocity_sd),
        ),
    )
    settings = filter_settings(believed)
    found = evaluate(simulate(settings, sensor_of_config(config), town, runs=8, seed=4), town.outages)
    causes = attribute(found, error_budget(settings, town))
    assert causes[0].source == "position and velocity fixes"
    assert causes[0].ratio == pytest.approx(2.0, rel=0.1)


def test_budget_from_the_command_line(tmp_path, capsys):
    file = tmp_path / "check.json"
    arguments = [
        "check",
        "stim300",
        "--gnss",
        "rtk",
        "--runs",
        "3",
        "--duration",
        "300",
        "--budget",
        "--quiet",
    ]
    assert run([*arguments, "--json", str(file)]) == 0
    content = json.loads(file.read_text(encoding="utf-8"))
    shares = content["budget"]["shares"]["aided"]["position"]
    assert len(shares) == len(content["budget"]["sources"])
    assert sum(shares) == pytest.approx(1.0)
    assert "share of the variance" in capsys.readouterr().out
