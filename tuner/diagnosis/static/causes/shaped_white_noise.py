"""Base of the causes that shape the spectrum of white noise: the sensor's filter, and colour without a filter."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from models.arrays import FloatArray
from models.noise import Term, White
from models.noise.arma import Arma
from tuner.diagnosis.static.causes.base import Extension

if TYPE_CHECKING:
    from tuner.diagnosis.static.model.fitted_channel import FittedChannel


MIN_ENLARGEMENT = 1.02
"""Ratio of densities up to which nothing is said: what a record tells of a density is no better."""


@dataclass(frozen=True)
class ShapedWhiteNoise(Extension):
    """An ARMA process in place of white noise; `rounding` is the sd of codes, scales."""

    group = "fast spectrum"
    shares = 3
    view = "spectrum"
    rounding: float

    @abstractmethod
    def arma(self, interval: float, density: float = 1.0) -> Arma:
        """Return white noise of a density in this shape."""

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the factor on the spectrum of white noise."""
        return self.arma(interval).psd(f, interval=interval)

    def power(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the power of the rounding, which has no shape."""
        return np.full_like(f, interval * self.rounding**2)

    def terms(self, interval: float) -> tuple[Term, ...]:
        """Return the rounding as white noise."""
        return (White(self.rounding * float(np.sqrt(interval))),) if self.rounding > 0 else ()

    def white_noise_enlargement(
        self, before: FittedChannel, after: FittedChannel
    ) -> tuple[float, str] | None:
        """Return the white density where the shape is flat ÷ that without it, and why, if it is clearly larger."""
        gain = self.gain(np.zeros(1), after.channel.interval)[0]
        density = after.model.white_density() * float(np.sqrt(gain))
        flat = before.model.white_density()
        if not density > MIN_ENLARGEMENT * flat > 0:
            return None
        return density / flat, f"{self.cause}: white density at the plateau"
