"""Gyro biases at rest are those of seconds in which the unit does not turn."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.navigation.data import Steps
from tuner.navigation.drive.steady_rest import steady_steps

COUNT, INTERVAL = 2000, 0.01


def resting(seed, turning=slice(0, 0), noise=0.01):
    rates = 0.01 + noise * np.random.default_rng(seed).standard_normal((COUNT, 6))
    rates[turning, 2] += 0.5
    return Steps(0.0, np.full(COUNT, INTERVAL), INTERVAL * rates)


def test_turning_on_the_spot_is_no_bias():
    """Five of twenty seconds turn at 0.5 rad/s, 0.125 rad/s in the mean of all; the noise of the mean is 3e-4."""
    steps = resting(2, slice(800, 1300))
    kept = steady_steps(steps, slice(0, COUNT))
    assert len(kept) == pytest.approx(1100, abs=100)
    found = steps.increments[kept, :3].sum(axis=0) / steps.dt[kept].sum()
    assert found == pytest.approx(np.full(3, 0.01), abs=2e-3)


@pytest.mark.parametrize("noise", [1e-3, 0.5])
def test_a_unit_that_rests_keeps_all_its_samples_however_it_shakes(noise):
    assert len(steady_steps(resting(3, noise=noise), slice(0, COUNT))) == COUNT
