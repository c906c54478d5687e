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
from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.shape import ShapeFit, ShapeTest, ar2, spread

FloatArray = NDArray[np.float64]

LIKE_A_FILTER = 0.9
"""Share of the gain that a low-pass filter must reach to be named for a spectrum that falls all the way."""


@dataclass(frozen=True)
class Colour(Extension):
    """ARMA coefficients of the noise of a sample."""

    cause: ClassVar[str] = "colour"
    meaning: ClassVar[str] = "neighbouring samples are correlated: the fast noise is ARMA, not white"
    consequence: ClassVar[str] = (
        "read the white density at the plateau; a filter at full rate needs shaping states or thinning"
    )
    ar: tuple[float, ...]
    ma: tuple[float, ...]

    def arma(self, interval: float, density: float = 1.0) -> Arma:
        """Return the process whose innovations have the density of white noise."""
        return Arma(self.ar, self.ma, density**2 / interval, interval)

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the factor on the spectrum of white noise."""
        return self.arma(interval).psd(f, interval=interval)


def coefficients(name: str, x: FloatArray) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return AR and MA coefficients of a fitted shape."""
    first = float(np.tanh(x[0]))
    table: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
        "ar1": ((first,), ()),
        "ma1": ((), (first,)),
        "arma11": ((first,), (float(np.tanh(x[-1])),)),
        "ar2": (ar2(x[:2]) if len(x) > 1 else (first,), ()),
        "arma21": (ar2(x[:2]) if len(x) > 1 else (first,), (float(np.tanh(x[-1])),)),
    }
    return table[name]


def test(tested: ShapeTest) -> Alarm:
    """Judge the colours."""
    p_value = min(1.0, 3.0 * min(tested.p_value, tested.misfit, tested.hump_p_value))
    name = "likelihood ratio of an ARMA spectrum"
    if not tested.colours:
        return Alarm("colour", p_value, -9.0, 0.0, name)
    best = tested.colours[0]
    ratio = 2.0 * (tested.null.cost - best.cost)
    gain = tested.gain(best)
    if tested.falling(best) and tested.gain(tested.filters[0]) > LIKE_A_FILTER * gain:
        gain = min(gain, tested.gain(tested.filters[0]) - 1e-6)
    return Alarm("colour", p_value, gain, ratio, name, lambda: (extension(tested, best),))


def extension(tested: ShapeTest, fitted: ShapeFit) -> Colour:
    """Return the process with an interval on every coefficient (by differences through the parameters)."""
    ar, ma = coefficients(fitted.name, fitted.x)
    covariance = spread(tested.data, fitted)
    step = 1e-5
    moved = [
        np.concatenate(coefficients(fitted.name, fitted.x + step * unit)) for unit in np.eye(len(fitted.x))
    ]
    jacobian = (np.stack(moved, axis=1) - np.concatenate((ar, ma))[:, None]) / step
    sd = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)).tolist()
    values = {f"ar_{i + 1}" if len(ar) > 1 else "ar": Value.of(a, sd[i]) for i, a in enumerate(ar)}
    values |= {f"ma_{j + 1}" if len(ma) > 1 else "ma": Value.of(b, sd[len(ar) + j]) for j, b in enumerate(ma)}
    return Colour(ar, ma, values=values)
