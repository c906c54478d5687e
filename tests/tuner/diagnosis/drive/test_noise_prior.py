"""Uncertainty of a static identification as standard deviations of logarithms."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis.drive.linear_model.noise_prior import DATASHEET_LOG_SD, UNKNOWN_LOG_SD, static_prior
from tuner.types import ChannelNoise, Coefficient, TermEstimate


def channel(axis: str, *estimates: TermEstimate) -> ChannelNoise:
    return ChannelNoise(axis, "rad/s", 1e-4, (), 0.0, 1e-3, identified=estimates)


def known(name: str, coefficient: str, sd: float) -> TermEstimate:
    spread = float(np.exp(1.96 * sd))
    return TermEstimate(name, {coefficient: Coefficient.known(1.0, 1.0 / spread, spread, "1")})


def test_intervals_become_sds_of_logs() -> None:
    prior = static_prior(
        {
            "gyro_x": channel(
                "gyro_x", known("white", "density", 0.03), known("bias_instability", "level", 0.2)
            ),
            "gyro_y": channel(
                "gyro_y", known("white", "density", 0.04), known("random_walk", "density", 0.2)
            ),
        }
    )
    assert prior["gyro_white"] == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2.0))
    assert prior["gyro_bias"] == pytest.approx(0.2)
    assert "accel_white" not in prior


def test_white_noise_is_taken_at_its_word_the_rest_is_vague() -> None:
    bounded = TermEstimate("white", {"density": Coefficient.bounded(2.0, "1", "short")})
    prior = TermEstimate("white", {"density": Coefficient(1.0, None, None, "1")})
    level = TermEstimate("bias_instability", {"level": Coefficient(1.0, None, None, "1")})
    assert static_prior({"accel_x": channel("accel_x", bounded)})["accel_white"] == UNKNOWN_LOG_SD
    of_sheet = static_prior({"accel_x": channel("accel_x", prior, level)})
    assert of_sheet == {"accel_white": DATASHEET_LOG_SD, "accel_bias": UNKNOWN_LOG_SD}
