"""The compiled filter equals the reference filter in every configuration; perfect data give no error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.error_state import corrected, navigation_error
from models.filter_states import named_states
from models.measurements import perfect_fixes
from models.noise import GaussMarkov
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.consistency.scores import innovation_scores
from tuner.navigation import engine
from tuner.navigation import reference_filter as reference
from tuner.navigation.data import GATED, USED, WITHHELD, Constraints, Fixes, Steps, split_at
from tuner.navigation.settings import chi2_gate, filter_settings, total_bias
from tuner.simulation.imu import sensor_of_config
from tuner.simulation.monte_carlo import simulate
from tuner.simulation.scenario import scenario
from tuner.synthesis import synthesize
from tuner.types.records import DataError

LEVER = (0.3, -0.2, -1.0)
PRIORS = dict.fromkeys(named_states(), 0.01) | {
    "lever_arm": 0.5,
    "gravity": 1e-3,
    "g_sensitivity": 1e-4,
    "gyro_ramp": 1e-6,
    "accel_ramp": 1e-4,
}
INTERVAL = 0.01


def configuration(grade="mpu9250", receiver="spp", **options):
    return synthesize(grade_identification(load_grade(grade)), gnss=load_gnss(receiver), **options)


def plain(config):
    """Fifteen states: constants that walk."""
    channels = {axis: replace(c, markov=(), ramp_sd=0.0) for axis, c in config.channels.items()}
    return replace(config, channels=channels, gnss=replace(config.gnss, correlated=()))


def ramped(config):
    channels = {
        axis: replace(c, ramp_sd=1e-3 * c.constant_sd, markov=(GaussMarkov(c.constant_sd, 0.05),))
        for axis, c in config.channels.items()
    }
    return replace(config, channels=channels)


def flight(settings, trajectory, duration, *, seed=0, offset=0.003, noisy=True):
    rng = np.random.default_rng(seed)
    motion = TRAJECTORIES[trajectory](duration)
    increments = np.hstack(imu_increments(motion, INTERVAL))
    density = np.concatenate([settings.model.gyro_density, settings.model.accel_density])
    if noisy:
        increments = increments + rng.standard_normal(increments.shape) * density * np.sqrt(INTERVAL)
        increments += INTERVAL * np.array([1e-3, 2e-3, -1e-3, 0.1, 0.05, -0.05])
    t = np.arange(1.0, duration - 1.0) + offset
    steps, after = split_at(Steps(0.0, np.full(len(increments), INTERVAL), increments), t)
    llh, vel = perfect_fixes(motion, t, lever_arm=settings.lever_arm, delay=0.02 if noisy else 0.0)
    if noisy:
        vel = vel + 0.05 * rng.standard_normal(vel.shape)
        vel[::7] = np.nan
        vel[3::7, 2] = np.nan  # speed and course
    sd = np.tile([1.5, 1.5, 3.0, 0.05, 0.05, 0.1], (len(t), 1))
    start = motion.evaluate([0.0]).at(0)
    return motion, start, steps, Fixes(t, after, llh, vel, sd)


@pytest.mark.parametrize("trajectory", TRAJECTORIES)
@pytest.mark.parametrize(
    ("make", "options"),
    [
        (plain, {}),
        (lambda c: c, {}),
        (ramped, {}),
        (lambda c: c, {"constants": PRIORS}),
        (plain, {"constants": {"accel_scale": 0.01}, "covariance_step": INTERVAL}),
    ],
    ids=["15", "ladder", "ramp", "everything", "every-sample"],
)
def test_engine_equals_filter(trajectory, make, options):
    settings = filter_settings(make(configuration()), lever_arm=LEVER, **options)
    _, start, steps, fixes = flight(settings, trajectory, 9.0)
    fixes = fixes.without([[3.0, 5.1]])
    start = corrected(start, np.array([1.0, -1.0, 2.0, 0.1, 0.1, -0.1, 0.01, -0.01, 0.1]))
    a = reference.run(settings, start, steps, fixes)
    b = engine.run(settings, start, steps, fixes)
    assert_same(settings, a, b)
    assert {USED, WITHHELD} <= set(a.use[:, 0].tolist())
    # Among filters that start elsewhere and whose fixes err otherwise, one of which is gated.
    rng = np.random.default_rng(1)
    starts = [
        corrected(start, np.array([3.0, 2.0, 1.0, 0.1, 0.1, 0.1, 0.02, 0.01, 0.2]) * k) for k in range(3)
    ]
    others = [
        replace(
            fixes, llh=fixes.llh + k * rng.standard_normal(fixes.llh.shape) * [1e-6, 1e-6, 200.0 * (k - 1)]
        )
        for k in range(3)
    ]
    first, *rest = engine.run_together(settings, starts, steps, others)
    assert_same(settings, a, first)
    for begin, own, found in zip(starts[1:], others[1:], rest, strict=True):
        assert_same(settings, engine.run(settings, begin, steps, own), found)


def test_a_missing_vertical_velocity_says_nothing():
    """Speed and course of a phone were left out whole; a component of sd 10⁵ m/s is as good as none."""
    settings = filter_settings(configuration(), lever_arm=LEVER)
    _, start, steps, fixes = flight(settings, "city", 30.0)
    vel, sd = fixes.vel_n.copy(), fixes.sd.copy()
    vel[np.isfinite(vel[:, 2]), 2], sd[:, 5] = 0.0, 1e5
    blank = vel.copy()
    blank[:, 2] = np.nan
    known, missing = (
        engine.run(settings, start, steps, replace(fixes, vel_n=one, sd=sd)) for one in (vel, blank)
    )
    sd = np.sqrt(np.einsum("kii->ki", known.covariance))
    assert np.all(np.abs(navigation_error(known.state, missing.state)) < 1e-6 * sd[:, :9])
    assert np.allclose(known.covariance, missing.covariance, rtol=1e-6, atol=1e-12)
    there = missing.use[:, 1] == USED
    assert there.any()
    assert np.isnan(missing.innovation[there, 5]).all()
    scores = {
        one.name: one
        for one in innovation_scores([missing.innovation], [missing.innovation_covariance], [missing.use])
    }
    assert (scores["nis"].dof, scores["nis_position"].dof, scores["nis_velocity"].dof) == (5, 3, 2)


def test_engine_equals_filter_long_after_fast_states_have_decayed():
    settings = filter_settings(ramped(configuration()))
    _, start, steps, fixes = flight(settings, "city", 9.0)
    last = Fixes(fixes.t[-1:], fixes.after[-1:], fixes.llh[-1:], fixes.vel_n[-1:], fixes.sd[-1:])
    assert_same(
        settings, reference.run(settings, start, steps, last), engine.run(settings, start, steps, last)
    )


def assert_same(settings, a, b):
    sd = np.sqrt(np.einsum("kii->ki", a.covariance))
    assert np.all(np.abs(navigation_error(a.state, b.state)) < 1e-9 * sd[:, :9])
    scale = settings.initial_sd + 1e-300
    assert np.all(np.abs(a.parameters - b.parameters) <= 1e-9 * scale)
    assert np.all(np.abs(a.covariance - b.covariance) < 1e-9 * sd[:, :, None] * sd[:, None, :])
    final = np.sqrt(np.diag(a.final_covariance))
    assert np.all(np.abs(a.final_covariance - b.final_covariance) <= 1e-9 * np.outer(final, final) + 1e-300)
    spread = np.sqrt(np.einsum("kii->ki", a.innovation_covariance))
    np.testing.assert_array_equal(np.isnan(a.innovation), np.isnan(b.innovation))
    assert np.all(np.abs(np.nan_to_num(a.innovation - b.innovation)) <= 1e-9 * spread)
    np.testing.assert_array_equal(a.use, b.use)


def constrained(steps, duration, *, seed=3):
    """Constraints of all kinds, one a second, some far from true."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.5, duration - 0.6, 0.5)
    after = np.searchsorted(steps.ends(), t)
    kind = np.arange(len(t)) % 3 + 1
    rates = steps.increments[after - 1] / steps.dt[after - 1, None]
    sd = np.select([kind == 1, kind == 2], [0.5, 8.0], 0.05) * rng.uniform(0.5, 2.0, len(t))
    mat_bv = rotation.mat_from_rpy([0.02, -0.05, 0.1])
    return Constraints(t, after, kind, sd, rates, mat_bv, (-1.0, 0.2, 0.4))


@pytest.mark.parametrize("trajectory", ["city", "s_turns", "static"])
@pytest.mark.parametrize("constants", [{}, PRIORS], ids=["15", "everything"])
def test_engine_equals_filter_with_constraints(trajectory, constants):
    settings = filter_settings(plain(configuration()), lever_arm=LEVER, constants=constants)
    _, start, steps, fixes = flight(settings, trajectory, 9.0)
    fixes, own = fixes.without([[3.0, 5.1]]), constrained(steps, 9.0)
    start = corrected(start, np.array([1.0, -1.0, 2.0, 0.1, 0.1, -0.1, 0.01, -0.01, 0.1]))
    a = reference.run(settings, start, steps, fixes, constraints=own)
    b = engine.run(settings, start, steps, fixes, constraints=own)
    sd = np.sqrt(np.einsum("kii->ki", a.covariance))
    assert np.all(np.abs(navigation_error(a.state, b.state)) < 1e-9 * sd[:, :9])
    assert np.all(np.abs(a.parameters - b.parameters) <= 1e-9 * (settings.initial_sd + 1e-300))
    assert np.all(np.abs(a.covariance - b.covariance) < 1e-9 * sd[:, :, None] * sd[:, None, :])
    np.testing.assert_array_equal(a.use, b.use)
    np.testing.assert_array_equal(a.constrained.use, b.constrained.use)
    np.testing.assert_allclose(a.constrained.distance, b.constrained.distance, rtol=1e-6, atol=1e-9)
    assert USED in b.constrained.use
    without = engine.run(settings, start, steps, fixes)
    assert without.constrained is None
    assert np.all(np.diag(b.final_covariance)[:9] <= 1.05 * np.diag(without.final_covariance)[:9])


def test_a_moving_vehicle_is_not_taken_to_stand():
    settings = filter_settings(plain(configuration()))
    motion, start, steps, fixes = flight(settings, "straight", 20.0)
    own = constrained(steps, 20.0)
    own = replace(own, kind=np.full(len(own), 2), sd=np.full(len(own), 0.05))
    found = engine.run(settings, start, steps, fixes, constraints=own).constrained
    speed = np.linalg.norm(motion.evaluate(own.t).vel_n, axis=1)
    assert np.count_nonzero(speed > 3.0) > 10
    assert np.all(found.use[speed > 3.0] == GATED)


def test_perfect_data_leave_no_error():
    settings = filter_settings(plain(configuration()), lever_arm=LEVER)
    motion, start, steps, fixes = flight(settings, "city", 60.0, noisy=False)
    solution = engine.run(settings, start, steps, fixes)
    truth = motion.evaluate(fixes.t)
    for k in range(len(fixes)):
        error = navigation_error(
            truth.at(k), replace(start, llh=solution.state.llh[k], vel_n=solution.state.vel_n[k],
                                 quat_nb=solution.state.quat_nb[k])
        )  # fmt: skip
        assert np.all(np.abs(error[:3]) < 2e-3)
        assert np.all(np.abs(error[6:]) < 5e-5)
    assert np.all(np.abs(solution.innovation) < 2e-3)


def test_the_estimate_of_gravity_moves_the_filter():
    """At rest with exact sensors, what is not felt of gravity is all of its excess, and stays found."""
    config = plain(configuration())
    channels = {
        axis: replace(c, constant_sd=1e-7, random_walk_density=0.0) for axis, c in config.channels.items()
    }
    settings = filter_settings(replace(config, channels=channels), constants={"gravity": 1e-2})
    _, start, steps, fixes = flight(settings, "static", 120.0, noisy=False)
    excess, increments = 5e-3, steps.increments.copy()
    increments[:, 3:] -= excess * rotation.mat_from_quat(start.quat_nb)[2] * steps.dt[:, None]
    solution = engine.run(settings, start, replace(steps, increments=increments), fixes)
    estimate = solution.parameters[:, settings.model.layout.start("gravity")]
    sd = np.sqrt(solution.further_covariance[:, 0, 0])
    assert sd[-1] < 0.1 * excess
    np.testing.assert_allclose(estimate[len(sd) // 2 :], excess, rtol=0.01)


def test_fix_within_a_sample_splits_it():
    steps = Steps(5.0, np.full(4, 0.25), np.arange(24.0).reshape(4, 6))
    split, after = split_at(steps, [5.25, 5.35, 5.35, 6.0 - 1e-9])
    np.testing.assert_allclose(split.dt, [0.25, 0.1, 0.15, 0.25, 0.25], atol=1e-12)
    np.testing.assert_allclose(split.increments.sum(axis=0), steps.increments.sum(axis=0))
    np.testing.assert_array_equal(after, [1, 2, 2, 5])
    with pytest.raises(ValueError, match="within"):
        split_at(steps, [4.0])


def test_far_fixes_are_gated():
    settings = filter_settings(plain(configuration()))
    _, start, steps, fixes = flight(settings, "straight", 20.0)
    llh = fixes.llh.copy()
    llh[9, 2] += 200.0
    solution = engine.run(settings, start, steps, replace(fixes, llh=llh))
    assert solution.use[9, 0] == GATED
    assert solution.use[9, 1] == USED
    assert np.all(np.delete(solution.use[:, 0], 9) == USED)


def test_a_lost_filter_accepts_fixes_again():
    settings = replace(filter_settings(plain(configuration())), patience=4.0)
    _, start, steps, fixes = flight(settings, "straight", 30.0)
    lost = corrected(start, np.array([40.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    solution = engine.run(settings, lost, steps, fixes)
    assert np.all(solution.use[:4, 0] == GATED)
    assert np.all(solution.use[-10:, 0] == USED)
    same = reference.run(settings, lost, steps, fixes)
    np.testing.assert_array_equal(same.use, solution.use)
    trusting = engine.run(settings, lost, steps, replace(fixes, trusted=np.ones(len(fixes), dtype=bool)))
    assert not np.any(trusting.use == GATED)


def test_stretches_can_be_joined():
    settings = filter_settings(configuration(), lever_arm=LEVER)
    _, start, steps, fixes = flight(settings, "s_turns", 12.0)
    whole = engine.run(settings, start, steps, fixes)
    k = 6
    cut = int(fixes.after[k - 1])
    first = engine.run(
        settings,
        start,
        Steps(0.0, steps.dt[:cut], steps.increments[:cut]),
        Fixes(fixes.t[:k], fixes.after[:k], fixes.llh[:k], fixes.vel_n[:k], fixes.sd[:k]),
    )
    # The joint lacks the increments of the step before: the coning term of one sample.
    second = engine.run(
        settings,
        first.final,
        Steps(float(fixes.t[k - 1]), steps.dt[cut:], steps.increments[cut:]),
        Fixes(fixes.t[k:], fixes.after[k:] - cut, fixes.llh[k:], fixes.vel_n[k:], fixes.sd[k:]),
        parameters=first.final_parameters,
        covariance=first.final_covariance,
    )
    np.testing.assert_allclose(second.final_covariance, whole.final_covariance, rtol=1e-4, atol=1e-9)
    assert np.all(np.abs(navigation_error(whole.final, second.final)) < 1e-3)


def test_total_bias_adds_up_the_states_of_an_axis():
    model = filter_settings(configuration()).model
    m = total_bias(model)
    assert np.all(m[9:12, model.layout["gyro_markov"]].sum(axis=0) == 1.0)
    assert np.all(m[9:, :9] == 0.0)


def test_gate_is_as_rare_as_its_sigmas():
    assert chi2_gate(5.0, 1) == pytest.approx(25.0)
    assert chi2_gate(3.0, 3) == pytest.approx(14.16, abs=0.01)


def test_a_run_is_the_same_in_any_company():
    config = configuration()
    settings, sensor = filter_settings(config), sensor_of_config(config)
    plan = scenario(TRAJECTORIES["city"](30.0), load_gnss("spp"), INTERVAL)
    few, many = (simulate(settings, sensor, plan, runs=runs, seed=5) for runs in (3, 9))
    np.testing.assert_array_equal(few.error, many.error[:3])
    assert len(many.error) == 9
    assert len(np.unique(many.error[:, -1, 0])) == 9


def test_missing_axes_are_refused():
    config = configuration()
    channels = {axis: c for axis, c in config.channels.items() if axis.startswith("gyro")}
    with pytest.raises(DataError, match="accel_x"):
        filter_settings(replace(config, channels=channels))
