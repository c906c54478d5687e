"""The error budget: shares add up to the filter's own covariance; what a trajectory shows of the states."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from models.measurements import perfect_fixes
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.cli import run
from tuner.consistency.error_budget import blind_spots, error_budget, table
from tuner.consistency.observability import observability
from tuner.navigation import engine
from tuner.navigation.data import Fixes
from tuner.navigation.settings import filter_settings
from tuner.report.verdict_text import observability_text
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize


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
    sd = np.sqrt(np.einsum("eii->ei", budget.total))
    off = np.abs(budget.covariance.sum(axis=1) - budget.total)
    assert np.all(off < 1e-9 * sd[:, :, None] * sd[:, None, :])
    assert np.all(np.einsum("egii->egi", budget.covariance) > -1e-9 * sd[:, None] ** 2)
    spread = np.sqrt(np.einsum("eii->ei", budget.innovation_total))
    off = np.abs(budget.innovation.sum(axis=1) - budget.innovation_total)
    assert np.all(off < 1e-9 * spread[:, :, None] * spread[:, None, :])
    settings = filter_settings(config)
    llh, vel_n = perfect_fixes(town.motion, town.times)
    fix_sd = np.tile([*config.gnss.position_sd, *config.gnss.velocity_sd], (len(town.times), 1))
    fixes = Fixes(town.times, town.after, llh, vel_n, fix_sd).without(town.outages)
    filtered = engine.run(settings, town.start, town.steps, fixes)
    at = np.searchsorted(town.times, budget.t)
    np.testing.assert_allclose(np.einsum("kii->ki", filtered.covariance[at]), sd**2, rtol=1e-5)


@pytest.mark.parametrize("configured", [True, False])
@pytest.mark.parametrize("measured", [True, False])
def test_budget_uses_the_velocities_that_the_receiver_measures(config, configured, measured):
    """The predicted sds of simulated filters along a town, whatever of receiver and filter has velocities."""
    with_velocity = load_gnss("spp")
    without = replace(with_velocity, velocity_sd=None)
    settings = filter_settings(replace(config, gnss=with_velocity if configured else without))
    plan = scenario(TRAJECTORIES["city"](300.0), with_velocity if measured else without, 0.02)
    budget = error_budget(settings, plan)
    runs = simulate(settings, sensor_of_config(config), plan, runs=4, seed=1)
    rows = np.searchsorted(runs.t, budget.t[budget.aided])
    own = np.diagonal(runs.covariance[:, rows], axis1=-2, axis2=-1).mean(axis=(0, 1), dtype=float)
    linear = np.diagonal(budget.total[budget.aided], axis1=-2, axis2=-1).mean(axis=0)
    np.testing.assert_allclose(np.sqrt(own), np.sqrt(linear), rtol=0.03)


def test_shares_are_shares(budget):
    cases = dict(table(budget))
    assert list(cases) == ["aided", "10 s without fixes", "60 s without fixes", "300 s without fixes"]
    for shares in cases.values():
        np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-9)
    aided, blind = cases["aided"], cases["60 s without fixes"]
    fixes = [budget.sources.index(name) for name in ("position fixes", "correlated fixes")]
    assert aided[fixes, 0].sum() > 0.5
    assert blind[fixes, 0].sum() < 0.05


def test_what_would_not_show_is_what_has_no_share(budget):
    spots = blind_spots(budget)
    shares = np.max([rows.max(axis=1) for _, rows in table(budget)], axis=0)
    small = np.array([spots[name][0] for name in budget.sources])
    assert np.all(np.diff(small[np.argsort(shares)]) <= 1e-12)
    assert spots["gyro bias noise"][0] < 1.2
    assert spots["gyro turn-on bias"][1] == np.inf


def test_trajectory_that_turns_shows_all_states(budget, config):
    seen = observability(filter_settings(config), budget.final)
    left = np.array(list(seen.left.values()))
    assert np.all(left[:9] < 0.6)
    assert np.all(left[9:] < 0.5)
    assert seen.weak == ()


def test_standing_still_leaves_bias_and_tilt_together(config):
    plan = scenario(TRAJECTORIES["static"](200.0), load_gnss("spp"), 0.05)
    settings = filter_settings(config)
    seen = observability(settings, error_budget(settings, plan).final)
    pairs = {frozenset(direction.states) for direction in seen.weak}
    level = {"accelerometer bias x", "accelerometer bias y"}
    tilts = {"tilt about north", "tilt about east"}
    assert any(len(pair & level) >= 1 and len(pair & tilts) >= 1 for pair in pairs)
    assert seen.left["heading"] > 0.9
    assert seen.left["gyro bias x"] < 0.3
    said = " ".join(observability_text(seen))
    assert "cannot be distinguished" in said
    assert "heading" in said


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
    assert set(content["budget"]["unnoticed"]) == set(content["budget"]["sources"])
    assert content["budget"]["sd_ratio_end_to_start"]["heading"] < 1.0
    assert "share of the variance" in capsys.readouterr().out
