"""How far an angle or a velocity drifts once the bias is known: as modelled, and as a poorer target predicts it.

All three are variances of the integral of the sensor's error over a lag τ, from an instant at which the bias was known
and kept (unit² s²):

    modelled          N²τ + K²τ³/3 + Σ σ²[2T²(x − 1 + e^{−x}) − 2τT(1 − e^{−x}) + τ²],  x = τ/T
    random walk       N²τ + K²τ³/3
    fading state      N²τ + σ²[2T²(x − 1 + e^{−x}) − T²(1 − e^{−x})²]

The last is a filter whose covariance lets one Gauss–Markov state fade, e^{−τ/T}, while its estimate stays: KF-GINS,
OB_GINS and NaveGo feed their estimate back and propagate a zero error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tuner.types import ChannelNoise

REPORTED_LAGS = (1.0, 10.0)
"""Lags, s, at which exports say how far their prediction is off, beside the memory of the filter."""

_SERIES_BELOW = 1e-3
"""Below this x = τ/T the closed forms lose digits to cancellation; their first term is then exact to 1e-3."""


def modelled_growth(channel: ChannelNoise, lag: float) -> float:
    """Return the variance of the integrated error of the configured noise, unit² s²."""
    bias = sum(_kept(state.sd, state.time_constant, lag) for state in channel.markov)
    return channel.white_density**2 * lag + channel.random_walk_density**2 * lag**3 / 3.0 + bias


def walk_growth(white: float, walk: float, lag: float) -> float:
    """Return the variance that a target with white noise N and a random walk K predicts, unit² s²."""
    return white**2 * lag + walk**2 * lag**3 / 3.0


def fading_growth(white: float, sd: float, time_constant: float, lag: float) -> float:
    """Return the variance that a target with white noise N and one fading state predicts, unit² s²."""
    x = lag / time_constant
    if x < _SERIES_BELOW:
        return white**2 * lag + sd**2 * 2.0 / time_constant * lag**3 / 3.0
    gone = -math.expm1(-x)
    return white**2 * lag + sd**2 * time_constant**2 * (2.0 * (x - gone) - gone**2)


def ratios(
    channels: Sequence[ChannelNoise], predicted: Callable[[ChannelNoise, float], float], lags: Sequence[float]
) -> list[tuple[float, float]]:
    """Return lag and predicted ÷ modelled sd of the integrated error, rms over the axes."""
    return [
        (
            lag,
            math.sqrt(
                sum(predicted(channel, lag) for channel in channels)
                / sum(modelled_growth(channel, lag) for channel in channels)
            ),
        )
        for lag in lags
    ]


def mismatch(name: str, found: Sequence[tuple[float, float]]) -> str:
    """Return the ratios in words for a header."""
    return f"{name}: predicted ÷ modelled sd of the integrated error " + ", ".join(
        f"{ratio:.2f} at {lag:g} s" for lag, ratio in found
    )


def _kept(sd: float, time_constant: float, lag: float) -> float:
    x = lag / time_constant
    if x < _SERIES_BELOW:
        return sd**2 * 2.0 / time_constant * lag**3 / 3.0
    gone = -math.expm1(-x)
    return sd**2 * time_constant**2 * (2.0 * (x - gone) - 2.0 * x * gone + x**2)
