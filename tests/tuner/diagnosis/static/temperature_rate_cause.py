"""A bias in proportion to the rate of the temperature: the cause that `docs/extending/cause.md` adds."""

from dataclasses import dataclass

import numpy as np

from models.effects.static.base import Effect, log_uniform, sign
from tuner.diagnosis.static.causes.template import Template


@dataclass(frozen=True)
class TemperatureRateEffect(Effect):
    """slope · dT/dt, slope in unit·s/K."""

    name = "temperature_rate"
    deterministic = needs_temperature = True
    slope: float

    def apply(self, block, rng):
        return block.add(self.slope * np.gradient(block.temperature, block.interval))

    @classmethod
    def draw(cls, rng, scale):
        return cls(sign(rng) * scale.floor * log_uniform(rng, 1e3, 1e4))


@dataclass(frozen=True)
class TemperatureRate(Template):
    """Bias in proportion to the rate of the temperature."""

    cause = "temperature_rate"
    effect = TemperatureRateEffect
    meaning = "the bias follows the rate at which the measured temperature changes"
    consequence = "a calibration to apply: subtract slope × dT/dt before the filter"
    covariate = "temperature"
    size = ("slope", "{u}·s/K")
    statistic = "likelihood ratio of the rate of the temperature"

    def template(self, channel):
        return np.gradient(channel.covariates["temperature"], channel.block * channel.interval)
