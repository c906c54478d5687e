"""Comb: something short that comes again and again at one period, lines of one spacing in the spectrum.

None of the lines needs to stand out. The period is sought in the autocorrelation r of the residuals, which is raised at
every multiple of it: the largest mean of r at `PERIOD_MULTIPLES` of them, among periods that differ by parts of a
sample, and where that is not clear, at `MANY_MULTIPLES` of those with the largest. Statistic: at that period, refined,
the residuals are folded into K bins. Where nothing repeats, Σ count · mean² is χ²_K, and the largest count · mean²,
which shows a short pulse, the largest of K squares of normal numbers; with a price for every period. What has most of
its power in `FEW_LINES` lines is one of lines, not a comb.
Extension: the mean course over a period is taken out of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from models.arrays import FloatArray, IndexArray, SingleArray
from models.effects.static.spectral import Comb as Effect
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.series_statistics import RESIDUAL_CLIP
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.variance.quantized_noise import slow_track

MIN_PERIOD, MAX_PERIOD = 12.0, 2000.0
"""Periods, samples: below there are too few lines for a comb, above few periods for their multiples."""
MIN_MULTIPLES, PERIOD_MULTIPLES = 8, 32
"""Multiples of a period at which the autocorrelation is averaged: its deviation falls by their root."""
MANY_MULTIPLES, CANDIDATE_COUNT = 256, 256
"""Multiples at which the autocorrelation is averaged for so many periods of largest mean at the first ones.

A comb that shows by 5.5 sds at 256 multiples shows by 1.9 at 32, as one in thirty periods does by chance, many of them
beside each other.
"""
MIN_SCORE = 5.5
"""Deviations of that mean below which no period is folded: one of 1e5 exceeds it by chance in 2e-3 of records."""
MAX_MULTIPLE = 12
"""Largest multiple of its period at which a comb is found; beyond, few periods are left in a record."""
PHASE_STEPS = (0.25, 0.0625, 0.015625)
"""Steps, samples, in the middle of a record and at its ends, by which the bins of a period are put around pulses."""
HELD_OUT_STEP = 0.25
"""Steps, bins, in phase and over a record, by which a comb is put on samples that did not show its period."""
MIN_SHIFT_SQUARE = 18.0
"""Squared sds by which a period must fit its course better one sample off: 2 ln 1e4, for one of 1e4 that is off."""
FOLDED_PARTS = 32
"""Parts of a record that are folded apart to refine a period: over one of them its harmonics lose no phase."""
FEW_LINES, MAX_LINE_SHARE, CLEAR_LINE_SHARE = 3, 0.6, 0.8
"""Lines that hold less than this share of the power of a comb; a pulse spreads its power over all of them evenly.

Beyond the second share they hold too much at any phase of the bins, which is then not sought.
"""
EDGE_MARGIN, TINY_LAG = 1e-6, 1e-12
"""Parts of a phase next to its edges in which samples are put by themselves, where rounding decides.

And least part of one by which samples and phases run apart in a step, so that quotients stay finite.
"""
MIDDLE_PHASE = 0.5
"""Phase, samples, at which samples lie in the middle of their bin: at its edge, rounding would spread what repeats."""


@dataclass(frozen=True)
class Comb(Extension):
    """A course over a period, `profile` at even phases, in scales; `period` and `phase` in samples."""

    cause = "comb"
    effect = Effect
    group = "fast spectrum"
    view = "spectrum"
    meaning = "something short comes again at one period: many lines of one spacing, none of which stands out"
    consequence = (
        "find what happens at that period (a bus, a clock, a heater) and keep it off; take its course out"
    )
    supersedes = ("line", "spikes", "heavy_tails", "skewed_noise", "periodic_variance")
    period: float
    profile: tuple[float, ...]
    phase: float

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the course out, in each period one sample earlier or later where it is clearly there."""
        return replace(channel, y=channel.y - self._course(channel.y)[0])

    def elsewhere(self, y: FloatArray) -> tuple[FloatArray, float]:
        """Return the course in other samples, shape (n,), and what its phases cost, nats.

        The phase is the one among all that these samples show, to a part of a bin, and the period the likeliest within
        what the samples resolve; a single period that is off costs what it must gain at least.
        """
        profile, level = np.array(self.profile), y - y.mean()
        seen = np.bincount(self._bins(len(y)), level, len(profile))
        late = int(np.argmax(irfft(rfft(seen) * np.conj(rfft(profile)), len(profile))))
        steps = [HELD_OUT_STEP * k for k in range(-4, 5)]
        tried = [
            replace(
                self,
                period=self.period * (1.0 + drift / len(y)),
                phase=self.phase - late * width + shift * width,
            )
            for width in (self.period / len(profile),)
            for drift in steps
            for shift in steps
        ]
        best = max(tried, key=lambda one: float(profile[one._bins(len(y))] @ level))
        course, off = best._course(level)
        return course, float(np.log(len(profile) * len(tried) * HELD_OUT_STEP)) + 0.5 * MIN_SHIFT_SQUARE * off

    def _course(self, y: FloatArray) -> tuple[FloatArray, int]:
        """Return the course in samples and how many periods in it are one sample earlier or later."""
        turns = (np.arange(len(y)) + self.phase) / self.period
        place, turn = self._bins(len(y)), np.floor(turns).astype(np.intp)
        profile, turn = np.array(self.profile), turn - turn[0]
        course, best = profile[place], np.full(turn[-1] + 1, MIN_SHIFT_SQUARE)
        plain, off = course, np.zeros(len(best), dtype=bool)
        for shift in (-1, 1):
            moved = profile[(place + shift) % len(profile)]
            better = np.bincount(turn, (moved - plain) * (2.0 * y - moved - plain))
            course = np.where((better > best)[turn], moved, course)
            off |= better > best
            best = np.maximum(best, better)
        return course, int(np.count_nonzero(off))

    def _bins(self, n: int) -> IndexArray:
        """Return which of the even phases each of n samples has, shape (n,)."""
        number = len(self.profile)
        at = ((np.arange(n) + self.phase) / self.period % 1.0 * number).astype(np.intp)
        return np.minimum(at, number - 1)

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Search for a period, and fold the residuals at it."""
        name = "sum of squared means over a period"
        score, period, number = _best_period(fitted)
        if score < MIN_SCORE:
            return TestResult(cls.cause, 1.0, NO_GAIN, score, name)
        e = np.clip(fitted.e, -RESIDUAL_CLIP, RESIDUAL_CLIP)
        e = np.where(fitted.valid, e - e[fitted.valid].mean(), 0.0)
        period = _fitted_best(e, _refined(fitted, e, period))
        if _of_few_lines(_fold(e, period, MIDDLE_PHASE), _square(e, period), CLEAR_LINE_SHARE):
            return TestResult(cls.cause, 1.0, NO_GAIN, score, name)
        period, phase = _in_phase(e, _shortest(e, period))
        folded = _fold(e, period, phase)
        square = _square(e, period, phase)
        if _of_few_lines(folded, square):
            return TestResult(cls.cause, 1.0, NO_GAIN, score, name)
        tried = number * len(e) / period
        highest = _highest_square(e, period, phase)
        chances = chi2_beyond(square, len(folded)), len(folded) * chi2_beyond(highest, 1.0)
        p_value = min(1.0, 2.0 * tried * min(chances))
        gains = 0.5 * (square - len(folded)), 0.5 * highest - float(np.log(len(folded)))
        gain = max(gains) - float(np.log(tried))
        return TestResult(
            cls.cause, p_value, gain, square, name, lambda: (_extension(fitted, period, phase),)
        )


def _best_period(fitted: FittedChannel) -> tuple[float, float, int]:
    """Return the largest mean of the autocorrelation over multiples, in sds, its period, samples, and their number."""
    n = len(fitted.e)
    e = fitted.clipped - fitted.clipped.mean(dtype=float).astype(np.float32)
    r = _autocorrelation(e, min(n // 2, int(MAX_PERIOD * PERIOD_MULTIPLES) + 2)) * np.sqrt(n)
    r = (r[:-1] + r[1:]) / np.sqrt(2.0)
    periods = np.arange(MIN_PERIOD, min(MAX_PERIOD, (len(r) - 1) / MIN_MULTIPLES), 1.0 / PERIOD_MULTIPLES)
    if not len(periods):
        return 0.0, MIN_PERIOD, 1
    score, number = _means(r, periods, PERIOD_MULTIPLES), len(periods)
    if score.max() < MIN_SCORE:
        largest = np.argpartition(score, -min(CANDIDATE_COUNT, number))[-CANDIDATE_COUNT:]
        steps = np.arange(-1.0, 1.0, PERIOD_MULTIPLES / MANY_MULTIPLES) / PERIOD_MULTIPLES
        periods = np.unique(np.add.outer(periods[largest], steps))
        score, number = _means(r, periods, MANY_MULTIPLES), number * MANY_MULTIPLES // PERIOD_MULTIPLES
    best = int(np.argmax(score))
    return float(score[best]), float(periods[best]), number


def _means(r: FloatArray, periods: FloatArray, most: int) -> FloatArray:
    """Return the mean of the autocorrelation, in sds, over so many multiples of each period or all there are."""
    total, count = np.zeros(len(periods)), np.minimum((len(r) - 1) // periods, most)
    for multiple in range(1, most + 1):
        inside = int(np.count_nonzero(count >= multiple))
        total[:inside] += r[(multiple * periods[:inside]).astype(np.intp)]
    return np.asarray(total / np.sqrt(count))


def _autocorrelation(e: SingleArray, reach: int) -> FloatArray:
    """Return the autocorrelation at lags 0 … reach − 1 of numbers of mean 0, from stretches of the record."""
    size = next_fast_len(max(4 * reach, 1 << 12), real=True)
    step, product = size - reach, np.zeros(size // 2 + 1, complex)
    for first in range(0, len(e), step):
        beside = e[first : first + size]
        product += rfft(beside[:step], size).conj() * rfft(beside, size)
    r: FloatArray = irfft(product, size)[:reach]
    return np.asarray(r / r[0])


def _fold(x: FloatArray, period: float, phase: float) -> FloatArray:
    """Return the means of samples at each phase, shape (int(period),)."""
    total, count = _sums(x, phase, period, int(period))
    return np.asarray(total / np.maximum(count, 1.0))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _sums(x: FloatArray, first: float, period: float, number: int) -> tuple[FloatArray, FloatArray]:
    """Return sum and count of samples at each of `number` phases, the first `first` samples into a period.

    `number` is that of whole samples in a period: a phase is as wide as a sample or slightly wider, so that within a
    period samples and phases run side by side but for one place, where two samples share a phase. Only about that
    place are phases computed sample by sample.
    """
    total, entered = np.zeros(number), np.zeros(number + 1)
    start, lag = 0, max(1.0 - number / period, TINY_LAG)
    while start < x.size:
        turn = np.floor((first + start) / period)
        stop = min(x.size, max(start + 1, int(np.ceil((turn + 1.0) * period - first))))
        while stop < x.size and np.floor((first + stop) / period) <= turn:
            stop += 1
        while stop > start + 1 and np.floor((first + stop - 1) / period) > turn:
            stop -= 1
        place = ((first + start) / period - turn) * number
        begin = min(int(place), number - 1)
        into, longest = place - begin, float(stop - start)
        near = 0.0 if into > 1.0 - EDGE_MARGIN else (into - EDGE_MARGIN) / lag - 2.0
        low = start + int(min(max(near, 0.0), longest))
        high = start + int(min((into + EDGE_MARGIN) / lag + 2.0, longest))
        _add(total[begin:], x[start:low])
        entered[begin] += 1.0
        entered[begin + low - start] -= 1.0
        for i in range(low, high):
            at = min(int(((first + i) / period - turn) * number), number - 1)
            total[at] += x[i]
            entered[at] += 1.0
            entered[at + 1] -= 1.0
        if high < stop:
            at = begin + high - start - 1
            _add(total[at:], x[high:stop])
            entered[at] += 1.0
            entered[at + stop - high] -= 1.0
        start = stop
    return total, np.cumsum(entered)[:-1]


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[misc, unused-ignore]
def _add(total: FloatArray, x: FloatArray) -> None:
    """Add numbers, shape (n,), to the first of others."""
    for i in range(x.size):
        total[i] += x[i]


def _refined(fitted: FittedChannel, e: FloatArray, near: float) -> float:
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
    sums = [
        _sums(e[at : at + size], at + 0.5, first, number)[0] for at in range(0, size * FOLDED_PARTS, size)
    ]
    turned = rfft(np.stack(sums), axis=1)[:, 1:]
    middle = (np.arange(FOLDED_PARTS) + 0.5) * size
    near_first = first + step * np.linspace(-1.0, 1.0, 65)
    near_first = near_first[near_first.astype(int) == number]
    turns = np.multiply.outer(1.0 / near_first - 1.0 / first, middle)
    wave = np.exp(-2j * np.pi * np.multiply.outer(turns, np.arange(1, turned.shape[1] + 1)))
    best = int(np.argmax((np.abs((wave * turned).sum(axis=1)) ** 2).sum(axis=1)))
    return float(near_first[best])


def _square(e: FloatArray, period: float, phase: float = MIDDLE_PHASE) -> float:
    """Return Σ count · mean² of residuals over the phases of a period: χ² where nothing repeats."""
    total, count = _sums(e, phase, period, int(period))
    return float(np.sum(total**2 / np.maximum(count, 1.0)))


def _highest_square(e: FloatArray, period: float, phase: float) -> float:
    """Return the largest count · mean² of residuals at one phase of a period: of a pulse in one bin."""
    total, count = _sums(e, phase, period, int(period))
    return float(np.max(total**2 / np.maximum(count, 1.0)))


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


def _of_few_lines(folded: FloatArray, square: float, share: float = MAX_LINE_SHARE) -> bool:
    """Return whether few lines hold more than a share of means over a period, shape (K,).

    `square` is their sum of squares, χ²_K by chance. What chance has a part in is taken off on both sides: 1 of a line
    on average, ln of their number of the largest.
    """
    lines = np.sort(np.abs(rfft(folded - folded.mean())[1:]) ** 2)[::-1]
    lines *= 0.5 * square / max(lines.sum(), np.finfo(float).tiny)
    few = float(lines[:FEW_LINES].sum()) - FEW_LINES * float(np.log(len(lines)))
    return few > share * (float(lines.sum()) - len(lines))


def _in_phase(e: FloatArray, near: float) -> tuple[float, float]:
    """Return a period beside one, and the phase of its bins, samples, at which short pulses lie in one bin each.

    What an edge of the bins divides is left in the samples, where it looks like spikes.
    """
    phase = 0.5 - 0.5 * len(e)
    for width in PHASE_STEPS:
        steps = [width * k for k in range(-4, 5)]
        phase = max((phase + step for step in steps), key=lambda x: _square(e, near, x))
        periods = (near * (1.0 + 2.0 * step / len(e)) for step in steps)
        near = max((p for p in periods if int(p) == int(near)), key=lambda p: _square(e, p, phase))
    return near, phase


def _extension(fitted: FittedChannel, period: float, phase: float) -> Comb:
    """Return the course over the period, with the spacing of its lines and its sd."""
    channel, n = fitted.cleaned, len(fitted.cleaned)
    slow, variance, _ = slow_track(fitted)
    profile = _fold(channel.y - slow, period, phase)
    profile = _shrunk(profile - profile.mean(), variance * len(profile) / n)
    noise = variance * len(profile) / n
    power = max(float(np.mean(profile**2)), 1e-3 * noise)
    sd = float(np.sqrt(power))
    frequency = 1.0 / (period * channel.interval)
    values = {
        "spacing": Value.of(frequency, 0.5 * frequency / n, "Hz"),
        "sd": Value.log(sd, float(np.sqrt(variance / n / power + 0.5 / len(profile))), "{u}"),
    }
    return Comb(period, tuple(profile.tolist()), phase, values=values)


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
