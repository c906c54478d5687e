"""Packets that come twice and samples on lines between others are found; noise through any quantizer is neither."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.diagnosis.data_quality.copied_samples import find_lines, find_packets
from tuner.types.records import Record

COUNT = 20_000


def white(seed: int, n: int = COUNT) -> np.ndarray:
    return np.random.default_rng([81, seed]).standard_normal(n)


@pytest.mark.parametrize("step", [0.0, 0.3])
def test_packets_are_found_sample_by_sample(step):
    """Through a quantizer the sample beside a packet equals the one before by chance, one of nine."""
    y = white(1)
    y = step * np.round(y / step) if step else y
    copies = np.zeros(COUNT, dtype=bool)
    for at in (1200, 5004, 9000, 9036, 15_000):
        y[at : at + 12] = y[at - 12 : at]
        copies[at : at + 12] = True
    found = find_packets(y[:, None])
    assert (found.length, found.number) == (12, 5)
    assert found.p_value < 1e-12
    assert np.count_nonzero(found.copies != copies) <= (8 if step else 0)


@pytest.mark.parametrize("step", [0.01, 0.5, 3.0])
def test_quantized_and_coloured_noise_has_neither(step):
    """One of sixteen tests is below 1e-4 with a chance of 2e-3."""
    for y in (white(2), np.convolve(white(3, COUNT + 7), np.ones(8) / np.sqrt(8.0), "valid")):
        codes = step * np.round(y / step)
        assert find_packets(codes[:, None]).p_value > 1e-4
        assert find_lines((codes,), step).p_value > 1e-4


def test_axes_mixed_after_the_quantizer_are_no_lines():
    """A calibration turns three quantized axes a little, and the text has four digits: no step is left to see."""
    codes = np.round(np.stack([0.7 * white(seed) for seed in (5, 6, 7)], axis=1))
    turned = np.round(
        0.0077 * codes @ (np.eye(3) + 0.003 * np.array([[0, 1, -2], [-1, 0, 1], [2, -1, 0]])), 4
    )
    for y in turned.T:
        assert find_lines((y,), 0.0).p_value > 1e-3


@pytest.mark.parametrize("ratio", [2.0, *(pytest.param(r, marks=pytest.mark.slow) for r in (3.0, 4.0))])
def test_interpolated_samples_have_that_name_alone(ratio):
    """Of a ratio r between two rates the share 1 − 1/r lies on lines."""
    y = np.interp(np.arange(COUNT) / ratio, np.arange(COUNT), white(4))
    record = Record("gyro", 0.01 * np.arange(COUNT), 1e-3 * y[:, None], ("gyro_x",), "rad/s", 0.01)
    (finding,) = diagnose(record).findings
    assert finding.cause == "interpolated"
    assert finding.parameters["fraction"].value == pytest.approx(1.0 - 1.0 / ratio, abs=1e-3)
