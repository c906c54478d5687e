"""Temperature rate: a bias that follows how fast the temperature changes, through gradients within the unit.

A thermometer that is late makes the same beside a temperature slope, with a factor slope × lag.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import TemperatureRate as Effect
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel


@dataclass(frozen=True)
class TemperatureRate(Template):
    """Bias in proportion to the rate of the temperature."""

    cause = "temperature_rate"
    effect = Effect
    meaning = (
        "the bias follows the rate at which the measured temperature changes, or the thermometer is late"
    )
    consequence = (
        "a calibration to apply: subtract slope × dT/dt before the filter, beside any slope by temperature"
    )
    excludes = ("thermal_lag",)
    covariate = COVARIATE
    size = ("slope", "{u}·s/K")
    statistic = "likelihood ratio of the rate of the temperature"
    view = "temperature"

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the rate on the blocks, K/s, shape (M,)."""
        return np.asarray(np.gradient(channel.covariates[COVARIATE], channel.block * channel.interval))
