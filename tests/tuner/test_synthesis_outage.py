"""How honest the bias rules are in outages: exact covariance of the true error against the filter's own.

Truth: white noise, flicker (a fine ladder from 0.3 s to 1e7 s) and random walk, Allan minimum at about 600 s.
The filter sees heading to 0.3° once a second for an hour, then predicts. Nothing is sampled: no scatter.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from models.statespace import flicker_ladder
from models.units import DEG, DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from tuner.results import ChannelNoise, MarkovState
from tuner.synthesis import RULES, step_noise
from tuner.synthesis.markov import FlickerView
from tuner.synthesis.process_noise import axis_system

WHITE = 0.15 * DEG_PER_SQRT_HOUR
LEVEL = 5.0 * DEG_PER_HOUR
MINIMUM_TAU = 600.0
WALK = math.sqrt(3.0) * WHITE / MINIMUM_TAU
MINIMUM = math.sqrt(2.0 * WHITE**2 / MINIMUM_TAU + 2.0 * math.log(2.0) / math.pi * LEVEL**2)
HEADING = 0.3 * DEG
OUTAGES = (10.0, 60.0, 300.0, 1000.0)


def noise(markov: tuple[MarkovState, ...]) -> ChannelNoise:
    return ChannelNoise("gyro_x", "rad/s", WHITE, markov, WALK, constant_sd=0.1 * DEG)


def sensitivity(size: int) -> NDArray[np.float64]:
    return np.eye(1, size)[0]


def ratios(believed: ChannelNoise) -> NDArray[np.float64]:
    """Return true rms ÷ predicted sd of the angle after each outage."""
    true = noise(
        tuple(MarkovState(g.sd, g.time_constant) for g in flicker_ladder(LEVEL, 0.3, 1e7, per_decade=3))
    )
    step_true, step_filter = step_noise(true, 1.0), step_noise(believed, 1.0)
    n, m = len(step_true[0]), len(step_filter[0])
    h_true, h = sensitivity(n), sensitivity(m)
    p = axis_system(believed).P0
    joint = np.zeros((n + m, n + m))  # of true state and estimate
    joint[:n, :n] = axis_system(true).P0
    advance = np.zeros((n + m, n + m))
    drive = np.zeros((n + m, n + m))
    advance[:n, :n], advance[n:, n:] = step_true[0], step_filter[0]
    drive[:n, :n] = step_true[1]
    for _ in range(3600):
        p = step_filter[0] @ p @ step_filter[0].T + step_filter[1]
        joint = advance @ joint @ advance.T + drive
        gain = p @ h / (h @ p @ h + HEADING**2)
        keep = np.eye(m) - np.outer(gain, h)
        p = keep @ p @ keep.T + HEADING**2 * np.outer(gain, gain)
        update = np.eye(n + m)
        update[n:, :n] = np.outer(gain, h_true)
        update[n:, n:] = keep
        joint = update @ joint @ update.T
        joint[n:, n:] += HEADING**2 * np.outer(gain, gain)
    found = []
    for seconds in OUTAGES:
        (phi_true, q_true), (phi, q) = step_noise(true, seconds), step_noise(believed, seconds)
        error = np.concatenate([h_true @ phi_true, -h @ phi])
        true_variance = error @ joint @ error + q_true[0, 0]
        found.append(math.sqrt(true_variance / (phi @ p @ phi.T + q)[0, 0]))
    return np.array(found)


def by_rule(name: str) -> NDArray[np.float64]:
    view = FlickerView(LEVEL, WHITE, MINIMUM, MINIMUM_TAU, horizon=1000.0, interval=0.01)
    return ratios(noise(RULES[name].states(view)))


def test_ladder_is_honest_at_every_horizon() -> None:
    found = by_rule("ladder")
    assert np.all(found < 1.10)
    assert np.all(found > 0.95)


def test_variance_at_the_allan_minimum_is_optimistic() -> None:
    found = by_rule("minimum")
    assert np.all(found > 1.4)
    assert np.all(found < 2.4)
    assert found == pytest.approx([1.6, 1.8, 1.9, 1.7], abs=0.1)  # published table of the four cases, case G1


def test_rules_are_ordered_by_their_worst_ratio() -> None:
    worst = {name: float(by_rule(name).max()) for name in RULES}
    assert worst["ladder"] < worst["peak"] < worst["level"] < worst["minimum"]
    for name, rule in RULES.items():
        assert worst[name] <= rule.worst_ratio * 1.01


def test_walk_alone_ignores_flicker_at_a_price() -> None:
    assert ratios(noise(())).max() > 5.0
