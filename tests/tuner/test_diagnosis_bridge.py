"""Where nothing was measured, templates run as the samples do that were put there."""

from __future__ import annotations

import numpy as np

from tuner.diagnosis.causes import telegraph
from tuner.diagnosis.causes.motion import Motion
from tuner.diagnosis.causes.warmup import Warmup
from tuner.diagnosis.channel import Channel
from tuner.diagnosis.channel import channel as ready
from tuner.diagnosis.residual import residual
from tuner.records import Record

RATE, BLOCKS = 1.0, 4096


def channel(y: np.ndarray) -> Channel:
    record = Record("gyro", np.arange(len(y)) / RATE, y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE)
    return ready(record, "gyro_x")


def noise(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def test_a_transient_that_starts_in_a_motion_leaves_nothing_there():
    # e^6 of the transient are foretold where the record was moved; 4096 means beyond 6 sd: 1e-5
    n = 45 * BLOCKS
    t = np.arange(n) / RATE
    even = channel(noise(n, 5) + 3.0 * np.exp((600.0 - t) / 100.0))
    found = residual(even, (Motion(0, 600), Warmup(100.0)))
    rest = even.block_mean(found.repaired.y) - found.path
    assert np.max(np.abs(rest - rest.mean())) * np.sqrt(even.block) < 6.0
    assert telegraph.test(found).gain < 0.0
