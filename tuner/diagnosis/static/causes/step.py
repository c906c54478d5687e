"""Step: a bias that jumps once.

Statistic: likelihood ratio of a step at the best of all block boundaries, the noise refitted; Davies' bound over
the boundaries. Extension: a template; its time by the profile of the likelihood, to the sample where the step is clear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform, inverse, transform
from tuner.diagnosis.static.model.null_distributions import EDGE, SHRINK
from tuner.diagnosis.static.model.profile_likelihood import SAME, first_column
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.model.score_scan import Scan, judge, scan_steps, step_column
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

CLEAR = 16
"""Blocks within which a step must lie for its place to be sought to the sample."""


@dataclass(frozen=True)
class Step(Extension):
    """A step before sample `first`.

    On the blocks it is a template, the block it falls into part of the way. Where its size is known, `jump` in scales,
    its fast part is taken out of the samples.
    """

    cause: ClassVar[str] = "step"
    repeats: ClassVar[int] = 4
    meaning: ClassVar[str] = (
        "the bias jumps once and stays; the noise alone would have to be called a random walk for it"
    )
    consequence: ClassVar[str] = (
        "keep the jump out of the random walk; a filter that meets such jumps needs its bias variance "
        "opened at that moment"
    )
    first: int
    jump: float = 0.0

    def repair(self, channel: Channel) -> Channel:
        """Take out what the slow track does not show of the step."""
        return replace(channel, y=channel.y - self._course(channel)) if self.jump else channel

    def columns(self, channel: Channel) -> FloatArray:
        """Return the step on the blocks, shape (M, 1)."""
        share = np.arange(1, channel.blocks + 1) - self.first / channel.block
        return np.asarray(np.clip(share, 0.0, 1.0)[:, None])

    def polished(self, found: Residual, index: int) -> Step:
        """Place the step to the sample, with the size it has there."""
        size = float(found.fit.beta[first_column(found, index)])
        if self.jump != 0.0 and abs(size - self.jump) < SAME * abs(size):
            return self
        channel = found.channel
        begin, end = (
            round((t - channel.start) / channel.interval)
            for t in (self.values["time"].lower, self.values["time"].upper)
        )
        if end - begin > CLEAR * channel.block:
            return replace(self, jump=size)
        whole = replace(found.repaired, y=found.repaired.y + self._course(channel))
        noise = float(found.power_at(1.0 / (CLEAR * channel.block * channel.interval))) / channel.interval
        return _placed(whole, begin, end, size, max(noise, 1.0))

    def _course(self, channel: Channel) -> FloatArray:
        """Return the part of the step above the coefficients of the slow track, shape (n,)."""
        if self.jump == 0.0:
            return np.zeros(len(channel))
        a = transform(np.where(np.arange(len(channel)) >= self.first, self.jump, 0.0), 1.0)
        a[: channel.blocks // 2 + 1] = 0.0
        return inverse(a, 1.0)

    def refined(self, found: Residual, index: int, size: Value) -> Step:  # noqa: ARG002
        """Take the size from the joint fit."""
        return replace(self, values={**self.values, "size": replace(size, unit="{u}")})


def test(found: Residual) -> Alarm:
    """Search for a jump of the slow track."""
    scores = scan_steps(found)
    name = "likelihood ratio of a step"
    if not scores.promising:
        return Alarm("step", 1.0, -9.0, float(scores.score[scores.best] ** 2), name)
    boundary = scores.best + 1
    template = block_transform(step_column(found, boundary)[:, None], found.repaired, found.track.singles)
    result = judge(found, template[:, 0], scores.correlation, price=float(np.log(found.channel.blocks / 8.0)))
    return Alarm(
        "step", result.p_value, result.gain, result.ratio, name, lambda: (extension(found, scores, boundary),)
    )


def extension(found: Residual, scores: Scan, boundary: int) -> Step:
    """Return the step with its time."""
    square = scores.score**2
    likely = np.flatnonzero(square > square[boundary - 1] - 2.0 * EDGE / SHRINK) + 1
    length = found.channel.block * found.channel.interval
    start = found.channel.start
    time = Value(
        start + boundary * length,
        start + (float(likely.min()) - 1.0) * length,
        start + (float(likely.max()) + 1.0) * length,
        "s",
    )
    return Step(boundary * found.channel.block, values={"time": time})


def _placed(channel: Channel, begin: int, end: int, size: float, noise: float) -> Step:
    """Return the step of this size, in scales, whose samples fit best, its first one in begin … end.

    Its level is free, its noise white of this variance; the first sample may lie where that costs `EDGE` nats at most.
    """
    flank = CLEAR // 2 * channel.block
    left, right = max(0, begin - flank), min(len(channel), end + flank)
    y = channel.y[left:right]
    after = np.arange(len(y), 0, -1.0)
    above = np.cumsum(y[::-1])[::-1]
    square = -2.0 * size * above + size**2 * after - (y.sum() - size * after) ** 2 / len(y)
    tried = slice(max(1, begin - left), max(2, end - left + 1))
    cost = 0.5 * square[tried] / noise
    near = np.flatnonzero(cost < cost.min() + EDGE)
    first, low, high = (left + tried.start + int(i) for i in (np.argmin(cost), near[0], near[-1]))
    dt, start = channel.interval, channel.start
    time = Value(start + first * dt, start + (low - 1) * dt, start + (high + 1) * dt, "s")
    return Step(first, size, values={"time": time})


def near(found: Residual, boundary: int, reach: int) -> Step:
    """Return the best step within `reach` blocks of a boundary."""
    scores = scan_steps(found)
    first = max(1, boundary - reach)
    window = np.abs(scores.score[first - 1 : boundary + reach])
    return extension(found, scores, first + int(np.argmax(window)))
