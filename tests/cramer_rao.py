"""Cramér–Rao bounds that tests compare intervals with, computed from a spectrum alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def spectral_bound(
    spectrum: Callable[..., FloatArray], parameters: tuple[float, ...], n: int, interval: float
) -> FloatArray:
    """Return the smallest relative sds with which n samples can give the parameters of their spectrum.

    The information on the logarithms of the parameters is ½ Σ_k ∂ln S(f_k)/∂ln θ_i ∂ln S(f_k)/∂ln θ_j over the
    frequencies f_k = k/(2 n Δ), 0 < k < n, of the cosine transform (P. Whittle, 1953).

    Parameters
    ----------
    spectrum : callable
        Two-sided density of the samples at frequencies (Hz) and parameters, all positive.
    parameters : tuple of float
        Their true values.
    n, interval : int and float
        Number of samples and the time between them, s.
    """
    f = np.arange(1, n) / (2.0 * n * interval)
    slopes = []
    for i, value in enumerate(parameters):
        sides = []
        for factor in (np.exp(1e-4), np.exp(-1e-4)):
            changed = (*parameters[:i], value * factor, *parameters[i + 1 :])
            sides.append(np.log(spectrum(f, *changed)))
        slopes.append((sides[0] - sides[1]) / 2e-4)
    information = 0.5 * np.array(slopes) @ np.array(slopes).T
    return np.sqrt(np.diag(np.linalg.inv(information)))


def butterworth_gain(f: FloatArray, cutoff: float, order: int, interval: float) -> FloatArray:
    """Return |H(f)|² of a low-pass filter whose Butterworth poles s are mapped to p = exp(s Δ), gain 1 at 0."""
    angle = np.pi * (2.0 * np.arange(order) + order + 1.0) / (2.0 * order)
    poles = np.exp(2.0 * np.pi * cutoff * interval * np.exp(1j * angle))
    z = np.exp(-2j * np.pi * f * interval)
    return np.prod([np.abs((1.0 - p) / (1.0 - p * z)) ** 2 for p in poles], axis=0)


def resonance_spectrum(f: FloatArray, frequency: float, quality: float, sd: float) -> FloatArray:
    """Return the two-sided density of a damped oscillator driven by white noise, unit²/Hz."""
    width = frequency / quality
    scale = sd**2 * frequency**2 * width / np.pi
    return scale / ((frequency**2 - f**2) ** 2 + (f * width) ** 2)
