"""Temperature over time in closed form: warming up, the day; and what a thermometer reads of it.

::

    Warming     T(t) = start + rise (1 − exp(−t/time_constant))
    Diurnal     T(t) = mean + amplitude sin(2πt/period + phase)

A profile is what the sensor feels; `thermometer` is what its thermometer writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from models.arrays import FloatArray
from models.effects.static.base import require_finite, require_not_negative, require_positive


@runtime_checkable
class Profile(Protocol):
    """A temperature as a function of time since power-on."""

    def celsius(self, t: FloatArray) -> FloatArray:
        """Return the temperature at times `t`, s, in °C; shape of `t`."""


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
