"""What a filter is given of one axis, and what stands beside it because a filter has no state for it.

A *block* is white noise N, Gauss–Markov states (σ, T) and a random walk K. Quantization noise and lines or resonances
stay bounded in the integral of the samples; they are kept beside the block. Both together predict the measured
Allan variance.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from models.noise import GaussMarkov, NoiseModel, Quantization, RandomWalk, White
from tuner.identification.predictive.spectral_excess import SpectralExcess

FloatArray = NDArray[np.float64]

FASTEST_STATE = 1.0
"""Time constant up to which a state is written as white noise, s: a filter with a fix a second cannot follow it."""


@dataclass(frozen=True)
class NoiseBlock:
    """A block with its bounded parts.

    Attributes
    ----------
    white_density : float
        N, unit/√Hz.
    states : tuple of GaussMarkov
        Bias states, the fastest first.
    random_walk_density : float
        K, unit/√s.
    increment_sd : float
        Quantization noise beside the block, unit·s.
    excess : tuple of SpectralExcess
        Lines, resonances and bands of motion beside the block.
    """

    white_density: float
    states: tuple[GaussMarkov, ...] = ()
    random_walk_density: float = 0.0
    increment_sd: float = 0.0
    excess: tuple[SpectralExcess, ...] = field(default=())

    @property
    def model(self) -> NoiseModel:
        """What a filter carries, as a noise model."""
        white = (White(self.white_density),) if self.white_density > 0.0 else ()
        walk = (RandomWalk(self.random_walk_density),) if self.random_walk_density > 0.0 else ()
        return NoiseModel((*white, *self.states, *walk))

    def allan_variance(self, tau: FloatArray, interval: float) -> FloatArray:
        """Return the predicted Allan variance of the samples, bounded parts included; shape of τ, unit²."""
        total = self.model.allan_variance(tau, interval=interval)
        if self.increment_sd > 0.0:
            total = total + Quantization(self.increment_sd).allan_variance(tau, interval=interval)
        for part in self.excess:
            total = total + part.allan_variance(tau)
        return total

    def bounded_integral_variance(self, duration: float) -> float:
        """Return the variance that the bounded parts add to the integral over a duration, s; (unit·s)²."""
        return 2.0 * self.increment_sd**2 + sum(part.integral_variance(duration) for part in self.excess)

    def without_fast_states(self, fastest: float = FASTEST_STATE) -> NoiseBlock:
        """Return the block whose states up to a time constant, s, have become white noise, N² += 2 σ² T."""
        fast = [state for state in self.states if state.time_constant <= fastest]
        density = np.sqrt(self.white_density**2 + sum(2.0 * s.sd**2 * s.time_constant for s in fast))
        slow = tuple(state for state in self.states if state.time_constant > fastest)
        return NoiseBlock(float(density), slow, self.random_walk_density, self.increment_sd, self.excess)
