"""What the law of the samples, heavier in its tails than the normal one, adds to the variance of a white power.

The variance s² of n independent samples has itself the variance σ⁴ (2/(n − 1) + κ/n), κ the excess kurtosis [1]_. The
second part is one and the same for the powers of all frequencies, so that no number of them averages it away: any
two have the covariance σ⁴ κ/n. The κ is that of neighbouring differences, which slow noise and ramps do not reach:
with equal and independent samples the fourth cumulant of a difference is twice that of a sample. Its own standard error
is added: it rests on the few largest samples, and is too small more often than too large.

References
----------
.. [1] M. G. Kendall, A. Stuart, The Advanced Theory of Statistics, vol. 1 (1963), sampling variances of moments.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.arrays import SAMPLES_AT_ONCE, FloatArray

CLEAR_KURTOSIS = 2.0
"""Standard errors above which tails are heavier than normal ones: below, a normal law keeps the intervals it has."""


def variance_by_law(pieces: Sequence[FloatArray], interval: float, m: int = 1) -> float:
    """Return the variance of the white power N² that comes from the law of the samples, unit⁴/Hz²: 0 for a normal one.

    Lighter tails than normal ones count as normal: a line has such tails, too, and says nothing of the noise.

    Parameters
    ----------
    pieces : sequence of ndarray
        Samples of each gap-free segment, unit.
    interval : float
        Sampling interval, s.
    m : int
        Samples a mean, where shorter clusters are not independent.
    """
    number, sums = 0, np.zeros(4)  # of the second, fourth, sixth and eighth powers
    step = m * max(SAMPLES_AT_ONCE // m, 2)
    for piece in pieces:
        for first in range(0, len(piece), step):
            part = piece[first : first + step + m]  # with the first mean of the next part
            means = part[: len(part) // m * m].reshape(-1, m).mean(axis=1) if m > 1 else part
            if len(means) < 2:
                continue
            square = np.diff(means) ** 2
            fourth = square * square
            number += len(square)
            sums += square.sum(), fourth.sum(), square @ fourth, fourth @ fourth
    if sums[0] == 0.0:
        return 0.0
    variance = float(sums[0]) / number
    four, six, eight = (sums[1:] / (number * variance ** np.arange(2.0, 5.0))).tolist()
    if four - 3.0 < CLEAR_KURTOSIS * np.sqrt(
        27.0 / number
    ):  # 24/n, and neighbouring differences have correlation −½
        return 0.0
    spread = np.sqrt(2.0 * max(eight - 4.0 * four * six + 4.0 * four**3 - four**2, 0.0) / number)
    density = 0.5 * variance * m * interval
    return float(2.0 * (four - 3.0 + spread) * density**2 / number)
