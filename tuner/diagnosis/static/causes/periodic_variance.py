"""Periodic variance: the white noise swells and ebbs in step with a clock, a multiplexer, a machine.

Statistic: the largest ordinate of the periodogram of the squared residuals, over the level of its neighbours, which
variance that changes otherwise raises as well; exponential, with a price for every frequency that is tried.
Extension: the log of the variance is a sinusoid of time; the residuals are divided by its root. Of the variance of the
residuals the white noise has the share a (`tuner.diagnosis.static.variance.white_share`): its depth is that seen ÷ a.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.special import ive

from models.arrays import FloatArray, SingleArray
from models.effects.static.distribution import PeriodicVariance as Effect
from tuner.curves.long_transforms import without_tables
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import any_of
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.spectrum.background import local_level
from tuner.diagnosis.static.variance.local_variance import local_variance
from tuner.diagnosis.static.variance.white_share import dilution

MIN_CYCLES = 64
"""Least number of periods in a record: slower changes are seen in the variance of its parts."""
BACKGROUND_WIDTH = 256
"""Ordinates whose median is the level of a frequency; chosen so that it is known to a tenth."""
MIN_ORDINATE = 12.0
"""Ordinate, in levels, below which a frequency is not looked at closer: by chance half of all records exceed it."""
MAX_DEPTH = 3.0
"""Largest depth: the variance of the noise then changes by a factor of 400, and a sinusoid of its log is no model."""
DEPTHS = np.linspace(0.0, MAX_DEPTH, 1000)
"""Depths at which the swing of the variance is tabulated: fine against their errors."""


@dataclass(frozen=True)
class PeriodicVariance(Extension):
    """The log of the variance is depth · cos(2π frequency · t + phase), t from the first sample, s."""

    cause = "periodic_variance"
    effect = Effect
    group = "distribution"
    repeats = 3
    view = "variance"
    meaning = "the white noise swells and ebbs with a period: it is in step with a clock or a machine"
    consequence = (
        "its mean serves a filter that averages over periods; sample at another rate to find the source"
    )
    frequency: float
    depth: float
    phase: float
    interval: float

    def course(self, n: int) -> FloatArray:
        """Return the log of the variance, shape (n,)."""
        return np.asarray(
            self.depth * np.cos(2.0 * np.pi * self.frequency * self.interval * np.arange(n) + self.phase)
        )

    def elsewhere(self, e: FloatArray) -> FloatArray:
        """Return the course of the log variance of other residuals, shape (n,), with the phase that these show."""
        turn = 2.0 * np.pi * self.frequency * self.interval * np.arange(len(e))
        phase = float(np.angle(np.sum((e * e - 1.0) * np.exp(-1j * turn))))
        return np.asarray(self.depth * np.cos(turn + phase))

    def whiten(self, e: FloatArray) -> FloatArray:
        """Bring all samples to the variance between swell and ebb."""
        return np.asarray(e * np.exp(-0.5 * self.course(len(e))))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Search the squares of the residuals for a period."""
        n, interval = len(fitted.channel), fitted.channel.interval
        size = next_fast_len(n, real=True)
        wave = rfft(_scatter(fitted), size)
        without_tables(size)
        power = wave.real**2
        power += wave.imag**2
        del wave
        power /= np.float32(max(int(np.count_nonzero(local_variance(fitted).scatter)), 1))
        if size % 2 == 0:
            power[-1] *= np.float32(0.5)  # of one degree of freedom, where all others have two
        first = int(np.ceil(MIN_CYCLES * size / n))
        name = "largest ordinate of the spectrum of the squared residuals"
        if float(power[first:].max()) < MIN_ORDINATE:
            return TestResult(cls.cause, 1.0, NO_GAIN, float(power[first:].max()), name)
        relative = power[first:] / local_level(power[first:], BACKGROUND_WIDTH)
        at = int(np.argmax(relative))
        number, largest = len(relative), float(relative[at])
        gain = largest - float(np.log(number)) - float(np.log(n))
        return TestResult(
            cls.cause, any_of(float(np.exp(-largest)), number), gain, largest, name,
            lambda: (_extension(fitted, (first + at) / (size * interval)),),
        )  # fmt: skip

    def enlarged_share(self, channel: Channel) -> float:  # noqa: ARG002
        """Return the share of the time in which the variance is above its mean."""
        return float(np.mean(np.exp(self.course(4096)) > np.exp(self.course(4096)).mean()))


def _scatter(fitted: FittedChannel) -> SingleArray:
    """Return the squares of the residuals less 1 ÷ their sd, shape (n,), 0 where nothing was measured."""
    local = local_variance(fitted)
    x = np.empty(len(local.square), np.float32)
    np.subtract(local.square, 1.0, out=x, casting="same_kind")
    x /= np.float32(np.sqrt(local.kappa))
    x[local.scatter <= 0.0] = 0.0
    return x


def _extension(fitted: FittedChannel, near: float) -> PeriodicVariance:
    """Return the period next to a frequency, Hz, with its depth."""
    x = _scatter(fitted)
    n, dt = len(x), fitted.channel.interval
    tried = near + np.linspace(-0.6, 0.6, 13) / (n * dt)
    waves = np.array([_wave(x, f * dt, near * dt, fitted.channel.block) for f in tried])
    best = int(np.argmax(np.abs(waves)))
    curve = np.abs(waves[max(best - 1, 0) : best + 2]) ** 2
    shift = 0.0
    if len(curve) == 3 and 2.0 * curve[1] > curve[0] + curve[2]:
        shift = (
            0.5
            * float((curve[0] - curve[2]) / (curve[0] - 2.0 * curve[1] + curve[2]))
            * float(tried[1] - tried[0])
        )
    frequency = float(tried[best]) + shift
    alternates = abs(frequency * dt - 0.5) * n < 0.5
    frequency = 0.5 / dt if alternates else frequency
    wave = _wave(x, frequency * dt, frequency * dt, fitted.channel.block)
    kappa = local_variance(fitted).kappa
    seen, error = 2.0 * abs(wave) / n * float(np.sqrt(kappa)), float(np.sqrt(2.0 * kappa / n))
    depth = log_amplitude(seen)
    if alternates:  # both halves of the spectrum are one there, and the swing is tanh d
        wave = complex(wave.real)
        depth = float(np.arctanh(min(0.5 * seen, np.tanh(MAX_DEPTH))))
    slope = float(np.sqrt(6.0)) / (np.pi * n * dt) / (2.0 * abs(wave) / float(np.sqrt(n)))
    white = dilution(fitted)
    share = white.variance
    values = {
        "period": Value.of(1.0 / frequency, slope / frequency**2, "s"),
        "depth": Value.of(depth / share, float(np.hypot(error, depth * white.error)) / share).positive,
    }
    return PeriodicVariance(frequency, depth, float(np.angle(wave)), dt, values=values)


def _wave(x: SingleArray, f: float, near: float, block: int) -> complex:
    """Return Σ x exp(−2πi f k), f in cycles a sample; within blocks the turn is that of a frequency `near` by."""
    sums = x.reshape(-1, block) @ np.exp(-2j * np.pi * near * np.arange(block))
    middle = 0.5 * (f - near) * (block - 1)
    return complex(sums @ np.exp(-2j * np.pi * (f * block * np.arange(len(sums)) + middle)))


def log_amplitude(seen: float) -> float:
    """Return the depth d of a log variance whose variance swings by a relative amplitude, 2 I₁(d)/I₀(d)."""
    return float(np.interp(seen, 2.0 * ive(1, DEPTHS) / ive(0, DEPTHS), DEPTHS))
