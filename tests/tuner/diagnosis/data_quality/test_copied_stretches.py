"""A stretch that stands in a log twice is found to the sample; noise, frozen readings and coarse codes are none."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis.data_quality import packets
from tuner.diagnosis.data_quality.copied_stretches import find_copied_stretches
from tuner.types.records import Record

COUNT = 30_000


def white(seed: int, axes: int = 2) -> np.ndarray:
    return np.random.default_rng([83, seed]).standard_normal((COUNT, axes))


@pytest.mark.parametrize("step", [0.0, 0.3])
@pytest.mark.parametrize("lag", [700, 9000])
def test_a_buffer_written_twice_is_found_to_the_sample(step, lag):
    y = white(1)
    y = step * np.round(y / step) if step else y
    y[15_000:15_700] = y[15_000 - lag : 15_700 - lag]
    found = find_copied_stretches(y)
    assert (found.number, found.length) == (1, 700)
    assert np.array_equal(np.flatnonzero(found.copies), np.arange(15_000, 15_700))
    assert found.p_value < 1e-9
    record = Record("gyro", 0.01 * np.arange(COUNT), y, ("gyro_x", "gyro_y"), "rad/s", 0.01)
    (test,) = packets(record)
    assert (test.cause, test.stretches) == ("repeated_packets", ((15_000, 15_700),))


def test_nothing_else_is_a_copy():
    """Noise, one axis of two, a frozen reading, and codes of which one holds nearly all samples."""
    one, frozen = white(2), white(3)
    one[20_000:20_700, 0] = one[10_000:10_700, 0]
    frozen[5000:6000] = frozen[5000]
    frozen[7000:8000] = frozen[5000]
    for y in (white(4), one, frozen, np.round(0.3 * white(5)), np.round(0.1 * white(6, 1))):
        assert find_copied_stretches(y).number == 0
