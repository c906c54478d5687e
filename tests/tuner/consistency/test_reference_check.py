"""The test of a reference by unit and fixes finds the seconds in which it errs, and none where it is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.earth import llh_displaced
from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.consistency.drive_scores import reference_at
from tuner.consistency.reference_check import contradictions, trusted_reference, with_trusted_reference
from tuner.consistency.score_drive import drive_filter, navigate_drive
from tuner.formats.reference_words import reference_line
from tuner.navigation.drive.run import RECOVERY_TIME, prepare
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config

RECEIVER = replace(load_gnss("rtk"), interval=0.5)
SECONDS, PULLED = 300.0, (180.0, 184.0)
"""Length of the drive, and the time at which its reference jumps and that at which it is back, s."""


@pytest.fixture(scope="module")
def flown():
    """Return a drive of a consumer unit, prepared."""
    drive = driven()
    settings, _ = drive_filter(drive, load_config("mpu9250", gnss=RECEIVER))
    return drive.reference, prepare(drive, settings)[0], settings


def driven():
    """Return a drive of a consumer unit."""
    unit = load_grade("mpu9250")
    return simulate_drive(unit, TRAJECTORIES["city"](SECONDS), RECEIVER, rate=20.0, seed=4)[0]


def pulled(reference):
    """Return a reference that loses 10 m/s at once, as by a false fix, and regains them and its place in 4 s."""
    since = reference.t - PULLED[0]
    inside = (since >= 0.0) & (reference.t < PULLED[1])
    slower = np.where(inside, -10.0 * (1.0 - since / 4.0), 0.0)
    behind = np.where(inside, 20.0 * (since / 4.0 - 1.0), 0.0)
    move = np.stack([behind, 0.0 * behind, 0.0 * behind], axis=-1)
    vel = reference.vel_n + np.stack([slower, 0.0 * slower, 0.0 * slower], axis=-1)
    return replace(reference, llh=llh_displaced(reference.llh, move), vel_n=vel)


@pytest.mark.parametrize("late", [0.0, 1.3, -0.4])
def test_a_right_reference_is_used_whole_whatever_its_clock(flown, late):
    reference, stretches, settings = flown
    shifted = replace(reference, t=reference.t + late)
    assert trusted_reference(shifted, stretches, settings) == (shifted, "")


def test_a_reference_that_is_pulled_aside_is_left_out_around_it(flown):
    """Nothing within the time that a filter needs to recover, all of what is further away."""
    reference, stretches, settings = flown
    wrong = pulled(reference)
    times, size = contradictions(wrong, stretches, settings)
    assert np.all((times > PULLED[0] - 1.0) & (times < PULLED[1] + 1.0))
    assert 5.0 < size < 12.0
    kept, text = trusted_reference(wrong, stretches, settings)
    assert "the reference is wrong" in text
    (line,) = reference_line([text])  # 30 s on either side of a pull of 4 s
    assert 60.0 <= float(line.split(": ")[1].split()[0]) <= 66.0
    t = np.array([PULLED[0] - RECOVERY_TIME - 2.0, PULLED[0] + 1.0, PULLED[1] + RECOVERY_TIME + 2.0])
    np.testing.assert_array_equal(np.isfinite(reference_at(kept, t)[0][:, 0]), [True, False, True])


def test_a_reference_is_wrong_at_one_set_of_times_whatever_filter_is_judged():
    """Seen: 104 s by one run of the filter and 356 s by another; by the settings of an LN-200, here, none."""
    drive = driven()
    wrong = replace(drive, reference=pulled(drive.reference))
    judged = with_trusted_reference(wrong)
    assert "64 s in all" in judged.judged
    assert with_trusted_reference(judged) is judged
    assert with_trusted_reference(drive).judged == ""
    said = []
    for grade in ("mpu9250", "ln200"):
        found = navigate_drive(wrong, load_config(grade, gnss=RECEIVER))
        said.append([note for note in found.notes if "the reference is wrong" in note])
    assert said == [[judged.judged]] * 2


def test_a_unit_that_is_wrong_is_not_the_fault_of_the_reference(flown):
    """A jump of the forces contradicts fixes and reference alike."""
    reference, stretches, settings = flown
    (one,) = stretches
    increments = one.steps.increments.copy()
    at = int(np.searchsorted(one.steps.ends(), 200.0))
    increments[at : at + 10, 3] += 0.5
    broken = replace(one, steps=replace(one.steps, increments=increments))
    assert len(contradictions(reference, (broken,), settings)[0]) == 0


def test_one_of_two_is_no_majority(flown):
    """Fixes without velocities: reference and unit contradict one another, and neither is said to be wrong."""
    reference, stretches, settings = flown
    (one,) = stretches
    bare = replace(one, fixes=replace(one.fixes, vel_n=np.full_like(one.fixes.vel_n, np.nan)))
    assert trusted_reference(pulled(reference), (bare,), settings)[1] == ""
