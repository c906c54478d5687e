"""Temperature squared: a bias that follows the temperature on a curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import TemperatureSquared as Effect
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel


@dataclass(frozen=True)
class TemperatureSquared(Template):
    """Bias in proportion to the square of the temperature about one, `about`, °C: without it, the mean of a record.

    About another mean it would have another slope: what was found in one part of a record keeps its own in the rest.
    """

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
    about: float | None = None

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the square on the blocks about its mean, K², shape (M,)."""
        celsius = channel.covariates[COVARIATE]
        square = (celsius - (celsius.mean() if self.about is None else self.about)) ** 2
        return np.asarray(square - square.mean())

    def likeliest(self, fitted: FittedChannel) -> Self:
        """Return the square about the mean of this record."""
        return replace(self, about=float(fitted.channel.covariates[COVARIATE].mean()))
