"""Temperature: a bias in proportion to the measured temperature.

Statistic: likelihood ratio of the block means of the temperature, the noise refitted; χ²₁.
Extension: a template; slope by the joint fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.model.score_scan import judge, scan
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

COVARIATE = "temperature"


@dataclass(frozen=True)
class Temperature(Extension):
    """Bias in proportion to the temperature."""

    cause: ClassVar[str] = "temperature"
    meaning: ClassVar[str] = "the bias follows the measured temperature"
    consequence: ClassVar[str] = (
        "a calibration to apply: subtract slope × (T − T₀) before the filter; the bias drive shrinks"
    )

    def columns(self, channel: Channel) -> FloatArray:
        """Return the temperature on the blocks, shape (M, 1), K about its mean."""
        return centred(channel)[:, None]

    def refined(self, found: Residual, index: int, size: Value) -> Temperature:  # noqa: ARG002
        """Take the slope from a joint fit."""
        return replace(self, values={**self.values, "slope": replace(size, unit="{u}/K")})


def centred(channel: Channel) -> FloatArray:
    """Return the temperature on the blocks about its mean, K, shape (M,)."""
    celsius = channel.covariates[COVARIATE]
    return np.asarray(celsius - celsius.mean())


def test(found: Residual) -> Alarm | None:
    """Test the temperature as a template; None where it was not measured."""
    if COVARIATE not in found.channel.covariates:
        return None
    scores, templates = scan(found, centred(found.channel)[:, None])
    name = "likelihood ratio of the temperature"
    if not scores.promising:
        return Alarm("temperature", 1.0, -9.0, float(scores.score[0] ** 2), name)
    result = judge(found, templates[:, 0], np.empty(0), price=0.0)
    return Alarm("temperature", result.p_value, result.gain, result.ratio, name, lambda: (Temperature(),))
