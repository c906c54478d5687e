"""The law of samples as it is: the normal deviate that is exceeded as often as each size.

A map through the quantiles of the residuals makes any continuous law the normal one. Between its knots, even steps of
the deviate, it is linear. Beyond the last of them, where too few residuals are left to count, the logarithm of the
share that lies farther out falls as steeply as before them: an exponential tail, so that samples far beyond the law,
spikes, stay far out.

Where a law has an edge the map is so steep that an error of the bias by a hundredth of an sd would change the variance
of the deviates. There their order says nothing of the noise: samples of one steep stretch get its deviates at random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri

from models.arrays import FloatArray
from tuner.diagnosis.static.model.series_statistics import order_statistics

KNOT_STEP = 0.2
"""Step of the deviate between knots: a normal law is bent by less than 0.005 between two."""
TAIL_SAMPLES = 30
"""Residuals beyond the last knot: their number is known to a fifth, the deviate there to 0.05."""
TAIL_KNOTS = 3
"""Steps over which the slope of a tail is measured."""
MAX_JUDGED_DEVIATION = 4.0
"""Sds up to which the law is judged: what lies beyond may be spikes, which have a test of their own."""
MAX_JUDGED = 200_000
"""Residuals that are enough to judge a law by: a gain of 1e-3 nats a sample is known to a few per cent."""
MAX_SLOPE = 2.5
"""Deviates a residual from which the map is steep: down to −3, that of a gamma law of skewness 0.7 stays below it."""
MIN_OUTLIER_DISTANCE = 1.0
"""Sds beyond the edge of a law at which a sample is no part of it: a hundred times what the bias may be wrong by."""
CELLS_PER_KNOT = 16
"""Cells of a table for each knot: hardly one holds two knots, and the table stays in the cache of a processor."""
LOG_ROOT = 0.5 * float(np.log(2.0 * np.pi))
"""Minus the log density of the normal law at 0."""
LEAST_SHARE = -600.0
"""Least logarithm of a share whose deviate is computed: deviates up to 34."""


@dataclass(frozen=True)
class NormalScores:
    """Knots of the map: sizes of residuals, rising, and the normal deviates of the shares below them."""

    value: tuple[float, ...]
    deviate: tuple[float, ...]

    @classmethod
    def of(cls, e: FloatArray) -> NormalScores:
        """Return the map that makes residuals normal."""
        last = float(-ndtri(min(TAIL_SAMPLES / len(e), 0.1)))
        z = KNOT_STEP * np.arange(-int(last / KNOT_STEP), int(last / KNOT_STEP) + 1)
        place = ndtr(z) * (len(e) - 1)
        below = place.astype(np.intp)
        lower, upper = order_statistics(e, below), order_statistics(e, below + 1)
        quantile = lower + (place - below) * (upper - lower)
        value, first = np.unique(quantile, return_index=True)
        return cls(tuple(value.tolist()), tuple(z[first].tolist()))

    def __call__(self, e: FloatArray) -> FloatArray:
        """Return the deviates of residuals, shape (n,)."""
        value, deviate = np.array(self.value), np.array(self.deviate)
        z = _interpolated(e, value, deviate)
        for side in (-1.0, 1.0):
            edge, level, slope = self._tail(side)
            far = np.flatnonzero(side * e > edge)
            share = np.maximum(level - slope * (side * e[far] - edge), LEAST_SHARE)
            z[far] = -side * ndtri(np.exp(share))
        return np.asarray(z)

    def shuffled(self, e: FloatArray) -> FloatArray:
        """Return the deviates of residuals, those of steep stretches at random."""
        z, rng = self(e), np.random.default_rng(len(e))
        value, deviate = np.array(self.value), np.array(self.deviate)
        steep = np.diff(deviate) > MAX_SLOPE * np.diff(value)
        limits = np.concatenate(
            ([value[0] - MIN_OUTLIER_DISTANCE], value[1:-1], [value[-1] + MIN_OUTLIER_DISTANCE])
        )
        shares = np.concatenate(([0.0], ndtr(deviate[1:-1]), [1.0]))
        for first, last in np.flatnonzero(np.diff(steep, prepend=False, append=False)).reshape(-1, 2):
            inside = (e > limits[first]) & (e <= limits[last])
            z[inside] = ndtri(rng.uniform(shares[first], shares[last], int(inside.sum())))
        return z

    def log_slope(self, e: FloatArray) -> FloatArray:
        """Return the logarithm of the derivative of the map."""
        value, deviate = np.array(self.value), np.array(self.deviate)
        place = np.clip(np.searchsorted(value, e), 1, len(value) - 1)
        out = np.log(np.diff(deviate) / np.diff(value))[place - 1]
        for side in (-1.0, 1.0):
            edge, _, slope = self._tail(side)
            far = np.flatnonzero(side * e > edge)
            z = side * self(e[far])
            out[far] = np.log(slope) + log_ndtr(-z) + 0.5 * z**2 + LOG_ROOT
        return np.asarray(out)

    def _tail(self, side: float) -> tuple[float, float, float]:
        """Return where a tail begins, the log of the share beyond, and how fast it falls; side 1 or −1."""
        value, deviate = side * np.array(self.value), side * np.array(self.deviate)
        ends = (-1, -1 - TAIL_KNOTS) if side > 0.0 else (0, TAIL_KNOTS)
        (edge, inside), (level, before) = value[list(ends)], log_ndtr(-deviate[list(ends)])
        return float(edge), float(level), float((before - level) / (edge - inside))

    def gain(self, e: FloatArray) -> float:
        """Return the log likelihood of residuals within `MAX_JUDGED_DEVIATION` sds over the normal law, nats."""
        some = e[:: 1 + len(e) // MAX_JUDGED]
        sd = float(np.std(some))
        near = some[np.abs(some) <= MAX_JUDGED_DEVIATION * sd]
        lead = self.log_slope(near) + np.log(sd) + 0.5 * ((near / sd) ** 2 - self(near) ** 2)
        return float(lead.sum()) * len(e) / len(some)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _interpolated(x: FloatArray, knots: FloatArray, values: FloatArray) -> FloatArray:
    """Return values at `x`, shape (n,), on straight lines between knots (k,), which rise; level beyond them.

    A table of even cells tells the last knot before each, so that numbers in any order need no search.
    """
    last, cells, low = knots.size - 1, CELLS_PER_KNOT * knots.size, knots[0]
    over = cells / (knots[last] - low)
    before = np.empty(cells + 1, np.intp)
    slope = np.diff(values) / np.diff(knots)
    at = 0
    for cell in range(cells + 1):
        while at < last - 1 and (knots[at + 1] - low) * over < cell:
            at += 1
        before[cell] = at
    out = np.empty(x.size)
    for i in range(x.size):
        if x[i] <= low:
            out[i] = values[0]
        elif x[i] >= knots[last]:
            out[i] = values[last]
        else:
            at = before[int((x[i] - low) * over)]
            while x[i] >= knots[at + 1]:
                at += 1
            out[i] = slope[at] * (x[i] - knots[at]) + values[at]
    return out
