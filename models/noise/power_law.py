"""Quantization, white noise, random walk and ramp: the terms whose Allan variance is one power of τ.

::

    Quantization  S_d = 4 Q²/dt sin²(πf dt)        AVAR = 3 Q²/τ²
    White         S   = N²                         AVAR = N²/τ
    RandomWalk    S   = K²/(2πf)²                  AVAR = K² τ/3
                  S_d = K² dt²/(4 sin²(πf dt))     AVAR = K² dt (2m² + 1)/(6m)   point samples
    Ramp          y   = R t                        AVAR = R² τ²/2

S_d is the spectrum of samples dt apart, m = τ/dt.

References
----------
.. [1] IEEE Std 952-1997, Annex C.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.noise.base import Term, as_array
from models.statespace import StateSpace


@dataclass(frozen=True)
class Quantization(Term):
    """White error of the integrated output (angle, velocity), seen in the rate as its difference.

    A quantiser of step s has increment_sd = s/√12.
    """

    increment_sd: float  # Q: unit·s (rad, m/s)

    name: ClassVar[str] = "quantization"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("increment_sd",)
    UNITS: ClassVar[tuple[float | str, ...]] = (-1.0,)
    SYMBOLS: ClassVar[tuple[str, ...]] = ("Q",)
    is_power_law: ClassVar[bool] = True
    title: ClassVar[str] = "quantization"
    is_bias: ClassVar[bool] = False

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 4 Q²/dt sin²(πf dt); the process exists only with its sampling interval."""
        dt = _need_interval(interval, "quantization noise has no spectrum")
        return 4.0 * self.increment_sd**2 / dt * np.sin(np.pi * as_array(f) * dt) ** 2

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 2 S."""
        return 2.0 * self.psd(f, interval=interval)[None]

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return 3 Q²/τ², the same for samples."""
        return 3.0 * self.increment_sd**2 / as_array(tau) ** 2

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return 10/3 Q²/τ², the same for samples."""
        return 10.0 / 3.0 * self.increment_sd**2 / as_array(tau) ** 2

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 2 Q²/dt² at lag 0, −Q²/dt² at one interval, else 0."""
        dt = _need_interval(interval, "quantization noise has no autocovariance")
        k = np.abs(np.rint(as_array(lag) / dt))
        return (self.increment_sd / dt) ** 2 * np.where(k == 0, 2.0, np.where(k == 1, -1.0, 0.0))

    def state_space(self) -> None:
        """Return None: a difference of white errors needs no continuous state."""

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return differences of white increment errors, as a fine quantiser leaves them."""
        return np.diff(rng.standard_normal(n + 1)) * (self.increment_sd / interval)

    def phase_white_variance(self) -> float:
        """Return Q²."""
        return self.increment_sd**2


@dataclass(frozen=True)
class White(Term):
    """White rate noise (angle or velocity random walk); samples average over the interval: variance N²/dt."""

    density: float  # N: unit/√Hz, two-sided

    name: ClassVar[str] = "white"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("density",)
    UNITS: ClassVar[tuple[float | str, ...]] = (-0.5,)
    SYMBOLS: ClassVar[tuple[str, ...]] = ("N",)
    is_power_law: ClassVar[bool] = True
    title: ClassVar[str] = "white (random walk of the integral)"
    is_bias: ClassVar[bool] = False

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return N² at every frequency, the same for samples."""
        return np.full(np.shape(f), self.density**2)

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 2 S."""
        return 2.0 * self.psd(f, interval=interval)[None]

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return N²/τ, the same for samples."""
        return self.density**2 / as_array(tau)

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return N²/τ, the same for samples."""
        return self.density**2 / as_array(tau)

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return N²/dt at lag 0, else 0; the continuous process has no finite variance."""
        dt = _need_interval(interval, "white noise has no finite variance")
        k = np.rint(as_array(lag) / dt)
        return np.where(k == 0, self.density**2 / dt, 0.0)

    def state_space(self) -> None:
        """Return None: white noise has no memory."""

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return independent normal samples of variance N²/dt."""
        return rng.standard_normal(n) * float(self.density / np.sqrt(interval))

    def _white_density(self) -> float:
        return self.density


@dataclass(frozen=True)
class RandomWalk(Term):
    """Integrated white noise: rate or acceleration random walk, sampled at the instant."""

    density: float  # K: unit/√s

    name: ClassVar[str] = "random_walk"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("density",)
    UNITS: ClassVar[tuple[float | str, ...]] = (0.5,)
    SYMBOLS: ClassVar[tuple[str, ...]] = ("K",)
    is_power_law: ClassVar[bool] = True
    title: ClassVar[str] = "rate random walk"

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return K²/(2πf)², or K² dt²/(4 sin²(πf dt)) of samples; infinite at f = 0."""
        w = np.pi * as_array(f)
        root = 2.0 * w if interval is None else 2.0 / interval * np.sin(w * interval)
        with np.errstate(divide="ignore"):
            return self.density**2 / root**2

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 2 S."""
        return 2.0 * self.psd(f, interval=interval)[None]

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return K² τ/3, or K² dt (2m² + 1)/(6m) of samples."""
        t, dt = as_array(tau), interval or 0.0
        return self.density**2 * (t / 3.0 + dt**2 / (6.0 * t))

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return K² τ/6, or K² dt (m² + 1)/(6m) of samples."""
        t, dt = as_array(tau), interval or 0.0
        return self.density**2 * (t + dt**2 / t) / 6.0

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Raise ValueError: the variance of a random walk grows for ever."""
        raise ValueError("a random walk has no autocovariance: it is not stationary")

    def state_space(self) -> StateSpace:
        """Return the integrator db/dt = w that starts at 0."""
        zero, one = np.zeros((1, 1)), np.ones((1, 1))
        return StateSpace(zero, one, one, self.density**2 * one, zero)

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return b_0 = 0, b_{k+1} = b_k + w_k with w of variance K² dt."""
        walk = rng.standard_normal(n)
        walk[:1] = 0.0
        np.cumsum(walk, out=walk)
        walk *= self.density * np.sqrt(interval)
        return walk

    def phase_covariance(self, t: ArrayLike, scale: float) -> FloatArray:  # noqa: ARG002
        """Return K² t³/12."""
        return as_array(self.density**2 * as_array(t) ** 3 / 12.0)


@dataclass(frozen=True)
class Ramp(Term):
    """A constant slope y = R t: deterministic, without spectral density, unseen by the Hadamard variance."""

    rate: float  # R: unit/s

    name: ClassVar[str] = "ramp"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("rate",)
    UNITS: ClassVar[tuple[float | str, ...]] = (1.0,)
    SYMBOLS: ClassVar[tuple[str, ...]] = ("R",)
    is_power_law: ClassVar[bool] = True
    title: ClassVar[str] = "ramp"
    deterministic: ClassVar[bool] = True

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return 0: R²/(2πf)³, often printed, gives no finite Allan variance."""
        return np.zeros(np.shape(f))

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 0."""
        return self.psd(f, interval=interval)[None]

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return R² τ²/2, the same for samples."""
        return 0.5 * (self.rate * as_array(tau)) ** 2

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return 0."""
        return np.zeros(np.shape(tau))

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Raise ValueError: a ramp is not stationary."""
        raise ValueError("a ramp has no autocovariance: it is not stationary")

    def state_space(self) -> StateSpace:
        """Return value and slope; the slope has the prior variance R² and no noise."""
        return StateSpace(
            F=np.array([[0.0, 1.0], [0.0, 0.0]]),
            G=np.array([[0.0], [1.0]]),
            H=np.array([[1.0, 0.0]]),
            Q=np.zeros((1, 1)),
            P0=np.diag([0.0, self.rate**2]),
        )

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:  # noqa: ARG002
        """Return R t from t = 0; nothing is random."""
        return np.arange(n, dtype=np.float64) * (self.rate * interval)


def _need_interval(interval: float | None, message: str) -> float:
    if interval is None:
        raise ValueError(f"{message} without the sampling interval: give 'interval'")
    return interval
