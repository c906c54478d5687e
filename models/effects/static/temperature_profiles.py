"""Temperature over time in closed form: constant, warming up, the day, a climatic chamber.

::

    Constant    T(t) = level
    Warming     T(t) = start + rise (1 − exp(−t/time_constant))
    Diurnal     T(t) = mean + amplitude sin(2πt/period + phase)
    Chamber     trapezium: from low to high at `rate`, rest, back down, rest, again

A profile is what the sensor feels; `thermometer` is what its thermometer writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from models.effects.static.base import (
    FloatArray,
    log_uniform,
    require_finite,
    require_not_negative,
    require_positive,
)


class Profile(Protocol):
    """A temperature as a function of time since power-on."""

    def celsius(self, t: FloatArray) -> FloatArray:
        """Return the temperature at times `t`, s, in °C; shape of `t`."""


@dataclass(frozen=True)
class Constant:
    """A constant temperature, °C."""

    level: float = 25.0

    def __post_init__(self) -> None:
        require_finite(level=self.level)

    def celsius(self, t: FloatArray) -> FloatArray:
        """Return the temperature at times `t`, s, in °C; shape of `t`."""
        return np.full_like(t, self.level)


@dataclass(frozen=True)
class Warming:
    """Self-heating after power-on: `start` °C, `rise` K, `time_constant` s."""

    start: float
    rise: float
    time_constant: float

    def __post_init__(self) -> None:
        require_finite(start=self.start, rise=self.rise)
        require_positive(time_constant=self.time_constant)

    def celsius(self, t: FloatArray) -> FloatArray:
        """Return the temperature at times `t`, s, in °C; shape of `t`."""
        return self.start - self.rise * np.expm1(-t / self.time_constant)


@dataclass(frozen=True)
class Diurnal:
    """A daily (or other) cycle: `mean` °C, `amplitude` K, `period` s, `phase` rad."""

    mean: float
    amplitude: float
    period: float = 86400.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        require_finite(mean=self.mean, amplitude=self.amplitude, phase=self.phase)
        require_positive(period=self.period)

    def celsius(self, t: FloatArray) -> FloatArray:
        """Return the temperature at times `t`, s, in °C; shape of `t`."""
        return self.mean + self.amplitude * np.sin(2.0 * np.pi * t / self.period + self.phase)


@dataclass(frozen=True)
class Chamber:
    """A climatic chamber: up from `low` to `high` °C at `rate` K/s, `rest` s, down, `rest` s, and again."""

    low: float
    high: float
    rate: float
    rest: float = 0.0

    def __post_init__(self) -> None:
        require_finite(low=self.low, high=self.high)
        require_positive(rate=self.rate)
        require_not_negative(rest=self.rest)
        if not self.high > self.low:
            msg = f"'high' must exceed 'low', {self.low}, got {self.high}"
            raise ValueError(msg)

    def celsius(self, t: FloatArray) -> FloatArray:
        """Return the temperature at times `t`, s, in °C; shape of `t`."""
        ramp = (self.high - self.low) / self.rate
        corners = np.cumsum([0.0, ramp, self.rest, ramp, self.rest])
        levels = [self.low, self.high, self.high, self.low, self.low]
        return np.asarray(np.interp(np.mod(t, corners[-1]), corners, levels), dtype=float)


def draw_profile(rng: np.random.Generator, span: float) -> Profile:
    """Draw one of the four kinds for a record of `span` seconds."""
    start = float(rng.uniform(15.0, 35.0))
    kind = int(rng.integers(4))
    if kind == 0:
        return Constant(start)
    if kind == 1:
        return Warming(start, float(rng.uniform(3.0, 12.0)), log_uniform(rng, 0.1 * span, 0.5 * span))
    if kind == 2:
        return Diurnal(start, float(rng.uniform(1.0, 6.0)), phase=float(rng.uniform(0.0, 2.0 * np.pi)))
    swing = float(rng.uniform(10.0, 40.0))
    return Chamber(start, start + swing, 2.5 * swing / span, 0.1 * span)


def thermometer(
    t: FloatArray, celsius: FloatArray, *, step: float, refresh: float, sd: float, rng: np.random.Generator
) -> FloatArray:
    """Return what a digital thermometer reads.

    Parameters
    ----------
    t, celsius : ndarray, shape (n,)
        Time, s, and true temperature, °C.
    step : float
        Quantizer step of the readings, K; 0 for none.
    refresh : float
        Time between new readings, s, the last one being repeated; 0 for a new one every sample.
    sd : float
        White noise of a reading, K.
    rng : numpy.random.Generator
        Source of that noise.

    Returns
    -------
    ndarray, shape (n,)
        Readings, °C.
    """
    require_not_negative(step=step, refresh=refresh, sd=sd)
    reading = celsius + sd * rng.standard_normal(len(t))
    if refresh > 0:
        tick = np.floor((t - t[0]) / refresh)
        fresh = np.concatenate(([True], np.diff(tick) > 0))
        reading = reading[np.maximum.accumulate(np.where(fresh, np.arange(len(t)), 0))]
    return np.round(reading / step) * step if step > 0 else reading
