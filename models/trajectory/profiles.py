"""Smooth functions of time with exact derivatives, from which trajectories are built.

A profile is a constant, a slope, smooth steps and waves added up::

    y(t) = start + rate t + Σ change S((t − begin)/duration) + Σ amplitude sin(2π frequency t + phase)
    S(x) = x⁴ (35 − 84 x + 70 x² − 20 x³)      0 before, 1 after: three continuous derivatives

So rates and forces made from a profile are smooth enough for the quadrature of an inertial unit everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray


@dataclass(frozen=True)
class Step:
    """A smooth change: when it begins and how long it takes, s, and by how much."""

    begin: float
    duration: float
    change: float

    def __post_init__(self) -> None:
        if not self.duration > 0.0:
            raise ValueError(f"'duration' must be positive, got {self.duration}")


@dataclass(frozen=True)
class Wave:
    """A sinusoid: amplitude, frequency in Hz and phase in rad."""

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        if not self.frequency > 0.0:
            raise ValueError(f"'frequency' must be positive, got {self.frequency}")


@dataclass(frozen=True)
class Profile:
    """A sum of a constant, a slope, steps and waves.

    Attributes
    ----------
    start : float
        Value at t = 0 without waves.
    rate : float
        Constant slope, 1/s.
    steps : tuple of Step
        In order of time, without overlap.
    waves : tuple of Wave
    """

    start: float = 0.0
    rate: float = 0.0
    steps: tuple[Step, ...] = ()
    waves: tuple[Wave, ...] = ()

    def __post_init__(self) -> None:
        for a, b in pairwise(self.steps):
            if b.begin < a.begin + a.duration:
                raise ValueError(f"'steps' must be in order and not overlap, got {a} and {b}")

    @property
    def knots(self) -> tuple[float, ...]:
        """Times where the fourth derivative jumps, s."""
        return tuple(x for s in self.steps for x in (s.begin, s.begin + s.duration))

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the waves, Hz; 0 without waves."""
        return max((w.frequency for w in self.waves), default=0.0)

    def _current(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the sum of finished steps; progress 0 … 1, change and duration of the last one begun."""
        table = np.array([[s.begin, s.duration, s.change] for s in self.steps])
        before = np.concatenate([[0.0], np.cumsum(table[:-1, 2])])
        i = np.maximum(np.searchsorted(table[:, 0], t, side="right") - 1, 0)
        begin, duration, change = np.moveaxis(table[i], -1, 0)
        return before[i], np.clip((t - begin) / duration, 0.0, 1.0), change, duration

    def __call__(self, t: ArrayLike) -> FloatArray:
        """Return the values at the times t, s."""
        t = np.asarray(t, dtype=float)
        y = self.start + self.rate * t
        if self.steps:
            before, x, change, _ = self._current(t)
            y = y + before + change * x**4 * (35.0 - x * (84.0 - x * (70.0 - 20.0 * x)))
        for w in self.waves:
            y = y + w.amplitude * np.sin(2.0 * np.pi * w.frequency * t + w.phase)
        return np.asarray(y)

    def derivative(self, t: ArrayLike) -> FloatArray:
        """Return the derivatives at the times t, 1/s."""
        t = np.asarray(t, dtype=float)
        y = np.full_like(t, self.rate)
        if self.steps:
            _, x, change, duration = self._current(t)
            y = y + change / duration * 140.0 * (x * (1.0 - x)) ** 3
        for w in self.waves:
            omega = 2.0 * np.pi * w.frequency
            y = y + w.amplitude * omega * np.cos(omega * t + w.phase)
        return y


def steps(*changes: tuple[float, float, float]) -> tuple[Step, ...]:
    """Return steps from rows (begin, duration, change)."""
    return tuple(Step(*row) for row in changes)
