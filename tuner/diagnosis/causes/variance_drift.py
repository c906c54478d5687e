"""Variance drift: the log of the variance of the noise runs evenly in time.

Statistic: slope of the log mean squares of 256 blocks of residuals over its standard deviation, normal.
Gain: likelihood of an exponential variance. Extension: the residuals are divided by its root.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.residual import CLIP, Residual

FloatArray = NDArray[np.float64]

BLOCKS = 256


@dataclass(frozen=True)
class VarianceDrift(Extension):
    """Variance exp(slope (t − t_mid)), `change` being its log over the whole record."""

    cause: ClassVar[str] = "variance_drift"
    meaning: ClassVar[str] = "the white noise grows (or fades) through the record"
    consequence: ClassVar[str] = (
        "one white density does not serve the whole record: take the larger end, or make it follow"
    )
    change: float

    def whiten(self, e: FloatArray) -> FloatArray:
        """Bring all samples to the variance in the middle."""
        place = (np.arange(len(e)) + 0.5) / len(e) - 0.5
        return np.asarray(e * np.exp(-0.5 * self.change * place))


def test(found: Residual) -> Alarm:
    """Regress the log variance of blocks on time."""
    square, weight = block_squares(found)
    kappa = float(np.var(np.clip(found.good, -CLIP, CLIP) ** 2))
    x = (np.arange(BLOCKS) + 0.5) / BLOCKS - 0.5
    x = x - weight @ x / weight.sum()
    y = np.log(square)
    information = float(weight @ x**2) / kappa
    change = float(weight @ (x * y)) / kappa / information
    sd = information**-0.5
    fitted = np.exp(change * x)
    fitted *= (weight @ (square / fitted)) / weight.sum()
    flat = float(weight @ square / weight.sum())
    cost = weight @ (np.log(flat) + square / flat - np.log(fitted) - square / fitted)
    gain = float(cost) / kappa - 0.5 * float(np.log(len(found.e)))
    span = found.channel.span
    return Alarm(
        "variance_drift",
        2.0 * float(norm.sf(abs(change) / sd)),
        gain,
        change,
        "change of the log variance over the record",
        lambda: (VarianceDrift(change, values={"slope": Value.of(change / span, sd / span, "1/s")}),),
    )


def block_squares(found: Residual) -> tuple[FloatArray, FloatArray]:
    """Return the mean squares of clipped residuals in blocks and the samples behind them, shapes (`BLOCKS`,)."""
    e = np.clip(found.e, -CLIP, CLIP)
    size = len(e) // BLOCKS
    square = (e * e * found.valid)[: size * BLOCKS].reshape(BLOCKS, size).sum(axis=1)
    weight = np.maximum(found.valid[: size * BLOCKS].reshape(BLOCKS, size).sum(axis=1).astype(float), 1.0)
    return np.maximum(square / weight, 1e-6), weight
