"""The smoother equals least squares over all fixes, is better than the filter, and consistent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.error_state import corrected, navigation_error
from models.measurements import perfect_fixes
from models.strapdown import NavigationState
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation import reference_filter as reference
from tuner.navigation.data import Fixes, Steps, split_at
from tuner.navigation.settings import filter_settings
from tuner.navigation.smoother import separation, smooth
from tuner.synthesis import synthesize

INTERVAL, DURATION, RUNS = 0.05, 60.0, 12


@pytest.fixture(scope="module")
def flights():
    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
    channels = {axis: replace(c, markov=()) for axis, c in config.channels.items()}
    config = replace(config, channels=channels, gnss=replace(config.gnss, correlated=()))
    config = replace(config, initial=replace(config.initial, heading=0.05))
    settings = filter_settings(config)
    motion = TRAJECTORIES["s_turns"](DURATION)
    perfect = np.hstack(imu_increments(motion, INTERVAL))
    t = np.arange(1.0, DURATION)
    truth = motion.evaluate(t)
    llh, vel = perfect_fixes(motion, t)
    sd = np.array([*config.gnss.position_sd, *config.gnss.velocity_sd])
    metres = np.array([6.37e6, 6.37e6 * np.cos(0.84), -1.0])
    answers = []
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        density = np.concatenate([settings.model.gyro_density, settings.model.accel_density])
        bias = settings.initial_sd[9:15] * rng.standard_normal(6)
        noise = density * np.sqrt(INTERVAL) * rng.standard_normal(perfect.shape)
        steps, after = split_at(
            Steps(0.0, np.full(len(perfect), INTERVAL), perfect + noise + bias * INTERVAL), t
        )
        error = sd * rng.standard_normal((len(t), 6))
        fixes = Fixes(t, after, llh + error[:, :3] / metres, vel + error[:, 3:], np.tile(sd, (len(t), 1)))
        fixes = fixes.without([[25.0, 35.0]])
        start = corrected(motion.evaluate([0.0]).at(0), -settings.initial_sd[:9] * rng.standard_normal(9))
        solution, kept = reference.run_for_smoother(settings, start, steps, fixes)
        answers.append((solution, kept, smooth(solution, kept)))
    states = [truth.at(k) for k in range(len(t))]
    stacked = NavigationState(truth.llh, truth.vel_n, np.stack([state.quat_nb for state in states]))
    return t, stacked, answers


def test_last_estimate_is_the_filters(flights):
    _, _, answers = flights
    for solution, _, smoothed in answers:
        assert np.all(smoothed.error[-1] == 0.0)
        np.testing.assert_allclose(smoothed.state.llh[-1], solution.state.llh[-1], rtol=1e-15)


def test_variances_shrink(flights):
    _, _, answers = flights
    for _, kept, smoothed in answers:
        before = np.array([np.diag(p.after) for p in kept])
        after = np.einsum("kii->ki", smoothed.covariance)
        assert np.all(after <= before * (1.0 + 1e-6))
        assert np.all(after > 0.0)


def test_errors_shrink_and_are_as_large_as_predicted(flights):
    t, truth, answers = flights
    inside = (t > 25.0) & (t < 35.0)
    filtered, smoothed, predicted = [], [], []
    for solution, _, answer in answers:
        filtered.append(navigation_error(truth, solution.state))
        smoothed.append(navigation_error(truth, answer.state))
        predicted.append(np.einsum("kii->ki", answer.covariance)[:, :9])
    filtered, smoothed, predicted = (np.array(a) for a in (filtered, smoothed, predicted))
    rms = [np.sqrt(np.mean(e[:, inside, :3] ** 2)) for e in (filtered, smoothed)]
    assert rms[1] < 0.6 * rms[0]
    ratio = np.mean(smoothed**2 / predicted, axis=(0, 1))
    assert np.all(ratio > 0.2)
    assert np.all(ratio < 3.0)
    assert 0.7 < np.sqrt(ratio.mean()) < 1.35


def test_filter_and_smoother_differ_as_they_should(flights):
    _, _, answers = flights
    found = np.array([separation(smoothed)[::10] for _, _, smoothed in answers])
    assert 0.6 < found.mean() < 1.6


def test_steps_of_the_smoother_are_those_of_the_filter(flights):
    _, _, answers = flights
    solution, kept, _ = answers[0]
    for k, one in enumerate(kept):
        z = solution.innovation[k, : len(one.H)]
        np.testing.assert_allclose(one.gain @ z, one.correction, atol=1e-9)
        if solution.use[k, 0] == 3:
            assert np.all(one.gain == 0.0)
