"""One Gauss–Markov state for a bias that has more: as a simulator draws it.

A simulator with one state is right where its samples have the Allan deviation of the model. σ and T are chosen
together so that the largest mismatch |ln(drawn ÷ modelled)| between 1 s and the horizon is smallest; white noise
counts, as it hides what lies below it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import GaussMarkov
from models.units import unit_of_samples
from tuner.formats.digits import rounded
from tuner.synthesis.projection import still_walk
from tuner.types import ChannelNoise

SIMULATED_HORIZON = 300.0
"""Lag, s, up to which a simulator's one state is fitted: outages of a filter that one tries in it are shorter."""

_LAGS_A_DECADE = 6
"""Cluster times a decade of the fit: Allan deviations of smooth spectra are smooth over a third of an octave."""

_TIME_PENALTY = 1e-4
"""Preference, in ln(ratio) a decade, for T near the longest of the model: decides where the fit does not."""

_GRID_PASSES, _GRID_TIMES, _GRID_SDS = 5, 41, 61
"""Grid search: each pass has this many T and σ, and a range ten times narrower than the one before."""


@dataclass(frozen=True)
class OneState:
    """A Gauss–Markov state that stands for a bias, and the Allan deviation left wrong.

    Attributes
    ----------
    sd, time_constant : float
        σ (unit) and T (s).
    lags, ratios : tuple of float
        Cluster times, s, and Allan deviation drawn ÷ modelled.
    """

    sd: float
    time_constant: float
    lags: tuple[float, ...]
    ratios: tuple[float, ...]

    @property
    def worst(self) -> tuple[float, float]:
        """Smallest and largest ratio."""
        return min(self.ratios), max(self.ratios)


def cluster_times() -> FloatArray:
    """Return the cluster times, s, at which a simulator is fitted: 1 s to the horizon."""
    count = 1 + math.ceil(_LAGS_A_DECADE * math.log10(SIMULATED_HORIZON))
    return np.geomspace(1.0, SIMULATED_HORIZON, count)


def allan_variances(channel: ChannelNoise, lags: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the Allan variances of white noise and of the bias of a channel as configured, unit²."""
    bias = channel.random_walk_density**2 * lags / 3.0
    for state in channel.markov:
        bias = bias + state.allan_variance(lags)
    return channel.white_density**2 / lags, bias


def simulated_state(channel: ChannelNoise, *, preferred: float) -> OneState:
    """Return the one state whose samples are closest in Allan deviation to the model from 1 s to the horizon.

    Parameters
    ----------
    channel : ChannelNoise
        The model.
    preferred : float
        T, s, that is taken where several fit alike.
    """
    lags = cluster_times()
    still, bias = allan_variances(channel, lags)
    if not bias.any():
        sd = still_walk(channel) * math.sqrt(preferred / 2.0)
        return _fitted(sd, preferred, still, still, lags)
    centre_sd = math.log(math.sqrt(float(bias.max())))
    centre_time = math.log(preferred)
    width_sd, width_time = math.log(1e3), math.log(1e3)
    for _ in range(_GRID_PASSES):
        times = np.exp(np.linspace(centre_time - width_time, centre_time + width_time, _GRID_TIMES))
        sds = np.exp(np.linspace(centre_sd - width_sd, centre_sd + width_sd, _GRID_SDS))
        shapes = np.array([GaussMarkov(1.0, float(time)).allan_variance(lags) for time in times])
        drawn = still + sds[:, None, None] ** 2 * shapes
        cost = np.abs(0.5 * np.log(drawn / (still + bias))).max(axis=2)
        cost = cost + _TIME_PENALTY * np.abs(np.log10(times / preferred))
        at_sd, at_time = np.unravel_index(int(np.argmin(cost)), cost.shape)
        centre_sd, centre_time = float(np.log(sds[at_sd])), float(np.log(times[at_time]))
        width_sd, width_time = width_sd / 10.0, width_time / 10.0
    return _fitted(math.exp(centre_sd), math.exp(centre_time), still, still + bias, lags)


def drawn_words(states: Mapping[str, OneState]) -> Iterator[str]:
    """Yield a line an axis: σ, T and what is left wrong."""
    for axis, state in states.items():
        low, high = state.worst
        yield (
            f"{axis}: one state of σ = {state.sd:.4g} {unit_of_samples(axis)}, T = {state.time_constant:.4g} s; Allan "
            f"deviation drawn ÷ modelled {low:.2f} … {high:.2f} from 1 to {state.lags[-1]:g} s, the least that one "
            "state can do"
        )


def _fitted(sd: float, time: float, white: FloatArray, modelled: FloatArray, lags: FloatArray) -> OneState:
    sd, time = rounded(sd), rounded(time)
    drawn = np.sqrt((white + GaussMarkov(sd, time).allan_variance(lags)) / modelled)
    return OneState(sd, time, tuple(map(float, lags)), tuple(map(float, drawn)))
