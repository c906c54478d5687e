"""Flicker and a random walk for a simulator that draws both, or the walk alone: nearest in Allan deviation.

White noise is that of the sensor. B and K are chosen together so that the largest mismatch |ln(drawn ÷ modelled)|
between 1 s and the horizon is smallest, as `tuner.exporters.one_state` does for σ and T.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from models.noise import BiasInstability
from models.units import unit_of_samples
from tuner.exporters.one_state import allan_variances, cluster_times
from tuner.formats.digits import rounded
from tuner.types import ChannelNoise

_GRID_PASSES, _GRID_SIZE = 4, 61
"""Grid search: each pass has so many B and K beside zero, and a range ten times narrower than the one before."""

_ZERO_PREFERENCE = 1e-3
"""ln(ratio) that a B or K above zero has to gain, as much as an export's digits and our ladders are worth."""


@dataclass(frozen=True)
class FlickerAndWalk:
    """B (unit) and K (unit/√s) of a simulator, and the Allan deviation left wrong.

    Attributes
    ----------
    level, density : float
        B and K.
    lags, ratios : tuple of float
        Cluster times, s, and Allan deviation drawn ÷ modelled.
    """

    level: float
    density: float
    lags: tuple[float, ...]
    ratios: tuple[float, ...]


def simulated_flicker(channel: ChannelNoise, *, flicker: bool = True) -> FlickerAndWalk:
    """Return the B and K whose samples are closest in Allan deviation to the model from 1 s to the horizon.

    Parameters
    ----------
    channel : ChannelNoise
        The model.
    flicker : bool
        Whether the simulator draws flicker; else B is 0.
    """
    lags = cluster_times()
    still, bias = allan_variances(channel, lags)
    shapes = BiasInstability(1.0).allan_variance(lags), lags / 3.0
    centres = [math.sqrt(float((bias / shape).max())) or 1.0 for shape in shapes]
    ranges = [np.append(0.0, centre * np.geomspace(1e-3, 3.0, _GRID_SIZE)) for centre in centres]
    if not flicker:
        ranges[0] = np.zeros(1)
    width = math.log(10.0)
    for _ in range(_GRID_PASSES):
        levels, densities = ranges
        drawn = levels[:, None, None] ** 2 * shapes[0] + densities[None, :, None] ** 2 * shapes[1]
        cost = np.abs(0.5 * np.log((still + drawn) / (still + bias))).max(axis=2)
        cost = cost + _ZERO_PREFERENCE * ((levels > 0.0)[:, None].astype(float) + (densities > 0.0))
        best = np.unravel_index(int(np.argmin(cost)), cost.shape)
        found = float(levels[best[0]]), float(densities[best[1]])
        ranges = [
            np.append(0.0, value * np.exp(np.linspace(-width, width, _GRID_SIZE))) if value else np.zeros(1)
            for value in found
        ]
        width /= 10.0
    return with_mismatch(channel, found[0], found[1])


def with_mismatch(channel: ChannelNoise, level: float, density: float) -> FlickerAndWalk:
    """Return a B and a K, rounded as an export does, with the Allan deviation that they leave wrong."""
    level, density = rounded(level), rounded(density)
    lags = cluster_times()
    still, bias = allan_variances(channel, lags)
    drawn = still + density**2 * lags / 3.0
    if level:
        drawn = drawn + BiasInstability(level).allan_variance(lags)
    ratios = np.sqrt(drawn / (still + bias))
    return FlickerAndWalk(level, density, tuple(map(float, lags)), tuple(map(float, ratios)))


def flicker_words(found: Mapping[str, FlickerAndWalk]) -> Iterator[str]:
    """Yield a line an axis: B, K and what is left wrong."""
    for axis, terms in found.items():
        yield (
            f"{axis}: B = {terms.level:.4g} {unit_of_samples(axis)}, K = {terms.density:.4g} "
            f"{unit_of_samples(axis)}/√s; Allan deviation drawn ÷ modelled "
            f"{min(terms.ratios):.2f} … {max(terms.ratios):.2f} from 1 to {terms.lags[-1]:g} s"
        )
