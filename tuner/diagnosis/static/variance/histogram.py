"""Residuals in narrow bins: likelihoods of a law cost the number of bins, not of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

FloatArray = NDArray[np.float64]

CELL_WIDTH = 0.02
"""Width of a bin, sds: grouping adds width²/12 = 3e-5 to the variance."""
MAX_DEVIATION = 60.0
"""Residuals beyond are counted at this deviation, sds; chosen to bound the number of bins."""


@dataclass(frozen=True)
class Histogram:
    """Filled bins: `value` at their middle and `count` in them, shapes (b,)."""

    value: FloatArray
    count: FloatArray

    def normal_cost(self) -> float:
        """Return minus the log likelihood of the normal law of best variance."""
        sd = float(np.sqrt(self.count @ self.value**2 / self.count.sum()))
        return -float(self.count @ norm.logpdf(self.value, 0.0, sd))


def histogram(e: FloatArray) -> Histogram:
    """Return the bins of residuals; what lies beyond `MAX_DEVIATION` is put there."""
    index = np.round((np.clip(e, -MAX_DEVIATION, MAX_DEVIATION) + MAX_DEVIATION) / CELL_WIDTH).astype(int)
    count = np.bincount(index)
    filled = np.flatnonzero(count)
    return Histogram(
        np.asarray(filled * CELL_WIDTH - MAX_DEVIATION, dtype=float), count[filled].astype(float)
    )
