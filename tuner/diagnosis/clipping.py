"""Saturation: nothing exceeds a rail that noise should have crossed.

A sample is predicted from those before it (moving mean and autoregression) with the normal error σ. Unclipped
samples exceed a rail r with ::

    p = exp(−E) for none at all,   E = Σ_t Φ(−(r − prediction_t)/σ_t)

Noise of light tails would not exceed it either; but at a rail all that should have exceeded it lies on one
value. Where the lattice is fine the value at the rail is therefore also compared with its neighbour: in the
tail of any noise the outermost code is not fuller than the next one, and the chance that it is, is binomial.
Both must be small. On a coarse lattice noise with hard ends of its own, such as a uniform one, looks clipped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.special import ndtr
from scipy.stats import binom

from tuner.diagnosis.codes import FLOOR, fast_part

FloatArray = NDArray[np.float64]

ORDER = 32
"""Samples that a prediction looks back."""
BLOCK = 4096
"""Samples over which σ is constant."""
LEAST = 3
"""Samples at a rail that make it one."""
COARSE = 1.2
"""Step ÷ σ above which a prediction from rounded samples is too far from normal."""
FINE = 0.1
"""Largest step ÷ σ at which the outermost code of unclipped noise is emptier than the next one."""


@dataclass(frozen=True)
class Rail:
    """One end of the range of a channel.

    Attributes
    ----------
    level : float
        Outermost value, unit.
    count : int
        Samples there.
    crossings : float
        Samples that should lie beyond it, E.
    p_value : float
        Chance that unclipped noise ends there, doubled for the two ends; 1 where the lattice is too coarse.
    """

    level: float
    count: int
    crossings: float
    p_value: float


def rails(pieces: Sequence[FloatArray], step: float) -> tuple[Rail, Rail]:
    """Test both ends of the range of one channel.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        Gap-free samples of the channel.
    step : float
        Its lattice step, unit; 0 for none.

    Returns
    -------
    (Rail, Rail)
        The low and the high end.
    """
    low = _upper_end([-piece for piece in pieces], step)
    return Rail(-low.level, low.count, low.crossings, low.p_value), _upper_end(pieces, step)


def _upper_end(pieces: Sequence[FloatArray], step: float) -> Rail:
    level = max(float(piece.max()) for piece in pieces)
    slack = 0.25 * step
    count = sum(int(np.count_nonzero(piece >= level - slack)) for piece in pieces)
    if count < LEAST:
        return Rail(level, count, 0.0, 1.0)
    noises = [fast_part(piece) for piece in pieces]
    whitener = _prediction_error_filter(noises)
    crossings, variance = 0.0, 0.0
    for piece, noise in zip(pieces, noises, strict=True):
        error = lfilter(whitener, [1.0], noise)
        prediction = piece - error
        variance += float(np.sum(error**2))
        for i in range(ORDER, len(piece), BLOCK):
            square = float(np.mean(error[i : i + BLOCK] ** 2))
            sigma = np.sqrt(max(square - step**2 / 12.0, FLOOR * step**2, np.finfo(float).tiny))
            crossings += float(np.sum(ndtr((prediction[i : i + BLOCK] - level - 0.5 * step) / sigma)))
    sd = math.sqrt(variance / sum(map(len, pieces)))
    if sd == 0.0 or step > COARSE * sd:
        return Rail(level, count, crossings, 1.0)
    p_value = float(np.exp(-crossings))
    if step <= FINE * sd:
        beside = sum(int(np.count_nonzero(np.abs(piece - level + step) <= slack)) for piece in pieces)
        beside -= count if step == 0.0 else 0
        p_value = max(p_value, float(binom.sf(count - 1, count + beside, 0.5)))
    return Rail(level, count, crossings, min(1.0, 2.0 * p_value))


def _prediction_error_filter(noises: Sequence[FloatArray]) -> FloatArray:
    """Return 1, −a_1, …, −a_p of the autoregression of order `ORDER` that the noise has (Yule–Walker)."""
    covariance = np.zeros(ORDER + 1)
    for noise in noises:
        if len(noise) > ORDER:
            covariance += [float(noise[lag:] @ noise[: len(noise) - lag]) for lag in range(ORDER + 1)]
    if covariance[0] == 0.0:
        return np.array([1.0])
    covariance[0] *= 1.0 + 1e-9
    return np.concatenate(([1.0], -solve_toeplitz(covariance[:-1], covariance[1:])))
