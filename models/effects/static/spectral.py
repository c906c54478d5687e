"""Effects that shape the spectrum: a line, a resonance, a filter, ARMA colour, a Gauss–Markov process.

Two-sided spectra of the sampled sequence with interval Δ, z = exp(2πifΔ)::

    line           A²/4 at ±frequency;   AVAR(τ) = A² sin⁴(πfτ)/(πfτ)²
    comb           lines of even power at all multiples of `spacing`
    vibration      c / |1 − 2r cos(θ) z⁻¹ + r² z⁻²|²,   r = exp(−πfΔ/quality), pole angle θ = 2πfΔ
    lowpass        S_y · Π |1 − p|² / |1 − p z⁻¹|²,     p = exp(s Δ), s the poles of a Butterworth filter
    colour         S_w · |1 + Σ ma_j z⁻ʲ|² / |1 − Σ ar_i z⁻ⁱ|²
    gauss_markov   sd² Δ (1 − φ²) / |1 − φ z⁻¹|²,       φ = exp(−Δ/time_constant)

References
----------
.. [1] IEEE Std 952-1997, Annex C.1.1 (sinusoidal, correlated noise).
.. [2] G. E. P. Box, G. M. Jenkins, Time Series Analysis, ch. 3 (AR(2), stationarity).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.base import (
    FILTER,
    NOISE,
    Effect,
    Joins,
    Samples,
    Scale,
    log_uniform,
    require_finite,
    require_not_negative,
    require_positive,
)


@dataclass(frozen=True)
class Line(Effect):
    """Sinusoid A sin(2πft + φ): mains, a fan, a dither; a frequency above Nyquist shows as its alias.

    Attributes
    ----------
    frequency : float
        Hz.
    amplitude : float
        Peak value A, unit.
    phase : float, optional
        Phase φ at t = 0, rad; drawn evenly where absent, one for all channels.
    modulation_frequency, modulation_depth : float
        Frequency g, Hz, and depth m of the swelling of the amplitude, A (1 + m cos 2πgt); 0 for none.
    """

    name: ClassVar[str] = "line"
    identified_as: ClassVar[str | None] = "sinusoid"
    locates: ClassVar[tuple[str, ...]] = ("frequency",)
    positive: ClassVar[tuple[str, ...]] = ("frequency", "amplitude")
    frequency: float
    amplitude: float
    phase: float | None = None
    modulation_frequency: float = 0.0
    modulation_depth: float = 0.0

    def __post_init__(self) -> None:
        require_positive(frequency=self.frequency)
        require_not_negative(
            amplitude=self.amplitude,
            modulation_frequency=self.modulation_frequency,
            modulation_depth=self.modulation_depth,
        )
        require_finite(phase=self.phase or 0.0)

    def signal(self, t: FloatArray, *, phase: float = 0.0) -> FloatArray:
        """Return the sinusoid at the times `t`, shape (n,); `phase` stands in for an absent one."""
        envelope = 1.0 + self.modulation_depth * np.cos(2.0 * np.pi * self.modulation_frequency * t)
        return (
            self.amplitude
            * envelope
            * np.sin(2.0 * np.pi * self.frequency * t + (phase if self.phase is None else self.phase))
        )

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the sinusoid to every channel."""
        return block.add(self.signal(block.t, phase=float(rng.uniform(0.0, 2.0 * np.pi))))

    @classmethod
    def drawn(cls, values: Mapping[str, float], block: Samples) -> FloatArray | None:
        """Return the sinusoid of this frequency that fits one channel best, shape (n,)."""
        y, turn = block.y[:, 0], np.exp(-2j * np.pi * values["frequency"] * (block.t - block.t[0]))
        return np.asarray(np.real(2.0 * np.mean((y - y.mean()) * turn) * turn.conj()))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of frequency 0.05 Hz … 0.49 of the rate, amplitude 0.003 … 1 white sd."""
        top = 0.49 / scale.interval
        return cls(log_uniform(rng, min(0.05, 0.1 * top), top), scale.white_sd * log_uniform(rng, 0.003, 1.0))


@dataclass(frozen=True)
class Comb(Effect):
    """A pulse of one sample that comes again and again: lines of one spacing up to half the rate.

    Attributes
    ----------
    spacing : float
        Frequency of the pulses, Hz.
    sd : float
        Root mean square of the pulses over the record, unit.
    """

    name: ClassVar[str] = "comb"
    locates: ClassVar[tuple[str, ...]] = ("spacing",)
    positive: ClassVar[tuple[str, ...]] = ("spacing", "sd")
    spacing: float
    sd: float

    def __post_init__(self) -> None:
        require_positive(spacing=self.spacing)
        require_not_negative(sd=self.sd)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add the pulses to every channel, the first by chance."""
        turns = np.floor((block.t - block.t[0]) * self.spacing + rng.uniform())
        pulse = np.diff(turns, prepend=turns[0]) > 0.0
        return block.add(pulse * self.sd / math.sqrt(max(float(pulse.mean()), 1.0 / len(pulse))))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of spacing of 20 … 2000 samples, sd 0.03 … 0.3 of the white one."""
        spacing = 1.0 / (scale.interval * log_uniform(rng, 20.0, 2000.0))
        return cls(spacing, scale.white_sd * log_uniform(rng, 0.03, 0.3))


@dataclass(frozen=True)
class Vibration(Effect):
    """Narrow-band resonance: a stationary AR(2), another one in each channel.

    Attributes
    ----------
    frequency : float
        Hz, below half the sampling rate.
    quality : float
        Frequency ÷ half-power bandwidth.
    sd : float
        Standard deviation, unit.
    """

    name: ClassVar[str] = "vibration"
    joins: ClassVar[Joins] = "noise model"
    is_noise: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("frequency",)
    positive: ClassVar[tuple[str, ...]] = ("frequency", "quality", "sd")
    frequency: float
    quality: float
    sd: float

    def __post_init__(self) -> None:
        require_positive(frequency=self.frequency, quality=self.quality)
        require_not_negative(sd=self.sd)

    def recursion(self, interval: float) -> tuple[float, float]:
        """Return φ₁, φ₂ of x_k = φ₁ x_{k−1} + φ₂ x_{k−2} + e_k."""
        if not self.frequency < 0.5 / interval:
            raise ValueError(
                f"'frequency' must be below half the rate, {0.5 / interval} Hz, got {self.frequency}"
            )
        r = math.exp(-math.pi * self.frequency * interval / self.quality)
        return 2.0 * r * math.cos(2.0 * math.pi * self.frequency * interval), -r * r

    def signal(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return `n` samples, stationary from the first on."""
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

        phi1, phi2 = self.recursion(interval)
        rho = phi1 / (1.0 - phi2)
        innovation = self.sd * math.sqrt((1.0 - phi2**2) * (1.0 - rho**2))
        x1 = self.sd * rng.standard_normal()
        x2 = rho * x1 + self.sd * math.sqrt(1.0 - rho**2) * rng.standard_normal()
        state = np.array([phi1 * x1 + phi2 * x2, phi2 * x1])
        e = innovation * rng.standard_normal(n)
        x, _ = lfilter([1.0], [1.0, -phi1, -phi2], e, zi=state)
        return np.asarray(x, dtype=float)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add an own resonance to every channel."""
        n, k = block.y.shape
        return block.add(np.column_stack([self.signal(n, block.interval, rng) for _ in range(k)]))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of frequency 2 Hz … 0.45 of the rate, quality 5 … 100, sd 0.02 … 0.5 white sd."""
        top = 0.45 / scale.interval
        return cls(
            log_uniform(rng, min(2.0, 0.1 * top), top),
            log_uniform(rng, 5.0, 100.0),
            scale.white_sd * log_uniform(rng, 0.02, 0.5),
        )


@dataclass(frozen=True)
class LowPass(Effect):
    """The sensor's low-pass filter: Butterworth poles mapped to the samples, gain 1 at frequency 0.

    Attributes
    ----------
    cutoff : float
        Half-power frequency of the continuous filter, Hz.
    order : int
        Number of poles.
    """

    name: ClassVar[str] = "lowpass"
    stage: ClassVar[int] = FILTER
    joins: ClassVar[Joins] = "noise model"
    is_noise: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("cutoff",)
    positive: ClassVar[tuple[str, ...]] = ("cutoff",)
    cutoff: float
    order: int = 1

    def __post_init__(self) -> None:
        require_positive(cutoff=self.cutoff, order=self.order)

    def denominator(self, interval: float) -> FloatArray:
        """Return the coefficients of Π(1 − p z⁻¹), shape (order + 1,)."""
        k = np.arange(self.order)
        poles = 2.0 * np.pi * self.cutoff * np.exp(1j * np.pi * (2 * k + self.order + 1) / (2 * self.order))
        return np.asarray(np.poly(np.exp(poles * interval)).real, dtype=float)

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the factor on the spectrum at frequencies `f`, Hz, shape of `f`."""
        a = self.denominator(interval)
        response = np.polynomial.polynomial.polyval(np.exp(-2j * np.pi * np.asarray(f) * interval), a)
        return np.asarray((a.sum() / np.abs(response)) ** 2)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Filter everything before it: noise and signals."""
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

        a = self.denominator(block.interval)
        start = block.y[:1]
        y = start + lfilter([a.sum()], a, block.y - start, axis=0)
        white = None if block.white is None else lfilter([a.sum()], a, block.white, axis=0)
        return replace(block, y=y, white=white)

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of first or second order, cutoff 0.1 … 0.48 of the rate."""
        return cls(log_uniform(rng, 0.1, 0.48) / scale.interval, int(rng.integers(1, 3)))


@dataclass(frozen=True)
class Colour(Effect):
    """ARMA colour: x_k = Σ ar_i x_{k−i} + w_k + Σ ma_j w_{k−j} in place of the white noise w.

    Attributes
    ----------
    ar, ma : tuple of float
        Coefficients; the autoregression must be stationary.
    """

    name: ClassVar[str] = "colour"
    stage: ClassVar[int] = NOISE
    joins: ClassVar[Joins] = "noise model"
    is_noise: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("ar", "ma")
    ar: tuple[float, ...] = ()
    ma: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for key in ("ar", "ma"):
            for value in getattr(self, key):
                require_finite(**{key: value})
        roots = np.roots([1.0, *(-a for a in self.ar)])
        if np.any(np.abs(roots) >= 1.0):
            raise ValueError(f"'ar' must be stationary (poles inside the unit circle), got {self.ar}")

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the factor on the spectrum of the white noise at frequencies `f`, Hz, shape of `f`."""
        z = np.exp(-2j * np.pi * np.asarray(f) * interval)
        above = np.polynomial.polynomial.polyval(z, [1.0, *self.ma])
        below = np.polynomial.polynomial.polyval(z, [1.0, *(-a for a in self.ar)])
        return np.asarray(np.abs(above / below) ** 2)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Colour the white part of every channel."""
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

        w = block.fast()
        return block.reshaped(w, lfilter([1.0, *self.ma], [1.0, *(-a for a in self.ar)], w, axis=0))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of AR(1) with −0.5 … −0.003, or ARMA(2,1) with poles and zero within ±0.5."""
        if rng.random() < 0.5:
            return cls(ar=(-log_uniform(rng, 0.003, 0.5),))
        p, q = rng.uniform(-0.5, 0.5, 2)
        return cls(ar=(float(p + q), float(-p * q)), ma=(float(rng.uniform(-0.5, 0.5)),))


@dataclass(frozen=True)
class CorrelatedDrift(Effect):
    """A first-order Gauss–Markov process beside the identified noise, another one in each channel.

    Attributes
    ----------
    sd : float
        Stationary standard deviation, unit.
    time_constant : float
        s.
    """

    name: ClassVar[str] = "gauss_markov"
    identified_as: ClassVar[str | None] = "gauss_markov"
    joins: ClassVar[Joins] = "noise model"
    is_noise: ClassVar[bool] = True
    locates: ClassVar[tuple[str, ...]] = ("time_constant",)
    positive: ClassVar[tuple[str, ...]] = ("sd", "time_constant")
    sd: float
    time_constant: float

    def __post_init__(self) -> None:
        require_not_negative(sd=self.sd)
        require_positive(time_constant=self.time_constant)

    def signal(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
        """Return `n` point samples, stationary from the first on."""
        from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

        phi = math.exp(-interval / self.time_constant)
        w = self.sd * math.sqrt(1.0 - phi * phi) * rng.standard_normal(n)
        x, _ = lfilter([1.0], [1.0, -phi], w, zi=[phi * self.sd * rng.standard_normal()])
        return np.asarray(x, dtype=float)

    def apply(self, block: Samples, rng: np.random.Generator) -> Samples:
        """Add an own process to every channel."""
        n, k = block.y.shape
        return block.add(np.column_stack([self.signal(n, block.interval, rng) for _ in range(k)]))

    @classmethod
    def draw(cls, rng: np.random.Generator, scale: Scale) -> Self:
        """Draw an effect of sd 0.5 … 5 Allan floors, time constant 1 s … a twentieth of the record."""
        top = max(scale.span / 20.0, 4.0 * scale.interval)
        return cls(
            scale.floor * log_uniform(rng, 0.5, 5.0),
            log_uniform(rng, min(1.0, 2.0 * scale.interval, 0.5 * top) if top < 2.0 else 1.0, top),
        )
