"""Large changes of the mean, coarse codes, late events: told by their own name alone, with gains of the right sign."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.types import Diagnosis
from tuner.types.records import Record

RATE, COUNT = 50.0, 24_000
T = np.arange(COUNT) / RATE
SPAN = COUNT / RATE


def found(y: np.ndarray) -> Diagnosis:
    return diagnose(Record("gyro", T, 1e-3 * y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE))


def noise(seed: int) -> np.ndarray:
    rng = np.random.default_rng([18, seed])
    return rng.standard_normal(COUNT) + 1e-3 * np.cumsum(rng.standard_normal(COUNT))


@pytest.mark.parametrize("size", [-250.0])
def test_step_far_above_the_noise_is_one_finding(size):
    diagnosis = found(noise(1) + size * (T >= 180.0))
    assert [f.cause for f in diagnosis.findings] == ["step"]
    assert not diagnosis.unexplained
    told = diagnosis.findings[0].parameters
    assert told["time"].value == pytest.approx(180.0, abs=2.0 / RATE)
    assert told["size"].value == pytest.approx(1e-3 * size, abs=1e-3)


def test_warm_up_far_above_the_noise_is_no_motion():
    diagnosis = found(noise(2) + 400.0 * np.exp(-T / 40.0))
    assert [f.cause for f in diagnosis.findings] == ["warmup"]
    assert not diagnosis.unexplained


@pytest.mark.parametrize(("ratio", "place"), [pytest.param(3.5, 0.1, marks=pytest.mark.slow), (5.5, 0.0)])
def test_quantizer_that_hides_the_noise_is_told_alone(ratio, place):
    """At 5.5 sds and a mean on a code, 1 in 170 samples has another one."""
    y = noise(3)
    diagnosis = found(ratio * np.round((y - y.mean()) / ratio + place) + 7.0 * ratio)
    assert [f.cause for f in diagnosis.findings] == ["lattice"]
    assert not diagnosis.unexplained


@pytest.mark.parametrize("share", [0.61])
def test_gain_of_a_late_step_is_positive(share):
    diagnosis = found(noise(4) + 3.0 * (share * SPAN <= T))
    assert [f.cause for f in diagnosis.findings] == ["step"]
    assert diagnosis.findings[0].gain.nats > 0.0


def test_gain_of_a_burst_over_the_cut_is_positive():
    diagnosis = found(noise(5) * np.where(np.abs(T - 0.6 * SPAN) < 30.0, 1.4, 1.0))
    assert [f.cause for f in diagnosis.findings] == ["burst"]
    assert diagnosis.findings[0].gain.nats > 0.0


@pytest.mark.slow
def test_gain_of_telegraph_noise_beside_a_slope_is_positive():
    rng = np.random.default_rng(6)
    path = np.searchsorted(np.cumsum(rng.exponential(20.0, 400)), T) % 2
    white = rng.standard_normal(COUNT)
    diagnosis = found(white + 0.8 * path + 4.0 * T / SPAN)
    assert [f.cause for f in diagnosis.findings] == ["telegraph"]
    assert diagnosis.findings[0].gain.nats > 0.0
