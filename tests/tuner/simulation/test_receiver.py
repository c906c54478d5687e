"""Errors of simulated receivers: sds by axis, white and correlated, the same law in both simulators.

Chance of a false failure below 1e-4 each: limits are four standard errors of an sd, σ/√(2ν).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from models.earth import ned_between
from models.measurements import perfect_fixes
from models.noise import GaussMarkov
from models.trajectory.catalogue import city
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.consistency.check import check
from tuner.navigation.settings import filter_settings
from tuner.simulation.drive import simulate_drive
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.receiver import draw_fix_errors, reported_sd
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize
from tuner.types import GnssNoise
from tuner.types.records import DataError

DOWN = 2.0
SHORT = GaussMarkov(3.0, 4.0)
"""A process that forgets within some fixes, so that 600 of them tell its sd."""
RECEIVER = GnssNoise((0.2, 0.2, 0.3), (0.05, 0.05, 0.1), 1.0, 5.0, (SHORT,), correlated_down=DOWN)


def standard_error(samples: int, correlation: float) -> float:
    """Relative standard error of the sd of an AR(1) sequence: Σ ρ²ᵏ = (1 + ρ²)/(1 − ρ²) samples count as one."""
    inflated = (1.0 + correlation**2) / (1.0 - correlation**2)
    return math.sqrt(inflated / (2.0 * samples))


def assert_sds_by_axis(position: np.ndarray) -> None:
    """Horizontal sd √(0.2² + 3²), down √(0.3² + (2 · 3)²)."""
    rho = math.exp(-1.0 / SHORT.time_constant)
    north, east, down = np.sqrt(np.mean(position**2, axis=0))
    limit = 4.0 * standard_error(len(position), rho)
    assert north == pytest.approx(math.hypot(0.2, 3.0), rel=limit)
    assert east == pytest.approx(math.hypot(0.2, 3.0), rel=limit)
    assert down == pytest.approx(math.hypot(0.3, DOWN * 3.0), rel=limit)


def test_errors_have_the_sds_of_the_receiver():
    errors = draw_fix_errors(RECEIVER, 40_000, 1.0, np.random.default_rng(1))
    assert_sds_by_axis(errors.position)
    sd = np.sqrt(np.mean(errors.white**2, axis=0))
    np.testing.assert_allclose(sd, reported_sd(RECEIVER, 1)[0], rtol=4.0 * standard_error(40_000, 0.0))
    np.testing.assert_array_equal(errors.velocity, errors.white[:, 3:])


def test_correlated_errors_forget_with_their_time_constant():
    """Lag-one correlation of errors without a white part: exp(−1/T), standard error √((1 − ρ²)/n)."""
    receiver = replace(RECEIVER, position_sd=(0.0, 0.0, 0.0))
    position = draw_fix_errors(receiver, 40_000, 1.0, np.random.default_rng(2)).position
    rho = math.exp(-1.0 / SHORT.time_constant)
    found = np.sum(position[1:] * position[:-1], axis=0) / np.sum(position**2, axis=0)
    np.testing.assert_allclose(found, rho, atol=4.0 * math.sqrt((1.0 - rho**2) / 40_000))


def test_a_receiver_without_velocity_gives_none():
    errors = draw_fix_errors(replace(RECEIVER, velocity_sd=None), 5, 1.0, np.random.default_rng(3))
    assert np.isnan(errors.velocity).all()
    assert np.isfinite(errors.position).all()


def test_simulated_drives_err_down_as_the_receiver_says():
    motion = city(3000.0)
    drive, _ = simulate_drive(load_grade("stim300"), motion, RECEIVER, rate=1.0, seed=4)
    llh, _ = perfect_fixes(motion, drive.gnss.t)
    assert_sds_by_axis(ned_between(drive.gnss.llh, llh))


def configuration(receiver: GnssNoise):
    return synthesize(grade_identification(load_grade("stim300")), gnss=receiver)


def test_innovations_of_each_axis_are_as_large_as_the_filter_predicts():
    """Down errors twice the horizontal ones, most of each innovation: mean zᵢ²/Sᵢᵢ is 1 on every axis."""
    config = configuration(RECEIVER)
    plan = scenario(city(600.0), RECEIVER, 0.1)
    found = simulate(filter_settings(config), sensor_of_config(config), plan, runs=8, seed=5)
    variance = np.diagonal(found.innovation_covariance, axis1=-2, axis2=-1)[:, 60:, :3].astype(float)
    squares = found.innovation[:, 60:, :3] ** 2 / variance
    limit = 4.0 * math.sqrt(2.0 / squares[..., 0].size)
    np.testing.assert_allclose(squares.mean(axis=(0, 1)), 1.0, atol=limit)


def test_check_of_a_receiver_that_errs_more_down_is_honest():
    config = configuration(RECEIVER)
    found = check(config, city(1500.0), runs=8, seed=6).consistency
    assert found.consistent, found.verdicts


def test_a_receiver_without_a_second_fix_is_refused():
    """Such as one identified from a log whose stamps are 10 000 times too large."""
    rare = replace(load_gnss("spp"), interval=1e4)
    with pytest.raises(DataError, match=r"expected two fixes or more in the 3600 s of city"):
        scenario(city(3600.0), rare, 0.01)
