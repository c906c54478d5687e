"""Thermal lag: a bias in proportion to a temperature that follows the measured one with a first-order lag.

Statistic: likelihood ratio of the best lag of a grid, the noise refitted; Davies' bound over the grid.
Extension: a template; its lag by the profile of the likelihood. The lagging temperature starts at the measured
one. Where the sensor was not at rest before the record that is wrong by slope · (L(0) − T(0)) exp(−t/τ): a further,
free template. So is T − L: part of the bias may follow at once, by `prompt_slope`, and the rest late (a heated sensor
has parts that follow their own ways); `slope` is that of slow changes either way. Each is taken where a likelihood
ratio of χ²₁ asks for it at 0.1 %.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import ThermalLag as Effect
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.causes.temperature import COVARIATE, centred
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.null_distributions import SHRINK
from tuner.diagnosis.static.model.profile_likelihood import (
    SAME,
    Template,
    best_constant,
    first_column,
    profile,
)
from tuner.diagnosis.static.model.residual import Residual
from tuner.diagnosis.static.model.score_scan import judge, likeliest, scan
from tuner.diagnosis.static.outcome import Alarm

FloatArray = NDArray[np.float64]

ASKS = 10.8
"""Likelihood ratio from which a further template is believed: χ²₁ at 0.1 %."""


@dataclass(frozen=True)
class ThermalLag(Extension):
    """Bias in proportion to the lagging temperature L.

    `settling`: L may start anywhere. `prompt`: another slope for what is faster than the lag.
    """

    cause: ClassVar[str] = "thermal_lag"
    meaning: ClassVar[str] = "the bias follows the measured temperature late: a loop of bias over temperature"
    consequence: ClassVar[str] = (
        "a calibration to apply to the low-passed temperature, slope × (L − T₀) with dL/dt = (T − L)/τ, and where a "
        "prompt slope is given, that × (T − L)"
    )
    time_constant: float
    settling: bool = False
    prompt: bool = False

    def columns(self, channel: Channel) -> FloatArray:
        """Return the lagging temperature on the blocks, what it lags by and what settles, shape (M, 1 … 3)."""
        main = lagged(channel, self.time_constant)
        parts = [main]
        if self.prompt:
            parts.append(centred(channel) - main)
        if self.settling:
            parts.append(self._start(channel))
        return np.stack(parts, axis=1)

    def polished(self, found: Residual, index: int) -> ThermalLag:
        """Fit the lag again; take the further templates that the record asks for."""
        constant = best_constant(found, index, self._template(found.channel), self.time_constant)
        settling = self.settling or asks(found, self._start(found.channel)) > ASKS
        late = centred(found.channel) - lagged(found.channel, self.time_constant)
        prompt = self.prompt or asks(found, late) > ASKS
        new = replace(self, time_constant=constant, settling=settling, prompt=prompt)
        moved = abs(np.log(constant / self.time_constant)) >= SAME
        return new if moved or (settling, prompt) != (self.settling, self.prompt) else self

    def _start(self, channel: Channel) -> FloatArray:
        return np.asarray(np.exp(-channel.block_time / self.time_constant))

    def refined(self, found: Residual, index: int, size: Value) -> ThermalLag:
        """Take slope and lag from the joint fit."""
        reach = profile(found, index, self._template(found.channel), self.time_constant, size)
        values = {"time_constant": reach.constant, "slope": replace(size, unit="{u}/K").owing(reach.drift)}
        if self.prompt:
            at = first_column(found, index) + 1
            sd = float(np.sqrt(found.fit.beta_covariance[at, at]))
            values["prompt_slope"] = Value.of(float(found.fit.beta[at]), sd, "{u}/K")
        return replace(self, values=values)

    def _template(self, channel: Channel) -> Template:
        return lambda constant: replace(self, time_constant=constant).columns(channel)


def asks(found: Residual, template: FloatArray) -> float:
    """Return the likelihood ratio of a further template, given on the blocks (M,)."""
    fit = found.refit(block_transform(template[:, None], found.repaired, found.track.singles))
    return 2.0 * SHRINK * (fit.log_likelihood - found.fit.log_likelihood)


def lagged(channel: Channel, time_constant: float) -> FloatArray:
    """Return the lagging temperature on the blocks about its mean, K, shape (M,)."""
    effect = Effect(1.0, time_constant)
    out = effect.lagged(channel.covariates[COVARIATE], channel.block * channel.interval)
    return np.asarray(out - out.mean())


def lags(channel: Channel) -> FloatArray:
    """Return the grid of lags, s."""
    shortest = max(30.0, 4.0 * channel.block * channel.interval)
    return np.geomspace(shortest, max(channel.span, 2.0 * shortest), 12)


def test(found: Residual) -> Alarm | None:
    """Search for a lag between temperature and bias; None where no temperature was measured."""
    channel = found.channel
    if COVARIATE not in channel.covariates:
        return None
    grid = lags(channel)
    scores, templates = scan(found, np.stack([lagged(channel, t) for t in grid], axis=1))
    name = "likelihood ratio of a lagging temperature"
    if not scores.promising:
        return Alarm("thermal_lag", 1.0, -9.0, float(scores.score[scores.best] ** 2), name)
    result = judge(found, templates[:, scores.best], scores.correlation, price=float(np.log(8.0)))
    near = float(grid[scores.best])
    return Alarm(
        "thermal_lag", result.p_value, result.gain, result.ratio, name, lambda: (extension(found, near),)
    )


def extension(found: Residual, near: float) -> ThermalLag:
    """Return the lag next to a time constant, s."""
    return ThermalLag(likeliest(found, lambda constant: lagged(found.channel, constant), near))


def beside(found: Residual) -> tuple[ThermalLag, float]:
    """Return the lag that explains most beside a temperature that a residual has, and its likelihood ratio.

    The bias then follows the temperature in two ways, one of them late.
    """
    channel = found.channel
    grid, now = lags(channel), centred(channel)
    scores, _ = scan(found, np.stack([now - lagged(channel, t) for t in grid], axis=1))
    best = float(grid[scores.best])
    ratio = asks(found, now - lagged(channel, best)) if scores.promising else 0.0
    return ThermalLag(best, prompt=True), ratio
