"""Residuals in narrow bins: likelihoods of a law cost the number of bins, not of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.probability import log_normal_density

FloatArray = NDArray[np.float64]

CELL_WIDTH = 0.02
"""Width of a bin, sds: grouping adds width²/12 = 3e-5 to the variance."""
MAX_DEVIATION = 60.0
"""Residuals beyond are counted at this deviation, sds; chosen to bound the number of bins."""

SAMPLES_AT_ONCE = 1 << 16
"""Samples treated at a time, so that what is computed from them stays in the cache of a processor."""


@dataclass(frozen=True)
class Histogram:
    """Filled bins: `value` at their middle and `count` in them, shapes (b,)."""

    value: FloatArray
    count: FloatArray

    def normal_cost(self) -> float:
        """Return minus the log likelihood of the normal law of best variance."""
        sd = float(np.sqrt(self.count @ self.value**2 / self.count.sum()))
        return -float(self.count @ log_normal_density(self.value, sd))


def histogram(e: FloatArray, *, clip: float = MAX_DEVIATION, sd: float = 1.0) -> Histogram:
    """Return the bins of residuals in sds; what lies beyond `clip` is put there."""
    count = np.zeros(round(2.0 * clip / CELL_WIDTH) + 1)
    for first in range(0, len(e), SAMPLES_AT_ONCE):
        part = np.clip(e[first : first + SAMPLES_AT_ONCE] / sd, -clip, clip)
        count += np.bincount(np.round((part + clip) / CELL_WIDTH).astype(int), minlength=len(count))
    filled = np.flatnonzero(count)
    return Histogram(np.asarray(filled * CELL_WIDTH - clip, dtype=float), count[filled])
