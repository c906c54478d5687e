"""Noise of one axis by an independent method: a spectrum filled with random phases.

::

    white          w_k,                                power w²
    quantization   e_{k+1} − e_k                       power 4 q² sin²(πfΔ)
    flicker        continuous law B²/(2πf)             power B²/(2πfΔ)
    markov         AR(1), φ = exp(−Δ/T)                power s² (1 − φ²)/|1 − φ z⁻¹|²
    walk           cumulated steps of variance K²Δ     power K²Δ/(4 sin²(πfΔ))

*Power* is the variance of an orthonormal cosine coefficient (DCT-II) at the frequency f = k/(2nΔ), in unit².
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len
from scipy.signal import lfilter

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """What an axis makes by itself.

    Attributes
    ----------
    white, quantum : float
        Standard deviations of the white samples and of the rounding of the increments, unit.
    flicker : float
        Level B, unit; 0 where the slow noise is a Gauss–Markov process.
    markov, time_constant : float
        Standard deviation (unit) and time constant (s) of that process; 0 where it is flicker.
    walk : float
        Density K, unit/√s.
    ramp : float
        Rate, unit/s.
    step : float
        Lattice of the codes, unit; 0 for none.
    bias : float
        Constant, unit.
    """

    white: float
    quantum: float
    flicker: float
    markov: float
    time_constant: float
    walk: float
    ramp: float
    step: float
    bias: float

    def power(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the power at frequencies `f`, Hz, without the effect of the lattice."""
        angle = np.sin(np.pi * f * interval) ** 2
        total = np.full_like(f, self.white**2) + 4.0 * self.quantum**2 * angle
        total += self.flicker**2 / (2.0 * np.pi * f * interval)
        if self.markov:
            total += markov_power(f, interval, self.markov, self.time_constant)
        return np.asarray(total + self.walk**2 * interval / (4.0 * angle))

    def slow(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return everything but the white noise and the lattice, shape (n,)."""
        y = self.bias + self.ramp * interval * np.arange(n)
        if self.quantum:
            y += np.diff(self.quantum * rng.standard_normal(n + 1))
        if self.flicker:
            y += flicker(n, self.flicker, rng)
        if self.markov:
            y += markov(n, interval, self.markov, self.time_constant, rng)
        if self.walk:
            y += np.cumsum(self.walk * np.sqrt(interval) * rng.standard_normal(n))
        return y


def flicker(n: int, level: float, rng: np.random.Generator) -> FloatArray:
    """Return noise with the spectrum B²/(2πf): random amplitudes on a grid of twice the length."""
    size = next_fast_len(2 * n, real=True)
    k = np.arange(1, size // 2 + 1)
    sd = level * np.sqrt(size / (2.0 * np.pi * k) * size / 2.0)
    line = np.zeros(size // 2 + 1, dtype=complex)
    line[1:] = sd * (rng.standard_normal(len(k)) + 1j * rng.standard_normal(len(k)))
    return np.asarray(irfft(line, size)[:n])


def markov(n: int, interval: float, sd: float, time_constant: float, rng: np.random.Generator) -> FloatArray:
    """Return a stationary first-order Gauss–Markov sequence."""
    phi = np.exp(-interval / time_constant)
    w = sd * np.sqrt(1.0 - phi * phi) * rng.standard_normal(n)
    w[0] = sd * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -phi], w))


def markov_power(f: FloatArray, interval: float, sd: float, time_constant: float) -> FloatArray:
    """Return the power of that sequence."""
    phi = np.exp(-interval / time_constant)
    return np.asarray(
        sd**2 * (1.0 - phi**2) / (1.0 + phi**2 - 2.0 * phi * np.cos(2.0 * np.pi * f * interval))
    )
