"""A poorer bias model that grows like a richer one: white noise with a random walk.

What a filter sees of a Gauss–Markov state (σ, T) depends on its memory τ_f, the time over which aiding renews a bias:

* T ≤ τ_f/30: each value is forgotten before the next fix. The state is white noise to the filter, N² += 2σ²T; in a
  random walk it would grow without end.
* T ≥ τ_f: the state wanders from its estimate like a random walk, with the structure function

      D(τ) = E[b(t+τ) − b(t)]² = K² τ + Σ 2σ_i² (1 − e^{−τ/T_i}),   K² += D(τ_f)/τ_f   (2σ²/T for τ_f ≪ T).

* Between, both: the shares of N² and K² that bring the Allan deviation nearest to that of the whole model, by least
  squares of its logarithm at cluster times of 1 s to τ_f.

How far two numbers can follow the richer model is `EquivalentNoise.mismatch`; exporters print it. Where nothing wanders
at all, K = 0.1 √3 N/τ_f adds 1 % to what white noise does to the angle (velocity) variance over the memory, N²τ_f:
harmless, and no target is handed a zero. One state in place of the walk: `tuner.exporters.one_state`.

Symbols: σ sd, T time constant (s), K random walk density, N white density, τ_f memory (s).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from models.noise import GaussMarkov, NoiseModel, White
from tuner.types import ChannelNoise

FloatArray = NDArray[np.float64]

FILTER_MEMORY = 100.0
"""Memory of the target filter assumed by exporters, s: about as long as GNSS aiding takes to renew a bias."""
WHITE_TIME_SHARE = 1.0 / 30.0
"""Time constant ÷ memory up to which a state is white noise: its Allan variance is then 2σ²T/τ to 5 % from half of
the memory on."""
SHORTEST_CLUSTER = 1.0
"""Shortest cluster time at which the models are compared, s: the usual interval of fixes."""
COMPARED_CLUSTERS = 41
"""Cluster times that are compared, evenly spaced in their logarithm."""


@dataclass(frozen=True)
class EquivalentNoise:
    """Two numbers in place of white noise, states and a random walk.

    Attributes
    ----------
    white_density, random_walk_density : float
        N, unit/√Hz, and K, unit/√s; neither is 0.
    mismatch : (float, float)
        Smallest and largest ratio of their Allan deviation to that of the whole model.
    shortest, longest : float
        Cluster times at which they are compared, s.
    """

    white_density: float
    random_walk_density: float
    mismatch: tuple[float, float]
    shortest: float
    longest: float


def structure_function(channel: ChannelNoise, lag: float) -> float:
    """Return E[b(t+lag) − b(t)]² of the modelled bias, unit²."""
    return float(channel.random_walk_density**2 * lag + _wander(channel.markov, lag))


def equivalent_noise(channel: ChannelNoise, *, memory: float = FILTER_MEMORY) -> EquivalentNoise:
    """Return white noise and random walk that stand for all noise of an axis in a filter without other states.

    Parameters
    ----------
    channel : ChannelNoise
        Settings of the axis.
    memory : float, optional
        Time over which the filter renews its biases, s.
    """
    fast = [state for state in channel.markov if state.time_constant <= WHITE_TIME_SHARE * memory]
    slow = [state for state in channel.markov if state.time_constant >= memory]
    between = [state for state in channel.markov if WHITE_TIME_SHARE * memory < state.time_constant < memory]
    white = channel.white_density**2 + sum(2.0 * state.sd**2 * state.time_constant for state in fast)
    walk = channel.random_walk_density**2 + _wander(slow, memory) / memory
    shortest = min(SHORTEST_CLUSTER, 0.1 * memory)
    tau = np.geomspace(shortest, memory, COMPARED_CLUSTERS)
    if between:
        own = NoiseModel((*between,)).allan_variance(tau)
        white, walk = _fitted(tau, own, white, walk, between, memory)
    if walk == 0.0:
        walk = 0.03 * white / memory**2
    own_walk = channel.random_walk_density**2 * tau / 3.0
    whole = NoiseModel((White(channel.white_density), *channel.markov)).allan_variance(tau) + own_walk
    ratio = np.sqrt((white / tau + walk * tau / 3.0) / whole)
    return EquivalentNoise(
        math.sqrt(white), math.sqrt(walk), (float(ratio.min()), float(ratio.max())), shortest, memory
    )


def equivalent_white_density(channel: ChannelNoise, *, memory: float = FILTER_MEMORY) -> float:
    """Return the density of white noise with what a filter forgets within `memory` seconds, unit/√Hz."""
    return equivalent_noise(channel, memory=memory).white_density


def equivalent_random_walk(channel: ChannelNoise, *, memory: float = FILTER_MEMORY) -> float:
    """Return the density of the random walk that stands for the bias over `memory` seconds, unit/√s; never 0."""
    return equivalent_noise(channel, memory=memory).random_walk_density


def _wander(states: Sequence[GaussMarkov], lag: float) -> float:
    return sum(-2.0 * state.sd**2 * math.expm1(-lag / state.time_constant) for state in states)


def _fitted(
    tau: FloatArray,
    own: FloatArray,
    white: float,
    walk: float,
    states: Sequence[GaussMarkov],
    memory: float,
) -> tuple[float, float]:
    """Return N² and K² with the shares that bring them nearest to the Allan variance with some states, shape (q,)."""
    goal = white / tau + walk * tau / 3.0 + own
    most = np.array(
        [sum(2.0 * state.sd**2 * state.time_constant for state in states), _wander(states, memory) / memory]
    )

    def misfit(share: FloatArray) -> FloatArray:
        added = share * most
        return np.asarray(np.log(((white + added[0]) / tau + (walk + added[1]) * tau / 3.0) / goal))

    found = least_squares(misfit, np.array([0.1, 0.5]), bounds=(0.0, np.inf), xtol=1e-10, ftol=1e-12)
    return white + float(found.x[0] * most[0]), walk + float(found.x[1] * most[1])
