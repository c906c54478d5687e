"""Errors of a reference are not counted as errors of the filter: its turns at rest and its velocities show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, steps
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.consistency.drive_scores import against_reference, settled
from tuner.consistency.reference_attitude import standing, without_wrong_attitude
from tuner.consistency.score_drive import drive_filter
from tuner.navigation.drive.run import navigate, prepare
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config

RECEIVER = replace(load_gnss("rtk"), interval=0.5)
DRIFT = np.radians(0.3)
"""Rate at which a heading drifts at rest, rad/s: that of a filter which takes a bias for no turn."""


@pytest.fixture(scope="module")
def flown():
    """Return reference, stretches and solutions of a drive of a consumer unit with two stops of 20 s between turns."""
    speeds = [
        (5.0, 5.0, 10.0),
        (70.0, 5.0, -10.0),
        (100.0, 5.0, 10.0),
        (170.0, 5.0, -10.0),
        (200.0, 5.0, 10.0),
    ]
    turns = [(15.0 + 20.0 * k, 5.0, (-1.0) ** k * np.pi / 2.0) for k in (0, 1, 2, 5, 6, 7, 10)]
    motion = Trajectory("errands", 240.0, Profile(steps=steps(*speeds)), Profile(0.2, steps=steps(*turns)))
    drive = simulate_drive(load_grade("mpu9250"), motion, RECEIVER, rate=20.0, seed=4)[0]
    settings, _ = drive_filter(drive, load_config("mpu9250", gnss=RECEIVER))
    stretches = prepare(drive, settings)[0]
    return drive.reference, stretches, navigate(stretches, settings, np.zeros((0, 2)))


def drifting(reference):
    """Return the turn of a heading that drifts while the vehicle stands, and is found again once it moves."""
    rests, step = np.linalg.norm(reference.vel_n, axis=1) < 0.05, np.gradient(reference.t)
    turn = np.zeros(len(reference.t))
    for k in range(1, len(turn)):
        turn[k] = turn[k - 1] + DRIFT * step[k] * (1.0 + k / len(turn)) if rests[k] else 0.8 * turn[k - 1]
    return turn


def turned(reference, turn):
    """Return a reference with further heading."""
    rpy = reference.rpy + np.stack([0.0 * turn, 0.0 * turn, turn], axis=-1)
    return replace(reference, rpy=rpy)


def test_a_right_reference_keeps_its_attitude(flown):
    reference, stretches, solutions = flown
    assert without_wrong_attitude(reference, stretches, solutions) == (reference, "")


def test_a_heading_that_drifts_at_rest_is_not_held_against_the_filter(flown):
    reference, stretches, solutions = flown
    wrong = turned(reference, drifting(reference))
    rows = [settled(*pair) for pair in zip(stretches, solutions, strict=True)]
    judged, _ = against_reference(wrong, solutions, rows, timed=False)
    assert "attitude" in [one.name for one in judged]
    kept, text = without_wrong_attitude(wrong, stretches, solutions)
    assert "attitude of the reference is wrong" in text
    assert "its heading by" in text
    assert "roll" not in text
    scores, _ = against_reference(kept, solutions, rows, timed=False)
    assert [one.name for one in scores] == ["position", "velocity"]
    assert all(one.consistent for one in scores)


@pytest.mark.filterwarnings("error")
def test_windows_that_all_turn_differently_are_none_at_rest():
    """Six windows, two with a turn of 10° about each axis: none turns as most of them do about every axis."""
    rests = np.zeros((6, 13))
    rests[np.arange(6), 4 + np.arange(6) % 3] = np.radians(10.0)
    assert len(standing(rests)) == 0
    assert len(standing(rests[:0])) == 0
    assert len(standing(np.zeros((6, 13)))) == 6


def test_a_vehicle_that_turns_at_rest_is_not_the_fault_of_its_reference(flown):
    """A turntable, a boat at its mooring: the gyroscopes show the turn."""
    reference, stretches, solutions = flown
    (one,) = stretches
    turn = drifting(reference)
    at = np.interp(one.steps.ends(), reference.t, turn)
    by_gyros = one.steps.increments.copy()
    by_gyros[:, 2] += np.diff(at)
    turning = replace(one, steps=replace(one.steps, increments=by_gyros))
    assert without_wrong_attitude(turned(reference, turn), (turning,), solutions)[1] == ""


def test_velocities_that_are_not_those_of_the_positions_are_not_held_against_the_filter(flown):
    """Waves of 30 s and 0.3 m/s: the figure is their rms of means over 10 s."""
    reference, stretches, solutions = flown
    rows = [settled(*pair) for pair in zip(stretches, solutions, strict=True)]
    right, notes = against_reference(reference, solutions, rows, timed=False)
    assert not any("contradict" in note for note in notes)
    wave = 0.3 * np.sin(2.0 * np.pi * reference.t / 30.0)
    wrong = replace(reference, vel_n=reference.vel_n + wave[:, None] * [1.0, 0.0, 0.0])
    scores, notes = against_reference(wrong, solutions, rows, timed=False)
    (note,) = (one for one in notes if "contradict" in one)
    shown = float(note.partition("by ")[2].partition(" m/s north")[0])
    assert shown == pytest.approx(0.3 / np.sqrt(2.0) * np.sinc(1.0 / 3.0), rel=0.15)
    assert "east" not in note
    named = {one.name: one for one in scores}
    assert named["velocity"].consistent
    assert named["position"].ratio == pytest.approx(next(s for s in right if s.name == "position").ratio)
