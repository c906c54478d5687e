"""Slower source: one of a lower rate is told by the rows at which its readings change, whatever the quantizer."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis.data_quality import data_quality_tests
from tuner.diagnosis.data_quality.slower_source import find_slower_source
from tuner.diagnosis.static.channel_preparation import prepared_axis
from tuner.types.records import Record

COUNT = 40_000


def record(y: np.ndarray) -> Record:
    return Record("gyro", 0.002 * np.arange(len(y)), y[:, None], ("gyro_x",), "rad/s", 0.002)


def noise(step: float) -> np.ndarray:
    y = np.random.default_rng(6).standard_normal(COUNT)
    return step * np.round(y / step) if step else y


@pytest.mark.parametrize("step", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("ratio", [2.0, 2.5, 4.0, 16.0 / 3.0])
def test_a_slower_source_leaves_its_own_readings(step, ratio):
    """In codes of 0.3 sds one pair in nine is equal by chance, and one in ten of the copies was kept before."""
    source = noise(step)[: int(COUNT / ratio)]
    log = record(source[(np.arange(COUNT) / ratio).astype(int).clip(0, len(source) - 1)])
    (found,) = (
        test for test in data_quality_tests(log) if test.cause == "duplicates" and test.p_value < 1e-6
    )
    assert abs(found.parameters["fraction"].value - (1.0 - 1.0 / ratio)) < 1e-3
    channel = prepared_axis(log, "gyro_x", (found,), 1e-4, 0)
    assert abs(channel.interval / (0.002 * ratio) - 1.0) < 1e-3
    kept = channel.y * channel.scale + channel.level
    assert np.allclose(kept, source[: len(kept)], atol=1e-9)


def test_a_source_of_a_few_readings_is_told_too():
    """Readings of 0.4 s at 500 Hz: 200 alike in a row were named bursts and spikes."""
    log = record(np.repeat(noise(0.0)[:600], 200))
    found = find_slower_source(log)
    assert found is not None
    assert (found.period, found.number) == (200, 1)


@pytest.mark.parametrize("step", [0.0, 0.3, 2.0, 4.0, 7.0])
def test_noise_and_random_repetitions_have_no_pattern(step):
    y, fresh = noise(step), np.random.default_rng(7).random(COUNT) < 0.3
    again = y[np.maximum.accumulate(np.where(fresh, np.arange(COUNT), 0))]
    assert find_slower_source(record(y)) is None
    assert find_slower_source(record(again)) is None


def test_short_holds_are_frozen_together():
    """Twelve holds of 20 samples in codes of 0.3 sds: one alone may be chance."""
    y = noise(0.3)
    for start in range(1000, COUNT, 3300):
        y[start : start + 20] = y[start]
    (found,) = (test for test in data_quality_tests(record(y)) if test.stretches)
    assert len(found.stretches) == 12
