"""Effects on the law of the noise: heavy tails, a burst, a drifting variance, noise that axes share.

Each acts on the white part w alone::

    heavy_tails       w √((ν − 2)/χ²_ν): Student's t of the same variance, excess kurtosis 6/(ν − 4)
    burst             w √variance_ratio, for start ≤ t < start + duration
    variance_drift    w exp(slope (t − t_mid)/2): the log of the variance runs at `slope`
    periodic_variance w exp(depth cos(2πt/period + φ)/2)
    skewed_noise      sd (g − k)/√k, g of the gamma law of shape k = 4/skewness²
    cross_axis        √(1 − ρ) w_j + √ρ sd_j c, with one white c for all channels
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from models.effects.static.base import (
    NOISE,
    Effect,
    Joins,
    Samples,
    Scale,
    log_uniform,
    require_between,
    require_finite,
    require_not_negative,
    require_positive,
    sign,
)

MIN_SKEWNESS = 1e-4
"""Skewness below which a law is taken for normal: no record is long enough to tell, and its shape is beyond 4e8."""


@dataclass(frozen=True)
class HeavyTails(Effect):
    """White noise with the distribution of Student in place of that of Gauss, variance unchanged.

    Attributes
    ----------
    excess_kurtosis : float
        6/(ν − 4), dimensionless; 0 is Gaussian.
    """

    name: ClassVar[str] = "heavy_tails"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "law of the noise"
    positive: ClassVar[tuple[str, ...]] = ("excess_kurtosis",)
    excess_kurtosis: float

    def __post_init__(self) -> None:
        require_not_negative(excess_kurtosis=self.excess_kurtosis)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Give the white part of every channel heavy tails."""
        if self.excess_kurtosis == 0.0:
            return block
        w = block.fast()
        nu = 4.0 + 6.0 / self.excess_kurtosis
        return block.reshaped(w, w * np.sqrt((nu - 2.0) / rng.chisquare(nu, w.shape)))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of excess kurtosis 0.06 … 6 (ν = 100 … 5)."""
        return cls(log_uniform(rng, 0.06, 6.0))


@dataclass(frozen=True)
class Burst(Effect):
    """A stretch of larger (or smaller) white noise.

    Attributes
    ----------
    start, duration : float
        On the clock of the record, s.
    variance_ratio : float
        Variance inside ÷ outside.
    """

    name: ClassVar[str] = "burst"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "law of the noise"
    locates: ClassVar[tuple[str, ...]] = ("start", "duration")
    positive: ClassVar[tuple[str, ...]] = ("duration", "variance_ratio")
    start: float
    duration: float
    variance_ratio: float

    def __post_init__(self) -> None:
        require_finite(start=self.start)
        require_positive(duration=self.duration, variance_ratio=self.variance_ratio)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Scale the white part of every channel inside the stretch."""
        inside = (block.t >= self.start) & (block.t < self.start + self.duration)
        w = block.fast()
        return block.reshaped(w, np.where(inside, np.sqrt(self.variance_ratio), 1.0)[:, np.newaxis] * w)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of 1 … 30 % of the record, variance × 1.1 … 10."""
        duration = scale.span * log_uniform(rng, 0.01, 0.3)
        start = scale.start + float(rng.uniform(0.0, scale.span - duration))
        return cls(start, duration, 1.0 + log_uniform(rng, 0.1, 9.0))


@dataclass(frozen=True)
class VarianceDrift(Effect):
    """White noise whose variance runs exponentially in time and is unchanged in the middle of the block.

    Attributes
    ----------
    slope : float
        d ln(variance)/dt, 1/s.
    """

    name: ClassVar[str] = "variance_drift"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "law of the noise"
    slope: float

    def __post_init__(self) -> None:
        require_finite(slope=self.slope)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Scale the white part of every channel."""
        w = block.fast()
        middle = 0.5 * (block.t[0] + block.t[-1])
        return block.reshaped(w, np.exp(0.5 * self.slope * (block.t - middle))[:, np.newaxis] * w)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of change of the log variance over the record ± 0.05 … 2."""
        return cls(sign(rng) * log_uniform(rng, 0.05, 2.0) / scale.span)


@dataclass(frozen=True)
class SkewedNoise(Effect):
    """White noise of a gamma law in place of the normal one, mean and variance unchanged.

    Attributes
    ----------
    skewness : float
        Third central moment ÷ sd³, −10 … 10; 0 is Gaussian.
    """

    name: ClassVar[str] = "skewed_noise"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "law of the noise"
    skewness: float

    def __post_init__(self) -> None:
        require_between(-10.0, 10.0, skewness=self.skewness)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Give the white part of every channel a skew law."""
        if abs(self.skewness) < MIN_SKEWNESS:
            return block
        w, shape = block.fast(), 4.0 / self.skewness**2
        gamma = (rng.standard_gamma(shape, w.shape) - shape) / np.sqrt(shape)
        return block.reshaped(w, np.copysign(1.0, self.skewness) * w.std(axis=0) * gamma)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of skewness ± 0.05 … 1."""
        return cls(sign(rng) * log_uniform(rng, 0.05, 1.0))


@dataclass(frozen=True)
class PeriodicVariance(Effect):
    """White noise whose variance swells and ebbs with a period, such as that of a clock or a machine.

    Attributes
    ----------
    period : float
        s.
    depth : float
        Amplitude of the log of the variance.
    """

    name: ClassVar[str] = "periodic_variance"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "law of the noise"
    locates: ClassVar[tuple[str, ...]] = ("period",)
    positive: ClassVar[tuple[str, ...]] = ("period", "depth")
    period: float
    depth: float

    def __post_init__(self) -> None:
        require_positive(period=self.period)
        require_not_negative(depth=self.depth)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Scale the white part of every channel, with a phase by chance."""
        w = block.fast()
        phase = 2.0 * np.pi * (block.t / self.period + rng.uniform())
        return block.reshaped(w, np.exp(0.5 * self.depth * np.cos(phase))[:, np.newaxis] * w)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of four intervals … a twentieth of the record, depth 0.05 … 1."""
        return cls(log_uniform(rng, 4.0 * scale.interval, 0.05 * scale.span), log_uniform(rng, 0.05, 1.0))


@dataclass(frozen=True)
class CrossAxis(Effect):
    """White noise shared by all channels of the block, variances unchanged.

    Attributes
    ----------
    correlation : float
        Correlation ρ of the white noise of any two channels, 0 ≤ ρ < 1.
    """

    name: ClassVar[str] = "cross_axis"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "law of the noise"
    one_for_all: ClassVar[bool] = True
    correlation: float

    def __post_init__(self) -> None:
        require_between(0.0, 1.0, correlation=self.correlation)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Mix one common noise into every channel."""
        if block.y.shape[1] < 2:
            raise ValueError(f"'{self.name}' needs two channels or more, got {block.y.shape[1]}")
        w = block.fast()
        common = rng.standard_normal(len(block.t))[:, np.newaxis] * w.std(axis=0)
        return block.reshaped(w, np.sqrt(1.0 - self.correlation) * w + np.sqrt(self.correlation) * common)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of correlation 0.01 … 0.5."""
        return cls(log_uniform(rng, 0.01, 0.5))
