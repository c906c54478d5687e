"""What a named cause predicts is looked for in all parts of the innovations; else something else is named."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import exp, factorial, log
from types import SimpleNamespace

import numpy as np
import pytest

from tests.tuner.diagnosis.drive.replicas import Source
from tuner.diagnosis.drive.linear_model.likelihood import as_configured
from tuner.diagnosis.drive.linear_model.whitened_innovations import whiten
from tuner.diagnosis.drive.noise_by_parts import (
    densities_by_parts,
    dirichlet_evidence,
    integrated,
    variances_by_parts,
)
from tuner.diagnosis.drive.parts_of_innovations import divisions
from tuner.diagnosis.drive.posterior_check import _amplitudes
from tuner.types import Parameter

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
