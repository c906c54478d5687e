"""Skewed noise: residuals of a gamma law in place of the normal one, longer on one side than on the other.

Statistic: mean of the third Hermite polynomial e³ − 3e of the residuals, cut at five deviations, over its own
deviation. Gain: half its square, what the likelihood of a slightly skew law gains.
Extension: the residuals pass Wilson and Hilferty's cube root, which makes gamma deviates normal::

    z = 6/γ ((1 + γ e/2)^⅓ − 1 + γ²/36)

Where the law is far from that, in one half of the record as in the other, and how its two sides differ is no small
part of it, they pass the quantiles of their own law (`tuner.diagnosis.static.variance.normal_scores`), tails and all:
one law is one cause.

What is reported is the skewness of the white noise itself: the whitening filter mixes samples
(`tuner.diagnosis.static.variance.white_share`).

References
----------
.. [1] E. B. Wilson, M. M. Hilferty, The distribution of chi-square, PNAS 17 (1931).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.effects.static.distribution import SkewedNoise as Effect
from models.probability import normal_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.series_statistics import moment
from tuner.diagnosis.static.outcome import WORTH_A_FIT, TestResult
from tuner.diagnosis.static.variance.local_variance import local_variance
from tuner.diagnosis.static.variance.normal_scores import NormalScores
from tuner.diagnosis.static.variance.white_share import dilution

MIN_PLACE = 1e-3
"""Least of 1 + γ e/2, the sample on the scale of the gamma law: what lies beyond its end is put there."""
MIN_SKEWED_SHARE = 0.25
"""Share of the gain of their own law that its two sides must differ by: less, and it is one of heavy tails first.

Gamma and lognormal laws of skewness 5 have 0.3 and 0.5, Student's law of four degrees of freedom 0.15 where one side
is a fifth narrower than the other.
"""
SAME_SCALE = 0.01
"""Logarithm of a ratio of scales within which a law is the same."""
MAX_SKEWNESS = 1.5
"""Largest skewness that is taken out: beyond, the cube root is no normal deviate any more."""


@dataclass(frozen=True)
class SkewedNoise(Extension):
    """A gamma law of this skewness, variance 1; or the law of the residuals themselves, `scores`."""

    cause = "skewed_noise"
    effect = Effect
    group = "distribution"
    needs_fine_quantizer = True
    view = "histogram"
    meaning = "large deviations to one side are more frequent than to the other"
    consequence = (
        "mean and variance are right; a gate or a robust update that is even on both sides shifts the bias"
    )
    skewness: float
    scores: NormalScores | None = None

    def whiten(self, e: FloatArray) -> FloatArray:
        """Map the law to the normal one, edges of the law at random."""
        return self.deviates(e) if self.scores is None else self.scores.shuffled(e)

    def deviates(self, e: FloatArray) -> FloatArray:
        """Return the map of which `log_slope` is the slope."""
        if self.scores is not None:
            return self.scores(e)
        root = np.cbrt(self._place(e))
        return np.asarray(6.0 / self.skewness * (root - 1.0 + self.skewness**2 / 36.0))

    def log_slope(self, e: FloatArray) -> FloatArray:
        """Return the log of the derivative of that map."""
        if self.scores is not None:
            return self.scores.log_slope(e)
        return np.asarray(-2.0 / 3.0 * np.log(self._place(e)))

    def _place(self, e: FloatArray) -> FloatArray:
        return np.maximum(1.0 + 0.5 * self.skewness * e, MIN_PLACE)

    def refit(self, fitted: FittedChannel, index: int) -> SkewedNoise:
        """Return the law of what is left where other causes, spikes above all, have changed its scale."""
        if self.scores is None or abs(np.log(fitted.spread)) < SAME_SCALE:
            return self
        e = fitted.whitened()
        for before in fitted.extensions[:index]:
            e = before.whiten(e)
        e = e[fitted.valid]
        scores = NormalScores.of(_between_codes(fitted, e))
        return replace(self, scores=scores, values=_values(fitted, *skewness(e)))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:
        """Compare the third moment of the residuals with that of an even law; None where codes or rails make one."""
        channel = fitted.channel
        if channel.clipped or channel.missing_codes or local_variance(fitted).rounded:
            return None
        e = fitted.good_clipped
        seen = moment(e, 3) - 3.0 * moment(e, 1)  # of e³ − 3 e, and of its square below
        square = moment(e, 6) - 6.0 * moment(e, 4) + 9.0 * moment(e, 2)
        error = float(np.sqrt(max(square - seen**2, 0.0) / len(e)))
        deviate = seen / error
        p_value = 2.0 * normal_beyond(abs(deviate))
        gain = 0.5 * deviate**2 - 0.5 * float(np.log(len(e)))
        scores = None
        if p_value < WORTH_A_FIT:
            unscaled = _between_codes(fitted, fitted.spread * fitted.good)
            own = NormalScores.of(unscaled)
            known, new = np.array_split(unscaled, 2)
            law = 2.0 * NormalScores.of(known).gain(new)
            tails = 2.0 * NormalScores.of(np.concatenate((known, -known))).gain(new)
            price = 0.5 * len(own.value) * float(np.log(len(e)))
            if law - tails > MIN_SKEWED_SHARE * law and law - price > gain:
                scores, gain = own, law - price
                seen, error = skewness(fitted.good)
        bent = float(np.clip(seen, -MAX_SKEWNESS, MAX_SKEWNESS))
        shape = cls(bent, scores, values=_values(fitted, seen, error))
        return TestResult(
            cls.cause,
            p_value,
            gain,
            seen,
            "skewness of the residuals",
            lambda: (shape,),
        )


def _between_codes(fitted: FittedChannel, e: FloatArray) -> FloatArray:
    """Return residuals whose samples are spread over the step of their codes, which are no part of the law."""
    step = fitted.channel.quantizer_step / np.sqrt(fitted.expected_power.fast / fitted.channel.interval)
    return np.asarray(e + step * (np.random.default_rng(len(e)).random(len(e)) - 0.5)) if step else e


def _values(fitted: FittedChannel, seen: float, error: float) -> dict[str, Value]:
    """Return the skewness of the white noise for that of the residuals and its standard error."""
    third = dilution(fitted).third
    return {"skewness": Value.of(seen / third, error / third)}


def skewness(e: FloatArray) -> tuple[float, float]:
    """Return the third central moment ÷ sd³ of residuals, all of them, and its standard error."""
    x = (e - e.mean()) / float(np.std(e))
    third = float(np.mean(x**3))
    influence = x**3 - third - 3.0 * x - 1.5 * third * (x**2 - 1.0)
    return third, float(np.sqrt(np.mean(influence**2) / len(e)))
