"""Smoothed covariates: the readings of a digital thermometer without their quantization and their noise.

Readings of quantizer step Δ stay constant and jump, and they are noisy; the temperature did none of that. The smoothest
curve within their error s is taken (Whittaker's smoother): it minimises Σ(x − r)² + λ Σ(third differences of x)², with
the largest λ for which the readings r lie s about it over the record, not much more in any part of it, and a few of
them together at no time as far off as rounding takes one, √3 s: where the temperature turns fast, the curve has to
follow. s is √(Δ²/12), or the noise of the readings as their second differences
over the time of one measurement show it, if that is more.

References
----------
.. [1] E. T. Whittaker, On a new method of graduation, Proc. Edinburgh Math. Soc. 41 (1923).
.. [2] P. H. C. Eilers, A perfect smoother, Anal. Chem. 75 (2003).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from models.arrays import FloatArray
from models.robust import normal_sd

PART_COUNT = 64
"""Parts of a record in each of which the curve must follow the readings: over the whole record a
short misfit, where the temperature turns, would average out.
"""
MAX_LOCAL_RMS = 1.6
"""Rms residual of a part, in errors, beyond which the curve does not follow; chosen below the √3 of half a step."""
MEAN_MEASUREMENTS = 16
"""Measurements whose mean must not be `MAX_MEAN_DISTANCE` off: the noise of their mean is 1/4 of one error."""
MAX_MEAN_DISTANCE = 1.4
"""Distance in errors; half a step, which rounding takes a reading off at most, is √3 of them."""


def code_step(values: FloatArray) -> float:
    """Return the quantizer step of readings, shape (n,); 0 where they take too many values for one."""
    codes = np.unique(values)
    if not 2 <= len(codes) <= max(2, len(values) // 20):
        return 0.0
    return float(np.median(np.diff(codes)))


def smoothed(readings: FloatArray, step: float, repeats: int = 1) -> FloatArray:
    """Return the smoothest curve within the error of readings, shape (n,).

    Parameters
    ----------
    readings : ndarray, shape (n,)
    step : float
        Their quantizer step; 0 for none.
    repeats : int
        Readings that repeat one measurement.
    """
    curve = readings
    if len(readings) < 4 * PART_COUNT:
        return curve
    repeats = min(repeats, len(readings) // PART_COUNT)
    second = readings[2 * repeats :] - 2.0 * readings[repeats:-repeats] + readings[: -2 * repeats]
    error = max(step / np.sqrt(12.0), float(normal_sd(second)) / np.sqrt(6.0))
    if error == 0.0:
        return curve
    low, high = -2.0, 13.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        trial = _whittaker(readings, 10.0**middle)
        if _within(readings - trial, error, MEAN_MEASUREMENTS * repeats):
            low, curve = middle, trial
        else:
            high = middle
    return curve


def typical_repeats(values: FloatArray) -> int:
    """Return how many equal values follow each other, typically."""
    change = np.flatnonzero(np.diff(values))
    return int(np.median(np.diff(change))) if len(change) > 1 else len(values)


def _within(rest: FloatArray, error: float, few: int) -> bool:
    total = np.concatenate(([0.0], np.cumsum(rest)))
    farthest = float(np.abs(total[few:] - total[:-few]).max()) / few
    parts = rest[: len(rest) // PART_COUNT * PART_COUNT].reshape(PART_COUNT, -1)
    worst = float(np.sqrt(np.mean(parts**2, axis=1)).max())
    return (
        float(np.std(rest)) <= error
        and worst <= MAX_LOCAL_RMS * error
        and farthest <= MAX_MEAN_DISTANCE * error
    )


def _whittaker(y: FloatArray, weight: float) -> FloatArray:
    """Return the minimum of Σ(x − y)² + weight Σ(third differences of x)²."""
    n, third = len(y), np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, n))
    for i in range(4):
        for j in range(i, 4):
            bands[3 - (j - i), j : n - 3 + j] += weight * third[i] * third[j]
    bands[3] += 1.0
    centre = float(y.mean())
    return np.asarray(centre + solveh_banded(bands, y - centre))
