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

import numpy as np

from models.arrays import LEAST_DIVISOR, FloatArray
from models.effects.static.distribution import VarianceDrift as Effect
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.variance.local_variance import LEVEL_BLOCKS, block_variance
from tuner.diagnosis.static.variance.white_share import dilution

SCORING_STEPS = 8
"""Steps of Fisher scoring from no change to the likeliest; enough for quadratic convergence."""
MAX_LOG_CHANGE = 12.0
"""Largest change of the log variance over the record: a factor of 400 on the sd, against overflow."""


@dataclass(frozen=True)
class VarianceDrift(Extension):
    """Log of the variance at the middles of `LEVEL_BLOCKS` even parts of the record, shape (`LEVEL_BLOCKS`,)."""

    cause = "variance_drift"
    effect = Effect
    group = "distribution"
    view = "variance"
    meaning = "the white noise grows (or fades) through the record"
    consequence = "one white density does not serve the whole record: take the larger end, or make it follow"
    course: tuple[float, ...]

    def whiten(self, e: FloatArray) -> FloatArray:
        """Bring all samples to the variance in the middle."""
        place = (np.arange(len(e)) + 0.5) / len(e) * LEVEL_BLOCKS - 0.5
        return np.asarray(e * np.exp(-0.5 * np.interp(place, np.arange(LEVEL_BLOCKS), self.course)))

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
    def largest_ratio(self) -> float:
        """Largest over usual standard deviation of the noise."""
        return float(np.exp(0.5 * max(self.course)))

    def white_noise_enlargement(self, before: FittedChannel, after: FittedChannel) -> tuple[float, str]:  # noqa: ARG002
        """Return the largest standard deviation ÷ its rms over the record."""
        rms = float(np.sqrt(np.mean(np.exp(self.course))))
        return self.largest_ratio / rms, "variance_drift: the noise where it is largest"

    def enlarged_share(self, channel: Channel) -> float:  # noqa: ARG002
        """Return the share of the parts of the record whose variance is above the mean of all."""
        variance = np.exp(self.course)
        return float(np.mean(variance > variance.mean()))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Regress the log variance of blocks on time, and on the temperature where it was measured."""
        span = fitted.channel.span
        results = [
            _regression(
                fitted,
                middles() - 0.5,
                "change of the log variance over the record",
                span,
                "1/s",
                VarianceDrift,
            )
        ]
        if COVARIATE in fitted.channel.covariates:
            celsius = on_blocks(fitted.channel, fitted.channel.covariates[COVARIATE])
            name = "change of the log variance a kelvin"
            results.append(_regression(fitted, celsius, name, 1.0, "1/K", VarianceByHeat))
        best = max(results, key=lambda result: result.gain)
        return TestResult(
            best.cause,
            min(1.0, len(results) * best.p_value),
            best.gain,
            best.statistic,
            best.name,
            best.propose,
        )


@dataclass(frozen=True)
class VarianceByHeat(VarianceDrift):
    """Variance drift in proportion to the temperature."""

    meaning = "the log of the variance of the white noise follows the measured temperature"
    consequence = "one white density does not serve all temperatures: take the larger end, or make it follow"

    def _follows(self, channel: Channel) -> FloatArray:
        """Return the temperature of the samples, shape (n,)."""
        at = (np.arange(channel.blocks) + 0.5) * channel.block
        return np.interp(np.arange(len(channel)), at, channel.covariates[COVARIATE])


def middles() -> FloatArray:
    """Return the middles of the blocks as shares of the record, shape (`LEVEL_BLOCKS`,)."""
    return np.asarray((np.arange(LEVEL_BLOCKS) + 0.5) / LEVEL_BLOCKS)


def on_blocks(channel: Channel, values: FloatArray) -> FloatArray:
    """Return block values of a channel, shape (M,), at the middles of the blocks of the variance."""
    return np.interp(middles(), (np.arange(channel.blocks) + 0.5) / channel.blocks, values)


def _regression(
    fitted: FittedChannel, x: FloatArray, name: str, width: float, unit: str, kind: type[VarianceDrift]
) -> TestResult:
    """Fit an exponential variance of the white noise in x, shape (`LEVEL_BLOCKS`,), to blocks; counts per x/width."""
    square, weight, usual = block_variance(fitted)
    x = x - weight @ x / weight.sum()
    white = dilution(fitted)
    most = MAX_LOG_CHANGE / (float(np.ptp(x)) + LEAST_DIVISOR)
    change = 0.0
    for _ in range(SCORING_STEPS):
        course, slope = _course(change, x, weight, white.variance)
        score = weight @ (slope * (square / _levelled(course, square, weight) - 1.0))
        information = float(weight @ slope**2) + LEAST_DIVISOR
        change = float(np.clip(change + score / information, -most, most))
    course, slope = _course(change, x, weight, white.variance)
    expected, flat = _levelled(course, square, weight), float(weight @ square / weight.sum())
    each = (usual + 1.0) * weight.sum() / float(weight @ square**2)
    kappa = max((each - 1.0) / (1.0 - each / float(weight.mean())), 0.1)  # within blocks, whatever the course
    gain = float(weight @ (np.log(flat) + square / flat - np.log(expected) - square / expected)) / kappa
    sd = float(np.hypot((float(weight @ slope**2) / kappa + LEAST_DIVISOR) ** -0.5, change * white.error))
    values = {"slope": Value.of(change / width, sd / width, unit)}
    return TestResult(
        "variance_drift",
        chi2_beyond(max(2.0 * gain, 0.0), 1),
        gain - 0.5 * float(np.log(len(fitted.e))),
        change,
        name,
        lambda: (kind(tuple(course.tolist()), values=values),),
    )


def _course(change: float, x: FloatArray, weight: FloatArray, share: float) -> tuple[FloatArray, FloatArray]:
    """Return the log variance of residuals and its slope by `change`, less its mean; shapes (`LEVEL_BLOCKS`,).

    Of the mean variance the white noise, which follows exp(change x), has this share.
    """
    growth = np.exp(change * x)
    mean = weight @ growth / weight.sum()
    total = 1.0 - share + share * growth / mean
    slope = share * growth / mean / total * (x - weight @ (x * growth) / weight.sum() / mean)
    return np.log(total), slope - weight @ slope / weight.sum()


def _levelled(course: FloatArray, square: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the variance of this course, at the level that the mean squares have; shape (`LEVEL_BLOCKS`,)."""
    fitted = np.exp(course)
    return np.asarray(fitted * (weight @ (square / fitted)) / weight.sum())
