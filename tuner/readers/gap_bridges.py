"""Values in place of missing samples: what those beside a gap predict, and a draw of what they cannot know.

The mean of the neighbours, as many as make the Allan deviation least, is the level at a gap. What is left of the
nearest ones, r, predicts that of the missing samples through the autocovariance of r, with the smallest error (simple
kriging: Chilès and Delfiner, Geostatistics, 2nd ed., section 3.3), whose covariance follows:

    W = Cov(near)⁻¹ Cov(near, missing),    r̂ = Wᵀ r,    Cov(error) = Cov(missing) − Cov(missing, near) W

A normal error is drawn from that covariance (conditional simulation, section 7.3). White noise stays white, a smooth
signal gets a curve through its neighbours. A straight line instead colours white noise at once: in a log that misses
1 % of its samples it makes a process of a few samples.
"""

from __future__ import annotations

import math

import numpy as np

from models.arrays import FloatArray, IntArray

SHORTEST_LEVEL = 128
"""Fewest samples whose mean is the level at a gap."""
LEAST_CLUSTERS = 16
"""Clusters from which an Allan deviation is known to a third."""
MAX_COLOUR = 1e-3
"""Correlation that straight lines may leave: each pass, with the autocovariance of what stands in the gaps by then,
leaves of it the share of the samples that are missing."""
NEAR_SAMPLES = 16
"""Samples that predict what differs from the level: a filter inside a sensor reaches over fewer."""
DRAWING_SEED = 0
"""Of the draws: a log is read alike every time."""
_LONGEST_LAG = 4 * NEAR_SAMPLES
"""Longest distance at which samples are taken to be correlated."""
_CHUNK_COUNT, _CHUNK_SAMPLES = 8, 8192
"""Pieces of a record from which C is taken, and their length: correlations are then known to 0.004."""
_GAPS_AT_ONCE = 1 << 12
"""Gaps treated at a time, so that memory stays bounded: 20 MB."""
_LEAST_UNPREDICTED_SHARE = 1e-6
"""Share of the variance that no neighbour predicts: keeps the equations of smooth signals solvable."""


def bridged(
    samples: FloatArray, positions: IntArray, segments: tuple[tuple[int, int], ...], stream: int
) -> FloatArray:
    """Return samples on an even grid with simulated ones where they are missing, shape (N,).

    Segments of too few samples get straight lines.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        What was recorded, of any type of number.
    positions : ndarray of int, shape (n,)
        Place of each sample on the grid, rising.
    segments : tuple of (start, stop)
        Ranges of the grid that no long gap parts.
    stream : int
        Number of the axis: what is drawn for one does not depend on the others.
    """
    samples = np.asarray(samples, np.float64)  # counts overflow in differences, single precision does in sums
    out = np.interp(np.arange(int(positions[-1]) + 1), positions, samples)
    edges = np.searchsorted(positions, np.array(segments))
    within = np.searchsorted(edges[:, 0], np.arange(len(samples)), side="right") - 1
    low, high = edges[within].T
    inside = np.arange(1, len(samples)) < high[:-1]
    before = np.flatnonzero((np.diff(positions) > 1) & inside & ((high - low)[:-1] >= NEAR_SAMPLES))
    if not len(before):
        return out
    reach = quietest_cluster(out, segments) // 2
    level = _level(samples, low, high, reach)
    left, levels = samples - level, np.interp(np.arange(len(out)), positions, level)
    length = positions[before + 1] - positions[before] - 1
    for _ in range(math.ceil(math.log(MAX_COLOUR) / math.log(1.0 - len(samples) / len(out)))):
        covariance = _autocovariance(out - levels)
        rng = np.random.default_rng([DRAWING_SEED, stream])
        for gap in np.unique(length):
            of_this = before[length == gap]
            for start in range(0, len(of_this), _GAPS_AT_ONCE):
                first = of_this[start : start + _GAPS_AT_ONCE, None]
                nearest = np.clip(first + 1 - NEAR_SAMPLES // 2, low[first], high[first] - NEAR_SAMPLES)
                near = nearest + np.arange(NEAR_SAMPLES)
                missing = positions[first] + 1 + np.arange(gap)
                drawn = _simulated(left[near], positions[near], missing, covariance, rng)
                out[missing] = levels[missing] + drawn
    return out


def quietest_cluster(samples: FloatArray, segments: tuple[tuple[int, int], ...]) -> int:
    """Return the cluster size, a power of two, of the least Allan deviation: noise and drift err alike there."""
    start, stop = max(segments, key=lambda piece: piece[1] - piece[0])
    size, best = SHORTEST_LEVEL, (np.inf, SHORTEST_LEVEL)
    while size * LEAST_CLUSTERS <= stop - start:
        count = (stop - start) // size
        means = samples[start : start + count * size].reshape(count, size).mean(axis=1)
        best = min(best, (float(np.mean(np.diff(means) ** 2)), size))
        size *= 2
    return best[1]


def _level(samples: FloatArray, low: IntArray, high: IntArray, reach: int) -> FloatArray:
    """Return the mean of the samples around each, `reach` on either side, within its segment from `low` to `high`."""
    total = np.concatenate(([0.0], np.cumsum(samples - samples[0])))
    at = np.arange(len(samples))
    begin = np.maximum(at - reach, low)
    end = np.maximum(np.minimum(at + 1 + reach, high), begin + 1)
    return np.asarray(samples[0] + (total[end] - total[begin]) / (end - begin))


def _autocovariance(left: FloatArray) -> FloatArray:
    """Return C(h) for distances h = 0 … `_LONGEST_LAG`, and zero for longer ones, of samples on the grid.

    In the first pass straight lines stand in for what is missing, in the next what they made.
    """
    length = min(_CHUNK_SAMPLES, len(left))
    starts = np.unique(np.linspace(0, len(left) - length, _CHUNK_COUNT).astype(np.int64))
    covariance = np.zeros(min(_LONGEST_LAG + 1, length))
    for start in starts:
        power = np.abs(np.fft.rfft(left[start : start + length], 2 * length)) ** 2
        covariance += np.fft.irfft(power)[: len(covariance)]
    return np.append(covariance / (len(starts) * length), 0.0)


def _simulated(
    left: FloatArray, near: IntArray, missing: IntArray, covariance: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return what differs from the level at missing places, shape (gaps, g), from that at near ones, (gaps, m)."""

    def between(one: IntArray, other: IntArray) -> FloatArray:
        apart = np.abs(one[:, :, None] - other[:, None, :])
        return np.asarray(covariance[np.minimum(apart, len(covariance) - 1)])

    nugget = _LEAST_UNPREDICTED_SHARE * covariance[0] + np.finfo(float).tiny
    known = between(near, near) + nugget * np.eye(near.shape[1])
    across = between(near, missing)
    weights = np.linalg.solve(known, across)
    error = between(missing, missing) - np.swapaxes(across, 1, 2) @ weights
    values, vectors = np.linalg.eigh(error)
    drawn = np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(values.shape)
    predicted = np.einsum("km,kmg->kg", left, weights)
    return np.asarray(predicted + np.einsum("kgh,kh->kg", vectors, drawn))
