"""Where a jump of the level lies to the sample, and what of it is too fast for the coefficients of the slow track."""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import EDGE_NATS, SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.score_scan import Scan

CLEAR_BLOCKS = 16
"""Blocks within which a jump must lie for its place to be estimated to the sample.

Chosen so that slow noise hardly moves within them.
"""


def likely_time(fitted: FittedChannel, scores: Scan, boundary: int) -> Value:
    """Return the time of a jump at a block boundary, with those that score nearly as well, s."""
    square, channel = scores.score**2, fitted.channel
    likely = np.flatnonzero(square > square[boundary - 1] - 2.0 * EDGE_NATS / SLOW_RATIO_FACTOR) + 1
    first, last = float(likely.min()) - 1.0, float(likely.max()) + 1.0
    return Value.moment(channel, *(channel.block * place for place in (boundary, first, last)))


def above_slow_track(channel: Channel, signal: FloatArray) -> FloatArray:
    """Return the part of a signal, shape (n,), above the coefficients of the slow track."""
    a = transform(signal, 1.0)
    a[: channel.blocks // 2 + 1] = 0.0
    return inverse(a, 1.0)


def placed(channel: Channel, begin: int, end: int, size: float, noise: float) -> tuple[int, Value]:
    """Return the first sample, in begin … end, and the time of the jump of this size, in scales, that fits best.

    Its level is free, its noise white of this variance; it may lie where that costs `EDGE_NATS` nats at most.
    """
    flank = CLEAR_BLOCKS // 2 * channel.block
    left, right = max(0, begin - flank), min(len(channel), end + flank)
    y = channel.y[left:right]
    after = np.arange(len(y), 0, -1.0)
    above = np.cumsum(y[::-1])[::-1]
    square = -2.0 * size * above + size**2 * after - (y.sum() - size * after) ** 2 / len(y)
    tried = slice(max(1, begin - left), max(2, end - left + 1))
    cost = 0.5 * square[tried] / noise
    near = np.flatnonzero(cost < cost.min() + EDGE_NATS)
    first, low, high = (left + tried.start + int(i) for i in (np.argmin(cost), near[0], near[-1]))
    return first, Value.moment(channel, first, low - 1, high + 1)
