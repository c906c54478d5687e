"""A sinusoid whose frequency sweeps is reported; white noise, lines and bursts are not taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.chirp import Sweep, _sums
from tuner.diagnosis.static.channel import channel
from tuner.diagnosis.static.model.fitted_channel import fit_channel
from tuner.types.records import Record

N, RATE = 65536, 50.0


def record(y: np.ndarray) -> Record:
    return Record("gyro", np.arange(len(y)) / RATE, y[:, None], ("gyro_x",), "rad/s", 1.0 / RATE)


def tone(low: float, high: float, nats: float) -> np.ndarray:
    """A tone between two frequencies, cycles a sample, of amplitude √(4 nats/n)."""
    t = np.arange(N)
    return np.sqrt(4.0 * nats / N) * np.cos(2.0 * np.pi * (low * t + 0.5 * (high - low) * t * t / N))


# 400 nats: the sum over 512 parts exceeds its expectation by more than 12 deviations, 7 suffice; the others need fewer
@pytest.mark.parametrize("ends", [(0.05, 0.3), (0.3, 0.05), (0.2, 0.25), (0.1, 0.11)])
def test_a_sweep_is_reported_with_its_first_and_last_frequency(ends):
    y = np.random.default_rng(1).standard_normal(N) + tone(*ends, 400.0)
    diagnosis = diagnose(record(y))
    assert not diagnosis.findings
    (unexplained_result,) = diagnosis.unexplained
    words = unexplained_result.statistic.split()
    assert words[:4] == ["a", "tone", "that", "sweeps"]
    assert np.allclose([float(words[5]), float(words[7])], np.array(ends) * RATE, atol=0.01 * RATE)


def test_chance_is_a_bound_on_white_noise():
    # 30 records: below 0.01 more than 5 times has a chance below 1e-6
    rng = np.random.default_rng(2)
    low = 0
    for _ in range(30):
        e = rng.standard_normal(N // 4).astype(np.float32)
        low += Sweep.test(fit_channel(channel(record(e.astype(float)), "gyro_x"))).p_value < 0.01
    assert low <= 5


def test_line_and_burst_are_no_sweep():
    # neither moves: the means of the parts and of the frequencies take them out; p < 1e-4 by chance
    rng = np.random.default_rng(3)
    y = rng.standard_normal(N) * np.where(np.arange(N) // 4096 == 5, 3.0, 1.0)
    y += 0.1 * np.cos(2.0 * np.pi * 0.123 * np.arange(N))
    assert Sweep.test(fit_channel(channel(record(y), "gyro_x"))).p_value > 1e-4


@pytest.mark.parametrize(("quality", "drift"), [(20.0, 0.0), (20.0, 0.04), (100.0, 0.04)])
def test_a_resonance_is_no_tone_nor_where_it_drifts(quality, drift):
    # a pole beside white noise, whose frequency falls by up to a fifth: its tracks lie side by side
    rng = np.random.default_rng(5)
    middle = 0.2 - drift * np.arange(N) / N
    drive = rng.standard_normal(N) + 1j * rng.standard_normal(N)
    decay = np.exp(-np.pi * 0.2 / quality)
    pole, state = np.empty(N), 0.0j
    for i, turn in enumerate(decay * np.exp(2j * np.pi * middle)):
        state = turn * state + drive[i]
        pole[i] = state.real
    y = rng.standard_normal(N) + np.sqrt(2.0) * (1.0 - decay) * pole
    result = Sweep.test(fit_channel(channel(record(y), "gyro_x")))
    assert result.p_value > 1e-4


def test_sums_run_along_straight_tracks():
    power = np.zeros((8, 40), dtype=np.float32)
    for k in range(8):
        power[k, 10 + round(5 * k / 7)] = 1.0
    sums = _sums(power)
    assert np.isclose(sums[5, 10], 8.0)
    assert np.isclose(sums.max(), 8.0)
    assert np.isclose(sums[0, 10], power[:, 10].sum())
