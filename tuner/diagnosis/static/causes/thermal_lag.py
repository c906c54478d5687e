"""Thermal lag: a bias in proportion to a temperature that follows the measured one with a first-order lag.

Statistic: likelihood ratio of the best lag of a grid, the noise refitted; Davies' bound over the grid.
Extension: a template; its lag by the profile of the likelihood. The lagging temperature starts at the measured
one. Where the sensor was not at rest before the record that is wrong by slope · (L(0) − T(0)) exp(−t/τ): a further,
free template. So is T − L: part of the bias may follow at once, by `prompt_slope`, and the rest late (a heated sensor
has parts that follow their own ways); `slope` is that of slow changes either way. Each is included where its likelihood
ratio is significant at 0.1 % (χ²₁).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.thermal import ThermalLag as Effect
from tuner.diagnosis.cause import Cause
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.temperature import COVARIATE, centred
from tuner.diagnosis.static.causes.template import TimeConstantTemplate
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.profile_likelihood import MIN_LOG_CHANGE, best_constant, first_column
from tuner.diagnosis.static.model.score_scan import scan

MAX_LAG_RATIO = 100.0
"""Ratio of the ends of the interval of a lag up to which the lag is estimable: a factor of ten either way.

Beyond, the interval reaches from well within the record to far outside of it, and slope and lag are not separable.
"""
MIN_LIKELIHOOD_RATIO = 10.8
"""Likelihood ratio from which a further template is taken: χ²₁ at 0.1 %."""


class Thermal(Cause):
    """A bias that goes with the temperature with a dynamic that the record does not determine."""

    cause = "thermal"
    group = "slow part"
    shares = 0
    meaning = (
        "the bias follows the measured temperature with a lag, or the rate at which it changes: "
        "the record does not determine which"
    )
    consequence = (
        "no calibration follows from this record: take one in which the temperature also rests, or changes at other "
        "rates; until then the bias has to be carried by the filter"
    )


@dataclass(frozen=True)
class ThermalLag(TimeConstantTemplate):
    """Bias in proportion to the lagging temperature L.

    `settling`: L may start anywhere. `prompt`: another slope for what is faster than the lag.
    """

    cause = "thermal_lag"
    effect = Effect
    meaning = "the bias follows the measured temperature late: a loop of bias over temperature"
    consequence = (
        "a calibration to apply to the low-passed temperature, slope × (L − T₀) with dL/dt = (T − L)/τ, and where a "
        "prompt slope is given, that × (T − L)"
    )
    excludes = ("temperature",)
    supersedes = ("telegraph",)
    covariate = COVARIATE
    size = ("slope", "{u}/K")
    statistic = "likelihood ratio of a lagging temperature"
    price = float(np.log(8.0))
    view = "temperature"
    defining = MappingProxyType({"time_constant": MAX_LAG_RATIO})
    family = Thermal
    settling: bool = False
    prompt: bool = False

    def template(self, channel: Channel) -> FloatArray:
        """Return the lagging temperature on the blocks about its mean, K, shape (M,)."""
        lag = Effect(1.0, self.time_constant)
        out = lag.lagged(channel.covariates[COVARIATE], channel.block * channel.interval)
        return np.asarray(out - out.mean())

    def late(self, channel: Channel) -> FloatArray:
        """Return what the lagging temperature lags by on the blocks, K, shape (M,)."""
        return centred(channel) - self.template(channel)

    @classmethod
    def time_constants(cls, channel: Channel) -> FloatArray:
        """Return the grid of lags, s."""
        shortest = max(30.0, 4.0 * channel.block * channel.interval)
        return np.geomspace(shortest, max(channel.span, 2.0 * shortest), 12)

    @classmethod
    def candidates_in_pairs(cls, channel: Channel) -> Sequence[Self]:
        """Return three of the candidates: the others differ little from these, or from the temperature itself."""
        return cls.candidates(channel)[2:7:2]

    def columns(self, channel: Channel) -> FloatArray:
        """Return the lagging temperature on the blocks, what it lags by and what settles, shape (M, 1 … 3)."""
        main = self.template(channel)
        parts = [main]
        if self.prompt:
            parts.append(centred(channel) - main)
        if self.settling:
            parts.append(self.start(channel))
        return np.stack(parts, axis=1)

    def columns_elsewhere(self, channel: Channel, *, same_record: bool) -> FloatArray:
        """Return its templates; of another record only the lagging temperature: what settles there is not known."""
        columns = self.columns(channel)
        if not same_record:
            columns[:, 1:] = 0.0
        return columns

    def refit(self, fitted: FittedChannel, index: int) -> Self:
        """Fit the lag again; take the further templates that the record shows."""
        constant = best_constant(
            fitted, index, lambda x: self.at(x).columns(fitted.channel), self.time_constant
        )
        settling = self.settling or further_ratio(fitted, self.start(fitted.channel)) > MIN_LIKELIHOOD_RATIO
        prompt = self.prompt or further_ratio(fitted, self.late(fitted.channel)) > MIN_LIKELIHOOD_RATIO
        moved = abs(np.log(constant / self.time_constant)) >= MIN_LOG_CHANGE
        new = replace(self, time_constant=constant, settling=settling, prompt=prompt)
        return new if moved or (settling, prompt) != (self.settling, self.prompt) else self

    def start(self, channel: Channel) -> FloatArray:
        """Return how a lag that did not begin at rest settles on the blocks, shape (M,)."""
        return np.asarray(np.exp(-channel.block_time / self.time_constant))

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Self:
        """Take slopes and lag from the joint fit; what the lag leaves open of one slope it leaves open of the other."""
        joint = super().with_joint_estimate(fitted, index, size)
        if not self.prompt:
            return joint
        at = first_column(fitted, index) + 1
        sd = float(np.sqrt(fitted.fit.beta_covariance[at, at]))
        drift = 0.5 * (joint.values["slope"].upper - joint.values["slope"].lower)
        prompt_slope = Value.of(float(fitted.fit.beta[at]), sd, "{u}/K").widened_by(drift)
        return replace(joint, values={**joint.values, "prompt_slope": prompt_slope})


def further_ratio(fitted: FittedChannel, template: FloatArray) -> float:
    """Return the likelihood ratio of a further template, given on the blocks (M,)."""
    fit = fitted.refit(block_transform(template[:, None], fitted.cleaned, fitted.track.singles))
    return 2.0 * SLOW_RATIO_FACTOR * (fit.log_likelihood - fitted.fit.log_likelihood)


def likeliest_beside(fitted: FittedChannel) -> ThermalLag:
    """Return the lag that scores most beside the temperature of a model: the bias then follows it in two ways."""
    tried = ThermalLag.candidates(fitted.channel)
    scores, _ = scan(fitted, np.stack([one.late(fitted.channel) for one in tried], axis=1))
    return replace(tried[scores.best], prompt=True)
