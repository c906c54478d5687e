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
    """Bias in proportion to the temperature."""

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

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the temperature on the blocks about its mean, K, shape (M,)."""
        return centred(channel)


def centred(channel: Channel) -> NDArray[np.float64]:
    """Return the temperature on the blocks about its mean, K, shape (M,)."""
    celsius = channel.covariates[COVARIATE]
    return np.asarray(celsius - celsius.mean())
