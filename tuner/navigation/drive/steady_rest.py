"""Samples of a stand-still in which the unit does not turn: speeds do not show people who turn on the spot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.robust import normal_sd
from tuner.navigation.data import Steps

MAX_SWAY = 0.03
"""Mean rate over a second, about the usual one, up to which a unit rests, rad/s: a standing person sways by as much."""
MAX_SCATTERS = 10.0
"""The same in robust sds of these means: engines and wind shake more."""
NEIGHBOUR_SECONDS = 2
"""Seconds on either side of turning that are left out with it: turns begin and end slowly."""


def steady_steps(steps: Steps, rest: slice) -> NDArray[np.intp]:
    """Return the steps of a stand-still in seconds without turning; all where turning is the rule.

    Parameters
    ----------
    steps : Steps
        Increments.
    rest : slice
        Steps while the fixes stand still.
    """
    every = np.arange(len(steps.dt))[rest]
    part = steps.dt[rest]
    if not len(part):
        return every
    second = (np.cumsum(part) - part).astype(int)
    time = np.bincount(second, weights=part).clip(1e-9)
    means = np.stack(
        [np.bincount(second, weights=axis) / time for axis in steps.increments[rest, :3].T], axis=-1
    )
    off = means - np.median(means, axis=0)
    limit = np.maximum(MAX_SWAY, MAX_SCATTERS * np.array([float(normal_sd(axis)) for axis in off.T]))
    turning = (np.abs(off) > limit).any(axis=1)
    calm = np.convolve(turning, np.ones(2 * NEIGHBOUR_SECONDS + 1), mode="same") == 0.0
    return every[calm[second]] if 2 * np.count_nonzero(calm) > len(calm) else every
