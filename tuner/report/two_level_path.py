"""The likeliest path of a bias between two levels through noisy means, for the picture that shows it."""

from __future__ import annotations

import math

import numpy as np

from models.arrays import FloatArray
from models.robust import normal_sd

LEVEL_PASSES = 3
"""Times the level is found again from what the path leaves: it moves by less than a tenth of the noise after two."""


def two_level_path(
    means: FloatArray, interval: float, size: float, dwells: tuple[float, float]
) -> FloatArray:
    """Return the likeliest path (Viterbi) between two levels.

    Parameters
    ----------
    means : ndarray, shape (n,)
        Bias, averaged over `interval`; its noise follows from neighbours, which seldom lie on two levels.
    interval : float
        s.
    size : float
        Upper less lower level, in the unit of `means`.
    dwells : (float, float)
        Mean time on the lower and the upper level, s.
    """
    noise = float(normal_sd(np.diff(means))) / math.sqrt(2.0)
    leave = [min(-math.expm1(-interval / dwell), 0.5) for dwell in dwells]
    move = np.log([[1.0 - leave[0], leave[0]], [leave[1], 1.0 - leave[1]]])
    share = dwells[1] / (dwells[0] + dwells[1])
    levels = np.array([-share, 1.0 - share]) * size
    offset = float(np.mean(means))
    path = np.full(len(means), offset)
    for _ in range(LEVEL_PASSES):
        fit = -0.5 * ((means[:, None] - offset - levels) / max(noise, 1e-300)) ** 2
        came = np.zeros((len(means), 2), dtype=int)
        best = fit[0]
        for k in range(1, len(means)):
            candidates = best[:, None] + move
            came[k] = candidates.argmax(axis=0)
            best = candidates.max(axis=0) + fit[k]
        state = np.empty(len(means), dtype=int)
        state[-1] = int(best.argmax())
        for k in range(len(means) - 1, 0, -1):
            state[k - 1] = came[k, state[k]]
        offset = float(np.mean(means - levels[state]))
        path = offset + levels[state]
    return np.asarray(path)
