"""Honest filters are not accused by a slow, late or turned reference; laws of interpolation and of what a fit takes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from models import rotation
from models.earth import llh_displaced, ned_between
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave
from tuner.consistency.correlated_errors import absorbed_shares
from tuner.consistency.frame_differences import errors_in_one_frame
from tuner.consistency.output_scores import error_scores
from tuner.consistency.time_alignment import find_time_offset
from tuner.consistency.trajectory_alignment import (
    Alignment,
    at_times,
    difference,
    interpolation_variance,
    velocity_of,
)
from tuner.types.filter_output import filter_output

DURATION = 400.0
SDS = np.repeat([0.5, 0.05, 3e-3], 3)
DRONE = Trajectory(
    "drone",
    DURATION,
    Profile(5.0, waves=(Wave(3.0, 1.0 / 15.0), Wave(1.0, 1.0 / 6.0))),
    Profile(waves=(Wave(2.5, 1.0 / 40.0),)),
    pitch=Profile(waves=(Wave(0.2, 1.0 / 11.0),)),
    roll=Profile(waves=(Wave(0.2, 1.0 / 5.0),)),
)
NONE = Alignment.NONE


def at(t, *, late=0.0, body=(0.0, 0.0, 0.0), error=None, stated=False, name="truth"):
    """The drone at times t: seen late, of a body turned against its own, with errors and their sds."""
    state = DRONE.evaluate(np.clip(t - late, 0.0, DURATION))
    quat = rotation.quat_multiply(
        rotation.quat_from_mat(state.mat_nb), np.broadcast_to(rotation.quat_from_rotvec(body), (len(t), 4))
    )
    e = np.zeros((len(t), 9)) if error is None else error
    cov = np.full((len(t), 15, 15), np.nan)
    cov[:, :9, :9] = np.diag(SDS**2)
    return filter_output(
        name,
        t,
        llh=llh_displaced(state.llh, -e[:, :3]),
        vel_n=state.vel_n - e[:, 3:6],
        quat_nb=rotation.quat_multiply(rotation.quat_from_rotvec(-e[:, 6:9]), quat),
        covariance=cov if stated else None,
    )


def honest(seed, factor=1.0):
    """A filter whose errors have the sds that it states, times a factor, and stay for 8 s."""
    rng, t = np.random.default_rng(seed), np.arange(1.0, DURATION)
    e, decay = rng.standard_normal((len(t), 9)), np.exp(-1.0 / 8.0)
    e = lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], e, axis=0)
    return at(t, error=factor * e * SDS, stated=True, name="filter")


def consistent(runs):
    nees, blocks = error_scores(runs)
    return all(one.consistent for one in (nees, *blocks))


def test_a_curve_through_attitudes_is_far_better_than_shortest_turns():
    """Swings of 1.8 Hz at 10 Hz: the chord is off by (ωh)²/8 = 16 % of the amplitude, the cubic by about (ωh)⁴/150."""
    t = np.arange(0.0, 20.0, 0.1)
    swing = 0.1 * np.sin(2.0 * np.pi * 1.8 * t)[:, None] * [1.0, 0.5, 0.0]
    given = filter_output("a", t, quat_nb=rotation.quat_from_rotvec(swing))
    between = t[20:-20] + 0.05
    true = rotation.quat_from_rotvec(0.1 * np.sin(2.0 * np.pi * 1.8 * between)[:, None] * [1.0, 0.5, 0.0])
    off = difference(at_times(given, between), filter_output("b", between, quat_nb=true))[:, 6:9]
    assert np.abs(off).max() < 0.02 * 0.1


@pytest.mark.parametrize("interval", [0.5, 1.0, 2.0])
def test_what_a_trajectory_leaves_open_is_measured_on_itself(interval):
    """Predicted ÷ true rms, at times anywhere between the rows; an upper bound where the motion is hardly resolved."""
    t = np.arange(0.0, DURATION, interval)
    times = np.random.default_rng(1).uniform(10.0, DURATION - 10.0, 300)
    times.sort()
    given, true = at(t), at(times)
    off = difference(true, at_times(given, times))[:, :9]
    predicted = np.sqrt(interpolation_variance(given, times).mean(axis=0))
    ratio = predicted / np.sqrt(np.mean(off**2, axis=0))
    assert ratio.min() > (0.8 if interval > 0.5 else 0.4)
    assert ratio.max() < 12.0


def test_a_trajectory_that_states_its_noise_leaves_nothing_more_open():
    rng, t = np.random.default_rng(2), np.arange(0.0, DURATION, 0.2)
    noisy = at(t, error=rng.standard_normal((len(t), 9)) * SDS, stated=True)
    open_between = interpolation_variance(noisy, t[:-1] + 0.1).mean(axis=0)
    assert np.all(open_between < 0.25 * SDS**2)


def test_a_fit_of_a_mean_takes_its_share():
    """Of a first-order process of correlation a, the mean of n has the share (1 + a)/(1 − a)/n of the variance."""
    n, a = 4000, 0.9
    w = lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], np.random.default_rng(3).standard_normal((n, 1)), axis=0)
    assert absorbed_shares(w, np.ones((n, 1, 1)))[0] == pytest.approx((1 + a) / (1 - a) / n, rel=0.3)
    assert absorbed_shares(w, np.zeros((n, 1, 0)))[0] == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_honest_filters_are_not_accused_by_their_reference(seed):
    """Rows of 1 and 10 Hz at other times; a body turned by degrees and a clock 0.2 s late, taken out and said."""
    output = honest(seed)
    for interval in (1.0, 0.1):
        t = np.arange(0.37, DURATION, interval)
        assert consistent(errors_in_one_frame([output], [at(t)], NONE, False, False)[1])
        turned = at(t, late=0.2, body=(0.01, -0.03, 0.06))
        offset, runs = errors_in_one_frame([output], [turned], NONE, True, True)
        assert consistent(runs)
        half = 0.5 * (offset.interval[1] - offset.interval[0])
        assert offset.value == pytest.approx(-0.2, abs=2.5 * half)
        assert half < 0.02 + 0.02 * interval
        assert runs[0].body.vector == pytest.approx([0.01, -0.03, 0.06], abs=1.5e-3)
        assert any("a constant rotation between the bodies" in note for note in runs[0].notes)


def test_a_vehicle_that_hardly_moves_shows_no_offset_of_clocks():
    """Standing, what moves is noise: the offset that fits best may be hours, and nothing is shifted by it."""
    rng, t = np.random.default_rng(8), np.arange(0.0, 60.0)
    covariance = np.broadcast_to(np.diag(np.concatenate([SDS**2, np.ones(6)])), (60, 15, 15))
    for scale in (0.0, 1e-3, 1.0):
        noise = scale * SDS * rng.standard_normal((60, 9))
        quat = rotation.quat_from_rotvec(noise[:, 6:])
        truth = filter_output("truth", t, local=noise[:, :3], vel_n=noise[:, 3:6], quat_nb=quat)
        still = rotation.quat_from_rotvec(0.1 * SDS[6:] * rng.standard_normal((60, 3)))
        output = filter_output(
            "filter",
            t,
            local=SDS[:3] * rng.standard_normal((60, 3)),
            vel_n=SDS[3:6] * rng.standard_normal((60, 3)),
            quat_nb=still,
            covariance=covariance,
        )
        for align_time in (False, True):
            offset, runs = errors_in_one_frame([output], [truth], NONE, align_time, True)
            assert len(runs[0].t) >= 50
            assert offset is None or abs(offset.value) <= 3.0


def test_optimistic_filters_stay_accused_by_a_turned_and_late_reference():
    t = np.arange(0.37, DURATION, 0.1)
    turned = at(t, late=0.2, body=(0.01, -0.03, 0.06))
    assert not consistent(errors_in_one_frame([honest(5, 1.5)], [turned], NONE, True, True)[1])


@pytest.mark.parametrize("seed", [29, 53, 65, 149])
def test_speeds_across_gaps_of_a_truth_show_no_offset_of_clocks(seed):
    """A vehicle stops and goes, its truth lacks its wrong parts: lines across these fit best up to 3 s elsewhere."""
    t, rng = np.arange(0.0, 400.0, 0.1), np.random.default_rng(seed)
    swing = np.sin(rng.uniform(0.03, 0.3) * t + rng.uniform(0.0, 6.0))
    speed = np.clip(20.0 * swing + rng.uniform(-5.0, 5.0), 0.0, 12.0) + 0.02 * t
    kept = (np.abs(t - rng.uniform(0.0, 400.0, 4)[:, None]) >= 28.0).all(axis=0)
    north = np.stack([speed, 0.0 * t, 0.0 * t], axis=-1)
    llh = llh_displaced(np.array([0.9, 0.2, 100.0]), np.cumsum(north, axis=0) * 0.1)
    estimate = filter_output("estimate", t, llh=llh, vel_n=north + 0.3 * np.cos(t)[:, None])
    truth = filter_output("truth", t[kept], llh=llh[kept], vel_n=north[kept])
    assert find_time_offset(estimate, truth) == pytest.approx(0.0, abs=0.1)


def test_positions_alone_tell_the_velocity_in_either_form():
    t = np.arange(0.0, 60.0, 0.1)
    state = DRONE.evaluate(t)
    local = ned_between(state.llh, state.llh[0])
    for given in (filter_output("a", t, llh=state.llh), filter_output("b", t, local=local)):
        np.testing.assert_allclose(velocity_of(given)[1:-1], state.vel_n[1:-1], atol=0.02)
    assert np.isnan(
        velocity_of(filter_output("c", t, quat_nb=np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))))
    ).all()
