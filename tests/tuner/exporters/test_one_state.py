"""One state for a richer bias: variances of integrals against sums over the covariance, the fit against a search."""

from __future__ import annotations

import math

import numpy as np
import pytest

from models.noise import GaussMarkov
from tuner.exporters.one_state import simulated_state
from tuner.exporters.simulated_flicker import simulated_flicker
from tuner.synthesis import structure_function
from tuner.synthesis.error_growth import estimated_share, modelled_growth, walk_growth
from tuner.types import ChannelNoise

LADDER = tuple(GaussMarkov(5e-5, time) for time in (1.0, 10.0, 100.0, 1000.0))
RICH = ChannelNoise("gyro_x", "rad/s", 5e-5, LADDER, 1e-7, 1e-3)


@pytest.mark.parametrize("lag", [0.5, 20.0, 400.0])
def test_growth_is_the_double_sum_of_the_covariance(lag: float) -> None:
    n = 2000
    s = (np.arange(n) + 0.5) * lag / n
    kept = sum(
        state.sd**2
        * (
            np.exp(-np.abs(s[:, None] - s) / state.time_constant)
            - estimated_share(state.time_constant, 100.0)
            * (np.exp(-s[:, None] / state.time_constant) + np.exp(-s / state.time_constant))
            + estimated_share(state.time_constant, 100.0) ** 2
        )
        for state in LADDER
    )
    walk = RICH.random_walk_density**2 * np.minimum(s[:, None], s)
    expected = RICH.white_density**2 * lag + (kept + walk).sum() * (lag / n) ** 2
    assert modelled_growth(RICH, lag, memory=100.0) == pytest.approx(expected, rel=2e-3)


def test_a_state_that_fades_slowly_is_a_walk() -> None:
    state = GaussMarkov(2e-5, 1e6)
    walk = walk_growth(1e-4, state.driving_density, 50.0)
    one = ChannelNoise("gyro_x", "rad/s", 1e-4, (state,), 0.0, 0.0)
    assert modelled_growth(one, 50.0, memory=100.0) == pytest.approx(walk, rel=1e-3)


def test_series_and_closed_form_meet() -> None:
    one = ChannelNoise("gyro_x", "rad/s", 0.0, (GaussMarkov(1.0, 1000.0),), 0.0, 0.0)
    assert modelled_growth(one, 0.999, memory=0.01) / modelled_growth(
        one, 1.001, memory=0.01
    ) == pytest.approx((0.999 / 1.001) ** 3, rel=2e-3)


def test_one_state_is_found_as_itself() -> None:
    one = ChannelNoise("gyro_x", "rad/s", 1e-5, (GaussMarkov(4e-5, 70.0),), 0.0, 0.0)
    found = simulated_state(one, preferred=70.0)
    assert (found.sd, found.time_constant) == pytest.approx((4e-5, 70.0), rel=1e-3)
    assert found.worst == pytest.approx((1.0, 1.0), abs=1e-3)
    # Where only σ²/T shows, the preferred T is kept.
    slow = ChannelNoise("gyro_x", "rad/s", 1e-5, (GaussMarkov(4e-5, 1e5),), 0.0, 0.0)
    assert simulated_state(slow, preferred=1e5).time_constant == pytest.approx(1e5, rel=0.1)


def test_no_other_state_is_nearer_to_a_ladder() -> None:
    found = simulated_state(RICH, preferred=1000.0)
    lags = np.array(found.lags)
    modelled = RICH.white_density**2 / lags + RICH.random_walk_density**2 * lags / 3.0
    modelled = modelled + sum(state.allan_variance(lags) for state in LADDER)
    least = math.inf
    for time in np.geomspace(1.0, 1e4, 80):
        for sd in np.geomspace(1e-5, 1e-3, 120):
            drawn = RICH.white_density**2 / lags + GaussMarkov(sd, time).allan_variance(lags)
            least = min(least, float(np.abs(0.5 * np.log(drawn / modelled)).max()))
    assert max(abs(math.log(ratio)) for ratio in found.ratios) <= least + 2e-3


def test_a_bias_that_does_not_wander_gets_a_harmless_state() -> None:
    still = ChannelNoise("gyro_x", "rad/s", 1e-4, (), 0.0, 1e-3)
    found = simulated_state(still, preferred=3600.0)
    assert found.sd > 0.0
    assert found.worst == pytest.approx((1.0, 1.0), abs=0.01)
    assert structure_function(still, 100.0) == 0.0


def test_flicker_and_walk_are_found_as_themselves() -> None:
    walk = ChannelNoise("gyro_x", "rad/s", 1e-5, (), 2e-6, 0.0)
    found = simulated_flicker(walk)
    assert (found.level, found.density) == (0.0, pytest.approx(2e-6, rel=1e-3))
    assert simulated_flicker(walk, flicker=False).density == pytest.approx(2e-6, rel=1e-3)
    still = ChannelNoise("gyro_x", "rad/s", 1e-5, (), 0.0, 0.0)
    assert (simulated_flicker(still).level, simulated_flicker(still).density) == (0.0, 0.0)


def test_flicker_draws_a_ladder_better_than_a_walk_or_one_state_can() -> None:
    def worst(ratios: tuple[float, ...]) -> float:
        return max(abs(math.log(ratio)) for ratio in ratios)

    flicker, walk = simulated_flicker(RICH), simulated_flicker(RICH, flicker=False)
    assert (
        worst(flicker.ratios)
        < 0.1
        < worst(simulated_state(RICH, preferred=1000.0).ratios)
        < worst(walk.ratios)
    )
    # The ladder's own level: σ of a state a decade is 0.856 B (Keshner), to within its ripple.
    assert flicker.level == pytest.approx(5e-5 / 0.856, rel=0.15)
