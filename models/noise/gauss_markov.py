"""Gauss–Markov noise and low-pass filtered white noise.

::

    GaussMarkov      db/dt = −b/T + w,  var b = σ²         S = 2σ²T / (1 + (2πf T)²)
    LowPassWhite 1   N through a pole at f_c               S = N² / (1 + (f/f_c)²)
    LowPassWhite 2   N through a Butterworth pair at f_c   S = N² / (1 + (f/f_c)⁴)

The density that drives a Gauss–Markov process is q = σ √(2/T). Its Allan deviation peaks at τ = 1.8926 T with
0.6174 σ; short of T it is the random walk K = q, long after T white noise N = σ √(2T). All are sampled at
the instant.

References
----------
.. [1] IEEE Std 952-1997, Annex C (exponentially correlated noise).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.noise import exponential
from models.noise.base import Term, as_array
from models.recursion import decaying_sum
from models.statespace import StateSpace, discretize


@dataclass(frozen=True)
class GaussMarkov(Term):
    """First-order Gauss–Markov (exponentially correlated) noise; samples are an AR(1) with φ = exp(−dt/T)."""

    sd: float  # σ: unit, stationary standard deviation
    time_constant: float  # T: s

    name: ClassVar[str] = "gauss_markov"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("sd", "time_constant")
    UNITS: ClassVar[tuple[float | str, ...]] = (0.0, "s")
    SYMBOLS: ClassVar[tuple[str, ...]] = ("σ GM", "T GM")
    title: ClassVar[str] = "Gauss–Markov"

    @property
    def driving_density(self) -> float:
        """White density q = σ √(2/T) that drives the process, unit/√s."""
        return float(self.sd * np.sqrt(2.0 / self.time_constant))

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 2σ²T/(1 + (2πfT)²), or the AR(1) spectrum of samples."""
        return exponential.spectrum(self.sd**2, 1.0 / self.time_constant, as_array(f), interval)

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the derivatives by ln σ and ln T, shape (2, *shape of f)."""
        by_rate = exponential.rate_derivative(self.sd**2, 1.0 / self.time_constant, as_array(f), interval)
        return np.stack([2.0 * self.psd(f, interval=interval), -by_rate])

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return σ² (2x − 3 + 4e^{−x} − e^{−2x})/x² with x = τ/T, or the AR(1) form of samples."""
        return exponential.allan_variance(self.sd**2, 1.0 / self.time_constant, as_array(tau), interval)

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return σ² (6x − 10 + 15e^{−x} − 6e^{−2x} + e^{−3x})/(3x²), or the AR(1) form of samples."""
        return exponential.hadamard_variance(self.sd**2, 1.0 / self.time_constant, as_array(tau), interval)

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return σ² exp(−|lag|/T), the same for samples."""
        return self.sd**2 * np.exp(-np.abs(as_array(lag)) / self.time_constant)

    def state_space(self) -> StateSpace:
        """Return the one state, initially stationary."""
        one = np.ones((1, 1))
        return StateSpace(
            F=-one / self.time_constant, G=one, H=one, Q=self.driving_density**2 * one, P0=self.sd**2 * one
        )

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return a stationary AR(1) sequence."""
        a = interval / self.time_constant
        drive = rng.standard_normal(n)
        drive[:1] /= np.sqrt(-np.expm1(-2.0 * a))
        drive *= self.sd * np.sqrt(-np.expm1(-2.0 * a))
        return decaying_sum(drive, float(np.exp(-a)))

    def phase_covariance(self, t: ArrayLike, scale: float) -> FloatArray:  # noqa: ARG002
        """Return −σ² T² (t/T − 1 + e^{−t/T})."""
        scaled = as_array(t) / self.time_constant
        return as_array(-((self.sd * self.time_constant) ** 2) * (scaled + np.expm1(-scaled)))


@dataclass(frozen=True)
class LowPassWhite(Term):
    """White noise seen through a low-pass filter of one pole (order 1) or a Butterworth pair (order 2)."""

    density: float  # N: unit/√Hz below the cutoff, two-sided
    cutoff: float  # f_c: Hz, where the power is halved
    order: int = 1

    name: ClassVar[str] = "low_pass_white"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("density", "cutoff")
    UNITS: ClassVar[tuple[float | str, ...]] = (-0.5, "Hz")
    is_bias: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.order not in (1, 2):
            raise ValueError(f"'order' must be 1 or 2, got {self.order}")

    @property
    def variance(self) -> float:
        """Variance of the filtered noise: π N² f_c, over √2 for the Butterworth pair."""
        return float(np.pi * self.density**2 * self.cutoff / np.sqrt(self.order))

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return N²/(1 + (f/f_c)^(2 order)), or the spectrum of its samples."""
        if interval is None:
            return self.density**2 / (1.0 + (as_array(f) / self.cutoff) ** (2 * self.order))
        return exponential.spectrum(*self._pole(), as_array(f), interval)

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the derivatives by ln N and ln f_c, shape (2, *shape of f)."""
        value = self.psd(f, interval=interval)
        by_rate = exponential.rate_derivative(*self._pole(), as_array(f), interval)
        return np.stack([2.0 * value, value + by_rate])

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Allan variance: peak (1.09 N)² f_c at f_c τ = 0.301 (order 1), 0.468 (order 2)."""
        return exponential.allan_variance(*self._pole(), as_array(tau), interval)

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return the Hadamard variance."""
        return exponential.hadamard_variance(*self._pole(), as_array(tau), interval)

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return the autocovariance, the same for samples."""
        c, p = self._pole()
        return as_array(np.real(c * np.exp(-p * np.abs(as_array(lag)))))

    def state_space(self) -> StateSpace:
        """Return the states of the filter, initially stationary."""
        w = 2.0 * np.pi * self.cutoff
        drive = np.array([[self.density**2]])
        if self.order == 1:
            one = np.ones((1, 1))
            return StateSpace(F=-w * one, G=w * one, H=one, Q=drive, P0=self.variance * one)
        return StateSpace(
            F=np.array([[0.0, 1.0], [-(w**2), -np.sqrt(2.0) * w]]),
            G=np.array([[0.0], [w**2]]),
            H=np.array([[1.0, 0.0]]),
            Q=drive,
            P0=self.variance * np.diag([1.0, w**2]),
        )

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return a stationary sequence with the exact distribution of the sampled process."""
        if self.order == 1:
            equal = GaussMarkov(float(np.sqrt(self.variance)), 1.0 / (2.0 * np.pi * self.cutoff))
            return equal.sample(n, interval, rng)
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

        system = self.state_space()
        transition, covariance = discretize(system, interval)
        start = np.sqrt(np.diag(system.P0)) * rng.standard_normal(2)
        noise = rng.standard_normal((n, 2)) @ np.linalg.cholesky(covariance).T
        # With the noise (v, u) of a step:
        # y_k = tr(Phi) y_{k−1} − det(Phi) y_{k−2} + v_k − Phi_11 v_{k−1} + Phi_01 u_{k−1}
        drive = noise[:, 0].copy()
        drive[1:] += transition[0, 1] * noise[:-1, 1] - transition[1, 1] * noise[:-1, 0]
        denominator = [1.0, -np.trace(transition), np.linalg.det(transition)]
        memory = transition @ start
        state = np.array([memory[0], transition[0, 1] * memory[1] - transition[1, 1] * memory[0]])
        filtered, _ = lfilter([1.0], denominator, drive, zi=state)
        return np.asarray(filtered)

    def _pole(self) -> tuple[complex, complex]:
        """Return (c, p) of the autocovariance Re[c exp(−p |t|)]."""
        w = 2.0 * np.pi * self.cutoff
        if self.order == 1:
            return self.variance, w
        return self.variance * (1.0 - 1.0j), w * (1.0 - 1.0j) / np.sqrt(2.0)
