"""Straight lines between samples of a rate less than twice as low are recognised by their inputs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tuner.diagnosis import diagnose
from tuner.diagnosis.data_quality.resampled import find_resampled
from tuner.types.records import Record

COUNT = 20_000


def white(seed: int) -> np.ndarray:
    return np.random.default_rng([82, seed]).standard_normal(COUNT)


@pytest.mark.parametrize("ratio", [1.12, 4.0 / 3.0, 1.5, np.sqrt(3.0), 1.95])
@pytest.mark.parametrize("step", [0.0, 0.3])
def test_a_lower_rate_is_found_with_its_ratio(ratio, step):
    y = np.interp(np.arange(COUNT) / ratio + 0.3, np.arange(COUNT), white(1))
    found = find_resampled([step * np.round(y / step) if step else y])
    assert found.p_value < 1e-12
    assert found.share == pytest.approx(1.0 - 1.0 / ratio, abs=1e-4)


def test_other_noise_is_not_resampled():
    """White, smooth, of a variance with a clock, and constant but for one sample."""
    pulse = np.exp(np.cos(2.0 * np.pi * 0.3 * np.arange(COUNT)))
    single = 1.0 * (np.arange(COUNT) == 500)
    for y in (
        white(2),
        lfilter([1.0], [1.0, -1.8, 0.85], white(3)),
        white(4) * pulse,
        single,
        white(5).round(),
    ):
        assert find_resampled([y]).p_value == 1.0


def test_a_log_of_a_lower_rate_has_that_name_alone():
    """A low-pass filter was named, and noise in step with a clock."""
    y = 1e-3 * np.interp(np.arange(COUNT) / 1.4, np.arange(COUNT), white(6))
    found = diagnose(Record("gyro", 0.01 * np.arange(COUNT), y[:, None], ("gyro_x",), "rad/s", 0.01))
    assert [one.cause for one in found.findings] == ["interpolated"]
    assert not found.unexplained
