"""Moments, robust standard deviation and periodogram of long series, piece by piece without a copy of them."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from tuner.curves.long_transforms import without_tables

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]

SAMPLES_AT_ONCE = 1 << 16
"""Numbers treated at a time, so that what is computed on the way stays in the cache of a processor."""
RESIDUAL_CLIP = 5.0
"""Sds at which residuals are cut for tests of the spectrum and of the variance.

Normal samples exceed five with a chance of 6e-7; spikes, which have a test of their own, do not decide these.
"""


def unit_periodogram(e: SingleArray, size: int) -> SingleArray:
    """Return the periodogram of e, followed by zeros up to `size`, at frequencies 1 … size/2, mean 1."""
    wave = rfft(e, size)[1:]
    without_tables(size)
    power: SingleArray = wave.real**2
    power += wave.imag**2
    del wave
    parts = (e[first : first + SAMPLES_AT_ONCE] for first in range(0, len(e), SAMPLES_AT_ONCE))
    power /= np.float32(sum(float(part @ part) for part in parts))
    return power


def moment(e: SingleArray, order: int) -> float:
    """Return the mean of a power of numbers, summed in double precision."""
    total = 0.0
    for first in range(0, len(e), SAMPLES_AT_ONCE):
        part = e[first : first + SAMPLES_AT_ONCE].astype(float)
        product = part.copy()
        for _ in range(order - 1):
            product *= part
        total += float(product.sum())
    return total / len(e)


def robust_sd(e: FloatArray) -> float:
    """Return the standard deviation with squares capped at five deviations."""
    mean = float(e.mean())
    cap = RESIDUAL_CLIP * float(np.sqrt(max(float(e @ e) / len(e) - mean * mean, 0.0)))
    for _ in range(5):
        cap = RESIDUAL_CLIP * float(np.sqrt(_capped_square(e, cap * cap) / len(e)))
    return cap / RESIDUAL_CLIP


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _capped_square(e: FloatArray, cap: float) -> float:
    """Return the sum of the squares, none above `cap`."""
    total = 0.0
    for i in range(e.size):
        total += min(e[i] * e[i], cap)
    return total
