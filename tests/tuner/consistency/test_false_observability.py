"""Information that linearisation invents: circles do not show heading, city drives do. Seeds are fixed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.consistency.check import check
from tuner.consistency.error_budget import error_budget
from tuner.consistency.false_observability import spurious_information
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize
from tuner.types.verdict import VerdictCode

CONFIG = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))


def spurious(motion, config, sensor):
    settings = filter_settings(config)
    plan = scenario(TRAJECTORIES[motion](600.0), load_gnss("spp"), 0.02)
    simulated = simulate(settings, sensor_of_config(sensor), plan, runs=16, seed=3)
    return spurious_information(simulated, error_budget(settings, plan))


def with_channels(**factors):
    return replace(
        CONFIG,
        channels={
            axis: replace(c, **{name: factor * getattr(c, name) for name, factor in factors.items()})
            for axis, c in CONFIG.channels.items()
        },
    )


@pytest.mark.parametrize("noise", [0.3, 1.0, 3.0])
def test_nothing_is_spurious_where_motion_shows_all(noise):
    assert spurious("city", with_channels(white_density=noise), CONFIG) is None


def test_a_heading_that_standing_never_shows_is_reported():
    found = spurious("static", CONFIG, CONFIG)
    assert found.subject == "heading"
    assert found.numbers["filter_sd"] < 0.8 * found.numbers["linear_sd"]


def test_a_smaller_uncertainty_at_the_start_mends_it():
    """Constants a hundredth as large, as after a stand, and a heading of a tenth of a degree."""
    assert spurious("circle", CONFIG, CONFIG) is not None
    known = with_channels(constant_sd=0.01)
    known = replace(known, initial=replace(known.initial, heading=np.radians(0.1)))
    assert spurious("circle", known, known) is None


def test_no_noise_is_blamed_for_it():
    found = check(CONFIG, TRAJECTORIES["static"](900.0), runs=16, seed=3)
    assert not found.consistency.consistent
    assert found.explanations == ()
    assert found.consistency.verdicts[0].code is VerdictCode.SPURIOUS_INFORMATION
