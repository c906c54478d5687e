"""How far an angle or a velocity drifts once the bias was estimated: the variance of the integral over a lag τ.

With x = τ/T it is (unit² s²)

    N²τ + K²τ³/3 + Σ σ²[2T²(x − 1 + e^{−x}) − 2gτT(1 − e^{−x}) + g²τ²]

A filter keeps an estimate that contains the share g = (T/τ_f)(1 − e^{−τ_f/T}) of each state: the best constant for its
memory τ_f, the regression of the state's mean over the memory on its value. States that outlast the memory are
estimated (g = 1), and drift away; those that are forgotten at once are not (g = 0): white noise, 2σ²T.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from tuner.types import ChannelNoise

FILTER_MEMORY = 100.0
"""Time over which aiding renews the estimate of a bias, s: about as long as GNSS takes."""
_SERIES_BELOW = 1e-3
"""Below this x = τ/T the closed forms lose digits to cancellation; two terms of their series are then exact to 1e-6."""


def structure_function(channel: ChannelNoise, lag: float) -> float:
    """Return E[b(t+lag) − b(t)]² of the modelled bias, unit²."""
    states = sum(-2.0 * one.sd**2 * math.expm1(-lag / one.time_constant) for one in channel.markov)
    return float(channel.random_walk_density**2 * lag + states)


def estimated_share(time_constant: float, memory: float) -> float:
    """Return the share g of a state that a filter with some memory estimates as its bias."""
    y = memory / time_constant
    return -math.expm1(-y) / y


def modelled_growth(channel: ChannelNoise, lag: ArrayLike, *, memory: float = FILTER_MEMORY) -> FloatArray:
    """Return the variance of the integrated error of the configured noise, unit² s²; the shape of `lag`.

    `memory` is the time over which the filter renews its biases, s.
    """
    tau = np.asarray(lag, dtype=float)
    found = walk_growth(channel.white_density, channel.random_walk_density, tau)
    for state in channel.markov:
        x = tau / state.time_constant
        gone = -np.expm1(-x)
        series = x**3 * (2.0 / 3.0 - x / 4.0)
        known = np.where(x < _SERIES_BELOW, series, 2.0 * (x - gone) - 2.0 * x * gone + x**2)
        lost = 1.0 - estimated_share(state.time_constant, memory)
        growth = known - 2.0 * lost * x * (x - gone) + (lost * x) ** 2
        found = found + (state.sd * state.time_constant) ** 2 * growth
    return found


def walk_growth(white: float, walk: float, lag: ArrayLike) -> FloatArray:
    """Return the variance that a target with white noise N and a random walk K predicts, unit² s²."""
    tau = np.asarray(lag, dtype=float)
    return np.asarray(white**2 * tau + walk**2 * tau**3 / 3.0)
