"""Which part of a record noise terms describe: all of it wherever a sum of terms made it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from tuner.identification.identify_channel import choose_terms

INTERVAL = 0.01
SAMPLES = 60_000


def white_and_gauss_markov(samples: float, ratio: float, seed: int) -> np.ndarray:
    """Return white noise of density 1 and a process of so many samples, `ratio` times it at low frequencies."""
    rng = np.random.default_rng(seed)
    memory = np.exp(-1.0 / samples)
    sd = ratio / np.sqrt(2.0 * samples * INTERVAL)
    driving = rng.standard_normal(SAMPLES) * sd * np.sqrt(1.0 - memory**2)
    driving[0] /= np.sqrt(1.0 - memory**2)
    return lfilter([1.0], [1.0, -memory], driving) + rng.standard_normal(SAMPLES) / np.sqrt(INTERVAL)


@pytest.mark.parametrize("samples", [60, 140, 250])
@pytest.mark.parametrize("ratio", [5.0, 40.0])
def test_a_short_gauss_markov_process_is_not_taken_for_white_noise(samples: int, ratio: float) -> None:
    noise = choose_terms([white_and_gauss_markov(samples, ratio, seed=samples)], INTERVAL)
    found = {term.name: term for term in noise.fit.model.terms}
    assert noise.band.m == 1
    # six standard deviations of the density are some 2 % with 60 000 samples; before, it was up to 40 times too large
    assert found["white"].density == pytest.approx(1.0, rel=0.03)
    assert found["gauss_markov"].time_constant == pytest.approx(samples * INTERVAL, rel=0.3)


@pytest.mark.parametrize("corner", [2.0, 5.0, 12.0])
def test_samples_behind_a_low_pass_filter_are_left_out(corner: float) -> None:
    """White noise behind a first-order filter of `corner` samples keeps its density at long cluster times only."""
    rng = np.random.default_rng(int(corner))
    memory = np.exp(-1.0 / corner)
    y = lfilter([1.0 - memory], [1.0, -memory], rng.standard_normal(SAMPLES)) / np.sqrt(INTERVAL)
    noise = choose_terms([y], INTERVAL)
    assert noise.band.m > corner
    assert noise.fit.value("white.density") == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_process_shorter_than_a_sample_is_white_noise_of_its_density(seed: int) -> None:
    """T = 0.46 dt: φ = e^(−dt/T), and the density of the samples is σ² dt (1 + φ)/(1 − φ)."""
    rng = np.random.default_rng(seed)
    memory = np.exp(-1.0 / 0.46)
    driving = rng.standard_normal(1400) * np.sqrt(1.0 - memory**2)
    y = lfilter([1.0], [1.0, -memory], driving)
    noise = choose_terms([y], 0.02)
    assert "gauss_markov" not in noise.fit.terms
    density = np.sqrt(0.02 * (1.0 + memory) / (1.0 - memory))
    # 1400 samples, an eighth of the spectrum: the density errs by √(1/(2·175)) = 5 %, here by three times that at most
    assert noise.fit.value("white.density") == pytest.approx(density, rel=0.16)


@pytest.mark.parametrize("seed", range(4))
def test_a_peak_hides_the_octaves_beside_it_alone(seed):
    """By the Allan curve, into which a peak of 0.55 Hz reaches far, the band ended at 0.024 Hz."""
    rng, n, step = np.random.default_rng(seed), 400_000, 2.0 * np.pi * 0.55 * INTERVAL
    pole = np.exp(-0.1 * step)
    peak = lfilter([1.0, 0.0, -1.0], [1.0, -2.0 * pole * np.cos(step), pole**2], rng.standard_normal(n))
    y = rng.standard_normal(n) / np.sqrt(INTERVAL) + 0.002 * rng.standard_normal(n).cumsum()
    found = choose_terms([y + 2.0 / peak.std() * peak], INTERVAL)
    assert 0.09 < found.band.highest < 0.4
    assert found.fit.value("white.density") == pytest.approx(1.0, rel=0.08)
