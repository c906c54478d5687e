"""How well a block foretells the integral of the samples: its Kalman filter on means of one second.

The filter estimates the bias states of the block from means of the samples, and predicts what the samples will add up
to over the next 10, 60 and 300 s: the angle or velocity that a navigation filter would lose in an outage. The error of
that prediction against the samples themselves, and the variance that the filter states for it, are averaged over
the record.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from models.arrays import FloatArray
from tuner.identification.predictive.criteria import forecast_comparison
from tuner.types.prediction import ForecastComparison, NoiseBlock

HORIZONS = (10.0, 60.0, 300.0)
"""Durations ahead, s."""
MEAN_OVER = 1.0
"""Length of the means that the filter takes in, s."""
MIN_WINDOWS = 8
"""Horizons that must fit into a stretch without a gap."""
SETTLING_SHARE = 0.1
"""Share of each stretch in which the filter settles and nothing is judged."""


def compare_forecasts(
    pieces: Sequence[FloatArray], interval: float, block: NoiseBlock
) -> tuple[ForecastComparison, ...]:
    """Return the comparison for each horizon that fits into the longest stretch.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Stretches of one axis without a gap.
    interval : float
        Sampling interval, s.
    block : NoiseBlock
        What the filter has.
    """
    per_mean = max(round(MEAN_OVER / interval), 1)
    step = per_mean * interval
    longest = max(len(piece) // per_mean for piece in pieces)
    horizons = [h for h in HORIZONS if MIN_WINDOWS * h <= longest * step and round(h / step) >= 1]
    if not horizons:
        return ()
    system = _system(block.without_fast_states(step), step)
    ahead = np.array([round(h / step) for h in horizons], dtype=np.int64)
    gains, floors = _predictions(block.without_fast_states(step), np.asarray(ahead * step, dtype=float))
    total, predicted, judged = np.zeros(len(ahead)), np.zeros(len(ahead)), np.zeros(len(ahead))
    for piece in pieces:
        means = _means(piece, per_mean)
        if len(means) <= MIN_WINDOWS:
            continue
        error, stated, count = _run_filter(means, step, *system, ahead, gains, floors, SETTLING_SHARE)
        total, predicted, judged = total + error, predicted + stated, judged + count
    bounded = np.array([block.bounded_integral_variance(h * step) for h in ahead])
    return tuple(
        forecast_comparison(
            h, float(np.sqrt(total[j] / (predicted[j] + judged[j] * bounded[j]))), longest * step
        )
        for j, h in enumerate(horizons)
        if judged[j]
    )


def _means(piece: FloatArray, per_mean: int) -> FloatArray:
    n = len(piece) // per_mean
    return np.asarray((piece[: n * per_mean] - piece.mean()).reshape(n, per_mean).mean(axis=1))


def _system(block: NoiseBlock, step: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return decay and driving variance of each state, first variances, and the variance of a mean.

    The last state is the constant with its random walk.
    """
    times = np.array([state.time_constant for state in block.states])
    power = np.array([state.sd**2 for state in block.states])
    decay = np.append(np.exp(-step / times), 1.0)
    driving_variance = np.append(power * (1.0 - decay[:-1] ** 2), block.random_walk_density**2 * step)
    noise = block.white_density**2 / step + 2.0 * (block.increment_sd / step) ** 2
    return decay, driving_variance, power, noise


def _predictions(block: NoiseBlock, durations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far each state carries over each duration, (h, k + 1), and the variance that noise adds, (h,)."""
    times = np.array([state.time_constant for state in block.states])
    gains = np.stack([np.append(times * -np.expm1(-h / times), h) for h in durations])
    added = []
    for h in durations:
        age = (np.arange(400) + 0.5) * h / 400.0
        variance = block.white_density**2 * h + block.random_walk_density**2 * h**3 / 3.0
        for state in block.states:
            reach = state.time_constant * -np.expm1(-age / state.time_constant)
            variance += 2.0 * state.sd**2 / state.time_constant * float(np.mean(reach**2)) * h
        added.append(variance)
    return gains, np.array(added)


@njit(cache=True, nogil=True)
def _run_filter(  # type: ignore[no-untyped-def]
    means, step, decay, driving_variance, power, noise, ahead, gains, floors, settling_share
):
    """Return squared errors, stated variances and counts of all forecasts, shapes (h,)."""
    n, k = len(means), len(decay)
    spread = np.std(means)
    state, covariance = np.zeros(k), np.zeros((k, k))
    for j in range(k - 1):
        covariance[j, j] = power[j]
    covariance[k - 1, k - 1] = (100.0 * spread) ** 2 + 1e-30
    state[k - 1] = means[0]
    measured_noise = noise + 1e-6 * spread**2
    integral = np.zeros(n + 1)
    for i in range(n):
        integral[i + 1] = integral[i] + means[i] * step
    error, stated, count = np.zeros(len(ahead)), np.zeros(len(ahead)), np.zeros(len(ahead))
    first = int(n * settling_share)
    gain = np.zeros(k)
    for i in range(n):
        if i >= first:
            for h in range(len(ahead)):
                if i + ahead[h] <= n:
                    foretold, variance = 0.0, floors[h]
                    for a in range(k):
                        foretold += gains[h, a] * state[a]
                        for b in range(k):
                            variance += gains[h, a] * covariance[a, b] * gains[h, b]
                    error[h] += (integral[i + ahead[h]] - integral[i] - foretold) ** 2
                    stated[h] += variance
                    count[h] += 1.0
        innovation, total = means[i], measured_noise
        for a in range(k):
            innovation -= state[a]
            gain[a] = 0.0
            for b in range(k):
                gain[a] += covariance[a, b]
            total += gain[a]
        for a in range(k):
            gain[a] /= total
        for a in range(k):
            state[a] = decay[a] * (state[a] + gain[a] * innovation)
            for b in range(k):
                covariance[a, b] = decay[a] * decay[b] * (covariance[a, b] - gain[a] * gain[b] * total)
            covariance[a, a] += driving_variance[a]
    return error, stated, count
