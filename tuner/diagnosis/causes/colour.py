"""Colour: ARMA noise in place of white noise that no filter and no quantization explains.

Statistic: as for the low-pass filter; the shapes compete by likelihood and number of parameters.
Extension: the ARMA process in the noise model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from models.arma import Arma
from models.noise import Term, White
from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.bins import Bins
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.forms import colour_arma
from tuner.diagnosis.shape import ShapeFit, ShapeTest, polished

FloatArray = NDArray[np.float64]

LIKE_A_FILTER = 0.9
"""Share of the gain that a low-pass filter must reach to be named for a spectrum that falls all the way."""


@dataclass(frozen=True)
class Colour(Extension):
    """ARMA coefficients of the noise of a sample; `rounding` the sd of codes, scales."""

    cause: ClassVar[str] = "colour"
    meaning: ClassVar[str] = "neighbouring samples are correlated: the fast noise is ARMA, not white"
    consequence: ClassVar[str] = (
        "read the white density at the plateau; a filter at full rate needs shaping states or thinning"
    )
    ar: tuple[float, ...]
    ma: tuple[float, ...]
    rounding: float

    def arma(self, interval: float, density: float = 1.0) -> Arma:
        """Return the process whose innovations have the density of white noise."""
        return Arma(self.ar, self.ma, density**2 / interval, interval)

    def power(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the power of the rounding, which no filter shapes."""
        return np.full_like(f, interval * self.rounding**2)

    def terms(self, interval: float) -> tuple[Term, ...]:
        """Return the rounding as white noise."""
        return (White(self.rounding * float(np.sqrt(interval))),) if self.rounding > 0 else ()

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the factor on the spectrum of white noise."""
        return self.arma(interval).psd(f, interval=interval)


def test(tested: ShapeTest) -> Alarm:
    """Judge the colours."""
    name = "likelihood ratio of an ARMA spectrum"
    if not tested.colours:
        return Alarm("colour", tested.any_p_value, -9.0, 0.0, name)
    best = tested.colours[0]
    ratio = 2.0 * (tested.null.cost - best.cost)
    gain = tested.gain(best)
    if tested.falls(best) and tested.filter_gain > LIKE_A_FILTER * gain:
        gain = min(gain, tested.filter_gain - 1e-6)
    return Alarm("colour", tested.any_p_value, gain, ratio, name, lambda: (extension(tested.data, best),))


def extension(data: Bins, fitted: ShapeFit) -> Colour:
    """Return the process with an interval on every coefficient (by differences through the free numbers)."""
    x, covariance = polished(data, fitted)
    ar, ma = colour_arma(fitted.name, x)
    step = 1e-5
    moved = [np.concatenate(colour_arma(fitted.name, x + step * unit)) for unit in np.eye(len(x))]
    jacobian = (np.stack(moved, axis=1) - np.concatenate((ar, ma))[:, None]) / step
    sd = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)).tolist()
    values = {f"ar_{i + 1}" if len(ar) > 1 else "ar": Value.of(a, sd[i]) for i, a in enumerate(ar)}
    values |= {f"ma_{j + 1}" if len(ma) > 1 else "ma": Value.of(b, sd[len(ar) + j]) for j, b in enumerate(ma)}
    return Colour(ar, ma, data.rounding_sd, values=values)
