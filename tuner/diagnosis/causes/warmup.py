"""Warm-up: an exponential transient after power-on.

Statistic: likelihood ratio of the best time constant of a grid, the noise refitted; Davies' bound over the grid.
Extension: a template; amplitude and time constant from a joint linearised fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.channel import Channel
from tuner.diagnosis.cosine import block_transform
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.residual import Residual
from tuner.diagnosis.scan import judge, project, rest, scan, weights

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Warmup(Extension):
    """exp(−t/time_constant), t from the first sample; `slope` is its derivative by the time constant."""

    cause: ClassVar[str] = "warmup"
    meaning: ClassVar[str] = "the bias decays exponentially after power-on"
    consequence: ClassVar[str] = (
        "wait five time constants before use, or carry the transient as a decaying bias state"
    )
    time_constant: float

    def columns(self, channel: Channel) -> FloatArray:
        """Return the transient on the blocks, shape (M, 1)."""
        return transient(channel, self.time_constant)[:, None]

    def refined(self, size: Value, widening: float) -> Warmup:
        """Take the amplitude from a joint fit; its interval keeps the share of the time constant."""
        amplitude = replace(size, unit="{u}").joined(self.values["amplitude"])
        constant = self.values["time_constant"].widened(widening)
        return replace(self, values={"time_constant": constant, "amplitude": amplitude})


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
    channel, singles = found.channel, found.track.singles
    target = rest(found) * np.sqrt(weights(found))

    def loss(log_constant: float) -> float:
        template = block_transform(transient(channel, np.exp(log_constant))[:, None], channel, singles)
        return -float((project(found, template)[0][:, 0] @ target) ** 2)

    best = minimize_scalar(loss, bounds=(np.log(near / 2.0), np.log(near * 2.0)), method="bounded")
    constant = float(np.exp(best.x))
    shape = transient(channel, constant)
    slope = shape * channel.block_time / constant
    white, norm = project(found, block_transform(np.stack((shape, slope), axis=1), channel, singles))
    design = white * norm
    covariance = np.linalg.pinv(design.T @ design, hermitian=True)
    amplitude = float((covariance @ (design.T @ target))[0])
    size = amplitude if amplitude else 1e-12
    relative = float(np.sqrt(covariance[1, 1])) / abs(size)
    return Warmup(
        constant,
        values={
            "time_constant": Value.log(constant, relative, "s"),
            "amplitude": Value.of(amplitude, float(np.sqrt(covariance[0, 0])), "{u}"),
        },
    )
