"""Least squares with amplitudes² that are not negative, of columns of any size."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from models.arrays import LEAST_DIVISOR, FloatArray

ROUNDING_SHARE = 1e-10
"""Part of the largest contribution below which another is zero but for rounding."""


def nonnegative(matrix: FloatArray, goal: FloatArray) -> FloatArray:
    """Return factors ≥ 0 of the columns of a matrix, shape (k, p), whose sum comes closest to a goal, (k,).

    Columns are brought to unit length first; one of zeros has the factor 0.
    """
    length = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    shares, _ = nnls(matrix / length, goal)
    least = ROUNDING_SHARE * max(float(shares.max(initial=0.0)), LEAST_DIVISOR)
    return np.asarray(np.where(shares > least, shares / length, 0.0))
