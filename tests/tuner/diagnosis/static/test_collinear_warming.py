"""A drift that comes with an even warming is a finding: it was taken for noise, and a log of it had none."""

from dataclasses import replace

import numpy as np
import pytest

from models.units import to_si
from tuner.catalogue.grades import load_grade
from tuner.diagnosis.static.diagnose import diagnose
from tuner.simulation.static import Channel, simulate

DRIFT, WARMTH = to_si(270.0, "deg/h"), 15.0


def _log(seed, drift, warmth):
    """Return 240 s of two gyros of an MPU-9250, the first of which drifts."""
    axis = Channel(load_grade("mpu9250").gyro.noise_model(), 1e-3)
    (gyro,), _ = simulate({"gyro_x": axis, "gyro_y": axis}, duration=240.0, rate=50.0, seed=seed)
    share, y = gyro.t / gyro.t[-1], gyro.y.copy()
    y[:, 0] += drift * share
    rng = np.random.default_rng(seed)
    celsius = 25.0 + warmth * share + 0.02 * rng.standard_normal(len(share))
    return replace(gyro, y=y, covariates={"temperature": celsius})


@pytest.mark.parametrize("seed", [1, 2])
def test_a_drift_beside_an_even_warming_is_temperature_or_warm_up(seed):
    found = diagnose(_log(seed, DRIFT, WARMTH))
    (one,) = found.findings
    assert (one.cause, one.channels) == ("temperature", ("gyro_x",))
    assert [other.cause for other in one.alternatives] == ["warmup"]
    # The drift of a line through flicker of 22.6 deg/h has an sd of 40 deg/h over the log: five of them.
    slope = one.parameters["slope"]
    assert slope.value * WARMTH == pytest.approx(DRIFT, abs=5.0 * to_si(40.0, "deg/h"))
    assert slope.interval[0] < slope.value < slope.interval[1]
    assert "over the log" in one.text


@pytest.mark.parametrize(("drift", "warmth"), [(0.0, WARMTH), (DRIFT, 0.0)])
def test_warming_without_drift_and_drift_without_warming_are_none(drift, warmth):
    assert not [one for one in diagnose(_log(3, drift, warmth)).findings if one.cause == "temperature"]
