"""What shapes noise without being an effect: filters, short Gauss–Markov processes, rails; and the period of a comb."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, firwin, freqz, lfilter

from tuner.diagnosis import diagnose
from tuner.diagnosis.static.causes.comb import _shortest
from tuner.diagnosis.static.spectrum.filters import MEAN_CUTOFFS, arma_power, filter_arma, filter_power
from tuner.types import Diagnosis
from tuner.types.records import Record

N, INTERVAL, FINER = 40_000, 0.01, 8
BUTTERWORTH = butter(4, 2.0 * 0.06 / FINER)


def diagnosed(y: np.ndarray) -> Diagnosis:
    t = INTERVAL * np.arange(len(y))
    return diagnose([Record("gyro", t, 1e-3 * y[:, None], ("gyro_x",), "rad/s", INTERVAL)])


@pytest.mark.parametrize(
    ("b", "a"),
    [
        pytest.param(np.ones(3 * FINER), [1.0], id="moving mean of three samples"),
        pytest.param(
            np.convolve(np.ones(FINER), np.ones(FINER)),
            [1.0],
            id="two integrators and combs",
            marks=pytest.mark.slow,
        ),
        pytest.param(*BUTTERWORTH, id="Butterworth of order 4, 72 dB deep"),
    ],
)
def test_a_real_filter_is_a_lowpass_and_leaves_nothing(b, a):
    """Before, nulls and stop bands were named vibration, spikes or bursts, or left unexplained."""
    w = lfilter(b, a, np.random.default_rng(8).standard_normal(FINER * N))[::FINER]
    found = diagnosed(w / w.std())
    assert [f.cause for f in found.findings] == ["lowpass"]
    assert not found.unexplained


def test_a_windowed_sinc_is_a_lowpass_with_its_cutoff():
    """Before, its edge and its stop band were three resonances, and 3900 nats were left unexplained."""
    sinc = firwin(241, 2.0 * 0.24 / FINER)
    w = lfilter(sinc, [1.0], np.random.default_rng(9).standard_normal(FINER * N))[::FINER]
    found = diagnosed(w / w.std())
    assert [f.cause for f in found.findings] == ["lowpass"]
    assert not found.unexplained
    f, h = freqz(sinc, worN=4000, fs=FINER / INTERVAL)
    half = float(f[np.argmax(np.abs(h) ** 2 < 0.5)])
    cutoff = found.findings[0].parameters["cutoff"]
    assert cutoff.value == pytest.approx(half, abs=0.38)  # a bin of the spectrum
    assert cutoff.interval[0] < half < cutoff.interval[1]


def resampled(x: np.ndarray, ratio: float, half: int) -> np.ndarray:
    """Samples at a rate `ratio` times higher, by a windowed sinc of so many samples on either side."""
    n = int((len(x) - 2 * half) * ratio)
    place = np.arange(n) / ratio + half
    off = place[:, None] - (place.astype(int)[:, None] + np.arange(1 - half, half + 1))
    weights = np.sinc(off) * np.cos(0.5 * np.pi * off / half) ** 2
    return np.sum(weights * x[place.astype(int)[:, None] + np.arange(1 - half, half + 1)], axis=1)


def test_resampled_noise_is_a_lowpass_alone():
    """Before, the images beyond the edge, which swing with the clock of the resampler, were a periodic variance."""
    found = diagnosed(resampled(np.random.default_rng(2).standard_normal(9000), 2.23, 6))
    assert [f.cause for f in found.findings] == ["lowpass"]
    assert not found.unexplained


def test_a_stop_band_without_noise_leaves_nothing():
    """Order 8 at 0.35 of the rate: before, the ends of the record were spikes, bursts and heavy tails in it."""
    noise = np.random.default_rng(12).standard_normal(22_000)
    found = diagnosed(lfilter(*butter(8, 0.7), noise)[2000:])
    assert [f.cause for f in found.findings] == ["lowpass"]
    assert not found.unexplained


def test_a_burst_behind_a_sharp_filter_has_its_ratio():
    """Only what passes the filter shows it."""
    noise = np.random.default_rng(3).standard_normal(9000)
    noise[4000:4400] *= 2.0
    found = diagnosed(resampled(noise, 2.23, 6))
    assert sorted(f.cause for f in found.findings) == ["burst", "lowpass"]
    (burst,) = (f for f in found.findings if f.cause == "burst")
    low, high = burst.parameters["variance_ratio"].interval
    assert low < 4.0 < high
    assert burst.parameters["start"].value == pytest.approx(4000 * 2.23 * INTERVAL, abs=1.0)


@pytest.mark.parametrize(("order", "width"), [(1, 3.0), (2, 1.7), (4, 1.2)])
def test_moving_means_have_the_power_of_their_covariance(order, width):
    """That of means of white noise at 40 times the rate, folded; its ARMA has the same."""
    cycles = np.linspace(0.01, 0.45, 30)
    cutoff, name = MEAN_CUTOFFS[order] / width, f"mean{order}"
    k = np.arange(-2000, 2001)[:, None]
    folded = np.sum(np.sinc(width * (cycles + k)) ** (2 * order), axis=0)
    middle = float(np.sum(np.sinc(width * k) ** (2 * order)))
    np.testing.assert_allclose(filter_power(name, cutoff, cycles), folded / middle, rtol=2e-3, atol=2e-6)
    factor = arma_power(*filter_arma(name, cutoff), np.append(0.0, cycles))
    np.testing.assert_allclose(factor[1:] / factor[0], folded / middle, rtol=5e-3, atol=2e-6)


def test_a_short_gauss_markov_process_is_noise():
    """Of 30 samples: before, it left a misfit of the slow spectrum."""
    rng, memory = np.random.default_rng(6), np.exp(-1.0 / 30.0)
    slow = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(N))
    assert diagnosed(0.5 * slow + rng.standard_normal(N)).quiet


def test_a_rail_makes_no_skewed_noise():
    y = np.minimum(np.random.default_rng(7).standard_normal(N), 2.2)
    assert [f.cause for f in diagnosed(y).findings] == ["clipping"]


@pytest.mark.parametrize("seed", range(5))
def test_a_comb_has_the_shortest_of_its_periods(seed):
    """What repeats at 111 samples does so at 333; before, half and a third of the spacing were told."""
    e = np.random.default_rng(seed).standard_normal(N) + 1.5 * (np.arange(N) % 111 == 40)
    assert _shortest(e, 333.0) == _shortest(e, 111.0) == 111.0


def test_glitches_that_decay_are_told_with_their_place():
    """Eight of 16 nats each; before, they were telegraph noise."""
    rng, memory = np.random.default_rng(11), np.exp(-1.0 / 20.0)
    at = rng.choice(N, 8, replace=False)
    pulses = lfilter([5.7 * np.sqrt(1.0 - memory**2)], [1.0, -memory], np.bincount(at, minlength=N))
    diagnosis = diagnosed(pulses + rng.standard_normal(N))
    assert not diagnosis.findings
    (left,) = diagnosis.unexplained
    assert left.statistic == "short transients that jump and decay"
    assert left.nats > 30.0  # 8 (16 − ln(n/T)) on average
    assert np.abs(at / 100.0 - float(left.place.split()[-2])).min() < 0.1


@pytest.mark.parametrize(("period", "height"), [(133.742, 6.0), (24.487, 1.6)])
def test_a_strong_comb_is_nothing_else(period, height):
    """Before, spikes, or six lines and more."""
    y = np.random.default_rng(8).standard_normal(N)
    y[(np.arange(N) + 7.3) % period < 1.0] += height
    assert [f.cause for f in diagnosed(y).findings] == ["comb"]
