"""How well a static identification knows the process noise: sds of the logs of the factors of a drive.

The interval of a coefficient, (low, high) at 95 %, is (ln high − ln low)/3.92 of its log; a group takes the rms over
its axes, of the bias terms that of the best known one. A term that is only bounded, or stands in a datasheet without an
interval, is known to `VAGUE`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tuner.diagnosis.drives.record import GROUPS
from tuner.results import ChannelNoise, Coefficient

VAGUE = 0.5
"""Sd of the log of a density without an interval: a factor 1.6 either way."""
COEFFICIENTS = {
    "white": {"white": "density"},
    "bias": {"bias_instability": "level", "random_walk": "density", "gauss_markov": "sd"},
}
"""Terms behind a group, with the coefficient that sets its density."""


def static_prior(channels: Mapping[str, ChannelNoise]) -> dict[str, float]:
    """Return the sds of the logs of the factors by group, for `noise.fit_noise` and `noise.imu_noise`.

    Parameters
    ----------
    channels : mapping of str to ChannelNoise
        Of a configuration, with what was identified behind it.
    """
    out = {}
    for group in GROUPS:
        sensor, _, kind = group.partition("_")
        own = [noise for axis, noise in channels.items() if axis.startswith(sensor)]
        if own:
            out[group] = float(np.sqrt(np.mean([_axis(noise, COEFFICIENTS[kind]) ** 2 for noise in own])))
    return out


def _axis(noise: ChannelNoise, terms: Mapping[str, str]) -> float:
    """Return the sd of the log of the best known of some terms of one axis."""
    known = [
        _log_sd(estimate.coefficients[terms[estimate.name]])
        for estimate in noise.identified
        if estimate.name in terms and estimate.present
    ]
    return min(known, default=VAGUE)


def _log_sd(coefficient: Coefficient) -> float:
    if coefficient.interval is None or coefficient.interval[0] <= 0.0:
        return VAGUE
    low, high = coefficient.interval
    return min(float(np.log(high / low)) / 3.92, VAGUE)
