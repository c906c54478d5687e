"""Saturation: no sample exceeds a limit (rail) that the noise should have crossed.

A sample is predicted from those before it (moving mean and autoregression) with the normal error σ. Unclipped
samples exceed a rail r with ::

    p = exp(−ρ²E) for none at all,   E = Σ_t Φ(−(r − prediction_t)/σ_t)

where ρ ≤ 1, the samples found beyond a level half a sd inside the rail ÷ those expected there, guards against
noise whose tails are lighter than normal. At a rail all that should have exceeded it lies on one value: ρ²E samples
or nearly so must be there, as at the steep end of skewed noise they are not, and where the quantizer is fine enough to
show it, the count there is also compared with the tail inside it, continued as a parabola in the logarithm. Both
chances must be small. With a coarse quantizer noise with hard ends of its own, such as a uniform one, looks clipped.

Where values are fine, equal values at the end are enough by themselves: the c outermost samples of a tail that falls
by the rate λ lie within a step δ of each other with the chance [1]_ ::

    p = (1 − exp(−λδ))^(c − 1)

if the rail is one that noise, or spikes of other sizes, should have crossed: equal glitches are no rail.

References
----------
.. [1] A. Rényi, On the theory of order statistics, Acta Math. Hung. 4 (1953): gaps between the largest of exponential
   samples are independent, the k-th one of mean 1/(λk).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.special import ndtr

from models.arrays import FloatArray
from models.probability import negative_binomial_at_least, poisson_at_least, rounding_variance
from tuner.segments.error_codes import MAX_TAIL_EXCESS
from tuner.segments.frozen import MIN_RAIL_SAMPLES
from tuner.segments.quantizer import MIN_NOISE_VARIANCE, fast_part

PREDICTION_ORDER = 32
"""Order of the autoregression that predicts a sample; chosen to whiten the filtered noise of digital sensors."""
BLOCK_SAMPLES = 4096
"""Samples over which σ is constant: its estimate is then good to 1/√8192 = 1 %."""
MAX_PREDICTED_STEP = 1.2
"""Step ÷ σ above which prediction errors of rounded samples are too far from normal for E.

Up to a step of one σ the variance is σ² + step²/12 within 1e-7 wherever the mean lies; at two σ it varies by 2 %.
"""
MIN_KEPT_SHARE = 0.7
"""Least samples at a rail ÷ those that should have exceeded it, ρ²E: 1 and more where all of them stay there.

With it 175 of 180 rails at 1.5 … 3.5 sds of normal, heavy-tailed and skewed noise are found, as many as without.
"""
MAX_COUNTED_STEP = 0.15
"""Largest step ÷ sd at which samples that saturate show in the count at the rail.

Chosen so that a code of the tail has few samples of its own beside those of the whole tail beyond.
"""
SPIKE_DEVIATIONS = 5.0
"""Sds beyond which samples are spikes: 6e-7 for normal noise, less than one in a million samples."""
END_P_VALUE = 1e-3
"""P-value (Poisson) below which the samples at an end are more than the noise gives there.

It is a precondition of the test of ties only, so that its value is not critical.
"""
MIN_DISTINCT_VALUES = 1e6
"""Least number of values in the range of data without a quantizer: single precision has 1.7e7."""
MAX_TAIL_STEEPNESS = 2.0
"""Factor by which a tail may fall faster than that of a Gaussian.

Chosen so that light tails are not taken for rails.
"""


@dataclass(frozen=True)
class Rail:
    """One end of the range of a channel, with the test whether it saturates there.

    Attributes
    ----------
    level : float
        Outermost value, unit.
    count : int
        Samples there.
    crossings : float
        Samples that should lie beyond it, E.
    p_value : float
        Chance that unclipped noise ends there, doubled for the two ends; 1 where the quantizer is too coarse.
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
        Its quantizer step, unit; 0 for none.

    Returns
    -------
    (Rail, Rail)
        The low and the high end.
    """
    low = _upper_end([-piece for piece in pieces], step)
    return Rail(-low.level, low.count, low.crossings, low.p_value), _upper_end(pieces, step)


def _upper_end(pieces: Sequence[FloatArray], step: float) -> Rail:
    level = max(float(piece.max()) for piece in pieces)
    slack = 0.5 * step
    count = (
        sum(int(np.count_nonzero(piece > level - slack)) for piece in pieces)
        if step > 0
        else _ties(pieces, level)
    )
    if count < MIN_RAIL_SAMPLES:
        return Rail(level, count, 0.0, 1.0)
    noises = [fast_part(piece) for piece in pieces]
    spread = math.sqrt(float(np.mean(np.concatenate(noises) ** 2)))
    width = max(1.0, round(0.5 * spread / step)) * step if step > 0 else 0.5 * spread
    whitener = _prediction_error_filter(noises)
    errors = [np.convolve(noise, whitener)[: len(noise)] for noise in noises]
    sd = math.sqrt(float(np.mean(np.concatenate(errors) ** 2)))
    if sd == 0.0 or step > MAX_PREDICTED_STEP * sd:
        return Rail(level, count, 0.0, 1.0)
    crossings = _crossings(pieces, errors, level + slack, step)
    edges = [level - slack - k * width for k in range(3)]
    beyond = [sum(int(np.count_nonzero(piece > edge)) for piece in pieces) for edge in edges]
    inside = _crossings(pieces, errors, edges[1], step)
    lightness = min(1.0, beyond[1] / inside) if inside > 0.0 else 1.0
    p_value = math.exp(-crossings * lightness**2)
    if count < MIN_KEPT_SHARE * crossings * lightness**2:  # what saturates stays at the rail
        p_value = 1.0
    if step <= MAX_COUNTED_STEP * spread:
        p_value = max(p_value, _pile(count, beyond[1] - count, beyond[2] - beyond[1], step, width, spread))
        if _reachable(pieces, level, slack, count, crossings, spread):
            p_value = min(p_value, _tie(pieces, level, step, spread))
    return Rail(level, count, crossings, min(1.0, 2.0 * p_value))


def _reachable(
    pieces: Sequence[FloatArray], level: float, slack: float, count: int, crossings: float, spread: float
) -> bool:
    """Whether the noise reaches the end, or explains all samples there, or as many others lie far away."""
    if poisson_at_least(count, MAX_TAIL_EXCESS * crossings) > END_P_VALUE:
        return True
    y = np.concatenate(pieces)
    away = np.abs(y - np.median(y))
    far = away > SPIKE_DEVIATIONS * spread
    return bool(np.count_nonzero(far & (y < level - slack)) >= count)


def _tie(pieces: Sequence[FloatArray], level: float, step: float, spread: float) -> float:
    """Return the chance that the outermost samples, one a visit, are as close to each other as they are."""
    y = np.concatenate(pieces)
    at = y > level - 0.5 * step if step > 0 else y == level
    visits = int(np.count_nonzero(np.diff(at.astype(np.int8), prepend=np.int8(0)) > 0))
    grain = max(step, float(np.ptp(y)) / MIN_DISTINCT_VALUES)
    rate = max(level - float(np.median(y)), spread) / spread**2
    return float(-math.expm1(-MAX_TAIL_STEEPNESS * rate * grain)) ** max(visits - 1, 0)


def _ties(pieces: Sequence[FloatArray], level: float) -> int:
    return sum(int(np.count_nonzero(piece == level)) for piece in pieces)


def _crossings(pieces: Sequence[FloatArray], errors: Sequence[FloatArray], edge: float, step: float) -> float:
    """Return how many samples should exceed the edge, given the errors of their predictions."""
    expected = 0.0
    for piece, error in zip(pieces, errors, strict=True):
        prediction = piece - error
        for i in range(PREDICTION_ORDER, len(piece), BLOCK_SAMPLES):
            square = float(np.mean(error[i : i + BLOCK_SAMPLES] ** 2))
            sigma = math.sqrt(
                max(square - rounding_variance(step), MIN_NOISE_VARIANCE * step**2, np.finfo(float).tiny)
            )
            expected += float(np.sum(ndtr((prediction[i : i + BLOCK_SAMPLES] - edge) / sigma)))
    return expected


def _pile(count: int, first: int, second: int, step: float, width: float, spread: float) -> float:
    """Return the chance of `count` samples at the outermost value, given those in the two bands inside it.

    The logarithm of the density of the bands, whose centres are (step + width)/2 and one width more inside,
    is continued to the outermost value with the curvature −1/spread² of a Gaussian of all the noise, which is
    the least that noise of lighter tails has.
    """
    inside = 0.5 * (step + width)
    weight = inside / width
    log_first, log_second = math.log((first + 0.5) / width), math.log((second + 0.5) / width)
    curve = 0.5 * inside * (inside + width) / spread**2
    expected = step * math.exp(log_first + weight * (log_first - log_second) - curve)
    variance = (1.0 + weight) ** 2 / (first + 0.5) + weight**2 / (second + 0.5)
    return negative_binomial_at_least(count, expected, variance)


def _prediction_error_filter(noises: Sequence[FloatArray]) -> FloatArray:
    """Return 1, −a_1, …, −a_p of the autoregression of order `PREDICTION_ORDER` that the noise has (Yule–Walker)."""
    covariance = np.zeros(PREDICTION_ORDER + 1)
    for noise in noises:
        if len(noise) > PREDICTION_ORDER:
            covariance += [
                float(noise[lag:] @ noise[: len(noise) - lag]) for lag in range(PREDICTION_ORDER + 1)
            ]
    if covariance[0] == 0.0:
        return np.array([1.0])
    covariance[0] *= 1.0 + 1e-9
    return np.concatenate(([1.0], -solve_toeplitz(covariance[:-1], covariance[1:])))
