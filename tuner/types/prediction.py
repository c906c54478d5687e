"""Settings of a filter for one axis, and how well they predict the record that they were made from.

A *block* is white noise N, Gauss–Markov states (σ, T) and a random walk K. Quantization noise and lines or resonances
stay bounded in the integral of the samples; a filter has no state for them, and they are kept beside the block. Both
together predict the measured Allan variance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.noise import GaussMarkov, NoiseModel, Quantization, RandomWalk, White

FASTEST_STATE = 1.0
"""Time constant up to which a state is written as white noise, s: a filter with a fix a second cannot follow it."""
JUDGED_SHARE = 1.0 / 30.0
"""Longest cluster time that is judged ÷ length: there the sd of ln σ is 0.10 (white noise) to 0.14 (random walk)."""
INNER_LIMIT = 1.25
"""Factor within which 95 % of the predicted deviations must lie, and every forecast but for its scatter."""
INNER_SHARE = 0.95
"""Share of the cluster times within the inner limit."""
LOWEST_RATIO, HIGHEST_RATIO = 0.7, 1.4
"""Bounds of predicted ÷ measured deviation at every cluster time."""


@dataclass(frozen=True)
class SpectralExcess:
    """Power at some frequencies.

    Attributes
    ----------
    frequency : ndarray, shape (k,)
        Hz.
    power : ndarray, shape (k,)
        Variance of the samples that each contributes, unit².
    interval : float
        Sampling interval, s.
    """

    frequency: FloatArray
    power: FloatArray
    interval: float

    def allan_variance(self, tau: FloatArray) -> FloatArray:
        """Return L at cluster times τ, s, shape of τ, unit²."""
        angle = np.pi * self.frequency * self.interval
        m = np.rint(np.asarray(tau) / self.interval)
        return np.array(
            [np.sum(2.0 * self.power * np.sin(angle * k) ** 4 / (k * np.sin(angle)) ** 2) for k in m]
        )

    def integral_variance(self, duration: float) -> float:
        """Return the variance of the integral over a duration, s; (unit·s)²."""
        half = np.pi * self.frequency
        return float(np.sum(self.power * (np.sin(half * duration) / half) ** 2))

    def scaled(self, share: float) -> SpectralExcess:
        """Return the same frequencies with their power multiplied."""
        return SpectralExcess(self.frequency, share * self.power, self.interval)


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

    @property
    def oscillation_sd(self) -> float:
        """Sd of the integral of lines and resonances about its mean, unit·s."""
        power = sum(float(np.sum(p.power / (2.0 * np.pi * p.frequency) ** 2)) for p in self.excess)
        return float(np.sqrt(power))

    def without_fast_states(self, fastest: float = FASTEST_STATE) -> NoiseBlock:
        """Return the block whose states up to a time constant, s, have become white noise, N² += 2 σ² T."""
        fast = [state for state in self.states if state.time_constant <= fastest]
        density = np.sqrt(self.white_density**2 + sum(2.0 * s.sd**2 * s.time_constant for s in fast))
        slow = tuple(state for state in self.states if state.time_constant > fastest)
        return NoiseBlock(float(density), slow, self.random_walk_density, self.increment_sd, self.excess)


@dataclass(frozen=True)
class MeasuredAllan:
    """The measured curve of one axis.

    Attributes
    ----------
    interval, length : float
        Sampling interval and length of the longest stretch without a gap, s.
    tau : ndarray, shape (q,)
        Cluster times, s.
    variance : ndarray, shape (q,)
        Overlapping Allan variance, unit².
    dof : mapping of str to ndarray, shape (q,)
        Degrees of freedom if all were noise of one kind, by `NOISE_KINDS`.
    """

    interval: float
    length: float
    tau: FloatArray
    variance: FloatArray
    dof: Mapping[str, FloatArray]

    @property
    def judged(self) -> NDArray[np.bool_]:
        """Cluster times at which a model is judged, shape (q,)."""
        return np.asarray(self.tau <= JUDGED_SHARE * self.length)


@dataclass(frozen=True)
class CurveComparison:
    """Predicted against measured Allan deviation.

    Attributes
    ----------
    tau, ratio : ndarray, shape (q,)
        Cluster times that are judged, s, and predicted ÷ measured deviation.
    scatter : ndarray, shape (q,)
        Sd of the logarithms of the measured ones that chance makes.
    """

    tau: FloatArray
    ratio: FloatArray
    scatter: FloatArray = field(default_factory=lambda: np.zeros(1))

    @property
    def worst(self) -> float:
        """The ratio farthest from 1."""
        return float(self.ratio[np.argmax(np.abs(np.log(self.ratio)))])

    @property
    def worst_tau(self) -> float:
        """Its cluster time, s."""
        return float(self.tau[np.argmax(np.abs(np.log(self.ratio)))])

    @property
    def passes(self) -> bool:
        """Whether the block predicts the curve."""
        within = np.abs(np.log(self.ratio)) <= np.log(INNER_LIMIT * (1.0 + 2.0 * self.scatter))
        return bool(
            np.mean(within) >= INNER_SHARE
            and self.ratio.min() >= LOWEST_RATIO
            and self.ratio.max() <= HIGHEST_RATIO
        )


@dataclass(frozen=True)
class ForecastComparison:
    """True ÷ predicted rms error of forecasts over one horizon.

    Attributes
    ----------
    horizon : float
        s.
    ratio : float
        True ÷ predicted rms error of the integral.
    lowest, highest : float
        Bounds of the ratio for a record of this length.
    """

    horizon: float
    ratio: float
    lowest: float
    highest: float

    @property
    def passes(self) -> bool:
        """Whether the errors of the forecasts are as large as the settings predict."""
        return self.lowest <= self.ratio <= self.highest


class BlockSource(StrEnum):
    """Where the numbers of a block come from."""

    LIKELIHOOD = "likelihood"
    CURVE = "curve"
    CURVE_WITH_MOTION = "curve with motion"


@dataclass(frozen=True)
class PredictedBlock:
    """A block and how well it predicts its record.

    Attributes
    ----------
    source : BlockSource
        Where its numbers come from.
    block : NoiseBlock
        What is written, with the bounded parts beside it.
    measured : MeasuredAllan
        The curve of the record.
    curve : CurveComparison
        Predicted against measured Allan deviation.
    forecasts : tuple of ForecastComparison
        True against predicted errors of forecasts.
    rejected : CurveComparison or None
        That of the likelihood's block where it is not the one that is written.
    rejected_forecasts : tuple of ForecastComparison
        Its forecasts.
    without : tuple of str
        What was taken out of the samples that it predicts, where nothing predicts them as they are.
    """

    source: BlockSource
    block: NoiseBlock
    measured: MeasuredAllan
    curve: CurveComparison
    forecasts: tuple[ForecastComparison, ...]
    rejected: CurveComparison | None = None
    rejected_forecasts: tuple[ForecastComparison, ...] = ()
    without: tuple[str, ...] = ()

    @property
    def passes(self) -> bool:
        """Whether the block predicts both the curve and the forecasts."""
        return self.curve.passes and all(forecast.passes for forecast in self.forecasts)
