"""Frequency sweep: a tone whose frequency changes linearly through the record, which no spectrum of the whole resolves.

The residuals are cut into K parts, each with its periodogram on half bins, divided by the mean of its part and of its
frequency: a burst, a line and the shape of the spectrum leave nothing behind. Where the model is right the
ordinates I are exponential numbers, independent from part to part, and on every linear track::

    Σ_k I[k, f + d k/(K − 1)]   is Gamma distributed with K,    d = −(K − 1) … K − 1 half bins

All tracks cost K F log K additions by halves of halves. A resonance that wanders fills many tracks side by side, a tone
one: each drift is looked for in the fewest, longest parts in which it is slow, and where the mean of the tracks beside
exceeds its expectation, sums are divided by that excess. Chance: that of the greatest sum times the number of tracks
and of lengths of parts (many parts for fast sweeps, few for slow ones). No cause of the catalogue sweeps: it is
reported as unexplained. Extension: the tone is taken out part by part, phase and size free.

References
----------
.. [1] J. H. Taylor, A sensitive method for detecting dispersed radio emission, Astron. Astrophys. Suppl. 15 (1974).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import prev_fast_len, rfft
from scipy.ndimage import uniform_filter1d

from models.arrays import SingleArray
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.outcome import TestResult

PARTS = (512, 256, 128, 64)
"""Numbers of parts that a record is cut into, in octaves: many parts for fast sweeps, few for slow ones."""
MIN_PART_SAMPLES = 16
"""Least number of samples in a part; fewer leave no frequencies above `MIN_HALF_BIN`."""
MIN_TRACK_MOTION = 4
"""Half bins by which a track must move: two bins; what moves less is a line."""
NEAR_TRACK_DISTANCE, FAR_TRACK_DISTANCE = 4, 10
"""Half bins from a track at which the tracks beside it lie: a tone does not reach them, a resonance does."""
MIN_HALF_BIN = 8
"""Half bins at the lower end that are left out: slow noise is not white within a part."""
PARTS_AT_ONCE = 8
"""Parts transformed side by side, which takes half the time of one after the other."""
LEAST_SHARE = 0.99
"""Share of the samples of a part that a transform must keep to leave the others out: a sweep loses 1 % of its nats."""
PART_PIECES = 8
"""Pieces of a part over each of which the frequency of the tone is taken as constant when its ends are estimated."""
END_PLACES = 17
"""Values of each end that are tried then, within two half bins: quarter steps of a half bin."""


@dataclass(frozen=True)
class Sweep(Extension):
    """A tone from frequency `first` to `last`, cycles a sample, of free phase and size in each of `parts`."""

    cause = "sweep"
    group = "fast spectrum"
    named = False
    tested_first = True
    meaning = "a tone that sweeps"
    consequence = "distrust the band it crosses; look for what speeds up or slows down"
    first: float
    last: float
    parts: int

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the tone out."""
        size = len(channel) // self.parts
        y = channel.y.copy()
        inside = y[: self.parts * size].reshape(self.parts, size)
        turn = _turn(self.first, self.last, len(channel))[: self.parts * size].reshape(self.parts, size)
        level = inside.mean(axis=1, keepdims=True)
        size_and_phase = 2.0 / size * np.sum((inside - level) * turn.conj(), axis=1, keepdims=True)
        inside -= np.real(size_and_phase * turn)
        return replace(channel, y=y)

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Search the residuals for a tone that sweeps from one end of the record to the other."""
        e = fitted.clipped
        tried = [parts for parts in PARTS if len(e) >= MIN_PART_SAMPLES * parts]
        slowest = {parts: parts // 4 if parts > min(tried) else MIN_TRACK_MOTION for parts in tried}
        tracks = [track for parts in tried if (track := _clearest(e, parts, slowest[parts])) is not None]
        if not tracks:
            return TestResult(Sweep.cause, 1.0, -9.0, 0.0, Sweep.meaning)
        best = min(tracks, key=lambda track: track.chance)
        low, high = (f / fitted.channel.interval for f in (best.tone.first, best.tone.last))
        name = f"{Sweep.meaning} from {low:.3g} to {high:.3g} Hz"
        chance = min(1.0, len(tried) * best.chance)
        return TestResult(
            Sweep.cause, chance, best.excess, best.excess, name, lambda: (_placed(e, best.tone),)
        )


@dataclass(frozen=True)
class _Track:
    """The clearest track for one number of parts: its chance, its sum less the expected one, its tone."""

    chance: float
    excess: float
    tone: Sweep


def _turn(first: float, last: float, n: int) -> NDArray[np.complex128]:
    """Return the tone as a unit vector that turns, shape (n,)."""
    t = np.arange(n)
    return np.asarray(np.exp(2j * np.pi * t * (first + 0.5 * (last - first) / n * t)))


def _clearest(e: SingleArray, parts: int, slowest: int) -> _Track | None:
    """Return the clearest track of residuals (n,) cut into a power of two of parts; None where nothing stands out.

    It moves by `slowest` half bins at least.
    """
    power = _powers(e, parts)
    width = power.shape[1]
    size = width + MIN_HALF_BIN
    best = None
    for mirrored in (False, True):
        most, drift, at = 0.0, slowest, 0
        for rise, sums in enumerate(_sums(power[:, ::-1] if mirrored else power)[slowest:], start=slowest):
            if sums.max() <= most:  # what is beside can only lower them
                continue
            above = sums / np.maximum(_beside(sums) / np.float32(parts), 1.0)
            if above.max() > most:
                most, drift, at = float(above.max()), rise, int(np.argmax(above))
        moved = np.array([at, min(at + drift, width - 1)])
        ends = (MIN_HALF_BIN + (width - 1 - moved if mirrored else moved)) / (2.0 * size)
        chance = 2.0 * (parts - slowest) * width * chi2_beyond(2.0 * most, 2.0 * parts)
        if chance < (best.chance if best else 1.0):
            best = _Track(chance, most - parts, Sweep(float(ends[0]), float(ends[1]), parts))
    return best


def _powers(e: SingleArray, parts: int) -> SingleArray:
    """Return the periodograms of even parts on half bins ÷ the means of their part and frequency, (parts, F)."""
    rows = _rows(e, parts)
    size = rows.shape[1]
    power = np.empty((parts, size - MIN_HALF_BIN), np.float32)
    for first in range(0, parts, PARTS_AT_ONCE):
        some = power[first : first + PARTS_AT_ONCE]
        wave = rfft(rows[first : first + PARTS_AT_ONCE], 2 * size, axis=1)[:, MIN_HALF_BIN:-1]
        np.add(wave.real**2, wave.imag**2, out=some)
        some /= some.mean(axis=1, keepdims=True)
    power /= power.mean(axis=0)
    return power


def _rows(e: SingleArray, parts: int) -> SingleArray:
    """Return even parts of residuals, (parts, size), without the few samples at the end of each that make them slow."""
    size = len(e) // parts
    fast = prev_fast_len(size, real=True)
    return e[: parts * size].reshape(parts, size)[:, : fast if fast > LEAST_SHARE * size else size]


def _sums(power: SingleArray) -> SingleArray:
    """Return the sums along all tracks that rise by d < K, of powers (K, F): shape (K, F), by d and first frequency."""
    number, width = power.shape
    before, after = power, np.empty_like(power)
    length = 1
    while (
        length < number
    ):  # tracks through `length` parts, one after the other, become those through twice as many
        first, second = before.reshape(-1, 2, length, width).swapaxes(0, 1)
        sums = after.reshape(-1, 2 * length, width)
        for d in range(2 * length):
            shift = min((d + 1) // 2, width)
            np.add(
                first[:, d // 2, : width - shift],
                second[:, d // 2, shift:],
                out=sums[:, d, : width - shift],
            )
            sums[:, d, width - shift :] = first[:, d // 2, width - shift :]
        before, after, length = after, np.empty_like(power) if before is power else before, 2 * length
    return before


def _beside(sums: SingleArray) -> SingleArray:
    """Return the mean sum of the parallel tracks beside each, of tracks of one rise by first frequency, (F,)."""
    outer, inner = 2 * FAR_TRACK_DISTANCE + 1, 2 * NEAR_TRACK_DISTANCE - 1
    wide, narrow = (uniform_filter1d(sums, size, mode="nearest") for size in (outer, inner))
    return np.asarray((outer * wide - inner * narrow) / (outer - inner))


def _placed(e: SingleArray, tone: Sweep) -> Sweep:
    """Return the tone with the ends, within two half bins, at which its parts have most power."""
    size = len(e) // tone.parts // PART_PIECES
    n = tone.parts * PART_PIECES * size
    pieces = (e * _turn(tone.first, tone.last, len(e)).conj())[:n].reshape(-1, size).sum(axis=1)
    middle = (np.arange(len(pieces)) + 0.5) * size
    off = np.linspace(-1.0, 1.0, END_PLACES) / (PART_PIECES * size)

    def power(first: float, last: float) -> float:
        turned = pieces * np.exp(-2j * np.pi * middle * (first + 0.5 * (last - first) / len(e) * middle))
        return float(np.sum(np.abs(turned.reshape(tone.parts, PART_PIECES).sum(axis=1)) ** 2))

    first, last = max(((a, b) for a in off for b in off), key=lambda ends: power(*ends))
    return replace(tone, first=tone.first + float(first), last=tone.last + float(last))
