"""A poorer bias model that grows like a richer one: white noise with a random walk, or with one fading state.

A filter uses its bias model to predict how far angle and velocity drift until the next fix, or over an outage. So the
two numbers are those whose prediction of the integrated error (`tuner.synthesis.error_growth`) is nearest to that of
the whole model: the largest |ln(predicted ÷ modelled)| of its sd between 1 s and the memory of the filter is least,
the memory τ_f being the time over which aiding renews a bias. White noise is never below that of the configuration,
nor a walk below its own. States that are forgotten at once count as white noise, 2σ²T in N², and states that outlast
the memory as a walk, 2σ²/T in K².

How far two numbers can follow the richer model is `mismatch`; exporters print it. Where nothing wanders at all,
K = 0.1 √3 N/τ_f adds 1 % to what white noise does to the angle (velocity) variance over the memory, N²τ_f: harmless,
and no target is handed a zero.

Symbols: σ sd, T time constant (s), K random walk density, N white density, τ_f memory (s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import GaussMarkov
from tuner.synthesis.error_growth import estimated_share, fading_growth, modelled_growth, walk_growth
from tuner.types import ChannelNoise

FILTER_MEMORY = 100.0
"""Memory of the target filter assumed by exporters, s: about as long as GNSS aiding takes to renew a bias."""
SHORTEST_LAG = 1.0
"""Shortest lag at which the models are compared, s: the usual interval of fixes."""
COMPARED_LAGS = 41
"""Lags that are compared, evenly spaced in their logarithm."""
STILL_SHARE = 0.01
"""Share of white noise, in the variance of the integrated error over the memory, of the walk of a still bias."""
_SEARCH_PASSES, _SEARCH_POINTS = 4, 121
"""Grid search for the share of the bias: each pass spans two steps of the one before."""
_WANDER_PENALTY = 1e-4
"""Preference, in ln(ratio) a unit of ln(b), for a bias that wanders as far as what is estimated: decides where white
noise hides it over the memory."""
_MAX_LOG_SHARE = 25.0
"""Largest |ln| of the share of the bias in the error, at any lag, that is looked for: beyond, the other rounds away."""


@dataclass(frozen=True)
class EquivalentNoise:
    """Two numbers in place of white noise, states and a random walk.

    Attributes
    ----------
    white_density : float
        N, unit/√Hz.
    bias : float
        K of a random walk, unit/√s, or σ of a fading state, unit; never 0.
    mismatch : (float, float)
        Smallest and largest ratio of the predicted sd of the integrated error to that of the whole model.
    shortest, longest : float
        Lags at which they are compared, s.
    """

    white_density: float
    bias: float
    mismatch: tuple[float, float]
    shortest: float
    longest: float


def structure_function(channel: ChannelNoise, lag: float) -> float:
    """Return E[b(t+lag) − b(t)]² of the modelled bias, unit²."""
    return float(channel.random_walk_density**2 * lag + sum(_wander(state, lag) for state in channel.markov))


def equivalent_noise(
    channel: ChannelNoise, *, memory: float = FILTER_MEMORY, fading_time: float | None = None
) -> EquivalentNoise:
    """Return the two numbers that stand for all noise of an axis in a filter without other states.

    Parameters
    ----------
    channel : ChannelNoise
        Settings of the axis.
    memory : float, optional
        Time over which the filter renews its biases, s.
    fading_time : float, optional
        Time constant of the one state that the filter lets fade, s; by default its bias is a random walk.
    """
    shortest = min(SHORTEST_LAG, 0.1 * memory)
    lags = np.geomspace(shortest, memory, COMPARED_LAGS)
    shape = walk_growth(0.0, 1.0, lags) if fading_time is None else fading_growth(0.0, 1.0, fading_time, lags)
    modelled = modelled_growth(channel, lags, memory=memory)
    white, own = channel.white_density**2, channel.random_walk_density**2
    bias = 0.0
    if channel.markov or (own and fading_time is not None):
        least = own if fading_time is None else 0.0
        wander = own * memory + sum(
            estimated_share(state.time_constant, memory) ** 2 * _wander(state, memory)
            for state in channel.markov
        )
        preferred = wander * memory**2 / 3.0 / float(shape[-1])
        white, bias = _nearest(lags / modelled, shape / modelled, (white, least), preferred)
    elif own:
        bias = own
    still = STILL_SHARE * white * memory / float(shape[-1])
    bias = bias or still
    ratio = np.sqrt((white * lags + bias * shape) / modelled)
    mismatch = (float(ratio.min()), float(ratio.max()))
    return EquivalentNoise(math.sqrt(white), math.sqrt(bias), mismatch, shortest, memory)


def equivalent_white_density(channel: ChannelNoise, *, memory: float = FILTER_MEMORY) -> float:
    """Return the density of the white noise beside `equivalent_random_walk`, unit/√Hz."""
    return equivalent_noise(channel, memory=memory).white_density


def equivalent_random_walk(channel: ChannelNoise, *, memory: float = FILTER_MEMORY) -> float:
    """Return the density of the random walk that stands for the bias over `memory` seconds, unit/√s; never 0."""
    return equivalent_noise(channel, memory=memory).bias


def _wander(state: GaussMarkov, lag: float) -> float:
    return -2.0 * state.sd**2 * math.expm1(-lag / state.time_constant)


def _nearest(
    white: FloatArray, bias: FloatArray, least: tuple[float, float], preferred: float
) -> tuple[float, float]:
    """Return a, b, at least `least`, with the least largest |ln(a white + b bias)|; shapes (q,)."""
    share = bias / white
    low = math.log(float((1.0 / share).min())) - _MAX_LOG_SHARE
    high = math.log(float((1.0 / share).max())) + _MAX_LOG_SHARE
    for _ in range(_SEARCH_PASSES):
        ratio = np.exp(np.linspace(low, high, _SEARCH_POINTS))
        curve = np.log(white + ratio[:, None] * bias)
        # The best level puts the largest deviation up and down at the same distance.
        level = np.exp(-0.5 * (curve.max(axis=1) + curve.min(axis=1)))
        level = np.maximum(level, np.maximum(least[0], least[1] / ratio))
        cost = np.abs(curve + np.log(level)[:, None]).max(axis=1)
        cost += _WANDER_PENALTY * np.abs(np.log(level * ratio / preferred))
        best = int(np.argmin(cost))
        found = float(level[best]), float(level[best] * ratio[best])
        step = (high - low) / (_SEARCH_POINTS - 1)
        centre = math.log(ratio[best])
        low, high = centre - step, centre + step
    return found
