"""The overlapping Allan variance of a record on a dense grid of cluster times, with its degrees of freedom.

Four cluster times an octave, from ten samples to a tenth of the longest stretch without a gap. A noise model is
fitted on all of them and judged on those up to a thirtieth: beyond, one record says too little of what the next will
show. Each kind of noise has its own degrees of freedom; those of a sum follow from the share that each kind has of
the variance, 1/ν = Σ share_j/ν_j.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray, IntArray
from tuner.curves import dof
from tuner.curves.allan import overlapping_allan
from tuner.types.prediction import MeasuredAllan

MIN_CLUSTER = 10
"""Samples of the shortest cluster: a shorter one shows the sensor's own low-pass filter, which no filter model has."""
POINTS_PER_OCTAVE = 4
"""Cluster times an octave; neighbours are then correlated, and none falls between two points unseen."""
LONGEST_SHARE = 0.1
"""Longest cluster time ÷ length of the longest stretch: some five independent differences are left."""
NOISE_KINDS = ("quantization", "white", "bias_instability", "random_walk")
"""Pure noises whose degrees of freedom stand for those of every component of a fit."""


def measured_allan(pieces: Sequence[FloatArray], interval: float) -> MeasuredAllan | None:
    """Return the curve of stretches without a gap, pooled; None where fewer than four points can be judged.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n_i,)
        Samples of one axis.
    interval : float
        Sampling interval, s.
    """
    lengths = np.array([len(piece) for piece in pieces])
    m = _cluster_sizes(int(lengths.max(initial=0)))
    if not m.size:
        return None
    weight, total = np.zeros(len(m)), np.zeros(len(m))
    for piece in pieces:
        fits = 2 * m <= len(piece)
        terms = len(piece) + 1.0 - 2.0 * m[fits]
        total[fits] += terms * overlapping_allan(piece - piece.mean(), m[fits])
        weight[fits] += terms
    variance = total / weight
    measured = MeasuredAllan(
        interval,
        float(lengths.max()) * interval,
        np.asarray(m * interval, dtype=float),
        np.asarray(variance, dtype=float),
        {kind: _pooled_dof(kind, lengths, m) for kind in NOISE_KINDS},
    )
    return measured if np.sum(measured.judged) >= 4 and np.all(variance > 0.0) else None


def _cluster_sizes(n: int) -> IntArray:
    longest = LONGEST_SHARE * n
    octaves = np.arange(0.0, np.log2(max(longest, 1.0)) * POINTS_PER_OCTAVE + 1.0) / POINTS_PER_OCTAVE
    m = np.unique(np.rint(2.0**octaves).astype(np.int64))
    return m[(m >= MIN_CLUSTER) & (m <= longest)]


def _pooled_dof(kind: str, lengths: IntArray, m: IntArray) -> FloatArray:
    total = np.zeros(len(m))
    for length, number in zip(*np.unique(lengths, return_counts=True), strict=True):
        fits = 2 * m <= length
        total[fits] += number * dof("oadev", int(length), m[fits], kind)
    return total
