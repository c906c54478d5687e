"""Splines through given positions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from models import earth
from models.strapdown import mechanize
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments
from models.trajectory.spline import Track


def _sampled(name, duration, interval=1.0):
    motion = TRAJECTORIES[name](duration)
    t = np.arange(0.0, duration + 1e-9, interval)
    return motion, t, motion.position(t)


def test_track_passes_through_its_points():
    _, t, llh = _sampled("s_turns", 60.0)
    state = Track("track", t + 5.0, llh).evaluate(t)
    np.testing.assert_allclose(earth.ned_between(state.llh, llh), 0.0, atol=1e-7)


def test_dense_track_resembles_the_motion_it_came_from():
    motion, t, llh = _sampled("s_turns", 60.0)
    inner = np.linspace(10.0, 50.0, 401)
    track, truth = Track("track", t, llh).evaluate(inner), motion.evaluate(inner)
    np.testing.assert_allclose(earth.ned_between(track.llh, truth.llh), 0.0, atol=2e-3)
    np.testing.assert_allclose(track.vel_n, truth.vel_n, atol=5e-3)
    np.testing.assert_allclose(track.acc_n, truth.acc_n, atol=3e-2)
    np.testing.assert_allclose(track.rpy[:, 1:], truth.rpy[:, 1:], atol=2e-3)


def test_acceleration_is_the_derivative_of_velocity():
    _, t, llh = _sampled("climb", 60.0)
    track, at, step = Track("track", t, llh), np.linspace(1.0, 59.0, 100), 1e-3
    numeric = (track.evaluate(at + step).vel_n - track.evaluate(at - step).vel_n) / (2 * step)
    np.testing.assert_allclose(track.evaluate(at).acc_n, numeric, atol=1e-5)


def test_perfect_increments_lead_back_to_the_track():
    _, t, llh = _sampled("s_turns", 60.0)
    track = Track("track", t, llh)
    dtheta, dvel = imu_increments(track, 0.01)
    end = mechanize(track.evaluate([0.0]).at(0), dtheta, dvel, 0.01)
    truth = track.evaluate(0.01 * np.arange(len(dtheta) + 1))
    assert np.abs(earth.ned_between(end.llh, truth.llh)).max() < 1e-3


def _waypoints(seed, duration=600.0):
    """A car that goes 5 … 15 m/s between points 3 … 10 s apart, up to 86° off the course before."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(3.0, 10.0, int(duration / 5.0)))])
    t = t[: np.searchsorted(t, duration) + 1]
    course, speed = np.cumsum(rng.uniform(-1.5, 1.5, len(t))), rng.uniform(5.0, 15.0, len(t))
    legs = np.stack([speed * np.cos(course), speed * np.sin(course), np.zeros_like(t)], axis=-1)
    ned = np.concatenate([[np.zeros(3)], np.cumsum(legs[1:] * np.diff(t)[:, None], axis=0)])
    return Track("waypoints", t, earth.llh_displaced(np.array([0.84, 0.16, 100.0]), ned))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_random_waypoints_are_led_back_to(seed):
    track = _waypoints(seed)
    dtheta, dvel = imu_increments(track, 0.01)
    end = mechanize(track.evaluate([0.0]).at(0), dtheta, dvel, 0.01)
    truth = track.evaluate(0.01 * np.arange(len(dtheta) + 1))
    assert np.abs(earth.ned_between(end.llh, truth.llh)).max() < 1e-3


@pytest.mark.parametrize("seed", range(20))
def test_a_track_does_not_swing_at_its_ends(seed):
    """Of all curves through the points it has the least jerk: another one has more."""
    track = _waypoints(seed, 60.0)
    t = np.linspace(0.0, track.duration, 6001)
    motion = track.evaluate(t)
    for end in (slice(None, 600), slice(-600, None)):
        assert np.linalg.norm(motion.f_b[end, :2], axis=1).max() < 10.0
    other = make_interp_spline(track.t, track.llh, k=5)
    ours, theirs = (
        np.sum(np.gradient(acc, t, axis=0) ** 2) for acc in (motion.acc_n, _second(other, t, track))
    )
    assert ours < theirs


def _second(spline, t, track):
    """Acceleration, up to terms of the curvature of the Earth."""
    return spline(t, nu=2) * earth.metres_per_radian(track.llh[0])


def test_standstill_keeps_its_course():
    _, t, llh = _sampled("city", 120.0)
    state = Track("track", t, llh).evaluate(np.linspace(110.0, 119.0, 50))
    assert np.ptp(state.rpy[:, 2]) < 0.02


def test_banked_turn_feels_no_side_force():
    _, t, llh = _sampled("circle", 60.0)
    state = Track("track", t, llh, banked=True).evaluate(np.linspace(10.0, 50.0, 200))
    assert np.abs(state.f_b[:, 1]).max() < 0.02
    assert state.rpy[:, 0].min() > 0.15


@pytest.mark.parametrize(
    ("t", "llh"),
    [
        (np.arange(5.0), np.zeros((5, 3))),
        (np.arange(8.0), np.zeros((8, 2))),
        (np.zeros(8), np.zeros((8, 3))),
    ],
)
def test_impossible_points_are_refused(t, llh):
    with pytest.raises(ValueError, match="'t'"):
        Track("track", t, llh)
