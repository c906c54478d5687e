"""Variance of quantized samples as a function of their place within a quantizer step."""

from __future__ import annotations

import numpy as np
import pytest

from models.noise import BiasInstability, NoiseModel, RandomWalk, White
from tuner.diagnosis.data_quality import data_quality_tests
from tuner.diagnosis.static.channel_preparation import prepared
from tuner.diagnosis.static.hypothesis_tests import hypothesis_tests, threshold
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.variance.local_variance import block_variance
from tuner.diagnosis.static.variance.quantized_noise import cell_moments, moments
from tuner.simulation.static import Channel, simulate

NOISE = NoiseModel((White(1e-3), BiasInstability(1.5e-4), RandomWalk(2e-6)))
RATE, WHITE = 50.0, 1e-3 * np.sqrt(50.0)


def fitted(step: float, deadband: float = 0.0, seed: int = 1, ramp: float = 3.0):
    """Return the residual of 2400 s whose mean runs over `ramp` steps; step in white sd, dead band in steps."""
    record = simulate({"gyro_x": Channel(NOISE)}, duration=2400.0, rate=RATE, seed=seed)[0][0]
    size = step * WHITE
    y = record.y - np.median(record.y) + size * np.linspace(-0.3, ramp, len(record))[:, None]
    y = size * np.round(y / size)
    y[np.abs(y) < deadband * size] = 0.0
    object.__setattr__(record, "y", y)
    return fit_channel(prepared(record, data_quality_tests(record), threshold(1), 0, [])[0])


@pytest.mark.parametrize(("sd", "deadband"), [(0.3, 0.0), (0.5, 0.0), (1.0, 0.0), (0.6, 1.0), (1.2, 2.5)])
def test_moments_are_those_of_rounded_numbers(sd, deadband):
    x = np.random.default_rng(4).standard_normal(400_000)
    law = moments(sd, deadband)
    for place in (-2.3, -0.5, 0.0, 0.2, 0.5, 1.4):
        code = np.round(place + sd * x)
        code[np.abs(place + sd * x) < deadband] = 0.0
        variance, scatter = law.at(np.array([code.mean()]))
        away = (code - code.mean()) ** 2
        assert abs(variance[0] - away.mean()) < 6.0 * away.std() / np.sqrt(len(x)) + 0.02 * sd**2
        if away.mean() > 0.05 * sd**2:
            assert abs((scatter[0] + 1.0) * away.mean() ** 2 / np.mean(away**2) - 1.0) < 0.1


def test_fine_steps_do_not_matter():
    law = moments(1.0)
    assert np.ptp(law.variance) < 1e-6
    assert abs(law.variance.mean() - 1.0 - 1.0 / 12.0) < 1e-6
    assert cell_moments(fitted(0.5)) is None


@pytest.mark.parametrize(("step", "deadband"), [(1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (0.8, 1.5)])
def test_a_slow_track_on_a_coarse_quantizer_makes_no_burst(step, deadband):  # five families at 1.2e-4 each
    found = fitted(step, deadband)
    results = {result.cause: result for result in hypothesis_tests(found)}
    for family in ("burst", "variance_drift", "periodic variance", "variance by bias", "irregular variance"):
        assert results[family].p_value > threshold(1), family


def test_local_variance_beside_a_quantizer_is_even_in_every_place():
    found = fitted(3.0)
    square, weight, kappa = block_variance(found)
    deviate = (square - 1.0) * np.sqrt(weight / kappa)
    assert np.mean(deviate**2) < 1.0 + 6.0 * np.sqrt(2.0 / len(deviate))


def test_a_burst_on_a_coarse_quantizer_is_still_found():  # 30 % of the record, variance × 2: hundreds of nats
    record = simulate({"gyro_x": Channel(NOISE)}, duration=2400.0, rate=RATE, seed=2,
                      effects=("burst:start=600,duration=700,variance_ratio=2",))[0][0]  # fmt: skip
    size = 2.5 * WHITE
    object.__setattr__(record, "y", size * np.round(record.y / size))
    found = fit_channel(prepared(record, data_quality_tests(record), threshold(1), 0, [])[0])
    result = next(result for result in hypothesis_tests(found) if result.cause == "burst")
    assert result.p_value < 1e-12
    (burst,) = result.propose()
    assert abs(burst.values["start"].value - 600.0) < 30.0
