"""Poorer bias models that grow like a richer one: a random walk alone, or one time constant alone.

What matters to a filter is how far the bias wanders from its estimate, the structure function

    D(τ) = E[b(t+τ) − b(t)]² = K² τ + Σ 2σ_i² (1 − e^{−τ/T_i}).

A random walk that wanders as far over the filter's memory τ_f has K² = D(τ_f)/τ_f (2σ²/T for τ_f ≪ T); a
state of time constant T has σ² = D(τ_f) / (2 − 2e^{−τ_f/T}). Neither follows D at other lags: the memory is
an assumption, and exporters print it. Where nothing wanders at all, K = 0.1 √3 N/τ_f adds 1 % to what white
noise does to the angle (velocity) variance over the memory, N²τ_f: harmless, and no target is handed a
zero.

Symbols: σ sd, T time constant (s), K random walk density, N white density, τ_f memory (s).
"""

from __future__ import annotations

import math

from tuner.types import ChannelNoise

FILTER_MEMORY = 100.0
"""Memory of the target filter assumed by exporters, s: about as long as GNSS aiding takes to renew a bias."""


def structure_function(channel: ChannelNoise, lag: float) -> float:
    """Return E[b(t+lag) − b(t)]² of the modelled bias, unit²."""
    correlated = sum(-2.0 * state.sd**2 * math.expm1(-lag / state.time_constant) for state in channel.markov)
    return float(channel.random_walk_density**2 * lag + correlated)


def equivalent_random_walk(channel: ChannelNoise, *, memory: float = FILTER_MEMORY) -> float:
    """Return the density of the random walk that wanders as far in `memory` seconds, unit/√s; never 0."""
    wander = structure_function(channel, memory)
    if wander > 0.0:
        return math.sqrt(wander / memory)
    return 0.1 * math.sqrt(3.0) * channel.white_density / memory


def equivalent_markov_sd(
    channel: ChannelNoise, time_constant: float, *, memory: float = FILTER_MEMORY
) -> float:
    """Return the sd of the state of that time constant that wanders as far in `memory` s, unit; never 0."""
    wander = equivalent_random_walk(channel, memory=memory) ** 2 * memory
    return math.sqrt(wander / (-2.0 * math.expm1(-memory / time_constant)))
