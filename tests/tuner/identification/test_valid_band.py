"""Which part of a record noise terms describe: all of it wherever a sum of terms made it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from tuner.identification.channel import choose_terms

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
