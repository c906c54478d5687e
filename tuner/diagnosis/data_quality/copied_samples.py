"""Samples that are no measurements of their own: packets that come twice, points on a line between their neighbours.

A packet of L samples that comes again in place of the next makes L equalities in a row at lag L. By chance a row of
L comes as often as at other lags, and as the usual share of equal samples to the power L. Samples that a program put on
a higher rate by straight lines have second differences of zero, to the last digit or within the step of the quantizer;
those of noise are that small in proportion to their density at zero, or, where a calibration mixed axes after the
quantizer, so that no step is left to see, as often as among samples farther apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import SAMPLES_AT_ONCE, BoolArray, FloatArray
from models.probability import binomial_at_least, poisson_at_least
from models.robust import normal_sd

MAX_PACKET = 64
"""Longest packet that is sought, samples; packets of inertial units and of links are shorter."""
MAX_SEARCHED_SAMPLES = 100_000
"""Samples in which packets are sought before the whole record is read for one length; chosen to bound the time."""
MIN_PACKETS = 3
"""Least number of packets that come twice, at the length that stands out."""
CHANCE_FACTOR = 4.0
"""Factor on the number by chance, for noise whose neighbours resemble each other more than those at other lags."""
MAX_P_VALUE = 1e-3
"""P-value above which the copies are not looked for in the whole record."""
MAX_LINE_DISTANCE = 1e-9
"""Second difference ÷ sd of the differences up to which three samples lie on a line: arithmetic, no noise."""
MIN_LINE_SHARE = 0.02
"""Least share of samples on a line; fewer are the bridges of short gaps."""
FAR_LAGS = (31, 37, 41, 43, 47)
"""Distances of samples that no resampling relates: above the ratios of rates in use, and without common divisors."""
MIN_STEPS = 4.0
"""Sd of the second differences, steps, below which a quantizer puts many triples of noise on lines."""


@dataclass(frozen=True)
class Packets:
    """Packets that come twice.

    Attributes
    ----------
    length : int
        Samples in a packet; 0 where there are none.
    number : int
        Packets that come again.
    p_value : float
    copies : ndarray of bool, shape (n,)
        Samples that are copies.
    """

    length: int
    number: int
    p_value: float
    copies: BoolArray


def find_packets(y: FloatArray) -> Packets:
    """Search the rows of samples, shape (n, k), for packets that come twice."""
    none = Packets(0, 0, 1.0, np.zeros(len(y), dtype=bool))
    part = y[:MAX_SEARCHED_SAMPLES]
    if len(part) < 4 * MAX_PACKET:
        return none
    lags = np.arange(2, MAX_PACKET + 1)
    equal = [_equal(part, lag) for lag in lags.tolist()]
    usual = float(np.median([float(one.mean()) for one in equal]))
    number = np.array([len(_rows(one, lag)) for one, lag in zip(equal, lags.tolist(), strict=True)])
    best = int(np.argmax(number - len(part) * usual**lags))
    beside = max(
        len(_rows(one, int(lags[best]))) for one, lag in zip(equal, lags, strict=True) if lag % lags[best]
    )
    chance = CHANCE_FACTOR * max(len(part) * usual ** float(lags[best]), float(beside), 1e-12)
    p_value = min(1.0, len(lags) * poisson_at_least(number[best], chance))
    if number[best] < MIN_PACKETS or p_value > MAX_P_VALUE:
        return none
    length = int(lags[best])
    starts = _rows(_equal(y, length), length) + length
    copies = np.zeros(len(y), dtype=bool)
    for start in starts.tolist():
        copies[start : start + length] = True
    return Packets(length, len(starts), p_value, copies)


def _equal(y: FloatArray, lag: int) -> BoolArray:
    """Return which samples equal those `lag` before, in all columns, and move beside; shape (n − lag,)."""
    return np.asarray(np.all(y[lag:] == y[:-lag], axis=1))


def _rows(equal: BoolArray, length: int) -> NDArray[np.intp]:
    """Return where rows of at least `length` equalities begin, each row taken in packets."""
    edge = np.diff(np.concatenate(([0], equal.astype(np.int8), [0])))
    first, last = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    long = np.flatnonzero(last - first >= length)
    starts = [np.arange(first[i], last[i] - length + 1, length) for i in long]
    return np.concatenate(starts) if starts else np.empty(0, dtype=np.intp)


@dataclass(frozen=True)
class Lines:
    """Samples on lines between those beside them: share of all, chance of so many."""

    share: float
    p_value: float


def find_lines(pieces: Sequence[FloatArray], step: float) -> Lines:
    """Test gap-free samples of a channel, shape (n,), for points on lines between their neighbours.

    `step` is that of its quantizer, 0 for none.
    """
    sizes = [(len(size), float(size.sum())) for size in _off_line(pieces, 1)]
    count = sum(number for number, _ in sizes)
    if not count:
        return Lines(0.0, 1.0)
    reach = max(1.01 * step, MAX_LINE_DISTANCE * sum(total for _, total in sizes) / count)
    on_line = sum(int(np.count_nonzero(size <= reach)) for size in _off_line(pieces, 1))
    share = on_line / count
    if share < MIN_LINE_SHARE or share == 1.0:
        return Lines(share, 1.0)
    size = np.concatenate(list(_off_line(pieces, 1)))
    scale = float(normal_sd(size[size > reach]))
    if not scale > 0.0 or scale < MIN_STEPS * step:
        return Lines(0.0, 1.0)
    by_density = (2.0 * reach + step) / (scale * np.sqrt(2.0 * np.pi))
    far = (np.concatenate([np.empty(0), *_off_line(pieces, lag)]) for lag in FAR_LAGS)
    apart = [np.mean(one <= reach) for one in far if len(one)]
    expected = min(CHANCE_FACTOR * max(by_density, float(np.median(apart)) if apart else 0.0) + 1e-9, 1.0)
    return Lines(share, binomial_at_least(on_line, count, expected))


def _off_line(pieces: Sequence[FloatArray], lag: int) -> Iterator[FloatArray]:
    """Yield how far samples lie off the line through those `lag` before and after them, where the signal moves."""
    for piece in pieces:
        for first in range(0, len(piece) - 2 * lag, SAMPLES_AT_ONCE):
            part = piece[first : first + SAMPLES_AT_ONCE + 2 * lag]
            before, after = part[lag:-lag] - part[: -2 * lag], part[2 * lag :] - part[lag:-lag]
            yield np.abs(after - before)[after != 0.0]
