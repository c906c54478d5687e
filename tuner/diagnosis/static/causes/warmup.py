"""Warm-up: an exponential transient after power-on.

Statistic: likelihood ratio of the best time constant of a grid, the noise refitted; Davies' bound over the grid.
Extension: a template; its time constant by the profile of the likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.profile_likelihood import SAME, Template, best_constant, profile
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.model.score_scan import judge, likeliest, scan
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Warmup(Extension):
    """exp(−t/time_constant), t from the first sample."""

    cause: ClassVar[str] = "warmup"
    meaning: ClassVar[str] = "the bias decays exponentially after power-on"
    consequence: ClassVar[str] = (
        "wait five time constants before use, or carry the transient as a decaying bias state"
    )
    time_constant: float

    def columns(self, channel: Channel) -> FloatArray:
        """Return the transient on the blocks, shape (M, 1)."""
        return transient(channel, self.time_constant)[:, None]

    def polished(self, found: Residual, index: int) -> Warmup:
        """Fit the time constant again, with the noise that is left beside the transient."""
        constant = best_constant(found, index, self._template(found.channel), self.time_constant)
        close = abs(np.log(constant / self.time_constant)) < SAME
        return self if close else replace(self, time_constant=constant)

    def refined(self, found: Residual, index: int, size: Value) -> Warmup:
        """Take amplitude and time constant from the joint fit."""
        reach = profile(found, index, self._template(found.channel), self.time_constant, size)
        values = {"time_constant": reach.constant, "amplitude": replace(size, unit="{u}").owing(reach.drift)}
        return replace(self, values=values)

    def _template(self, channel: Channel) -> Template:
        return lambda constant: replace(self, time_constant=constant).columns(channel)


def transient(channel: Channel, time_constant: float) -> FloatArray:
    """Return exp(−t/time_constant) on the blocks, shape (M,)."""
    return np.asarray(np.exp(-channel.block_time / time_constant))


def constants(channel: Channel) -> FloatArray:
    """Return the grid of time constants, s."""
    shortest = max(8.0 * channel.block * channel.interval, channel.span / 300.0)
    return np.geomspace(shortest, channel.span / 3.0, 14)


def test(found: Residual) -> Alarm:
    """Search for an exponential transient."""
    channel = found.channel
    grid = constants(channel)
    scores, templates = scan(found, np.stack([transient(channel, t) for t in grid], axis=1))
    name = "likelihood ratio of an exponential transient"
    if not scores.promising:
        return Alarm("warmup", 1.0, -9.0, float(scores.score[scores.best] ** 2), name)
    result = judge(found, templates[:, scores.best], scores.correlation, price=float(np.log(5.0)))
    near = float(grid[scores.best])
    return Alarm("warmup", result.p_value, result.gain, result.ratio, name, lambda: (extension(found, near),))


def extension(found: Residual, near: float) -> Warmup:
    """Return the transient next to a time constant, s."""
    return Warmup(likeliest(found, lambda constant: transient(found.channel, constant), near))
