"""False-alarm rate and power of searches of the spectrum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import rfft

from tuner.diagnosis.static import hypothesis_tests, residual_checks
from tuner.diagnosis.static.causes.line import Line, _chance
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.diagnosis.static.spectrum.binned import Bins, rise, sized
from tuner.diagnosis.static.spectrum.filters import arma_power
from tuner.types.records import Record


def height(cycles: float, n: int) -> float:
    """Return the statistic of a line, 2 sd large, of so many cycles a record of n samples."""
    rng, phase = np.random.default_rng(4), 2.0 * np.pi * cycles * np.arange(n) / n
    y = rng.standard_normal((n, 1)) + 2.0 * np.cos(phase)[:, None]
    record = Record("gyro", 0.01 * np.arange(n), y, ("gyro_x",), "rad/s", 0.01)
    return Line.test(fit_channel(channel(record, "gyro_x"))).statistic


def test_a_line_between_half_bins_is_as_high_as_one_on_them():
    """Of 32 768 nats each, known to 1 %; a quarter bin off, the nearest half bin shows 81 % of it."""
    n = 32_768
    assert height(5000.25, n) == pytest.approx(height(5000.0, n), rel=0.06)


def test_the_chance_of_a_peak_is_that_of_the_highest_at_any_frequency():
    """Rice's bound, over 2000 periodograms sixteen times finer than bins, to five sd and the local level's 10 %."""
    n, number = 512, 2000
    x = np.random.default_rng(7).standard_normal((number, n))
    power = np.abs(rfft(x, 16 * n, axis=1)[:, 16:-16]) ** 2 / n
    few = sum(_chance(float(h), n) < 0.05 for h in power.max(axis=1)) / number
    assert 0.02 < few < 0.075


def test_slow_noise_does_not_stand_in_for_a_filter():
    """White noise whose neighbours are correlated by φ gains nφ²/2 nats, however slow noise of no account is sized."""
    number, phi, n = 128, 0.01, 360_000
    cycles = 0.01 + 0.49 * (np.arange(number) + 0.5) / number
    count = np.full(number, n / number)
    seen = arma_power((phi,), (), cycles)
    data = Bins(1.0, cycles, seen, count, np.ones(number), 1e-5 / cycles, np.zeros(number), 0.0, seen)

    def cost(shape: np.ndarray) -> float:
        return sized(data, np.stack((data.white * shape, data.rest, rise(cycles)))).cost

    assert cost(np.ones(number)) - cost(seen) == pytest.approx(0.5 * n * phi**2, rel=0.1)


def test_the_power_of_a_resonance_is_that_of_its_recursion_however_sharp():
    f = np.linspace(0.1, 49.9, 500)
    for quality in (3.0, 30.0, 300.0):
        resonance = Vibration(17.0, quality, 0.3)
        np.testing.assert_allclose(
            resonance.power(f, 0.01), resonance.arma(0.01).psd(f, interval=0.01), rtol=1e-9
        )
    assert 0.0 < Vibration(17.0, 1e8, 0.3).power(np.array([17.0]), 0.01)[0] < np.inf


OF_ACCEPTED = ("beside lines", "course", "times of spikes")
"""Checks of causes that were accepted, which white noise has none of."""


def test_all_tests_share_the_budget() -> None:
    limit = hypothesis_tests.threshold(3)
    by_cause = [c.shares * c.tests for c in CAUSES.values() if c.tested_with is None]
    assert 3 * limit * (sum(by_cause) + hypothesis_tests.TESTS_WITHOUT_CAUSE) == pytest.approx(
        hypothesis_tests.FALSE_ALARM_BUDGET
    )
    y = np.random.default_rng(4).standard_normal((20_000, 1))
    white = Record("gyro", 0.01 * np.arange(len(y)), y, ("gyro_x",), "rad/s", 0.01)
    fitted = fit_channel(channel(white, "gyro_x"))
    results = (*hypothesis_tests.hypothesis_tests(fitted), *residual_checks.checks(fitted))
    without = {result.cause for result in results if result.cause not in CAUSES}
    assert len(without) + len(("pair", *OF_ACCEPTED)) == hypothesis_tests.TESTS_WITHOUT_CAUSE
