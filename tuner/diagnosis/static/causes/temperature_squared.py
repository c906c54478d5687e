"""Temperature squared: a bias that follows the temperature on a curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import TemperatureSquared as Effect
from tuner.diagnosis.static.causes.temperature import COVARIATE, centred
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel


@dataclass(frozen=True)
class TemperatureSquared(Template):
    """Bias in proportion to the square of the temperature about its mean."""

    cause = "temperature_squared"
    effect = Effect
    meaning = "the bias follows the measured temperature on a curve, not on a line"
    consequence = (
        "a calibration to apply: subtract curvature × (T − T_mean)² before the filter, beside any slope"
    )
    excludes = ("hysteresis",)
    covariate = COVARIATE
    size = ("curvature", "{u}/K²")
    statistic = "likelihood ratio of the square of the temperature"
    view = "temperature"

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the square on the blocks about its mean, K², shape (M,)."""
        square = centred(channel) ** 2
        return np.asarray(square - square.mean())
