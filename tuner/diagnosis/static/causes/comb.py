"""Comb: something short that comes again and again at one period, lines of one spacing in the spectrum.

None of the lines needs to stand out. The period is sought in the autocorrelation r of the residuals, which is raised at
every multiple of it: the largest mean of r at `PERIOD_MULTIPLES` of them, among periods that differ by parts of a
sample. Statistic: at that period, refined, the residuals are folded into K bins; Σ count · mean² is χ²_K where nothing
repeats, with a price for every period. What has most of its power in `FEW_LINES` lines is one of lines, not a comb.
Extension: the mean course over a period is taken out of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.stats import chi2

from models.effects.static.spectral import Comb as Effect
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.residual import RESIDUAL_CLIP, Residual
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.variance.quantized_noise import slow_track

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

MIN_PERIOD, MAX_PERIOD = 16.0, 2000.0
"""Periods, samples: below there are too few lines for a comb, above few periods for their multiples."""
PERIOD_MULTIPLES = 32
"""Multiples of a period at which the autocorrelation is averaged: its deviation falls by their root."""
MIN_SCORE = 5.5
"""Deviations of that mean below which no period is folded: one of 1e5 exceeds it by chance in 2e-3 of records."""
MAX_MULTIPLE = 12
"""Largest multiple of its period at which a comb is found; beyond, few periods are left in a record."""
FOLDED_PARTS = 32
"""Parts of a record that are folded apart to refine a period: over one of them its harmonics lose no phase."""
FEW_LINES, MAX_LINE_SHARE = 3, 0.6
"""Lines that hold less than this share of the power of a comb; a pulse spreads its power over all of them evenly."""


@dataclass(frozen=True)
class Comb(Extension):
    """A course over a period, `profile` at even phases, in scales; `period` in samples."""

    cause = "comb"
    effect = Effect
    group = "fast spectrum"
    view = "spectrum"
    meaning = "something short comes again at one period: many lines of one spacing, none of which stands out"
    consequence = (
        "find what happens at that period (a bus, a clock, a heater) and keep it off; take its course out"
    )
    period: float
    profile: tuple[float, ...]

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the course out."""
        return replace(channel, y=channel.y - np.array(self.profile)[_bins(len(channel), self.period)])

    def elsewhere(self, y: FloatArray) -> FloatArray:
        """Return the course in other samples, shape (n,), with the phase among all that these show."""
        place, profile = _bins(len(y), self.period), np.array(self.profile)
        level = np.bincount(place, y - y.mean(), len(profile))
        agreement = irfft(rfft(level) * np.conj(rfft(profile)), len(profile))
        return np.asarray(profile[(place - int(np.argmax(agreement))) % len(profile)])

    @classmethod
    def test(cls, fitted: Residual) -> TestResult:
        """Search for a period, and fold the residuals at it."""
        name = "sum of squared means over a period"
        score, period, number = _best_period(fitted)
        if score < MIN_SCORE:
            return TestResult(cls.cause, 1.0, NO_GAIN, score, name)
        e = np.where(fitted.valid, np.clip(fitted.e, -RESIDUAL_CLIP, RESIDUAL_CLIP), 0.0)
        period = _shortest(e, _fitted_best(e, _refined(fitted, e, period)))
        folded = _fold(e, period)
        lines = np.sort(np.abs(rfft(folded - folded.mean())) ** 2)[::-1]
        if lines[:FEW_LINES].sum() > MAX_LINE_SHARE * lines.sum():
            return TestResult(cls.cause, 1.0, NO_GAIN, score, name)
        square = _square(e, period)
        p_value = min(1.0, number * len(e) / period * float(chi2.sf(square, len(folded))))
        gain = 0.5 * (square - len(folded)) - float(np.log(number * len(e) / period))
        return TestResult(cls.cause, p_value, gain, square, name, lambda: (_extension(fitted, period),))


def _best_period(fitted: Residual) -> tuple[float, float, int]:
    """Return the largest mean of the autocorrelation over multiples, in sds, its period, samples, and their number."""
    n = len(fitted.e)
    power = fitted.spectrum[1]
    r = irfft(np.concatenate(([0.0], power)), 2 * len(power))[: n // 2] * np.sqrt(n)
    r = (r[:-1] + r[1:]) / np.sqrt(2.0)
    periods = np.arange(MIN_PERIOD, min(MAX_PERIOD, (len(r) - 1) / PERIOD_MULTIPLES), 1.0 / PERIOD_MULTIPLES)
    if not len(periods):
        return 0.0, MIN_PERIOD, 1
    total = np.zeros(len(periods))
    for multiple in range(1, PERIOD_MULTIPLES + 1):
        total += r[(multiple * periods).astype(np.intp)]
    score = total / np.sqrt(PERIOD_MULTIPLES)
    best = int(np.argmax(score))
    return float(score[best]), float(periods[best]), len(periods)


def _bins(n: int, period: float) -> IntArray:
    """Return which phase of the period each of n samples has, as a whole number below the period, shape (n,).

    Samples lie in the middle of their bin: at its edge, rounding would spread what comes again over two.
    """
    number = int(period)
    return np.minimum(((np.arange(n) + 0.5) / period % 1.0 * number).astype(np.intp), number - 1)


def _fold(x: FloatArray, period: float) -> FloatArray:
    """Return the means of samples at each phase, shape (int(period),)."""
    total, count = _sums(x, 0, period, int(period))
    return np.asarray(total / np.maximum(count, 1.0))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _sums(x: FloatArray, first: int, period: float, number: int) -> tuple[FloatArray, FloatArray]:
    """Return sum and count of samples `first`, `first` + 1, … at each of `number` phases, as `_bins` has them."""
    total, count = np.zeros(number), np.zeros(number)
    for i in range(x.size):
        turns = (first + i + 0.5) / period
        at = min(int((turns - np.floor(turns)) * number), number - 1)
        total[at] += x[i]
        count[at] += 1.0
    return total, count


def _refined(fitted: Residual, e: FloatArray, near: float) -> float:
    """Return the period next to one at which the residuals fold best.

    A first search sums the spectrum at the harmonics of each period, a second one turns the harmonics of `FOLDED_PARTS`
    parts of the record, folded at the first, against each other.
    """
    n, (span, power) = len(e), fitted.spectrum
    step, harmonics = near / n, np.arange(1, int(near) // 2 + 1)
    tried = np.arange(near - 1.0 / PERIOD_MULTIPLES, near + 1.0 / PERIOD_MULTIPLES, 0.5 * step)
    tried = tried[tried.astype(int) == int(near)]
    places = np.rint(np.multiply.outer(span / fitted.channel.interval / tried, harmonics)).astype(np.intp) - 1
    first = float(tried[np.argmax(power[places].sum(axis=1))])
    number, size = int(near), n // FOLDED_PARTS
    sums = [_sums(e[at : at + size], at, first, number)[0] for at in range(0, size * FOLDED_PARTS, size)]
    turned = rfft(np.stack(sums), axis=1)[:, 1:]
    middle = (np.arange(FOLDED_PARTS) + 0.5) * size
    near_first = first + step * np.linspace(-1.0, 1.0, 65)
    near_first = near_first[near_first.astype(int) == number]
    turns = np.multiply.outer(1.0 / near_first - 1.0 / first, middle)
    wave = np.exp(-2j * np.pi * np.multiply.outer(turns, np.arange(1, turned.shape[1] + 1)))
    best = int(np.argmax((np.abs((wave * turned).sum(axis=1)) ** 2).sum(axis=1)))
    return float(near_first[best])


def _square(e: FloatArray, period: float) -> float:
    """Return Σ count · mean² of residuals over the phases of a period: χ² where nothing repeats."""
    total, count = _sums(e, 0, period, int(period))
    return float(np.sum(total**2 / np.maximum(count, 1.0)))


def _shortest(e: FloatArray, period: float) -> float:
    """Return a period or the part of it that is likeliest: what repeats at one repeats at its multiples, too.

    The likelihood is that of K means whose variance is unknown, ½ (S − K − K ln S/K) for the sum S of their squares.
    """

    def likelihood(tried: float) -> float:
        ratio = max(_square(e, tried) / int(tried), 1.0)
        return 0.5 * int(tried) * (ratio - 1.0 - float(np.log(ratio)))

    return max(
        (period / k for k in range(1, int(period / MIN_PERIOD) + 1) if k <= MAX_MULTIPLE), key=likelihood
    )


def _fitted_best(e: FloatArray, near: float) -> float:
    """Return the period within an eighth of a sample, over the record, at which the residuals fold best."""
    tried = [near * (1.0 + 0.03125 * step / len(e)) for step in range(-4, 5)]
    return max((p for p in tried if int(p) == int(near)), key=lambda p: _square(e, p))


def _extension(fitted: Residual, period: float) -> Comb:
    """Return the course over the period, with the spacing of its lines and its sd."""
    channel, n = fitted.cleaned, len(fitted.cleaned)
    slow, variance, _ = slow_track(fitted)
    profile = _fold(channel.y - slow, period)
    profile = _shrunk(profile - profile.mean(), variance * len(profile) / n)
    noise = variance * len(profile) / n
    power = max(float(np.mean(profile**2)), 1e-3 * noise)
    sd = float(np.sqrt(power))
    frequency = 1.0 / (period * channel.interval)
    values = {
        "spacing": Value.of(frequency, 0.5 * frequency / n, "Hz"),
        "sd": Value.log(sd, float(np.sqrt(variance / n / power + 0.5 / len(profile))), "{u}"),
    }
    return Comb(period, tuple(profile.tolist()), values=values)


def _shrunk(means: FloatArray, variance: float) -> FloatArray:
    """Return means, shape (K,), of this variance with less noise: only those that stand out, or all of them smaller.

    What is nearer to the truth by Stein's estimate of the risk: means beyond √(2 ln K) sds, or all times
    1 − (K − 2) variance ÷ Σ means² (James and Stein).
    """
    z, number = means / np.sqrt(variance), len(means)
    square = float(z @ z)
    kept = z * z > 2.0 * np.log(number)
    alone = float(np.sum(2.0 - z[kept] ** 2))
    together = -((number - 2.0) ** 2) / square
    if alone < together:
        return np.where(kept, means, 0.0)
    return np.asarray(means * max(1.0 - (number - 2.0) / square, 0.0))
