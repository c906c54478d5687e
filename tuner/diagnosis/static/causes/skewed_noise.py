"""Skewed noise: residuals of a gamma law in place of the normal one, longer on one side than on the other.

Statistic: mean of the third Hermite polynomial e³ − 3e of the residuals, cut at five deviations, over its own
deviation. Gain: half its square, what the likelihood of a slightly skew law gains.
Extension: the residuals pass Wilson and Hilferty's cube root, which makes gamma deviates normal::

    z = 6/γ ((1 + γ e/2)^⅓ − 1 + γ²/36)

What is reported is the skewness of the white noise itself: the whitening filter mixes samples
(`tuner.diagnosis.static.variance.white_share`).

References
----------
.. [1] E. B. Wilson, M. M. Hilferty, The distribution of chi-square, PNAS 17 (1931).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.effects.static.distribution import SkewedNoise as Effect
from models.probability import normal_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.model.series_statistics import moment
from tuner.diagnosis.static.outcome import TestResult
from tuner.diagnosis.static.variance.local_variance import local_variance
from tuner.diagnosis.static.variance.white_share import dilution

FloatArray = NDArray[np.float64]

MIN_PLACE = 1e-3
"""Least of 1 + γ e/2, the sample on the scale of the gamma law: what lies beyond its end is put there."""
MAX_SKEWNESS = 1.5
"""Largest skewness that is taken out: beyond, the cube root is no normal deviate any more."""


@dataclass(frozen=True)
class SkewedNoise(Extension):
    """A gamma law of this skewness, variance 1."""

    cause = "skewed_noise"
    effect = Effect
    group = "distribution"
    needs_fine_quantizer = True
    only_if_clearest = True
    view = "histogram"
    meaning = "large deviations to one side are more frequent than to the other"
    consequence = (
        "mean and variance are right; a gate or a robust update that is even on both sides shifts the bias"
    )
    skewness: float

    def whiten(self, e: FloatArray) -> FloatArray:
        """Map the gamma law to the normal one."""
        root = np.cbrt(self._place(e))
        return np.asarray(6.0 / self.skewness * (root - 1.0 + self.skewness**2 / 36.0))

    def log_slope(self, e: FloatArray) -> FloatArray:
        """Return the log of the derivative of that map."""
        return np.asarray(-2.0 / 3.0 * np.log(self._place(e)))

    def _place(self, e: FloatArray) -> FloatArray:
        return np.maximum(1.0 + 0.5 * self.skewness * e, MIN_PLACE)

    @classmethod
    def test(cls, fitted: Residual) -> TestResult | None:
        """Compare the third moment of the residuals with that of an even law; None where codes or rails make one."""
        channel = fitted.channel
        if channel.clipped or channel.missing_codes or local_variance(fitted).rounded:
            return None
        e = fitted.good_clipped
        seen = moment(e, 3) - 3.0 * moment(e, 1)  # of e³ − 3 e, and of its square below
        square = moment(e, 6) - 6.0 * moment(e, 4) + 9.0 * moment(e, 2)
        error = float(np.sqrt(max(square - seen**2, 0.0) / len(e)))
        deviate = seen / error
        gain = 0.5 * deviate**2 - 0.5 * float(np.log(len(e)))
        third = dilution(fitted).third
        size = Value.of(seen / third, error / third)
        shape = cls(float(np.clip(seen, -MAX_SKEWNESS, MAX_SKEWNESS)), values={"skewness": size})
        return TestResult(
            cls.cause,
            2.0 * normal_beyond(abs(deviate)),
            gain,
            seen,
            "skewness of the residuals",
            lambda: (shape,),
        )
