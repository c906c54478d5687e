"""What a configuration states of the noise that a drive is compared with."""

from __future__ import annotations

import math

import pytest

from models.noise import GaussMarkov
from tuner.diagnosis.drive.noise_scale_estimates import bias_driving_density
from tuner.types.config import ChannelNoise


def test_bias_states_are_driven_by_the_root_of_the_sum_of_squares():
    """K of a random walk, and σ √(2/T) of each Gauss–Markov state."""
    states = (GaussMarkov(2e-5, 100.0), GaussMarkov(1e-5, 3.0))
    axis = ChannelNoise("gyro_x", "rad/s", 1e-4, states, random_walk_density=3e-6, constant_sd=1e-3)
    expected = math.sqrt((3e-6) ** 2 + (2e-5) ** 2 * 2.0 / 100.0 + (1e-5) ** 2 * 2.0 / 3.0)
    assert bias_driving_density(axis) == pytest.approx(expected)
    still = ChannelNoise("gyro_x", "rad/s", 1e-4, (), random_walk_density=3e-6, constant_sd=1e-3)
    assert bias_driving_density(still) == pytest.approx(3e-6)
