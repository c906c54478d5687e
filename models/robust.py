"""Standard deviation of normal samples from a median, which a few outliers do not change."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

MEDIAN_OF_NORMAL = 0.6745
"""Median of the absolute value of a normal variable of unit variance."""
MEDIAN_OF_CHI2 = 0.4549
"""Median of the square of a normal variable of unit variance."""


def normal_sd(deviations: ArrayLike, axis: int | None = None) -> Any:
    """Return the standard deviation of normal deviations from zero by the median of their absolute values.

    Parameters
    ----------
    deviations : array_like
        Deviations from their mean, in any unit.
    axis : int, optional
        Axis over which the median is taken; all by default.

    Returns
    -------
    float or ndarray
        In the unit of the deviations.
    """
    return np.median(np.abs(deviations), axis=axis) / MEDIAN_OF_NORMAL
