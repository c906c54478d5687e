"""How well a static identification knows the process noise: prior sds of the logs of noise factors of a drive.

The interval of a coefficient, (low, high) at 95 %, gives the sd (ln high − ln low)/3.92 of its log; a group takes the
root mean square over its axes, and of several bias terms the best known one. White noise stated in a datasheet
without an interval is known to `DATASHEET_LOG_SD`. Bias terms without an interval, and terms that are only bounded,
are known to `UNKNOWN_LOG_SD`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from models.noise import TERMS, White
from tuner.linear_run.linearized_run import NOISE_GROUPS
from tuner.types import ChannelNoise, Coefficient

DATASHEET_LOG_SD = 0.1
"""Sd of the log of a white density as a datasheet states it: the spread of units of one type."""
UNKNOWN_LOG_SD = 0.5
"""Sd of the log of a density that is hardly known: a factor 1.6 either way."""


def static_prior(channels: Mapping[str, ChannelNoise]) -> dict[str, float]:
    """Return the sds of the logs of the factors by group, as `imu_noise` takes them.

    Parameters
    ----------
    channels : mapping of str to ChannelNoise
        Of a configuration, with what was identified behind it.
    """
    out = {}
    for group in NOISE_GROUPS:
        sensor, _, kind = group.partition("_")
        own = [noise for axis, noise in channels.items() if axis.startswith(sensor)]
        if own:
            unstated = DATASHEET_LOG_SD if kind == "white" else UNKNOWN_LOG_SD
            sds = [_axis(noise, _amplitudes(kind), unstated) for noise in own]
            out[group] = float(np.sqrt(np.mean(np.square(sds))))
    return out


def _amplitudes(kind: str) -> dict[str, str]:
    """Return the terms that set the density of a group, ``white`` or ``bias``, with the name of their amplitude."""
    if kind == "white":
        return {White.name: White.PARAMETERS[0]}
    return {
        name: term.PARAMETERS[0]
        for name, term in TERMS.items()
        if term.fitted and term.is_bias and not term.deterministic
    }


def _axis(noise: ChannelNoise, terms: Mapping[str, str], unstated: float) -> float:
    """Return the sd of the log of the best known of some terms of one axis."""
    known = [
        _log_sd(estimate.coefficients[terms[estimate.name]], unstated)
        for estimate in noise.identified
        if estimate.name in terms and estimate.present
    ]
    return min(known, default=UNKNOWN_LOG_SD)


def _log_sd(coefficient: Coefficient, unstated: float) -> float:
    if coefficient.value is not None and coefficient.interval is None:
        return unstated
    if coefficient.interval is None or coefficient.interval[0] <= 0.0:
        return UNKNOWN_LOG_SD
    low, high = coefficient.interval
    return min(float(np.log(high / low)) / 3.92, UNKNOWN_LOG_SD)
