"""A line in the spectrum: vibration, dither, mains.

::

    y = A cos(2πf₀t + phase)      AVAR = A² sin⁴(πf₀τ)/(πf₀τ)²      HVAR = (4/3) A² sin⁶(πf₀τ)/(πf₀τ)²

For samples dt apart (πf₀τ)² becomes m² sin²(πf₀ dt). The spectrum is A²/4 at each of ±f₀, which no density
can hold.

References
----------
.. [1] IEEE Std 952-1997, Annex C; the weight A²/2 printed there is twice the one its Allan variance needs.
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
class Sinusoid(Term):
    """A sinusoid of constant amplitude; its phase is uniformly random where none is given."""

    amplitude: float  # A: unit, peak
    frequency: float  # f₀: Hz
    phase: float | None = None  # rad, at t = 0

    name: ClassVar[str] = "sinusoid"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("amplitude", "frequency")
    UNITS: ClassVar[tuple[float | str, ...]] = (0.0, "Hz")
    deterministic: ClassVar[bool] = True
    fitted: ClassVar[bool] = False

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return 0: the power sits in the line, not in a density."""
        return np.zeros(np.shape(f))

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return 0, shape (2, *shape of f)."""
        return np.zeros((2, *np.shape(f)))

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return A² sin⁴(πf₀τ)/(πf₀τ)², or with m² sin²(πf₀ dt) below for samples."""
        return as_array(self.amplitude**2 * self._sine_square(tau) ** 2 / self._width_square(tau, interval))

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return (4/3) A² sin⁶(πf₀τ)/(πf₀τ)², or with m² sin²(πf₀ dt) below for samples."""
        power = 4.0 / 3.0 * self.amplitude**2
        return as_array(power * self._sine_square(tau) ** 3 / self._width_square(tau, interval))

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Return (A²/2) cos(2πf₀ lag), over random phase."""
        return 0.5 * self.amplitude**2 * np.cos(2.0 * np.pi * self.frequency * as_array(lag))

    def state_space(self) -> StateSpace:
        """Return the oscillator without noise, of random phase and amplitude of the right power."""
        w = 2.0 * np.pi * self.frequency
        return StateSpace(
            F=np.array([[0.0, w], [-w, 0.0]]),
            G=np.zeros((2, 1)),
            H=np.array([[1.0, 0.0]]),
            Q=np.zeros((1, 1)),
            P0=0.5 * self.amplitude**2 * np.eye(2),
        )

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return the sinusoid from t = 0."""
        phase = rng.uniform(0.0, 2.0 * np.pi) if self.phase is None else self.phase
        angle = 2.0 * np.pi * self.frequency * interval * np.arange(n) + phase
        return as_array(self.amplitude * np.cos(angle))

    def fastest_time(self) -> float:
        """Return 0: a line is no slow error, whatever its period."""
        return 0.0

    def _sine_square(self, tau: ArrayLike) -> FloatArray:
        return as_array(np.sin(np.pi * self.frequency * as_array(tau)) ** 2)

    def _width_square(self, tau: ArrayLike, interval: float | None) -> FloatArray:
        if interval is None:
            return (np.pi * self.frequency * as_array(tau)) ** 2
        return (as_array(tau) / interval * float(np.sin(np.pi * self.frequency * interval))) ** 2
