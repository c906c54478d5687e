"""Variance drift: the log of the variance of the noise follows time, or the temperature.

Statistic: slope of the log mean squares of 256 blocks of residuals over its standard deviation, normal; of time and
temperature the one of the larger gain counts, and the chance is doubled where both were tried.
Gain: likelihood of an exponential variance. Extension: the residuals are divided by its root.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.causes.temperature import COVARIATE
from tuner.diagnosis.channel import Channel
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.residual import CLIP, Residual

FloatArray = NDArray[np.float64]

BLOCKS = 256


@dataclass(frozen=True)
class VarianceDrift(Extension):
    """Log of the variance at the middles of `BLOCKS` even parts of the record, shape (`BLOCKS`,)."""

    cause: ClassVar[str] = "variance_drift"
    meaning: ClassVar[str] = "the white noise grows (or fades) through the record"
    consequence: ClassVar[str] = (
        "one white density does not serve the whole record: take the larger end, or make it follow"
    )
    course: tuple[float, ...]

    def whiten(self, e: FloatArray) -> FloatArray:
        """Bring all samples to the variance in the middle."""
        place = (np.arange(len(e)) + 0.5) / len(e) * BLOCKS - 0.5
        return np.asarray(e * np.exp(-0.5 * np.interp(place, np.arange(BLOCKS), self.course)))

    @property
    def inflation(self) -> float:
        """Largest over usual standard deviation of the noise."""
        return float(np.exp(0.5 * max(self.course)))


@dataclass(frozen=True)
class VarianceByHeat(VarianceDrift):
    """The same, in proportion to the temperature."""

    meaning: ClassVar[str] = "the log of the variance of the white noise follows the measured temperature"
    consequence: ClassVar[str] = (
        "one white density does not serve all temperatures: take the larger end, or make it follow"
    )


def test(found: Residual) -> Alarm:
    """Regress the log variance of blocks on time, and on the temperature where it was measured."""
    span = found.channel.span
    alarms = [
        _regression(
            found, middles() - 0.5, "change of the log variance over the record", span, "1/s", VarianceDrift
        )
    ]
    if COVARIATE in found.channel.covariates:
        celsius = on_blocks(found.channel, found.channel.covariates[COVARIATE])
        name = "change of the log variance a kelvin"
        alarms.append(_regression(found, celsius, name, 1.0, "1/K", VarianceByHeat))
    best = max(alarms, key=lambda alarm: alarm.gain)
    return Alarm(
        best.cause, min(1.0, len(alarms) * best.p_value), best.gain, best.statistic, best.name, best.propose
    )


def middles() -> FloatArray:
    """Return the middles of the blocks as shares of the record, shape (`BLOCKS`,)."""
    return np.asarray((np.arange(BLOCKS) + 0.5) / BLOCKS)


def on_blocks(channel: Channel, values: FloatArray) -> FloatArray:
    """Return block values of a channel, shape (M,), at the middles of the blocks of the variance."""
    return np.interp(middles(), (np.arange(channel.blocks) + 0.5) / channel.blocks, values)


def _regression(
    found: Residual, x: FloatArray, name: str, width: float, unit: str, kind: type[VarianceDrift]
) -> Alarm:
    """Regress the log variance of the blocks on x, shape (`BLOCKS`,); a slope counts per x/width."""
    square, weight = block_squares(found)
    kappa = float(np.var(np.clip(found.good, -CLIP, CLIP) ** 2))
    x = x - weight @ x / weight.sum()
    y = np.log(square)
    information = float(weight @ x**2) / kappa + 1e-300
    change = float(weight @ (x * y)) / kappa / information
    sd = information**-0.5
    fitted = np.exp(change * x)
    fitted *= (weight @ (square / fitted)) / weight.sum()
    flat = float(weight @ square / weight.sum())
    cost = weight @ (np.log(flat) + square / flat - np.log(fitted) - square / fitted)
    gain = float(cost) / kappa - 0.5 * float(np.log(len(found.e)))
    values = {"slope": Value.of(change / width, sd / width, unit)}
    return Alarm(
        "variance_drift",
        2.0 * float(norm.sf(abs(change) / sd)),
        gain,
        change,
        name,
        lambda: (kind(tuple((change * x).tolist()), values=values),),
    )


def block_squares(found: Residual) -> tuple[FloatArray, FloatArray]:
    """Return the mean squares of clipped residuals in blocks and the samples behind them, shapes (`BLOCKS`,)."""
    e = np.clip(found.e, -CLIP, CLIP)
    size = len(e) // BLOCKS
    square = (e * e * found.valid)[: size * BLOCKS].reshape(BLOCKS, size).sum(axis=1)
    weight = np.maximum(found.valid[: size * BLOCKS].reshape(BLOCKS, size).sum(axis=1).astype(float), 1.0)
    return np.maximum(square / weight, 1e-6), weight
