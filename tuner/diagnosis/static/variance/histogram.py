"""Residuals in narrow bins: likelihoods of a law cost the number of bins, not of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.arrays import SAMPLES_AT_ONCE, FloatArray
from models.probability import log_normal_density

CELL_WIDTH = 0.02
"""Width of a bin, sds: grouping takes width²/12 = 3e-5 from the variance."""
MAX_DEVIATION = 60.0
"""Residuals beyond are counted at this deviation, sds; chosen to bound the number of bins."""


@dataclass(frozen=True)
class Histogram:
    """Filled bins: `value` is the mean of what is in them and `count` its number, shapes (b,).

    Not their middle: codes lie elsewhere in each bin, which bends the law of 1e5 samples on codes of 0.3 sd visibly.
    """

    value: FloatArray
    count: FloatArray

    def normal_cost(self) -> float:
        """Return minus the log likelihood of the normal law of best variance."""
        sd = float(np.sqrt(self.count @ self.value**2 / self.count.sum()))
        return -float(self.count @ log_normal_density(self.value, sd))


def histogram(e: FloatArray, *, clip: float = MAX_DEVIATION, sd: float = 1.0) -> Histogram:
    """Return the bins of residuals in sds; what lies beyond `clip` is put there."""
    count, total = np.zeros((2, round(2.0 * clip / CELL_WIDTH) + 1))
    for first in range(0, len(e), SAMPLES_AT_ONCE):
        part = np.clip(e[first : first + SAMPLES_AT_ONCE] / sd, -clip, clip)
        place = np.round((part + clip) / CELL_WIDTH).astype(int)
        count += np.bincount(place, minlength=len(count))
        total += np.bincount(place, part, len(count))
    filled = np.flatnonzero(count)
    return Histogram(total[filled] / count[filled], count[filled])
