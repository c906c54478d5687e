"""Overflow: a register too small for a sample wraps it around, to the other end of its range.

Samples beyond a limit L come out one range W lower (or higher, at the low end), at the end of all others: L is the
largest sample, L − W the smallest. The level beside a sample is the median of its block, taken again once those that
seem to have wrapped are put back: one in six of them moves it by 0.4 sds. Samples nearer to the level once W is added
to them count as wrapped; without overflow they are glitches, and nothing keeps the others below L.
The chance of both is ::

    p = exp(−ρ²E) · (r/W')^(k−1),    E = Σ_t Φ((level_t − L)/σ)

E the samples that the noise should have beyond L, ρ ≤ 1 the samples found beyond a level half a sd inside it ÷ those
expected there, which guards against light tails, and r the range of the k wrapped samples beside W', in which
glitches of other sizes would lie. The number k of the wrapped ones must be that of those that are missing, they must
lie at their end as a tail does, and farther from the level than the noise's own tail on that side. Inside the other end
samples must lie as close as those of noise do of which so many are cut off. Two neighbours must not both have wrapped
more often than noise of the same correlation is beyond L twice: frozen readings come in runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincc

from models.arrays import BoolArray, FloatArray
from models.probability import binomial_at_least, normal_beyond, normal_density, rounding_variance
from tuner.types.records import Record

LEVEL_SAMPLES = 64
"""Samples whose median is their level: its sd is then 0.16 of theirs, and wrapped ones up to a third change little."""
MIN_WRAPPED = 3
"""Least number of wrapped samples: two glitches of like size may be chance."""
MAX_WRAPPED_SHARE = 0.2
"""Largest share of wrapped samples: with more, medians of blocks are between the two ends."""
FAR_SHARE = 0.35
"""Share of the range by which samples more than half of it from a median are from a mean, at least, of one in seven."""
MIN_DISTANCE = 4.0
"""Least distance of wrapped samples from the level, sds: most of the noise must lie nearer to it than W/2."""
INNER_EDGE = 0.5
"""Distance inside the end from which on samples are counted to see how light the tail is, sds."""
GAP_NATS = 3.0
"""Gap beside the outermost of k samples of a tail, times k and its rate, that is exceeded in 5 % of cases: −ln 0.05."""
MIN_BEYOND = 1.0
"""Samples that the noise should have beyond an end for their lack to say anything."""
COUNT_SDS = 4.0
"""Sds by which the number of wrapped samples may differ from that expected beyond the end; normal: 6e-5."""
SD_ERROR = 0.02
"""Relative error of the sd of the noise: that of the number beyond L is (L/σ)² times as large."""
OWN_TAIL_RATE = 0.7
"""Rate of the noise's own tail ÷ W/2 in sds: 0.72 at four sds for Student's t₃₀, 1.1 for normal noise."""
MEAN_MARGIN = 1.3
"""Mean distance beyond an end ÷ that of normal noise: 1.29 at three sds for Student's t₃₀."""
TIED_MARGIN = 1.3
"""Samples on the code next to an end ÷ those of normal noise: a code that is 0.3 steps too wide has as many."""
OUTERMOST_SAMPLES = 4
"""Samples next to the outermost one whose distance from it tells how dense they lie: enough for a gamma law."""
APART_P_VALUE = 1e-6
"""Chance of so wide a distance where noise is cut off: one such record in a million is not named."""
NEIGHBOUR_MARGIN = 2.0
"""Pairs of neighbours beyond L ÷ those of normal noise of the same correlation, of noise that is not normal."""
MIN_GRAIN = 1e-6
"""Distance at which two samples are one value, sds."""
TIED_P_VALUE = 1e-6
"""Chance of so many samples of one value at an end.

An end at which samples pile up is a rail, and one value that comes again and again a code for an error.
"""


@dataclass(frozen=True)
class Overflow:
    """Test whether an axis wraps around.

    Attributes
    ----------
    low, high : float
        Ends of the range: smallest and largest sample, unit.
    slack : float
        How far beyond these it may reach (95 %), unit.
    count : int
        Samples that wrapped.
    p_value : float
        Chance of such samples without overflow, doubled for the two ends.
    """

    low: float
    high: float
    slack: float
    count: int
    p_value: float


def unwrapped(y: FloatArray, width: float) -> FloatArray:
    """Return samples, shape (n,), of which those that wrapped are put back by a range of this width."""
    return np.asarray(y - width * np.round((y - _levels(y)) / width))


def without_overflow(record: Record, widths: Mapping[str, float]) -> Record:
    """Return a record with the wrapped samples of those axes that it has put back, by the width of the range of each.

    Segments are treated one by one: the level may differ between them. Where nothing wrapped it is the record itself.
    """
    wrapped = widths.keys() & set(record.axes)
    if not wrapped:
        return record
    y = record.y.copy(order="F")
    for axis in wrapped:
        column, width = y[:, record.axes.index(axis)], widths[axis]
        for start, stop in record.segments:
            column[start:stop] = unwrapped(column[start:stop], width)
    return replace(record, y=y)


def find_overflow(pieces: Sequence[FloatArray], step: float) -> Overflow:
    """Test both ends of the range of one channel.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        Gap-free samples of the channel.
    step : float
        Its quantizer step, unit; 0 for none.
    """
    low = min(float(piece.min()) for piece in pieces)
    high = max(float(piece.max()) for piece in pieces)
    width = high - low + step
    if sum(_far(piece, width) for piece in pieces) < MIN_WRAPPED:
        return Overflow(low, high, 0.0, 0, 1.0)
    levels = [_levels(unwrapped(piece, width)) for piece in pieces]
    off = np.concatenate([piece - level for piece, level in zip(pieces, levels, strict=True)])
    tests: list[tuple[float, float, int]] = []
    for sign in (1.0, -1.0):
        wrapped = sign * off < -0.5 * width
        if MIN_WRAPPED <= np.count_nonzero(wrapped) <= MAX_WRAPPED_SHARE * len(off):
            level = np.concatenate(levels)
            room = high - level if sign > 0.0 else level - low
            tests.append(_end(sign * off, room, wrapped, step, width))
    if not tests:
        return Overflow(low, high, 0.0, 0, 1.0)
    p_value, slack, count = min(tests)
    return Overflow(low, high, slack, count, min(1.0, 2.0 * p_value))


def _end(
    off: FloatArray, room: FloatArray, wrapped: BoolArray, step: float, width: float
) -> tuple[float, float, int]:
    """Return the chance that wrapped samples do not come from beyond the high end, its error (95 %), their number.

    `off` is the distance of each sample from its level, `room` that of the end, `wrapped` which ones wrapped.
    """
    count = int(np.count_nonzero(wrapped))
    lower = off[(off < 0.0) & ~wrapped]
    square = float(np.mean(lower**2)) - rounding_variance(step)
    if 0.25 * width**2 < MIN_DISTANCE**2 * square or square <= 0.0:
        return 1.0, 0.0, count
    sigma = math.sqrt(square)
    room = room / sigma
    chance = normal_beyond(room + 0.5 * step / sigma)
    beyond = float(chance.sum())
    if beyond < MIN_BEYOND:
        return 1.0, 0.0, count
    end, grain = max(float(chance @ room) / beyond, 1.0), max(step / sigma, MIN_GRAIN)
    inside = float(np.sum(normal_beyond(room - INNER_EDGE)))
    found = count + int(np.count_nonzero(off > sigma * (room - INNER_EDGE)))
    lightness = min(1.0, found / inside) if inside > 0.0 else 1.0
    error = math.sqrt(beyond + (SD_ERROR * end**2 * beyond) ** 2)
    if not lightness * beyond - COUNT_SDS * error <= count <= beyond + COUNT_SDS * error:
        return 1.0, 0.0, count
    edge = end + 0.5 * grain
    mean = normal_density(edge) / normal_beyond(edge) - edge
    past = off[wrapped] / sigma + width / sigma - room[wrapped] - 0.5 * grain
    short = room - off / sigma
    reach = max(mean, 2.0 * grain)
    first = 1.0 - normal_beyond(edge + grain) / normal_beyond(edge)
    last = (normal_beyond(edge - grain) - normal_beyond(edge)) / (
        normal_beyond(edge - 0.5 * grain - reach) - normal_beyond(edge)
    )
    apart = max(float(np.partition(short[~wrapped], OUTERMOST_SAMPLES)[OUTERMOST_SAMPLES]) - grain, 0.0)
    if (
        _in_runs(off / sigma, wrapped, edge, mean)
        or gammaincc(OUTERMOST_SAMPLES, count * apart / max(float(past.mean()), grain)) < APART_P_VALUE
        or past.mean() > mean * (MEAN_MARGIN + COUNT_SDS / math.sqrt(count))
        or _tied(past, grain, first)
        or _tied(short[short < reach], grain, last)
    ):
        return 1.0, 0.0, count
    spread = float(np.ptp(past)) / (0.5 * width / sigma)
    alike = min(spread, 1.0) ** (count - 1) if np.ptp(past) > grain else 1.0
    farther = -off[wrapped] / sigma - 0.5 * width / sigma
    own_tail = gammaincc(count, OWN_TAIL_RATE * 0.5 * width / sigma * float(farther.sum()))
    p_value = max(math.exp(-(lightness**2) * beyond) * alike, float(own_tail))
    return p_value, GAP_NATS * sigma / (end * count), count


def _in_runs(off: FloatArray, wrapped: BoolArray, end: float, mean: float) -> bool:
    """Return whether more neighbours wrapped than noise of this correlation has beyond its end at once.

    All in sds: `end` that of the range, `mean` how far samples beyond it are from it on average.
    """
    kept = ~(wrapped[1:] | wrapped[:-1])
    correlation = float(np.mean(off[1:][kept] * off[:-1][kept])) / float(np.mean(off[~wrapped] ** 2))
    correlation = min(max(correlation, 0.0), 0.99)
    again = normal_beyond((end - correlation * (end + mean)) / math.sqrt(1.0 - correlation**2))
    pairs = int(np.count_nonzero(wrapped[1:] & wrapped[:-1]))
    share = min(NEIGHBOUR_MARGIN * float(again), 1.0)
    return binomial_at_least(pairs, int(np.count_nonzero(wrapped)), share) < TIED_P_VALUE


def _tied(distance: FloatArray, grain: float, share: float) -> bool:
    """Return whether more samples lie on the code next to an end than this share of them, as a normal tail has."""
    at = int(np.count_nonzero(distance < distance.min(initial=np.inf) + 0.5 * grain))
    return binomial_at_least(at, len(distance), min(TIED_MARGIN * share, 1.0)) < TIED_P_VALUE


def _far(y: FloatArray, width: float) -> int:
    """Return how many samples are more than half a range from their level, seen in blocks where that may be."""
    number = max(len(y) // LEVEL_SAMPLES, 1)
    blocks = y[: len(y) // number * number].reshape(number, -1)
    off = np.abs(blocks - blocks.mean(axis=1, keepdims=True)) > FAR_SHARE * width
    some = blocks[off.any(axis=1)]
    return int(np.count_nonzero(np.abs(some - np.median(some, axis=1, keepdims=True)) > 0.5 * width))


def _levels(y: FloatArray) -> FloatArray:
    """Return the median of the block of each sample, shape (n,)."""
    number = max(len(y) // LEVEL_SAMPLES, 1)
    size = len(y) // number
    median = np.median(y[: number * size].reshape(number, size), axis=1)
    return np.append(np.repeat(median, size), np.full(len(y) - number * size, median[-1]))
