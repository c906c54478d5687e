"""Local variance of the residuals: squares of unit expectation, their variances, their means over parts of the record.

Squares of normal residuals have the variance κ = 2, as they are κ is measured. With a coarse quantizer both the
expectation and κ depend on where the slow track lies between two codes
(`tuner.diagnosis.static.variance.quantized_noise`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, once
from tuner.diagnosis.static.model.null_distributions import variance_deviate
from tuner.diagnosis.static.model.series_statistics import RESIDUAL_CLIP
from tuner.diagnosis.static.variance.quantized_noise import cell_moments

LEVEL_BLOCKS = 256
"""Parts of the record whose local variance is compared; chosen to resolve 64 cycles a record with four parts each."""
MIN_SQUARE_VARIANCE = 0.2
"""Least variance of a square, a tenth of the normal 2.

The place in a quantizer cell is not known well enough for less.
"""


@dataclass(frozen=True)
class LocalVariance:
    """Squares of the residuals, as estimates of the local variance.

    Attributes
    ----------
    square : ndarray, shape (n,)
        Squares of mean 1; 1 where nothing was measured.
    scatter : ndarray, shape (n,)
        Their variances κ; 0 where nothing was measured.
    kappa : float
        Usual variance.
    rounded : bool
        Whether a coarse quantizer makes them rare and large, rather than those of a normal law.
    """

    square: FloatArray
    scatter: FloatArray
    kappa: float
    rounded: bool

    def outside(self, stretches: Sequence[tuple[int, int]]) -> LocalVariance:
        """Return the squares without stretches of samples, their mean 1 again."""
        square, scatter = self.square.copy(), self.scatter.copy()
        for first, last in stretches:
            scatter[first:last] = 0.0
        measured = scatter > 0.0
        if not measured.any():
            return self
        level = float(square[measured].mean())
        kappa = float(np.var(square[measured])) / level**2
        scatter *= kappa / float(scatter[measured].mean())
        square = np.where(measured, square / level, 1.0)
        return LocalVariance(square, scatter, kappa, self.rounded)

    def deviate(self, mean: FloatArray, freedom: FloatArray) -> FloatArray:
        """Return normal deviates of mean squares with so many degrees of freedom.

        Sums of rare large squares follow Poisson's law, whose lower tail is thicker than that of χ² and thinner than
        the normal one: there the normal deviate holds.
        """
        deviate = variance_deviate(mean, freedom)
        if not self.rounded:
            return deviate
        return np.where(deviate < 0.0, np.maximum(deviate, (mean - 1.0) * np.sqrt(0.5 * freedom)), deviate)


@once
def local_variance(fitted: FittedChannel) -> LocalVariance:
    """Return the squares of the residuals as estimates of the local variance, and their variances."""
    square, measured = np.clip(fitted.e, -RESIDUAL_CLIP, RESIDUAL_CLIP), fitted.valid
    square *= square
    cell = cell_moments(fitted)
    if cell is not None:
        measured = measured & np.isfinite(cell[1])
        square = square / cell[0]
    if not measured.any():
        return LocalVariance(np.ones_like(square), np.zeros_like(square), 2.0, rounded=True)
    inside = square if measured.all() else square[measured]
    level = float(inside.mean())
    kappa = float(np.var(inside)) / level**2
    square /= level
    scatter = np.broadcast_to(kappa, len(square))
    if cell is not None:
        likely = np.maximum(cell[1], MIN_SQUARE_VARIANCE)
        scatter = likely * (kappa / float(likely[measured].mean()))
    if not measured.all():
        square, scatter = np.where(measured, square, 1.0), np.where(measured, scatter, 0.0)
    return LocalVariance(square, scatter, kappa, cell is not None)


@once
def course(fitted: FittedChannel) -> FloatArray:
    """Return the variance of each sample's noise ÷ its mean, shape (n,), as the extensions model it."""
    changing = [x for x in fitted.extensions if x.cause in ("burst", "variance_drift")]
    if not changing:
        return np.broadcast_to(1.0, len(fitted.cleaned))
    deviate = np.ones(len(fitted.cleaned))
    for extension in changing:
        deviate = extension.whiten(deviate)
    variance = deviate**-2
    return np.asarray(variance / variance.mean())


@once
def block_variance(fitted: FittedChannel) -> tuple[FloatArray, FloatArray, float]:
    """Return the mean squares of `LEVEL_BLOCKS` even parts, their weights, shapes (`LEVEL_BLOCKS`,), and κ.

    The weights are numbers of samples of the usual κ: 2 weight/κ are the degrees of freedom of a mean square.
    """
    local = local_variance(fitted)
    size = len(fitted.e) // LEVEL_BLOCKS
    inside = slice(0, size * LEVEL_BLOCKS)
    measured = local.scatter[inside] > 0.0
    count = measured.reshape(LEVEL_BLOCKS, size).sum(axis=1).astype(float)
    filled = local.square[inside] if measured.all() else np.where(measured, local.square[inside], 0.0)
    square = filled.reshape(LEVEL_BLOCKS, size).sum(axis=1)
    scatter = local.scatter[inside].reshape(LEVEL_BLOCKS, size).sum(axis=1)
    weight = np.maximum(local.kappa * count**2 / np.maximum(scatter, 1e-12), 1.0)
    mean = np.where(count > 0.0, square / np.maximum(count, 1.0), 1.0)
    return np.maximum(mean, 1e-6), weight, local.kappa
