"""Hysteresis: a bias that follows the temperature only after it has turned back by some kelvin.

Template: the temperature behind a play, of a few widths in shares of its range. Where the temperature hardly turns back
that is the temperature itself, and nothing can tell them apart: then it is not tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.thermal import Hysteresis as Effect
from models.effects.static.thermal import behind_play
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.temperature import COVARIATE
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel

WIDTHS = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Widths of the play that are tried, in ranges of the temperature: factors of two, half of which is its error."""
MIN_TURN = 0.5
"""Least way back of the temperature in a record, in shares of its range, for a loop to show."""


@dataclass(frozen=True)
class Hysteresis(Template):
    """Bias in proportion to the temperature behind a play of `width`, K."""

    cause = "hysteresis"
    effect = Effect
    meaning = "the bias follows the measured temperature only after that has turned back by some kelvin"
    consequence = (
        "no function of the temperature takes it out: calibrate up and down, or carry it in the bias state"
    )
    excludes = ("thermal_lag", "temperature_squared")
    covariate = COVARIATE
    size = ("slope", "{u}/K")
    statistic = "likelihood ratio of a temperature behind a play"
    price = float(np.log(len(WIDTHS)))
    view = "temperature"
    width: float

    def template(self, channel: Channel) -> FloatArray:
        """Return the temperature behind the play on the blocks about its mean, K, shape (M,)."""
        out = behind_play(channel.covariates[COVARIATE], self.width)
        return np.asarray(out - out.mean())

    @classmethod
    def candidates(cls, channel: Channel) -> Sequence[Self]:
        """Return one extension a width."""
        span = float(np.ptp(channel.covariates[COVARIATE]))
        return [
            cls(share * span, values={"width": Value.log(share * span, 0.5 * float(np.log(2.0)), "K")})
            for share in WIDTHS
        ]

    @classmethod
    def applies(cls, channel: Channel) -> bool:
        """Return whether the temperature turns back far enough."""
        if COVARIATE not in channel.covariates:
            return False
        celsius = channel.covariates[COVARIATE]
        risen = float((celsius - np.minimum.accumulate(celsius)).max())
        fallen = float((np.maximum.accumulate(celsius) - celsius).max())
        return min(risen, fallen) > MIN_TURN * float(np.ptp(celsius))

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Self:  # noqa: ARG002
        """Take the factor from the joint fit."""
        return replace(self, values={**self.values, "slope": replace(size, unit="{u}/K")})
