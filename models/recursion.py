"""The recursion of first order, in which each input decays from then on."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dtbsv

from models.arrays import SAMPLES_AT_ONCE, FloatArray


def decaying_sum(x: ArrayLike, decay: float) -> FloatArray:
    """Return y_k = x_k + decay y_{k−1}, shape (n,): by triangular solution, for `scipy.signal` loads slowly."""
    y = np.array(x, dtype=float)
    bands = np.full((2, min(len(y), SAMPLES_AT_ONCE)), -decay, order="F")
    for first in range(0, len(y), SAMPLES_AT_ONCE):
        part = y[first : first + SAMPLES_AT_ONCE]
        part[0] += decay * y[first - 1] if first else 0.0
        part[:] = dtbsv(1, bands[:, : len(part)], part, lower=1, diag=1)
    return y
