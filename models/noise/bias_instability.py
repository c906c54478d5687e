"""Bias instability: flicker noise, continuous, as the discrete process of Hosking and Kasdin, and as a ladder.

::

    S = B²/(2πf)                  AVAR = (2 ln 2/π) B²           HVAR = ln(256/27)/(2π) B²
    S_d = B² dt/(2 sin(πf dt))    AVAR = B²/(4π m²) [(16m² − 1) O(2m) − (16m² − 4) O(m)]

with O(m) = 1 + 1/3 + … + 1/(2m − 1) = [ψ(m + ½) + γ + 2 ln 2]/2. The samples have
E(y_{i+k} − y_i)² = (4/π) B² O(k), whatever the interval; their Allan variance exceeds the flat line by
44 % at m = 1 and 0.5 % at m = 16.

References
----------
.. [1] J. R. M. Hosking, Fractional differencing, Biometrika 68 (1981), with d = 1/2.
.. [2] N. J. Kasdin, Discrete simulation of colored noise, Proc. IEEE 83 (1995).
.. [3] R. B. Davies, D. S. Harte, Tests for Hurst effect, Biometrika 74 (1987): circulant embedding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.special import digamma

from models.arrays import FloatArray
from models.noise.base import Term, as_array
from models.noise.gauss_markov import GaussMarkov

ALLAN_FLOOR: Final = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""Allan deviation of flicker ÷ B, 0.664."""


@dataclass(frozen=True)
class BiasInstability(Term):
    """Flicker rate noise, S = B²/(2πf); the floor of its Allan deviation is 0.664 B."""

    level: float  # B: unit

    name: ClassVar[str] = "bias_instability"
    PARAMETERS: ClassVar[tuple[str, ...]] = ("level",)
    UNITS: ClassVar[tuple[float | str, ...]] = (0.0,)
    SYMBOLS: ClassVar[tuple[str, ...]] = ("B",)
    is_power_law: ClassVar[bool] = True
    title: ClassVar[str] = "bias instability"

    def psd(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return B²/(2πf), or B² dt/(2 sin(πf dt)) of samples; infinite at f = 0."""
        w = np.pi * np.abs(as_array(f))
        root = 2.0 * w if interval is None else 2.0 / interval * np.sin(w * interval)
        with np.errstate(divide="ignore"):
            return self.level**2 / root

    def psd_gradient(self, f: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return 2 S."""
        return 2.0 * self.psd(f, interval=interval)[None]

    def allan_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return (2 ln 2/π) B², or the exact curve of samples."""
        if interval is None:
            return np.full(np.shape(tau), 2.0 * np.log(2.0) / np.pi * self.level**2)
        m = as_array(tau) / interval
        one, two = _odd_harmonic(m), _odd_harmonic(2 * m)
        contrast = 16.0 * (two - one) + (4.0 * one - two) / m**2
        return self.level**2 / (4.0 * np.pi) * contrast

    def hadamard_variance(self, tau: ArrayLike, *, interval: float | None = None) -> FloatArray:
        """Return ln(256/27)/(2π) B², or the exact curve of samples."""
        if interval is None:
            return np.full(np.shape(tau), np.log(256.0 / 27.0) / (2.0 * np.pi) * self.level**2)
        m = as_array(tau) / interval
        one, two, three = _odd_harmonic(m), _odd_harmonic(2 * m), _odd_harmonic(3 * m)
        contrast = 60.0 * (two - one) - 36.0 * (three - two) + (15.0 * one - 6.0 * two + three) / m**2
        return self.level**2 / (12.0 * np.pi) * contrast

    def autocovariance(self, lag: ArrayLike, *, interval: float | None = None) -> FloatArray:  # noqa: ARG002
        """Raise ValueError: the variance of flicker noise grows with the record."""
        raise ValueError("flicker noise has no autocovariance: it is not stationary")

    def state_space(self) -> NoReturn:
        """Raise ValueError: only a ladder of Gauss–Markov states comes close."""
        raise ValueError(
            "flicker noise has no finite state space: replace it by models.noise.bias_instability.flicker_ladder"
        )

    def sample(self, n: int, interval: float, rng: np.random.Generator) -> FloatArray:  # noqa: ARG002
        """Return n samples that start at 0, exact over the whole record.

        The differences of the samples are stationary with autocovariance (4/π) B²/(1 − 4k²); circulant
        embedding [3]_ of 2n points draws them exactly: there is no warm-up, and correlation reaches from the
        first sample to the last. Needs about 70 bytes a sample, and keeps 8.
        """
        if n < 2:
            return np.zeros(n)
        half = fft.next_fast_len(n - 1, real=True)
        noise = rng.standard_normal(2 * (half + 1)).view(np.complex128)
        noise *= _amplitudes(half)
        noise[[0, -1]] = np.sqrt(2.0) * noise[[0, -1]].real
        steps = fft.irfft(noise, 2 * half, norm="ortho", overwrite_x=True)[: n - 1]
        samples = np.zeros(n)
        np.cumsum(steps, out=samples[1:])
        samples *= self.level * np.sqrt(2.0 / np.pi)
        return samples

    def fastest_time(self) -> float:
        """Return infinity: what flicker holds of high frequencies lies far below white noise."""
        return np.inf

    def phase_covariance(self, t: ArrayLike, scale: float) -> FloatArray:
        """Return B² t² ln(t/scale) / (2π)."""
        lag = as_array(t)
        log = np.log(np.maximum(lag / scale, np.finfo(float).tiny))
        return as_array(self.level**2 / (2.0 * np.pi) * lag**2 * log)


@lru_cache(maxsize=1)  # axes and runs of a study are equally long
def _amplitudes(half: int) -> FloatArray:
    """Return the amplitudes of the differences on a circle of 2 `half` points, shape (half + 1,)."""
    lags = np.arange(half + 1, dtype=float)
    power: FloatArray = fft.dct(1.0 / (1.0 - 4.0 * lags**2), type=1, overwrite_x=True)
    np.sqrt(power, out=power)  # positive: the lags sum to 0, and all but the first are negative
    power.flags.writeable = False
    return power


def _odd_harmonic(m: FloatArray) -> FloatArray:
    """Return 1 + 1/3 + … + 1/(2m − 1)."""
    return as_array(0.5 * (digamma(m + 0.5) + np.euler_gamma) + np.log(2.0))


def flicker_ladder(
    level: float, shortest: float, longest: float, *, per_decade: float = 1.0
) -> tuple[GaussMarkov, ...]:
    """Return Gauss–Markov terms whose sum stands for flicker noise between two time constants.

    Time constants in geometric ratio r, all with sd = B √(ln r / π). The ripple of the Allan variance
    between the ends is ±2 % at one a decade and ±0.02 % at two.

    Parameters
    ----------
    level : float
        B of S = B²/(2πf).
    shortest, longest : float
        First and last time constant, s.
    per_decade : float, optional
        Smallest number of terms a decade.

    Returns
    -------
    tuple of GaussMarkov
        In the order of rising time constant.
    """
    if not 0.0 < shortest <= longest < np.inf:
        raise ValueError(f"time constants must satisfy 0 < shortest <= longest, got {shortest} and {longest}")
    if not per_decade > 0.0:
        raise ValueError(f"'per_decade' must be positive, got {per_decade}")
    decades = np.log10(longest / shortest)
    steps = int(np.ceil(decades * per_decade - 1e-9))
    log_ratio = np.log(10.0) * (decades / steps if steps > 0 else 1.0 / per_decade)
    sd = float(level * np.sqrt(log_ratio / np.pi))
    return tuple(GaussMarkov(sd, float(t)) for t in np.geomspace(shortest, longest, steps + 1))
