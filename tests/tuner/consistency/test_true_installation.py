"""A check against another truth names a wrong start, lever arm or delay, and errors of fixes that a filter lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.consistency.check import check
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.load_truth import installation, load_truth
from tuner.synthesis import synthesize
from tuner.types import Compensation

RIGHT = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
TOWN = TRAJECTORIES["city"](600.0)
HEADING = replace(RIGHT, initial=replace(RIGHT.initial, heading=RIGHT.initial.heading / 8.0))
WHITE_FIXES = replace(RIGHT, gnss=replace(RIGHT.gnss, correlated=()))


def placed(**values):
    """The right configuration with another lever arm or delay."""
    texts = {name.replace("__", "."): value for name, value in values.items()}
    return replace(RIGHT, compensation=Compensation.parse(texts))


@pytest.mark.parametrize(
    ("config", "truth", "name", "size", "tolerance"),
    [
        # The sd of a ratio of 16 runs is 1/√32 of it: three of them.
        (HEADING, RIGHT, "initial heading", 8.0, 0.55),
        (RIGHT, placed(lever_arm__x=1.5, lever_arm__y=-2.0), "lever arm", 2.5, 1e-9),
        (RIGHT, placed(time_offset__delay=0.3), "delay of the fixes", 0.3, 1e-9),
        # Ten minutes hold two time constants of 300 s: most of their constant part is in sight.
        (WHITE_FIXES, RIGHT, "missing position fixes (correlated)", 1.0 / 1.5, 0.4),
    ],
)
def test_what_differs_from_the_truth_is_named_first(config, truth, name, size, tolerance):
    found = check(config, TOWN, truth=truth, runs=16, seed=3)
    assert not found.consistency.consistent
    assert found.explanations[0].source == name
    assert found.explanations[0].ratio == pytest.approx(size, rel=tolerance)


def test_the_right_configuration_passes_against_itself_as_truth():
    found = check(RIGHT, TOWN, truth=RIGHT, runs=16, seed=3)
    assert found.consistency.consistent, found.consistency.verdicts
    assert {"initial_tilt", "initial_heading"} <= {one.name for one in found.consistency.blocks}


def test_a_truth_by_name_says_what_an_alignment_with_it_leaves():
    start = load_truth("mpu9250").start_sd
    expected = RIGHT.initial.tilt, RIGHT.initial.tilt, RIGHT.initial.heading
    assert start[6:] == pytest.approx(expected)
    assert np.isnan(start[:6]).all()


def test_an_installation_is_what_the_truth_has_more_than_the_filter_takes_out():
    truth = Compensation.parse({"lever_arm.x": 1.0, "time_offset.delay": 0.1})
    own = Compensation.parse({"lever_arm.x": 0.4, "lever_arm.z": 0.2})
    arm, delay = installation(truth, own)
    assert arm == pytest.approx((0.6, 0.0, -0.2))
    assert delay == pytest.approx(0.1)


def test_a_unit_or_a_grade_says_nothing_of_an_installation():
    """The unit alone is what `tune --drive` checks with: the delay that it had found was called wrong."""
    late = placed(time_offset__delay=0.1, lever_arm__x=1.0)
    for truth in (sensor_of_config(RIGHT), "mpu9250"):
        assert installation(load_truth(truth).compensation, late.compensation) == ((0.0, 0.0, 0.0), 0.0)
