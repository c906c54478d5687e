"""Constants between an estimate and its truth are named with their size, and filters are honest without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models import rotation
from models.earth import llh_displaced, ned_between
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave
from tuner.consistency.constant_errors import constant_errors, unit_of_sds
from tuner.consistency.frame_differences import errors_in_one_frame
from tuner.consistency.output_errors import output_errors
from tuner.consistency.output_scores import error_scores
from tuner.consistency.score_output import score_outputs
from tuner.consistency.time_alignment import find_time_offset
from tuner.consistency.trajectory_alignment import Alignment
from tuner.types.filter_output import filter_output

DURATION = 400.0
SDS = np.repeat([0.02, 0.01, 2e-3], 3)
"""Of a filter with centimetres: every constant below is far beyond them."""
DRONE = Trajectory(
    "drone",
    DURATION,
    Profile(5.0, waves=(Wave(3.0, 1.0 / 15.0), Wave(1.0, 1.0 / 6.0), Wave(2.0, 1.0 / 190.0))),
    Profile(waves=(Wave(2.5, 1.0 / 40.0),)),
    pitch=Profile(waves=(Wave(0.2, 1.0 / 11.0),)),
    roll=Profile(waves=(Wave(0.2, 1.0 / 5.0),)),
)


def course(t):
    return DRONE.evaluate(np.clip(t, 0.0, DURATION))


def reference():
    t = np.arange(0.0, DURATION, 0.2)
    state = course(t)
    return filter_output(
        "truth", t, llh=state.llh, vel_n=state.vel_n, quat_nb=rotation.quat_from_mat(state.mat_nb)
    )


def honest(seed, *, late=0.0, moved=None, body=(0.0, 0.0, 0.0)):
    """A filter whose errors have the sds that it states and stay for 8 s; what is wrong beside them."""
    rng, t = np.random.default_rng(seed), np.arange(1.0, DURATION)
    decay = np.exp(-1.0 / 8.0)
    e = lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], rng.standard_normal((len(t), 9)), axis=0) * SDS
    state = course(t - late)
    shift = np.zeros((len(t), 3)) if moved is None else moved(state)
    quat = rotation.quat_multiply(rotation.quat_from_rotvec(-e[:, 6:9]), rotation.quat_from_mat(state.mat_nb))
    covariance = np.full((len(t), 15, 15), np.nan)
    covariance[:, :9, :9] = np.diag(SDS**2)
    return filter_output(
        "filter",
        t,
        llh=llh_displaced(state.llh, shift - e[:, :3]),
        vel_n=state.vel_n - e[:, 3:6],
        quat_nb=rotation.quat_multiply(quat, np.broadcast_to(rotation.quat_from_rotvec(body), (len(t), 4))),
        covariance=covariance,
    )


def units_of(runs):
    return unit_of_sds(runs, error_scores(runs)[1])


def upwards(state):
    return np.broadcast_to([0.0, 0.0, -47.6], (len(state.llh), 3))


def aside(state):
    return np.broadcast_to([1.5, -2.5, 0.0], (len(state.llh), 3))


def ahead(state):
    return state.mat_nb @ [0.9, -0.4, 0.2]


def turned(state):
    """Positions turned by 1.5° about a point 3 km south; velocities stay."""
    place = ned_between(state.llh, llh_displaced(state.llh[:1], np.array([[-3000.0, 0.0, 0.0]]))[0])
    return place @ rotation.mat_from_rotvec([0.0, 0.0, np.radians(1.5)]).T - place


CASES = {
    "height": ({"moved": upwards}, ("gnss_frame", "height"), 47.6),
    "offset": ({"moved": aside}, ("gnss_frame", "offset"), np.hypot(1.5, 2.5)),
    "antenna": ({"moved": ahead}, ("lever_arm", "output"), np.sqrt(0.81 + 0.16 + 0.04)),
    "body": ({"body": (0.0, 0.02, -0.3)}, ("mounting", ""), np.hypot(0.02, 0.3)),
    "backwards": ({"body": (0.0, 0.0, 3.13)}, ("mounting", ""), 3.13),
    "grid": ({"moved": turned}, ("gnss_frame", "rotation"), np.radians(1.5)),
    "leap seconds": ({"late": 18.0}, ("time_offset", "stamps of the output or of the truth"), 18.0),
    "early": ({"late": -41.3}, ("time_offset", "stamps of the output or of the truth"), -41.3),
}


@pytest.mark.parametrize("case", CASES)
def test_a_constant_is_named_and_a_filter_is_honest_without_it(case):
    """Before, all of these diverged, and 18 s were 2.55 s late."""
    wrong, name, size = CASES[case]
    found = score_outputs([honest(1, **wrong)], [reference()])
    assert not found.consistency.consistent
    assert not found.consistency.diverged
    (cause,) = found.causes
    assert (cause.cause, cause.subject) == name
    assert cause.interval[0] <= size <= cause.interval[1]
    assert cause.size == pytest.approx(size, rel=0.02)
    assert found.without_constants.honesty.good


def test_a_filter_that_is_lost_has_no_constant():
    """From a fifth of the record on it was 36 km off: "a constant offset", and honest without it."""
    one = honest(1)
    lost = one.llh.copy()
    lost[80:] = llh_displaced(lost[80:], np.broadcast_to([3e4, 2e4, 0.0], (len(lost) - 80, 3)))
    found = score_outputs([replace(one, llh=lost)], [reference()])
    assert not found.consistency.honesty.good
    assert found.without_constants is None


@pytest.mark.parametrize("seed", range(6))
def test_a_filter_that_is_right_has_no_constant(seed):
    outputs, truths = [honest(seed)], [reference()]
    offset, runs = errors_in_one_frame(outputs, truths, Alignment.NONE, align_time=False, align_body=False)
    assert constant_errors(outputs, truths, Alignment.NONE, runs, offset)[0] == ()
    assert units_of(runs)[0] == ()
    assert score_outputs(outputs, truths).without_constants is None


def test_an_optimistic_filter_of_constant_sds_does_not_state_variances():
    """Of 1 cm in place of 10 cm: the root of 0.01 is 0.1."""
    one = honest(3)
    wide = one.covariance.copy()
    wide[:, :3, :3] = 0.01 * SDS[0] ** 2 * np.eye(3)
    found = score_outputs([replace(one, covariance=wide)], [reference()])
    assert all(cause.cause != "unit_of_sds" for cause in found.causes)


def test_a_lag_is_found_anywhere_and_the_nearest_where_the_course_repeats():
    """A circle each 40 s: lags of 5 s and of 45 s are as good, and the smaller is meant."""
    t = np.arange(0.0, 400.0, 0.1)
    speed = 5.0 + 2.0 * np.sin(2.0 * np.pi * t / 40.0)
    north = np.stack([speed, 0.0 * t, 0.0 * t], axis=-1)
    truth = filter_output("truth", t, local=np.cumsum(north, axis=0) * 0.1, vel_n=north)
    assert find_time_offset(replace(truth, t=t + 5.0), truth) == pytest.approx(5.0, abs=0.01)


@pytest.mark.parametrize(("power", "subject"), [(2.0, "variances"), (0.5, "roots")])
def test_variances_in_place_of_sds_are_told_and_other_factors_are_not(power, subject):
    output, truth = honest(2), reference()
    squared = output.covariance.copy()
    squared[:, :9, :9] = np.diag(SDS ** (2.0 * power))
    (cause,), (rest,) = units_of([output_errors(replace(output, covariance=squared), truth)])
    assert cause.subject == subject
    assert rest.covariance[5, 0, 0] == pytest.approx(SDS[0] ** 2, rel=0.1)
    assert units_of([output_errors(replace(output, covariance=0.01 * output.covariance), truth)])[0] == ()
