"""Temperature: a bias in proportion to the measured temperature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import TemperatureSlope
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel

COVARIATE = "temperature"
"""Name of the covariate that is the temperature of the sensor."""


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
    different_in_pairs = 1.0
    view = "temperature"
    time_constant: float = 0.0

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the temperature on the blocks about its mean, K, shape (M,)."""
        if self.time_constant:
            return warming(channel, self.time_constant)[0]
        return centred(channel)


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
