"""What several tests need of a residual is computed once, and results keep no residual."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from models.noise import NoiseModel, White
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.causes.vibration import Vibration, _largest
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel, relabelled
from tuner.diagnosis.static.model.null_distributions import minimum
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.variance.local_variance import block_variance, local_variance
from tuner.diagnosis.static.variance.quantized_noise import hides_noise, moments
from tuner.jobs import each, limited
from tuner.simulation.static import Channel, simulate


def test_local_variance_is_computed_once_for_a_residual():
    record = simulate({"gyro_x": Channel(NoiseModel((White(1e-3),)))}, duration=60.0, rate=100.0, seed=1)[0][
        0
    ]
    found = fit_channel(channel(record, "gyro_x"))
    assert local_variance(found) is local_variance(found)
    assert block_variance(found) is block_variance(found)
    assert local_variance(relabelled(found, (HeavyTails(6.0),))) is not local_variance(found)


def test_a_residual_goes_from_one_process_to_another():
    """Copies share the samples, and what was computed once stays behind: its functions have no name in a pickle."""
    record = simulate({"gyro_x": Channel(NoiseModel((White(1e-3),)))}, duration=60.0, rate=100.0, seed=1)[0][
        0
    ]
    samples = channel(record, "gyro_x")

    def made(_: int):
        found = fit_channel(samples)
        assert not hides_noise(found)
        return found

    with limited(2):
        here, there = made(0), each(made, [0, 1], shared=[samples])[1]
    assert there.channel is samples
    np.testing.assert_array_equal(there.e, here.e)


def test_moments_between_places_are_on_straight_lines():
    law = moments(0.3)
    mean = np.random.default_rng(2).uniform(-0.4, 0.4, 1000)
    for interpolated, known in zip(law.at(mean), (law.variance, law.scatter), strict=True):
        np.testing.assert_allclose(
            interpolated, np.interp(np.interp(mean, law.mean, law.place), law.place, known)
        )


def test_tails_are_mapped_evenly_and_in_order():
    e = np.linspace(-12.0, 12.0, 4001)
    mapped = HeavyTails(5.0).whiten(e)
    np.testing.assert_allclose(mapped, -mapped[::-1], atol=1e-12)
    assert np.all(np.diff(mapped) > 0.0)
    exact = HeavyTails(5.0)._deviate(np.abs(e))
    np.testing.assert_allclose(np.abs(mapped), exact, atol=1e-5)


def test_a_result_keeps_no_residual():
    assert TestResult("line", 0.1, 1.0, 2.0, "peak", tuple).without_proposal.propose is None


def test_shapes_are_kept_from_step_to_step():
    record = simulate({"gyro_x": Channel(NoiseModel((White(1e-3),)))}, duration=60.0, rate=100.0, seed=1)[0][
        0
    ]
    resonance, other = Vibration(20.0, 30.0, 0.3), Vibration(30.0, 10.0, 0.1)
    first = fit_channel(channel(record, "gyro_x"), (resonance,))
    assert first.peaks is not None
    second = fit_channel(first.channel, (resonance, other), near=first)
    assert second.shapes[resonance] is first.shapes[resonance]
    np.testing.assert_allclose(second.peaks, fit_channel(first.channel, (resonance, other)).peaks)
    f = np.arange(1.0, len(first.coefficients)) / (2.0 * first.channel.span)
    np.testing.assert_allclose(second.peaks, resonance.power(f, 0.01) + other.power(f, 0.01))
    np.testing.assert_allclose(second.power_at(f), second.power)
    assert second.power_at(0.0) == second.power[0]


def test_the_periodogram_is_every_second_ordinate_of_the_finer_spectrum():
    record = simulate({"gyro_x": Channel(NoiseModel((White(1e-3),)))}, duration=60.0, rate=100.0, seed=1)[0][
        0
    ]
    found = fit_channel(channel(record, "gyro_x"))
    e = np.clip(found.e, -5.0, 5.0)
    np.testing.assert_allclose(found.periodogram, np.abs(np.fft.rfft(e)[1:]) ** 2 / np.sum(e * e), atol=1e-5)


@pytest.mark.parametrize(("frequency", "quality"), [(20.0, 30.0), (0.3, 5.0), (48.0, 100.0)])
def test_a_resonance_has_the_spectrum_of_its_recursion(frequency, quality):
    resonance, f = Vibration(frequency, quality, 0.3), np.linspace(0.01, 49.9, 5000)
    np.testing.assert_allclose(
        resonance.power(f, 0.01), resonance.arma(0.01).psd(f, interval=0.01), rtol=1e-9
    )


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [3.0, -2.0, 1.0]])
def test_the_simplex_walks_as_that_of_scipy(start):
    def cost(x):
        return float((1.0 - x[0]) ** 2 + 5.0 * (x[1] - x[0] ** 2) ** 2 + (x[2] - x[1]) ** 2 + 0.1 * abs(x[2]))

    simplex = np.vstack([start, start + 0.3 * np.eye(3)])
    options = {"xatol": 1e-5, "fatol": 1e-5, "initial_simplex": simplex}
    known = minimize(cost, start, method="Nelder-Mead", options=options)
    x, value = minimum(cost, [start])
    np.testing.assert_allclose(x, known.x, atol=1e-9)
    assert value == pytest.approx(known.fun, abs=1e-12)


@pytest.mark.parametrize("number", [1, 8, 50])
def test_the_largest_are_found_in_order(number):
    values = np.random.default_rng(5).standard_normal(50)
    np.testing.assert_array_equal(_largest(values, number), np.argsort(values)[-number:])
