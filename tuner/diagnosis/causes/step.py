"""Step: a bias that jumps once.

Statistic: likelihood ratio of a step at the best of all block boundaries, the noise refitted; Davies' bound over
the boundaries. Extension: a template; its time by the profile of the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.channel import Channel
from tuner.diagnosis.cosine import block_transform
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.residual import Residual
from tuner.diagnosis.scan import Scan, judge, scan_steps, step_column

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Step(Extension):
    """A step at a block boundary."""

    cause: ClassVar[str] = "step"
    repeats: ClassVar[int] = 4
    meaning: ClassVar[str] = (
        "the bias jumps once and stays; the noise alone would have to be called a random walk for it"
    )
    consequence: ClassVar[str] = (
        "keep the jump out of the random walk; a filter that meets such jumps needs its bias variance "
        "opened at that moment"
    )
    boundary: int

    def columns(self, channel: Channel) -> FloatArray:
        """Return the step on the blocks, shape (M, 1)."""
        return (np.arange(channel.blocks) >= self.boundary).astype(float)[:, None]

    def refined(self, size: Value, widening: float) -> Step:  # noqa: ARG002
        """Take the size from a joint fit."""
        return replace(self, values={**self.values, "size": replace(size, unit="{u}")})


def test(found: Residual) -> Alarm:
    """Search for a jump of the slow track."""
    scores = scan_steps(found)
    name = "likelihood ratio of a step"
    if not scores.promising:
        return Alarm("step", 1.0, -9.0, float(scores.score[scores.best] ** 2), name)
    boundary = scores.best + 1
    template = block_transform(step_column(found, boundary)[:, None], found.channel, found.track.singles)
    result = judge(found, template[:, 0], scores.correlation, price=float(np.log(found.channel.blocks / 8.0)))
    return Alarm(
        "step", result.p_value, result.gain, result.ratio, name, lambda: (extension(found, scores, boundary),)
    )


def extension(found: Residual, scores: Scan, boundary: int) -> Step:
    """Return the step with its time."""
    square = scores.score**2
    likely = np.flatnonzero(square > square[boundary - 1] - 5.0) + 1
    length = found.channel.block * found.channel.interval
    start = found.channel.start
    time = Value(
        start + boundary * length,
        start + (float(likely.min()) - 1.0) * length,
        start + (float(likely.max()) + 1.0) * length,
        "s",
    )
    return Step(boundary, values={"time": time})


def near(found: Residual, boundary: int, reach: int) -> Step:
    """Return the best step within `reach` blocks of a boundary."""
    scores = scan_steps(found)
    first = max(1, boundary - reach)
    window = np.abs(scores.score[first - 1 : boundary + reach])
    return extension(found, scores, first + int(np.argmax(window)))
