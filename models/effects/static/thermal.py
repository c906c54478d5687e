"""Effects of heat: a temperature coefficient, one that lags, and the transient after power-on.

::

    temperature    slope · (T − T_0)
    thermal_lag    slope · (L − T_0) + prompt_slope · (T − L),    time_constant · dL/dt = T − L,   L(0) = T_0
    temperature_squared   curvature · (T − T_m)²
    temperature_rate   slope · dT/dt
    hysteresis     slope · (P − T_0),    P the temperature behind a play of `width`
    warmup         amplitude · exp(−(t − t_0) / time_constant)

T_0 is the first temperature of the block, T_m their mean, t_0 its first time. Curves of the temperature itself are in
`models.effects.static.temperature_profiles`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.base import (
    Effect,
    Samples,
    Scale,
    log_uniform,
    require_finite,
    require_positive,
    sign,
)
from models.recursion import decaying_sum


def _temperature(block: Samples, cause: str) -> FloatArray:
    if block.temperature is None:
        raise ValueError(f"'{cause}' needs a block with a temperature, got one without")
    return block.temperature


@dataclass(frozen=True)
class TemperatureSlope(Effect):
    """Bias in proportion to temperature.

    Attributes
    ----------
    slope : float
        unit/K.
    """

    name: ClassVar[str] = "temperature"
    deterministic: ClassVar[bool] = True
    needs_temperature: ClassVar[bool] = True
    slope: float

    def __post_init__(self) -> None:
        require_finite(slope=self.slope)

    def signal(self, temperature: FloatArray) -> FloatArray:
        """Return the bias at each temperature (n,), °C."""
        signal: FloatArray = self.slope * (temperature - temperature[0])
        return signal

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the bias to every channel."""
        return block.add(self.signal(_temperature(block, self.name)))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Slope ± 3 … 30 Allan floors per kelvin (0.005 … 0.05 deg/s/K at a floor of 6 deg/h)."""
        return cls(sign(rng) * scale.floor * log_uniform(rng, 3.0, 30.0))


@dataclass(frozen=True)
class ThermalLag(Effect):
    """Bias in proportion to a temperature that follows the measured one with a first-order lag.

    Attributes
    ----------
    slope : float
        unit/K.
    time_constant : float
        Lag, s.
    prompt_slope : float
        Slope of what the lagging temperature has not followed yet, unit/K.
    """

    name: ClassVar[str] = "thermal_lag"
    deterministic: ClassVar[bool] = True
    needs_temperature: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("time_constant",)
    positive: ClassVar[tuple[str, ...]] = ("time_constant",)
    slope: float
    time_constant: float
    prompt_slope: float = 0.0

    def __post_init__(self) -> None:
        require_finite(slope=self.slope, prompt_slope=self.prompt_slope)
        require_positive(time_constant=self.time_constant)

    def lagged(self, temperature: FloatArray, interval: float) -> FloatArray:
        """Return the lagging temperature (n,), °C, exact where the input is constant between samples."""
        phi = math.exp(-interval / self.time_constant)
        rise = np.concatenate(([0.0], temperature[:-1] - temperature[0]))
        return np.asarray(temperature[0] + (1.0 - phi) * decaying_sum(rise, phi), dtype=float)

    def signal(self, temperature: FloatArray, interval: float) -> FloatArray:
        """Return the bias for evenly sampled temperatures (n,), °C."""
        late = self.lagged(temperature, interval)
        signal: FloatArray = self.slope * (late - temperature[0]) + self.prompt_slope * (temperature - late)
        return signal

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the bias to every channel."""
        return block.add(self.signal(_temperature(block, self.name), block.interval))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Slope ± 3 … 30 Allan floors per kelvin, lag 50 … 800 s."""
        return cls(sign(rng) * scale.floor * log_uniform(rng, 3.0, 30.0), log_uniform(rng, 50.0, 800.0))


@dataclass(frozen=True)
class TemperatureSquared(Effect):
    """Bias in proportion to the square of the temperature about its mean over the record.

    Attributes
    ----------
    curvature : float
        unit/K².
    """

    name: ClassVar[str] = "temperature_squared"
    deterministic: ClassVar[bool] = True
    needs_temperature: ClassVar[bool] = True
    curvature: float

    def __post_init__(self) -> None:
        require_finite(curvature=self.curvature)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the bias to every channel."""
        celsius = _temperature(block, self.name)
        return block.add(self.curvature * (celsius - celsius.mean()) ** 2)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Curvature ± 0.3 … 3 Allan floors per square kelvin."""
        return cls(sign(rng) * scale.floor * log_uniform(rng, 0.3, 3.0))


@dataclass(frozen=True)
class TemperatureRate(Effect):
    """Bias in proportion to the rate of the temperature.

    Attributes
    ----------
    slope : float
        unit·s/K.
    """

    name: ClassVar[str] = "temperature_rate"
    deterministic: ClassVar[bool] = True
    needs_temperature: ClassVar[bool] = True
    needs_smooth_temperature: ClassVar[bool] = True
    slope: float

    def __post_init__(self) -> None:
        require_finite(slope=self.slope)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the bias to every channel."""
        return block.add(self.slope * np.gradient(_temperature(block, self.name), block.interval))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Slope ± 1000 … 10 000 Allan floors per K/s."""
        return cls(sign(rng) * scale.floor * log_uniform(rng, 1e3, 1e4))


@dataclass(frozen=True)
class Hysteresis(Effect):
    """Bias in proportion to a temperature that a play has passed: it turns back only after some kelvin.

    Attributes
    ----------
    slope : float
        unit/K.
    width : float
        Play, K: what the temperature must turn back before the bias follows.
    """

    name: ClassVar[str] = "hysteresis"
    deterministic: ClassVar[bool] = True
    needs_temperature: ClassVar[bool] = True
    positive: ClassVar[tuple[str, ...]] = ("width",)
    slope: float
    width: float

    def __post_init__(self) -> None:
        require_finite(slope=self.slope)
        require_positive(width=self.width)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the bias to every channel."""
        celsius = _temperature(block, self.name)
        return block.add(self.slope * (behind_play(celsius, self.width) - celsius[0]))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Slope ± 3 … 30 Allan floors per kelvin, play 0.5 … 5 K."""
        return cls(sign(rng) * scale.floor * log_uniform(rng, 3.0, 30.0), log_uniform(rng, 0.5, 5.0))


def behind_play(x: FloatArray, width: float) -> FloatArray:
    """Return values, shape (n,), behind a play of this width, which begins in its middle."""
    out, at, half = np.empty(len(x)), float(x[0]), 0.5 * width
    for i, value in enumerate(x.tolist()):
        at = min(max(at, value - half), value + half)
        out[i] = at
    return out


@dataclass(frozen=True)
class Warmup(Effect):
    """Exponential transient after power-on.

    Attributes
    ----------
    amplitude : float
        Deviation at the first sample, unit (either sign).
    time_constant : float
        s.
    """

    name: ClassVar[str] = "warmup"
    deterministic: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("time_constant",)
    positive: ClassVar[tuple[str, ...]] = ("time_constant",)
    amplitude: float
    time_constant: float

    def __post_init__(self) -> None:
        require_finite(amplitude=self.amplitude)
        require_positive(time_constant=self.time_constant)

    def signal(self, t: FloatArray) -> FloatArray:
        """Return the transient at times `t`, power-on being the first of them; shape (n,)."""
        signal: FloatArray = self.amplitude * np.exp(-(t - t[0]) / self.time_constant)
        return signal

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the transient to every channel."""
        return block.add(self.signal(block.t))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Amplitude ± 1.5 … 50 Allan floors (10 … 300 deg/h at 6 deg/h), time constant 20 … 900 s."""
        return cls(sign(rng) * scale.floor * log_uniform(rng, 1.5, 50.0), log_uniform(rng, 20.0, 900.0))
