"""A bias that jumps and decays back is told as that, with its numbers; steps and warm-ups keep their names."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.types.records import Record

N, INTERVAL = 40_000, 0.01
T = INTERVAL * np.arange(N)


def record(signal: np.ndarray, seed: int) -> Record:
    y = 1e-3 * (signal + np.random.default_rng(seed).standard_normal(N))
    return Record("gyro", T, y[:, None], ("gyro_x",), "rad/s", INTERVAL)


@pytest.mark.parametrize(("size", "constant"), [(0.8, 5.0), (-2.0, 1.5)])
def test_a_recovery_is_named_with_its_numbers(size, constant):
    """Before, it was told as two to four steps."""
    after = T - 150.0
    signal = np.where(after >= 0.0, size * np.exp(-np.maximum(after, 0.0) / constant), 0.0)
    (found,) = diagnose([record(signal, 3)]).findings
    assert found.cause == "recovery"
    for name, truth in (("time", 150.0), ("size", 1e-3 * size), ("time_constant", constant)):
        low, high = found.parameters[name].interval
        middle = 0.5 * (low + high)
        assert abs(truth - middle) <= high - low  # twice the 95 % interval, four deviations
    assert found.parameters["time"].interval[1] - found.parameters["time"].interval[0] < constant
    assert found.gain is not None
    assert found.gain.nats > 0.0


@pytest.mark.parametrize(
    ("signal", "cause"),
    [(0.2 * (T > 210.0), "step"), (0.8 * np.exp(-T / 25.0), "warmup")],
    ids=["step", "warmup"],
)
def test_what_stays_or_begins_with_the_record_is_no_recovery(signal, cause):
    assert [f.cause for f in diagnose([record(signal, 4)]).findings] == [cause]
