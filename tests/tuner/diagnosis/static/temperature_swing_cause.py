"""A bias in proportion to temperature times its rate: the cause that `docs/extending/cause.md` adds."""

from dataclasses import dataclass

import numpy as np

from models.effects.static.base import Effect, log_uniform, sign
from tuner.diagnosis.static.causes.temperature import centred
from tuner.diagnosis.static.causes.template import Template


@dataclass(frozen=True)
class TemperatureSwingEffect(Effect):
    """slope · (T − T_mean) dT/dt, slope in unit·s/K²."""

    name = "temperature_swing"
    deterministic = needs_temperature = True
    slope: float

    def apply(self, block, rng):
        away = block.temperature - block.temperature.mean()
        return block.add(self.slope * away * np.gradient(away, block.interval))

    @classmethod
    def draw(cls, rng, scale):
        return cls(sign(rng) * scale.floor * log_uniform(rng, 3e2, 3e3))


@dataclass(frozen=True)
class TemperatureSwing(Template):
    """Bias in proportion to temperature times its rate."""

    cause, effect = "temperature_swing", TemperatureSwingEffect
    meaning = statistic = "the bias follows the measured temperature times the rate at which it changes"
    consequence = "a calibration to apply: subtract slope × (T − T_mean) dT/dt before the filter"
    covariate = "temperature"
    size = ("slope", "{u}·s/K²")

    def template(self, channel):
        return np.gradient(0.5 * centred(channel) ** 2, channel.block * channel.interval)
