"""Temperature: a bias in proportion to the measured temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import TemperatureSlope
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.profile_likelihood import MIN_LOG_CHANGE, best_constant

COVARIATE = "temperature"
"""Name of the covariate that is the temperature of the sensor."""
TRIED_CONSTANTS = 40
"""Time constants by which the temperature may warm: a seventh apart, a hundredth of the warming's own size."""
MAX_REST_RATIO = 1.1
"""Rms distance of readings from an exponential ÷ the least one up to which it is as likely.

Errors that stay for minutes leave few independent readings, some ten in a record: their rms is known to no tenth.
"""
MIN_WARMING = 2.0
"""Rms of the exponential about a line ÷ that distance from which the temperature warms by it at all.

It then has 80 % of the power of what is no ramp in the readings, as of a box that warms by 7 K, read with errors of
0.4 K for minutes. A chamber that warms and cools is nearer to a parabola, the longest of the exponentials.
"""


@dataclass(frozen=True)
class Temperature(Template):
    """Bias in proportion to the temperature.

    `time_constant` is that of the exponential which the temperature follows but for errors of its readings, s; 0 where
    the readings themselves are meant.
    """

    cause = "temperature"
    effect = TemperatureSlope
    meaning = "the bias follows the measured temperature"
    consequence = (
        "a calibration to apply: subtract slope × (T − T₀) before the filter; the bias drive shrinks"
    )
    excludes = ("thermal_lag",)
    supersedes = ("telegraph",)
    covariate = COVARIATE
    size = ("slope", "{u}/K")
    statistic = "likelihood ratio of the temperature"
    view = "temperature"
    time_constant: float = 0.0

    @classmethod
    def candidates_in_pairs(cls, channel: Channel) -> Sequence[Self]:
        """Return the temperature itself."""
        return cls.candidates(channel)

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the temperature on the blocks about its mean, K, shape (M,)."""
        if self.time_constant:
            return warming(channel, self.time_constant)[0]
        return centred(channel)

    def refit(self, fitted: FittedChannel, index: int) -> Self:
        """Fit the time constant of the warming again; keep it if the readings follow the new one less closely."""
        if not self.time_constant:
            return self
        channel = fitted.channel
        constant = best_constant(
            fitted, index, lambda x: Temperature(time_constant=x).columns(channel), self.time_constant
        )
        apart = warming(channel, constant)[2] / warming(channel, self.time_constant)[2]
        moved = abs(np.log(constant / self.time_constant)) >= MIN_LOG_CHANGE
        return replace(self, time_constant=constant) if moved and apart <= MAX_REST_RATIO else self


def warming_alike(channel: Channel) -> list[Temperature]:
    """Return the temperature as each exponential that its readings follow as closely as the best one; none for none."""
    constants = Warmup.time_constants(channel)
    tried = np.geomspace(constants[0], 3.0 * constants[-1], TRIED_CONSTANTS)
    rests = np.array([warming(channel, constant)[2] for constant in tried.tolist()])
    best = int(np.argmin(rests))
    if best == len(tried) - 1 or warming(channel, float(tried[best]))[1] < MIN_WARMING * rests[best]:
        return []
    likely = tried[rests <= MAX_REST_RATIO * rests.min()]
    return [Temperature(time_constant=constant) for constant in likely.tolist()]


def warming(channel: Channel, time_constant: float) -> tuple[NDArray[np.float64], float, float]:
    """Return how the temperature warms by an exponential and a ramp: K about its mean, shape (M,), and two rms, K.

    The first is that of the exponential about the line that is nearest to it, which no ramp stands for, the second that
    of the readings about the course.
    """
    time, read = channel.block_time, centred(channel)
    basis = np.stack((np.ones_like(time), time / channel.span, np.exp(-time / time_constant)), axis=1)
    share = np.linalg.lstsq(basis, read)[0]
    course = basis @ share
    bend = course - basis[:, :2] @ np.linalg.lstsq(basis[:, :2], course)[0]
    return course - course.mean(), float(np.std(bend)), float(np.sqrt(np.mean((read - course) ** 2)))


def centred(channel: Channel) -> NDArray[np.float64]:
    """Return the temperature on the blocks about its mean, K, shape (M,)."""
    celsius = channel.covariates[COVARIATE]
    return np.asarray(celsius - celsius.mean())
