"""What an effect is: a map from a block of samples to a block of samples.

A block y is the sum of a slow part and a fast part, its white noise w::

    y_k = slow_k + w_k

An effect acts at one stage on the way from the sensing element to the file: on the noise itself (w), as a
signal added to y, in the filter, as a glitch of the wire, at the rails, in the quantizer, in the register of its
codes, when a reading is repeated, or in the time stamps. Every effect is a frozen set of SI parameters with the names a
finding uses; all chance comes from the generator given to `apply`.

References
----------
.. [1] IEEE Std 952-1997, Annex C (environment-sensitive errors of gyros).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Literal, Self

import numpy as np
from scipy.ndimage import uniform_filter1d

from models.arrays import FloatArray
from models.effects.parsing import Written

NOISE, SIGNAL, FILTER, GLITCH, RAIL, QUANTIZER, REGISTER, HOLD, STAMP = range(9)
"""Stages in the order in which a sample passes them."""

Joins = Literal["preprocessing", "noise model", "law of the noise"]
"""Parts of a model: what is done to the samples, the sum of noise terms, the distribution of the residuals."""

FAST_WINDOW = 101
"""Width in samples of the moving mean that parts slow from fast where the white noise is not known."""


@dataclass(frozen=True)
class Samples:
    """A block of evenly sampled channels.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time stamps, s.
    y : ndarray, shape (n, k)
        Samples, SI unit of the sensor.
    interval : float
        Nominal sampling interval, s.
    temperature : ndarray, shape (n,), optional
        True temperature of the sensor, °C.
    white : ndarray, shape (n, k), optional
        White part of `y`, where it is known (in a simulation).
    breaks : tuple of int
        Samples that come after a gap.
    """

    t: FloatArray
    y: FloatArray
    interval: float
    temperature: FloatArray | None = None
    white: FloatArray | None = None
    breaks: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.t)
        if self.y.ndim != 2 or self.t.shape != (self.y.shape[0],):
            raise ValueError(
                f"'t' and 'y' must have shapes (n,) and (n, k), got {self.t.shape} and {self.y.shape}"
            )
        if self.temperature is not None and self.temperature.shape != (n,):
            raise ValueError(f"'temperature' must have shape ({n},), got {self.temperature.shape}")
        if self.white is not None and self.white.shape != self.y.shape:
            raise ValueError(f"'white' must have the shape {self.y.shape} of 'y', got {self.white.shape}")
        require_positive(interval=self.interval)

    def fast(self) -> FloatArray:
        """Return the white part, or `y` less its moving mean over `FAST_WINDOW` samples; shape (n, k)."""
        if self.white is not None:
            return self.white
        slow: FloatArray = uniform_filter1d(self.y, FAST_WINDOW, axis=0, mode="reflect")
        return self.y - slow

    def add(self, signal: FloatArray) -> Samples:
        """Return the block with a signal of shape (n,) or (n, k) added to every channel."""
        return replace(self, y=self.y + (signal[:, np.newaxis] if signal.ndim == 1 else signal))

    def reshaped(self, old: FloatArray, new: FloatArray) -> Samples:
        """Return the block with its fast part `old` replaced by `new`, both of shape (n, k)."""
        return replace(self, y=self.y + (new - old), white=None if self.white is None else new)


@dataclass(frozen=True)
class Scale:
    """What an amplitude is measured by when an effect is drawn at random.

    Attributes
    ----------
    white_sd : float
        Standard deviation of the white noise of a sample, unit.
    interval, span, start : float
        Sampling interval, length and first time stamp of the record, s.
    floor : float
        Smallest Allan deviation of the record, unit.
    level : float
        Mean of the channel, unit.
    """

    white_sd: float
    interval: float
    span: float
    start: float
    floor: float
    level: float


@dataclass(frozen=True)
class Effect(Written, ABC):
    """One cause with its parameters (the fields), in SI units."""

    stage: ClassVar[int] = SIGNAL
    joins: ClassVar[Joins] = "preprocessing"
    """Which part of a model the cause joins once it is found."""
    is_noise: ClassVar[bool] = False
    """Whether the noise terms fitted together with the cause contain its spectrum."""
    identified_as: ClassVar[str | None] = None
    """Noise term that an identification of the samples has for it; None where the terms take no account of it."""
    locates: ClassVar[tuple[str, ...]] = ()
    """Parameters that must agree for two channels to share one finding: where, when, or at which frequency."""
    positive: ClassVar[tuple[str, ...]] = ()
    """Parameters that cannot be negative: their intervals end at 0."""
    home: ClassVar[str | None] = None
    """Channels (``gyro``, ``accel``, ``imu``) where none are named; None for those of the first sensor."""
    one_for_all: ClassVar[bool] = False
    """Whether the effect is one in all of its channels, and not another in each."""
    absolute: ClassVar[bool] = False
    """Whether its parameters are readings about an unknown mean, so that no simulation can take them over."""

    deterministic: ClassVar[bool] = False
    """Whether the effect adds a signal that follows from its parameters, the time and the temperature alone."""
    needs_temperature: ClassVar[bool] = False
    """Whether the effect acts only where a temperature is known."""
    needs_smooth_temperature: ClassVar[bool] = False
    """Whether codes and noise of a thermometer, differentiated, would be more than the effect."""

    @classmethod
    def drawn(cls, values: Mapping[str, float], block: Samples) -> FloatArray | None:
        """Return the signal that the effect adds to samples, to be drawn over them; None where it adds none.

        Parameters
        ----------
        values : mapping of str to float
            Parameters of a finding.
        block : Samples
            One channel.

        Returns
        -------
        ndarray, shape (n,), or None
        """
        if not cls.deterministic or (cls.needs_temperature and block.temperature is None):
            return None
        effect = cls(**{f.name: values[f.name] for f in fields(cls) if f.name in values})
        silent = replace(block, y=np.zeros_like(block.y), white=None)
        return np.asarray(effect.apply(silent, np.random.default_rng(0)).y[:, 0])

    @abstractmethod
    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Return the block with the effect in it."""

    @classmethod
    @abstractmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Return the effect with random parameters, sized by the record they are meant for."""


def require_finite(**values: float) -> None:
    """Raise ValueError for a parameter that is not a finite number."""
    for name, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"'{name}' must be finite, got {value}")


def require_positive(**values: float) -> None:
    """Raise ValueError for a parameter that is not positive and finite."""
    for name, value in values.items():
        if not (value > 0 and math.isfinite(value)):
            raise ValueError(f"'{name}' must be positive, got {value}")


def require_not_negative(**values: float) -> None:
    """Raise ValueError for a parameter that is negative or not finite."""
    for name, value in values.items():
        if not (value >= 0 and math.isfinite(value)):
            raise ValueError(f"'{name}' must not be negative, got {value}")


def require_between(low: float, high: float, **values: float) -> None:
    """Raise ValueError for a parameter outside low ≤ x < high."""
    for name, value in values.items():
        if not low <= value < high:
            raise ValueError(f"'{name}' must be at least {low} and below {high}, got {value}")


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform between two positive bounds."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def sign(rng: np.random.Generator) -> float:
    """Return +1 or −1 with equal chance."""
    return float(rng.choice((-1.0, 1.0)))
