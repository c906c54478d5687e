"""Correlation that is left in the innovations of a drive, row by row: a filter whose model is right leaves none.

With the whitened innovations W of one row (north, east, down of positions and velocities), for bands of lags l::

    z = Σ_l Σ_k W_k W_(k−l) / √(Σ_l Σ_k (W_k W_(k−l))²)

whose own denominator allows for heavy tails of W. A sum of products of n normal numbers over b lags of an octave has
the excess kurtosis 12 b/n (48 tr A⁴/(2 tr A²)² of its quadratic form; the third moment is 0): z is taken for Student's
t of that kurtosis, 4 + n/(2 b) degrees of freedom. The largest of all rows and bands counts, with the p value of a
choice among that many; its evidence is at most −e p ln p to one against chance [1]_.

References
----------
.. [1] T. Sellke, M. J. Bayarri, J. O. Berger, Calibration of p values for testing precise null hypotheses, The American
       Statistician 55 (2001).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from tuner.linear_run.likelihood import NoiseHypothesis, evaluate

ROWS = (
    "positions north", "positions east", "heights", "velocities north", "velocities east", "velocities down"
)  # fmt: skip
LAGS = ((1, 2), (2, 4), (4, 8), (8, 16), (16, 32), (32, 64))
"""Bands of lags, in fixes, to below the second: octaves, as correlated errors decay over decades of time."""
MIN_FIXES = 100
"""Fixes of a row from which sums of products are about normal, and the longest lags have enough of them."""


@dataclass(frozen=True)
class CorrelationLeft:
    """The largest correlation of whitened innovations: p value, evidence in nats, and where."""

    p_value: float
    evidence: float
    text: str


def correlation_left(noise: NoiseHypothesis) -> CorrelationLeft:
    """Return the largest correlation of the whitened innovations among all rows and bands of lags."""
    white = np.where(noise.counted, evaluate(noise).white, 0.0)
    least, count, text = 1.0, 0, ""
    for row, y in zip(ROWS, white.T, strict=True):
        n = np.count_nonzero(y)
        for first, end in LAGS if n >= MIN_FIXES else ():
            products = [y[lag:] * y[:-lag] for lag in range(first, end)]
            square = sum(float(p @ p) for p in products)
            freedom = 4.0 + n / (2.0 * (end - first))
            unit = math.sqrt(square * (freedom - 2.0) / freedom)
            t = abs(sum(float(p.sum()) for p in products)) / unit if square > 0.0 else 0.0
            p_value = 2.0 * float(stdtr(freedom, -t))
            count += 1
            if p_value < least:
                fixes = f"{first}" if end == first + 1 else f"{first} to {end - 1}"
                least, text = p_value, f"innovations of {row} are correlated at {fixes} fixes' distance"
    chance = -math.expm1(count * math.log1p(-least)) if least < 1.0 else 1.0
    chance = max(chance, float(np.finfo(float).tiny))
    evidence = -math.log(-math.e * chance * math.log(chance)) if chance < math.exp(-1.0) else 0.0
    return CorrelationLeft(chance, evidence, text)
