"""The level of a periodogram about each frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.model.dct import between_middles

FloatArray = NDArray[np.float64]

FIRST_ORDINATE = 20
"""Lowest Fourier frequency that is searched for lines and resonances.

Below, the spectrum of slow noise is too steep for the median of the neighbours to be its level.
"""


def local_level(power: FloatArray, width: int) -> FloatArray:
    """Return the level of exponential ordinates by medians over `width` of them, shape of `power`."""
    width = min(width, len(power))
    number = len(power) // width
    median = np.median(power[: number * width].reshape(number, width), axis=1) / np.log(2.0)
    return np.maximum(between_middles(median, width, len(power)), 0.2)
