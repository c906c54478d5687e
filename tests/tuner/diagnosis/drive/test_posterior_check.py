"""What a named cause predicts is looked for in all parts of the innovations; else something else is named."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import exp, factorial, log
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.motion_courses import Motion
from tuner.diagnosis.drive.noise_by_parts import (
    densities_by_parts,
    dirichlet_evidence,
    evidence_of_axes,
    integrated,
    variances_by_parts,
)
from tuner.diagnosis.drive.parts_of_innovations import divisions, thirds_by_size
from tuner.diagnosis.drive.posterior_check import _amplitudes, _overlaps
from tuner.linear_run.likelihood import as_configured
from tuner.linear_run.whitened_innovations import whiten
from tuner.types import Coefficient, Parameter

DELAY = Parameter("time_offset", "delay")


def test_expected_bayes_factor_of_shares_is_one():
    """Over all outcomes of five runs in three parts, weighted by their chance where the shares are right."""
    weight, total = np.array([0.2, 0.3, 0.5]), 0.0
    for count in product(range(6), repeat=3):
        if sum(count) == 5:
            chance = factorial(5) * np.prod([w**n / factorial(n) for w, n in zip(weight, count, strict=True)])
            total += chance * exp(dirichlet_evidence(np.array(count), weight))
    assert total == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(("best", "information"), [(0.0, 400.0), (0.3, 400.0), (1.2, 50.0), (0.1, 0.5)])
def test_integral_of_a_normal_likelihood_is_exact(best, information):
    tau = 0.7
    exact = 0.5 * information**2 * best**2 / (information + tau**-2) - 0.5 * log(1.0 + tau**2 * information)
    found = integrated(lambda x: information * (best * x - 0.5 * x**2), tau)
    assert found == pytest.approx(exact, abs=1e-6)


def run_with(linearized, of_fix, seed):
    """Draw a replica whose delay is 0.1 s times `of_fix` (k,), of which 0.1 s times its mean is compensated."""
    column = linearized.parameters.index(DELAY)
    values = np.zeros(len(linearized.parameters))
    drawn = Source.of(as_configured(linearized)).draw(np.random.default_rng(seed), values)
    left = 0.1 * (of_fix - of_fix.mean())
    moved = drawn.innovation + drawn.D[:, :, column] * left[:, None]
    linearized = replace(drawn, innovation=moved)
    size = 0.1 * of_fix.mean()
    effect = linearized.B[:, :, column] * size, linearized.D[:, :, column] * size
    run = SimpleNamespace(linearized=linearized, whitened=whiten(as_configured(linearized)))
    return _amplitudes(run, {"time_offset": effect}, divisions(linearized))["time_offset"]


def test_a_delay_that_is_there_all_the_time_passes_and_one_of_half_the_drive_does_not(city_drive):
    """The expected Bayes factor of a true cause is 1, so that 3 nats come in one of twenty drives at most."""
    half = (np.arange(len(city_drive.t)) < len(city_drive.t) // 2).astype(float)
    for seed in range(2):
        assert run_with(city_drive, np.ones(len(half)), seed).evidence < 3.0
    changed = run_with(city_drive, half, 7)
    assert changed.evidence > 10.0
    assert changed.between == "time"


def test_noise_of_turns_alone_is_no_density_of_the_sensor_and_no_sd_of_the_receiver(city_drive):
    rng = np.random.default_rng(11)
    parts = divisions(city_drive)
    source = Source.of(as_configured(city_drive))
    clean = as_configured(source.draw(rng, np.zeros(len(city_drive.parameters))))
    assert variances_by_parts(clean, 0.5, parts).evidence < 3.0
    assert densities_by_parts(clean, ("gyro_white", "accel_white"), 1.0, parts).evidence < 3.0
    turning = parts["turn"][:, :1] != 1
    noisy = clean.linearized.innovation + np.where(turning, 2.0, 0.0) * clean.sd * rng.standard_normal(
        (len(turning), 6)
    )
    found = variances_by_parts(
        replace(clean, linearized=replace(clean.linearized, innovation=noisy)), 0.5, parts
    )
    assert found.evidence > 10.0
    assert found.between == "turn"


def test_a_square_is_no_scale_factor_and_what_hardly_differs_is_not_divided():
    """Thirds of what an effect tells: the largest fixes, fewer than the smallest, tell as much as these."""
    size = np.linspace(0.0, 1.0, 1000)
    part = thirds_by_size(size)
    told = [np.sum(size[part == p] ** 2) for p in range(3)]
    assert told == pytest.approx(np.full(3, np.sum(size**2) / 3.0), rel=0.01)
    assert np.all(np.diff(part) >= 0)
    assert thirds_by_size(np.ones(10) + 0.01 * size[:10]) is None
    assert thirds_by_size(np.zeros(10)) is None


def with_staying_errors(linearized, sd, time):
    """Return a run whose filter has three states of errors of positions that stay."""
    k, n = linearized.transition.shape[:2]
    wider = {name: np.pad(of, ((0, 0), (0, 3), (0, 3))) for name, of in linearized.noise.items()}
    transition = np.pad(linearized.transition, ((0, 0), (0, 3), (0, 3)))
    transition[:, n:, n:] = np.exp(-1.0 / time) * np.eye(3)
    wider["gnss_position"] = np.zeros((k, n + 3, n + 3))
    wider["gnss_position"][:, n:, n:] = -np.expm1(-2.0 / time) * sd**2 * np.eye(3)
    initial = np.pad(linearized.initial, (0, 3))
    initial[n:, n:] = sd**2 * np.eye(3)
    H = np.pad(linearized.H, ((0, 0), (0, 0), (0, 3)))
    H[:, :3, n:] = np.eye(3)
    B = np.pad(linearized.B, ((0, 0), (0, 3), (0, 0)))
    correction = np.zeros((k, n + 3))
    return replace(
        linearized,
        transition=transition,
        noise=wider,
        initial=initial,
        H=H,
        B=B,
        D=linearized.D.copy(),
        correction=correction,
    ), slice(n, n + 3)


def test_antennas_in_turn_are_no_errors_that_stay(city_drive):
    """Errors that stay know nothing of where the vehicle points; those of a second antenna are along it."""
    run, states = with_staying_errors(city_drive, 1.0, 30.0)
    forward = Motion.of(run).mat[:, :2, 0]
    at = run.parameters.index(DELAY)
    second = np.floor(run.t / 40.0) % 2.0
    run.D[:, :, at] = 0.0
    run.D[:, :2, at] = second[:, None] * forward
    for size, low, high in ((0.0, -np.inf, 3.0), (4.0, 10.0, np.inf)):
        drawn = Source.of(as_configured(run)).draw(
            np.random.default_rng(12), size * np.eye(len(run.parameters))[at]
        )
        assert low < evidence_of_axes(as_configured(drawn), states, forward) < high


def jump(low, high, unit="rad/s"):
    size = Coefficient.known(1e-3, 9e-4, 1.1e-3, unit)
    time = Coefficient.known(0.5 * (low + high), low, high, "s")
    return SimpleNamespace(cause="bias_jump", parameters={"time": time, "x": size, "y": size, "z": size})


def test_two_jumps_of_a_sensor_at_one_time_are_none_and_a_third_one_stays():
    every = jump(154.0, 181.0), jump(166.0, 171.0), jump(181.0, 190.0), jump(300.0, 301.0)
    assert [_overlaps(one, every) for one in every] == [True, True, False, False]


def test_a_knock_that_moves_the_biases_of_both_sensors_at_once_is_believed():
    both = jump(154.0, 158.0), jump(154.0, 158.0, "m/s^2")
    assert not any(_overlaps(one, both) for one in both)
