"""Cross-axis: white noise that several channels share.

Statistic: Σ e_i e_j / √n of the residuals of two channels, standard normal where they are independent;
Bonferroni over the pairs. Rejected pairs that share a channel are one finding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from models.arrays import SAMPLES_AT_ONCE
from models.effects.static.distribution import CrossAxis as Effect
from models.probability import REACH_95, normal_beyond
from tuner.diagnosis.cause import Cause
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.types import Coefficient


class CrossAxis(Cause):
    """White noise that several channels share."""

    cause = "cross_axis"
    effect = Effect
    group = "several channels"
    view = "pairs"
    meaning = (
        "the white noise of these channels is partly one and the same (supply, clock, vibration of the board)"
    )
    consequence = "a full block of the white covariance instead of a diagonal one"


@dataclass(frozen=True)
class Shared:
    """Channels that share white noise, with its correlation.

    Attributes
    ----------
    channels : tuple of str
        Axes.
    statistic, p_value : float
        Largest normal deviate of a pair, and the chance of it, all pairs paid for.
    correlation : Coefficient
        Mean correlation of the pairs.
    pairs : mapping of str to Coefficient
        Correlation of every pair, such as ``gyro_x, gyro_y``.
    """

    channels: tuple[str, ...]
    statistic: float
    p_value: float
    correlation: Coefficient
    pairs: Mapping[str, Coefficient]


def test(residuals: Mapping[str, FittedChannel], limit: float) -> tuple[Shared, ...]:
    """Test all pairs of channels that were sampled together.

    Parameters
    ----------
    residuals : mapping of str to FittedChannel
        Final residuals by axis.
    limit : float
        P-value below which a pair rejects, Bonferroni-corrected for all pairs.
    """
    pairs = [(a, b) for a, b in combinations(residuals, 2) if _together(residuals[a], residuals[b])]
    found: dict[tuple[str, str], tuple[float, float, float]] = {}
    for a, b in pairs:
        seen, n = _correlation(residuals[a], residuals[b])
        p_value = min(1.0, 2.0 * len(pairs) * normal_beyond(abs(seen) * np.sqrt(n)))
        if p_value < limit:
            share = 1.0 - float(np.mean(residuals[a].hidden | residuals[b].hidden))
            rho = min(max(seen / share, -1.0), 1.0)
            found[a, b] = (rho, (1.0 - seen**2) / np.sqrt(n) / share, p_value)
    return tuple(_shared(group, found) for group in _groups(list(found)))


def _correlation(a: FittedChannel, b: FittedChannel) -> tuple[float, int]:
    """Return the correlation of clipped residuals that are valid in both channels, and their number."""
    number, sums, products = 0, np.zeros(2), np.zeros((2, 2))
    for first in range(0, len(a.valid), SAMPLES_AT_ONCE):
        part = slice(first, first + SAMPLES_AT_ONCE)
        both = a.valid[part] & b.valid[part]
        x = np.stack([a.clipped[part][both], b.clipped[part][both]]).astype(float)
        number += x.shape[1]
        sums += x.sum(axis=1)
        products += x @ x.T
    covariance = products / number - np.outer(sums, sums) / number**2
    return float(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])), number


def _together(a: FittedChannel, b: FittedChannel) -> bool:
    one, other = a.channel, b.channel
    same_clock = len(one) == len(other) and abs(one.start - other.start) < 0.5 * one.interval
    return same_clock and abs(one.interval - other.interval) < 1e-9 * one.interval


def _groups(pairs: list[tuple[str, str]]) -> list[set[str]]:
    """Return the sets of channels that pairs connect."""
    groups: list[set[str]] = []
    for pair in pairs:
        touching = [g for g in groups if g & set(pair)]
        groups = [g for g in groups if g not in touching] + [set(pair).union(*touching)]
    return groups


def _shared(group: set[str], found: Mapping[tuple[str, str], tuple[float, float, float]]) -> Shared:
    mine = {pair: value for pair, value in found.items() if set(pair) <= group}
    rho = np.array([value[0] for value in mine.values()])
    sd = np.array([value[1] for value in mine.values()])
    mean = float(np.mean(np.abs(rho))) if len(rho) > 1 else float(rho[0])
    half = REACH_95 * float(np.sqrt(np.sum(sd**2))) / len(rho)
    spread = float(np.std(rho)) if len(rho) > 1 else 0.0
    half = max(half, REACH_95 * spread / np.sqrt(len(rho)))
    axes = tuple(dict.fromkeys(axis for pair in mine for axis in pair))
    each = {
        ", ".join(pair): Coefficient.known(r, r - REACH_95 * s, r + REACH_95 * s, "1")
        for pair, (r, s, _) in mine.items()
    }
    with np.errstate(divide="ignore"):  # axes that are one and the same have no sd
        best = float(np.max(np.abs(rho) / sd))
    p_value = min(value[2] for value in mine.values())
    return Shared(axes, best, p_value, Coefficient.known(mean, mean - half, mean + half, "1"), each)
