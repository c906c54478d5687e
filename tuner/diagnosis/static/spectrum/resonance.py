"""Broad resonance in the binned fast spectrum: an AR(2) process too wide to be compared with its neighbourhood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.effects.static.spectral import Vibration
from models.probability import normal_beyond
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE, curvature, minimum, variance_deviate
from tuner.diagnosis.static.spectrum.binned import Bins, Sizes, rise, sized
from tuner.diagnosis.static.spectrum.filters import arma_power

WIDTHS = (1, 2, 4, 8, 16)
"""Bins of a window, in octaves up to an eighth of the spectrum."""
FREQUENCIES = (0.002, 0.495)
"""Least and largest frequency × interval: within the bins, below the Nyquist frequency 0.5."""
QUALITIES = (1.0, 200.0)
"""Least and largest quality: broader is a filter or a colour, narrower lies within one bin."""


@dataclass(frozen=True)
class ResonanceFit:
    """White noise, quantization and a resonance.

    Attributes
    ----------
    x, covariance : ndarray, shapes (3,), (3, 3)
        Logs of frequency × interval, quality and variance.
    cost : float
        Minus the log likelihood.
    """

    x: FloatArray
    covariance: FloatArray
    cost: float


def scan_resonances(data: Bins, expected: FloatArray) -> tuple[float, float, float]:
    """Return the chance of the clearest excess of 1 … 16 bins over a power, its middle and width, cycles."""
    total = np.concatenate(([0.0], np.cumsum(data.count * data.power / expected)))
    mass = np.concatenate(([0.0], np.cumsum(data.count)))
    best = (np.inf, 0.25, 0.01)
    for width in WIDTHS:
        freedom = mass[width:] - mass[:-width]
        z = variance_deviate((total[width:] - total[:-width]) / freedom, freedom)
        at = int(np.argmax(z))
        chance = len(WIDTHS) * len(z) * normal_beyond(z[at])
        if chance < best[0]:
            middle = float(data.cycles[at : at + width].mean())
            best = (chance, middle, width * float(data.cycles[1] - data.cycles[0]))
    return min(1.0, best[0]), best[1], best[2]


def fit_resonance(data: Bins, middle: float, width: float) -> ResonanceFit:
    """Fit white noise, quantization and a resonance next to a frequency, cycles."""
    background = np.stack((data.white, data.rest, rise(data.cycles)))

    def fitted(x: FloatArray) -> Sizes:
        return sized(data, np.vstack((background, _power(x, data))))

    def cost(x: FloatArray) -> float:
        inside = FREQUENCIES[0] < np.exp(x[0]) < FREQUENCIES[1] and QUALITIES[0] < np.exp(x[1]) < QUALITIES[1]
        return fitted(x).cost if inside else COST_OUTSIDE

    qualities = [
        np.clip(middle / (share * width), 1.1 * QUALITIES[0], 0.9 * QUALITIES[1]) for share in (0.5, 1.5)
    ]
    x, value = minimum(
        cost, [[np.log(middle), float(np.log(q))] for q in qualities], scale=0.1, tolerance=1e-3
    )
    best = fitted(x)
    whole = np.append(x, np.log(max(best.size[-1], 1e-12)))

    def profile(y: FloatArray) -> float:
        return sized(data, background, np.exp(y[2]) * _power(y[:2], data)).cost

    return ResonanceFit(whole, curvature(profile, whole), value)


def _power(x: FloatArray, data: Bins) -> FloatArray:
    """Return the power of a resonance of unit variance: x = logs of frequency × interval and quality."""
    frequency, quality = np.exp(np.clip(x, -20.0, 10.0))
    ar = Vibration(min(float(frequency), 0.4999), float(quality), 1.0).recursion(1.0)
    rho = ar[0] / (1.0 - ar[1])
    return data.interval * (1.0 - ar[1] ** 2) * (1.0 - rho**2) * arma_power(ar, (), data.cycles)
