"""Scatter of stamps is distinguished from uneven sampling by the variance of their differences."""

import numpy as np
import pytest

from tuner.readers.steady_stamps import steady_stamps


def stamps(count, interval, scatter, walk, seed=1):
    rng = np.random.default_rng(seed)
    true = np.cumsum(interval + walk * rng.standard_normal(count))
    return true, true + scatter * rng.standard_normal(count)


@pytest.mark.parametrize("walk", [0.0, 3e-5])
def test_scatter_about_an_even_clock_is_taken_out(walk):
    """Means of a thousand stamps have a thirtieth of their scatter; a wandering clock leaves √(scatter · walk / 2)."""
    true, t = stamps(20_000, 0.01, 2e-3, walk)
    steady, scatter = steady_stamps(t)
    assert scatter == pytest.approx(2e-3, rel=5.0 / np.sqrt(len(t)))
    assert np.std(steady - true) < max(2e-3 / 20.0, 1.5 * np.sqrt(2e-3 * walk / 2.0))


@pytest.mark.parametrize(("scatter", "walk"), [(0.0, 0.0), (0.0, 2e-3), (3e-4, 0.0), (3e-4, 2e-3)])
def test_uneven_sampling_and_rounded_stamps_stay(scatter, walk):
    _, t = stamps(5_000, 0.01, scatter, walk)
    steady, found = steady_stamps(t)
    assert found == 0.0
    assert steady is t


def test_what_lies_between_gaps_is_steadied_by_itself():
    true, t = stamps(4_000, 0.1, 5e-3, 0.0)
    later = np.where(np.arange(4_000) >= 2_000, 17.53, 0.0)
    steady, scatter = steady_stamps(t + later)
    error = steady - true - later
    assert scatter == pytest.approx(5e-3, rel=0.1)
    assert np.std(error[:2_000]) < 5e-4
    assert np.std(error[2_000:]) < 5e-4
