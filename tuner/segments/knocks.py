"""Knocks: motion too short for the variance of a second, seen on overlapping blocks of a quarter of one.

With v_bj the variance of block b on channel j and m_j its usual value, the median over a minute of blocks at rest,

    L_b = mean_j ½ ln(v_bj / m_j),    the largest channel counted as the second largest

A block moved if L_b > z s + ln 1.2. s is the scatter of L_b below its median, of the record itself, so that filtered
and heavy-tailed noise has a law of its own; z is the normal quantile of the false-alarm probability ÷ number of blocks.
Logarithms of variances are skewed to the left, so that the normal law is never too short. One channel alone is no
motion, nor is one sample: variances count without the sample that is furthest off. White noise that swells on all
channels of one sensor, or for more than a few seconds, is a burst: a motion is slower than the noise, or a blow that
both sensors feel. What changes neither the variance nor the white noise of the record by 1 % is left where it is.

A motion goes on beside a block that moved, or beside one that is known to, while L_b exceeds what 1 % of blocks at rest
exceed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.ndimage import binary_dilation, label
from scipy.special import ndtri

from models.arrays import BoolArray, FloatArray, IntArray
from models.probability import normal_below
from tuner.segments.block_moments import block_moments
from tuner.segments.knock_bridges import MAX_SECONDS
from tuner.types.records import Record

BLOCK_SECONDS = 0.25
"""Length of a block, s: a knock on a table rings for a tenth to half a second."""
MIN_BLOCK_SAMPLES = 16
"""Least length of a block in samples: its variance is then known to a third."""
USUAL_BLOCKS = 480
"""Blocks over which the level of the noise is taken, a minute: slower changes of it are no knocks."""
MIN_USUAL_BLOCKS = 48
"""Fewest blocks at rest that tell what is usual, 6 s: their scatter is then known to a fifth."""
LEVEL_MARGIN = float(np.log(1.2))
"""For a noise level that changes within a minute while the sensor is at rest."""
MIN_WORTH = 0.01
"""Least part of the variance or of the white noise of a channel that a knock must make up: its interval is wider."""
BLOCKS_BESIDE = 8
"""Blocks on either side, a second, whose mean is the level from which a knock displaces a sensor."""
EDGE_PROBABILITY = 0.01
"""Probability that a still block beside a moving one counts as moving: one hundredth of a second of each edge."""
MIN_SLOWER_GROWTH = float(np.log(1.25))
"""Growth of the sd of samples ÷ that of their differences from which what is added is slower than the noise, and growth
of a sensor from which it feels the motion: blocks at rest scatter by a quarter of it."""


def knocked(
    records: Sequence[Record], moving: BoolArray, rounding: Sequence[FloatArray], false_alarm: float
) -> BoolArray:
    """Return the samples that moved, shape (n,): those that are known to, what continues them, and knocks.

    Parameters
    ----------
    records : sequence of Record
        Sensors on one clock.
    moving : ndarray of bool, shape (n,)
        Samples in motion by the variance of seconds.
    rounding : sequence of ndarray
        For each record the variance of rounding of its channels.
    false_alarm : float
        Probability that a record of a still sensor shows any knock.
    """
    first = records[0]
    size = max(MIN_BLOCK_SAMPLES, round(BLOCK_SECONDS * first.rate))
    starts = np.concatenate([np.arange(a, b - size + 1, size // 2) for a, b in first.segments])
    busy = _any_in_block(moving, starts, size)
    if sum(record.y.shape[1] for record in records) < 2 or np.count_nonzero(~busy) < MIN_USUAL_BLOCKS:
        return moving
    columns = [
        _Column(column, float(least), starts, size, busy)
        for record, step in zip(records, rounding, strict=True)
        for column, least in zip(record.y.T, step, strict=True)
    ]
    level = _without_largest([one.level for one in columns])
    centre = float(np.median(level[~busy]))
    scatter = centre - float(np.quantile(level[~busy], normal_below(-1.0)))
    high = centre - float(ndtri(false_alarm / len(starts))) * scatter + LEVEL_MARGIN
    low = centre - float(ndtri(EDGE_PROBABILITY)) * scatter
    chosen = np.flatnonzero((level > high) & ~busy)
    hit = np.zeros(len(starts), dtype=bool)
    if len(chosen):
        again = [one.without_furthest(chosen) for one in columns]
        edges = np.cumsum([0, *(record.y.shape[1] for record in records)])
        felt = np.array([np.mean(again[a:b], axis=0) for a, b in pairwise(edges)])
        slow = np.mean([one.level - one.roughness for one in columns], axis=0)
        both = (len(felt) > 1) & np.all(felt > MIN_SLOWER_GROWTH, axis=0)
        hit[chosen] = (_without_largest(again) > high) & ((slow[chosen] > MIN_SLOWER_GROWTH) | both)
        hit = _motions(hit, columns, slow, int(np.count_nonzero(~busy)), first.rate)
    return moving | _grown(hit, busy, level > low, starts, size, first)


class _Column:
    """Variances of the blocks of a channel.

    `mean` is that of their samples, `level` ½ ln of their variance over the usual one, shape (b,).
    """

    def __init__(
        self, column: FloatArray, least: float, starts: IntArray, size: int, busy: BoolArray
    ) -> None:
        self._column, self._least, self._starts, self.size, self._busy = column, least, starts, size, busy
        self.mean, variance = block_moments(column, starts, starts + size)
        log = 0.5 * np.log(np.maximum(variance, least))
        self._usual = _usual(log, busy)
        self.level = log - self._usual

    @property
    def roughness(self) -> FloatArray:
        """½ ln of half the mean square of the differences of samples over the usual one, shape (b,)."""
        change, scatter = block_moments(np.diff(self._column), self._starts, self._starts + self.size - 1)
        rough = 0.5 * np.log(np.maximum(0.5 * (change**2 + scatter), self._least))
        return np.asarray(rough - _usual(rough, self._busy))

    def without_furthest(self, chosen: IntArray) -> FloatArray:
        """Return the level of chosen blocks without the sample that is furthest from their median."""
        blocks = self._column[self._starts[chosen, None] + np.arange(self.size)]
        off = np.abs(blocks - np.median(blocks, axis=1)[:, None])
        blocks[np.arange(len(blocks)), np.argmax(off, axis=1)] = np.nan
        fewer = np.maximum(np.nanvar(blocks, axis=1, ddof=1), self._least)
        return np.asarray(0.5 * np.log(fewer) - self._usual[chosen])

    def worth(self, hits: IntArray, blocks: int) -> float:
        """Return which part of the variance, or of the white noise, of overlapping blocks is in some of them."""
        variance = float(np.sum(np.expm1(2.0 * self.level[hits])))
        beside = np.r_[
            max(hits[0] - BLOCKS_BESIDE, 0) : hits[0] - 1, hits[-1] + 2 : hits[-1] + 1 + BLOCKS_BESIDE
        ]
        beside = beside[beside < len(self.mean)]
        if not len(beside):
            return variance / blocks
        turned = 0.5 * self.size * float(np.sum(self.mean[hits] - np.mean(self.mean[beside])))
        usual = np.exp(2.0 * self._usual[hits[0]])
        return max(variance, turned**2 / (0.5 * self.size * float(usual))) / blocks


def _motions(
    hit: BoolArray, columns: Sequence[_Column], slow: FloatArray, blocks: int, rate: float
) -> BoolArray:
    """Return which of the blocks belong to motions that change the noise of the record: brief ones, or slow ones."""
    kept = np.zeros_like(hit)
    events, count = label(binary_dilation(hit, iterations=BLOCKS_BESIDE))
    for k in range(1, count + 1):
        hits = np.flatnonzero(hit & (events == k))
        brief = 0.5 * (hits[-1] - hits[0] + 1) * columns[0].size <= MAX_SECONDS * rate
        slower = float(np.median(slow[hits])) > MIN_SLOWER_GROWTH
        if (brief or slower) and max(one.worth(hits, blocks) for one in columns) >= MIN_WORTH:
            kept[hits] = True
    return kept


def _without_largest(levels: Sequence[FloatArray]) -> FloatArray:
    """Return the mean over channels, with the largest one counted as the second largest, shape (b,)."""
    ordered = np.sort(np.array(levels), axis=0)
    return np.asarray(ordered.mean(axis=0) - (ordered[-1] - ordered[-2]) / len(ordered))


def _usual(log: FloatArray, busy: BoolArray) -> FloatArray:
    """Return the median of the blocks at rest within about a minute of each block, shape (b,)."""
    place = np.flatnonzero(~busy)
    count = max(1, len(place) // USUAL_BLOCKS)
    parts = place[: len(place) // count * count].reshape(count, -1)
    return np.interp(np.arange(len(log)), parts.mean(axis=1), np.median(log[parts], axis=1))


def _any_in_block(mask: BoolArray, starts: IntArray, size: int) -> BoolArray:
    place = np.flatnonzero(mask)
    return np.asarray(place.searchsorted(starts + size) > place.searchsorted(starts))


def _grown(
    hit: BoolArray, busy: BoolArray, raised: BoolArray, starts: IntArray, size: int, record: Record
) -> BoolArray:
    """Return the samples of blocks that moved, of their neighbours, and of raised ones beside these or busy ones."""
    moved = np.zeros(len(record), dtype=bool)
    beside = binary_dilation(hit, iterations=2)
    grown = binary_dilation(beside | busy, iterations=0, mask=beside | busy | raised) & ~busy
    for start in starts[grown]:
        moved[start : start + size] = True
    for begin, end in record.segments:  # the last samples are no block of their own
        whole = begin + (end - begin) // size * size
        moved[whole:end] = moved[max(begin, whole - 1)]
    return moved
