"""The level of a periodogram about each frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.model.dct import between_middles
from tuner.diagnosis.static.model.series_statistics import Real, row_medians

FIRST_ORDINATE = 20
"""Lowest Fourier frequency that is searched for lines and resonances.

Below, the spectrum of slow noise is too steep for the median of the neighbours to be its level.
"""


def local_level(power: NDArray[Real], width: int) -> NDArray[Real]:
    """Return the level of exponential ordinates by medians over `width` of them, shape and type of `power`."""
    width = min(width, len(power))
    number = len(power) // width
    median = row_medians(power[: number * width].reshape(number, width)) / float(np.log(2.0))
    level = between_middles(median, width, len(power))
    return np.maximum(level, power.dtype.type(0.2), out=level)
