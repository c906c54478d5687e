"""Why a simulated filter diverged. Seeds are fixed; verdicts are tested, not numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, grade_names, load_gnss, load_grade
from tuner.consistency.check import check
from tuner.consistency.scores import run_ratios
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import Runs
from tuner.synthesis import synthesize
from tuner.types.verdict import VerdictCode

TOWN = TRAJECTORIES["city"](600.0)


ONE_OF_A_KIND = ("mpu9250", "bmi088", "adis16465", "stim300", "rlg", "fog")
"""Grades from consumer to navigation; the others lie between them."""


def grade(name):
    return synthesize(grade_identification(load_grade(name)), gnss=load_gnss("spp"))


def with_gyro_constants(config, sd):
    channels = {
        axis: replace(c, constant_sd=sd) if axis.startswith("gyro") else c
        for axis, c in config.channels.items()
    }
    return replace(config, channels=channels)


@pytest.mark.parametrize(
    "name",
    [name if name in ONE_OF_A_KIND else pytest.param(name, marks=pytest.mark.slow) for name in grade_names()],
)
def test_every_built_in_grade_gives_a_consistent_filter(name):
    """At a false alarm in a hundred each."""
    found = check(grade(name), TOWN, runs=12, seed=1)
    assert found.consistency.consistent, found.consistency.verdicts


@pytest.mark.parametrize("constant", [5.0, 10.0])
def test_gyros_whose_constants_are_too_large_for_a_linear_start_are_named(constant):
    """Five degrees a second: one run in forty is lost; ten: most are."""
    config = with_gyro_constants(grade("adis16405"), np.radians(constant))
    verdicts = check(config, TOWN, runs=40, seed=0).consistency.verdicts
    assert verdicts[1].code is VerdictCode.START_NOT_LINEAR
    assert verdicts[1].numbers["gyro_bias_sd"] == pytest.approx(3 * (np.radians(constant),))
    assert verdicts[0].code is VerdictCode.RUNS_DIVERGED
    assert verdicts[0].numbers["runs"] == 40


def test_a_truth_far_from_the_configuration_is_named():
    verdicts = check(
        grade("fog"), TOWN, truth=sensor_of_config(grade("mpu9250")), runs=8
    ).consistency.verdicts
    assert verdicts[1].code is VerdictCode.TRUTH_FAR
    ratio = load_grade("mpu9250").gyro.white.value / load_grade("fog").gyro.white.value
    assert verdicts[1].numbers["gyro white noise"] == pytest.approx(ratio)
    assert "position fixes" not in verdicts[1].numbers


def test_errors_smaller_than_configured_are_no_reason_to_diverge():
    config = grade("mpu9250")
    few = {a: replace(c, constant_sd=0.0, markov=()) for a, c in config.channels.items()}
    wrong = replace(
        config, channels={a: replace(c, white_density=9.0 * c.white_density) for a, c in few.items()}
    )
    truth = sensor_of_config(with_gyro_constants(config, np.radians(20.0)))
    verdicts = check(wrong, TOWN, truth=truth, runs=8, seed=1).consistency.verdicts
    assert verdicts[1].numbers["gyro constants"] == np.inf
    assert not any("white noise" in name for name in verdicts[1].numbers)


def test_a_run_is_judged_by_its_own_errors():
    t, rng = np.arange(300.0), np.random.default_rng(1)
    error = rng.standard_normal((3, 300, 15))
    error[1] *= 30.0
    error[2, 200] = np.nan
    covariance = np.broadcast_to(np.eye(15, dtype=np.float32), (3, 300, 15, 15))
    none = np.zeros((3, 300, 6))
    runs = Runs(
        t,
        error,
        covariance,
        none,
        np.zeros((3, 300, 6, 6), dtype=np.float32),
        np.ones((3, 300, 2), dtype=int),
        np.zeros((3, 300, 0)),
        np.zeros((3, 300, 0, 0)),
    )
    ratios = run_ratios(runs, np.empty((0, 2)))
    np.testing.assert_allclose(
        ratios, [1.0, 30.0, np.inf], rtol=0.05
    )  # 900 squares: 2 sds of their root mean
    assert np.count_nonzero(np.isfinite(ratios)) == 2
