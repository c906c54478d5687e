"""Variance drift: the log of the variance of the noise follows time, or the temperature.

Statistic: likelihood ratio of the mean squares of 256 blocks of residuals, χ²₁, with the degrees of freedom that the
measured kurtosis allows; of time and temperature the one of the larger gain counts, and the chance is doubled where
both were tried. Of a residual of variance 1 the white noise has the share a
(`tuner.diagnosis.static.variance.white_share`) and alone
follows exp(c x)::

    v = 1 − a + a exp(c x) ÷ mean exp(c x)

Extension: the residuals are divided by √v.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.outcome import Alarm
from tuner.diagnosis.static.variance.level import BLOCKS, block_loudness
from tuner.diagnosis.static.variance.white_share import dilution

FloatArray = NDArray[np.float64]

STEPS = 8
"""Steps of Fisher's scoring from no change to the likeliest."""
MOST = 12.0
"""Largest change of the log variance over the record."""


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

    def foretold(self, fitted: Channel, other: Channel) -> FloatArray:
        """Return the log of the variance in another channel of the same unit, or a longer one, shape (n,)."""
        x, there = self._follows(fitted), self._follows(other)
        own = np.interp(middles() * len(fitted), np.arange(len(fitted)), x)
        change = own - own.mean()
        return np.asarray((there - own.mean()) * float(change @ np.array(self.course) / (change @ change)))

    def _follows(self, channel: Channel) -> FloatArray:
        """Return what the log of the variance is proportional to: the time, shape (n,)."""
        return np.arange(float(len(channel))) * channel.interval

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

    def _follows(self, channel: Channel) -> FloatArray:
        """Return the temperature of the samples, shape (n,)."""
        at = (np.arange(channel.blocks) + 0.5) * channel.block
        return np.interp(np.arange(len(channel)), at, channel.covariates[COVARIATE])


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
    """Fit an exponential variance of the white noise in x, shape (`BLOCKS`,), to the blocks; it counts per x/width."""
    square, weight, usual = block_loudness(found)
    x = x - weight @ x / weight.sum()
    white = dilution(found)
    most = MOST / (float(np.ptp(x)) + 1e-300)
    change = 0.0
    for _ in range(STEPS):
        course, slope = _course(change, x, weight, white.variance)
        score = weight @ (slope * (square / _levelled(course, square, weight) - 1.0))
        information = float(weight @ slope**2) + 1e-300
        change = float(np.clip(change + score / information, -most, most))
    course, slope = _course(change, x, weight, white.variance)
    fitted, flat = _levelled(course, square, weight), float(weight @ square / weight.sum())
    kappa = max((usual + 1.0) * weight.sum() / float(weight @ fitted**2) - 1.0, 0.1)
    gain = float(weight @ (np.log(flat) + square / flat - np.log(fitted) - square / fitted)) / kappa
    sd = float(np.hypot((float(weight @ slope**2) / kappa + 1e-300) ** -0.5, change * white.error))
    values = {"slope": Value.of(change / width, sd / width, unit)}
    return Alarm(
        "variance_drift",
        float(chi2.sf(max(2.0 * gain, 0.0), 1)),
        gain - 0.5 * float(np.log(len(found.e))),
        change,
        name,
        lambda: (kind(tuple(course.tolist()), values=values),),
    )


def _course(change: float, x: FloatArray, weight: FloatArray, share: float) -> tuple[FloatArray, FloatArray]:
    """Return the log variance of residuals and its slope by `change`, less its mean; shapes (`BLOCKS`,).

    Of the mean variance the white noise, which follows exp(change x), has this share.
    """
    loud = np.exp(change * x)
    mean = weight @ loud / weight.sum()
    total = 1.0 - share + share * loud / mean
    slope = share * loud / mean / total * (x - weight @ (x * loud) / weight.sum() / mean)
    return np.log(total), slope - weight @ slope / weight.sum()


def _levelled(course: FloatArray, square: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the variance of this course, at the level that the mean squares have; shape (`BLOCKS`,)."""
    fitted = np.exp(course)
    return np.asarray(fitted * (weight @ (square / fitted)) / weight.sum())
