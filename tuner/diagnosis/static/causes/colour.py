"""Colour: ARMA noise in place of white noise that no filter and no quantization explains.

Statistic: as for the low-pass filter; the shapes compete by likelihood and number of parameters.
Extension: the ARMA process in the noise model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.effects.static.spectral import Colour as Effect
from models.noise.arma import Arma
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.shaped_white_noise import ShapedWhiteNoise
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.spectrum.binned import Bins
from tuner.diagnosis.static.spectrum.filters import MAX_FREE_NUMBER, Coefficients, colour_arma
from tuner.diagnosis.static.spectrum.shape import ShapeFit, ShapeTest, fit_colour, refit_colour

MAX_INTERVAL_WIDTH = 2.0
"""Width of the interval of a coefficient from which it is not estimable: stationary ones lie between −1 and 1.

Colour and quantization are then not separable.
"""
EDGE_DISTANCE = 0.01
"""Distance from the edge of a stationary process within which a colour is none: it stands for another shape."""
MIN_FILTER_GAIN_SHARE = 0.9
"""Share of the gain of a colour that a low-pass filter must reach to be named, where the spectrum falls all the way.

Chosen because sensors have filters: a colour must be clearly better.
"""


@dataclass(frozen=True)
class Colour(ShapedWhiteNoise):
    """ARMA coefficients of the noise of a sample; `rounding` the sd of codes, scales."""

    cause = "colour"
    effect = Effect
    tested_with = "lowpass"
    excludes = ("lowpass",)
    meaning = "neighbouring samples are correlated: the fast noise is ARMA, not white"
    consequence = (
        "read the white density at the plateau; a filter at full rate needs shaping states or thinning"
    )
    ar: tuple[float, ...]
    ma: tuple[float, ...]

    def arma(self, interval: float, density: float = 1.0) -> Arma:
        """Return the process whose innovations have the density of white noise."""
        return Arma(self.ar, self.ma, density**2 / interval, interval)


def test(tested: ShapeTest) -> TestResult:
    """Test for ARMA noise in place of white noise."""
    name = "likelihood ratio of an ARMA spectrum"
    inside = [c for c in tested.colours if np.all(np.abs(c.x) < MAX_FREE_NUMBER - EDGE_DISTANCE)]
    if not inside:
        return TestResult("colour", tested.any_p_value, NO_GAIN, 0.0, name)
    best = inside[0]
    ratio = 2.0 * (tested.null.cost - best.cost)
    gain = tested.gain(best)
    if tested.falls(best) and tested.filter_gain > MIN_FILTER_GAIN_SHARE * gain:
        gain = min(gain, tested.filter_gain - 1e-6)
    return TestResult(
        "colour", tested.any_p_value, gain, ratio, name, lambda: (extension(tested.data, best),)
    )


def extension(data: Bins, fitted: ShapeFit) -> Colour:
    """Return the process with an interval on every coefficient.

    Where quantization is not worth its price beside the colour it may still be there, and takes a part of what the
    colour seems to be: intervals reach to the ends of those with quantization free.
    """
    (ar, ma), sds = _estimated(data, fitted)
    values = [Value.of(value, sd) for value, sd in zip((*ar, *ma), sds, strict=True)]
    if not fitted.rises:
        (more_ar, more_ma), more_sds = _estimated(data, fit_colour(data, fitted.name))
        free = [Value.of(value, sd) for value, sd in zip((*more_ar, *more_ma), more_sds, strict=True)]
        values = [
            one.union(other) if other.upper - other.lower < MAX_INTERVAL_WIDTH else one
            for one, other in zip(values, free, strict=True)
        ]
    names = [f"ar_{i + 1}" if len(ar) > 1 else "ar" for i in range(len(ar))]
    names += [f"ma_{j + 1}" if len(ma) > 1 else "ma" for j in range(len(ma))]
    return Colour(data.rounding_sd, ar, ma, values=dict(zip(names, values, strict=True)))


def _estimated(data: Bins, fitted: ShapeFit) -> tuple[Coefficients, list[float]]:
    """Return the coefficients of a colour and the sd of each (by differences through the free numbers)."""
    x, covariance = refit_colour(data, fitted)
    ar, ma = colour_arma(fitted.name, x)
    step = 1e-5
    moved = [np.concatenate(colour_arma(fitted.name, x + step * unit)) for unit in np.eye(len(x))]
    jacobian = (np.stack(moved, axis=1) - np.concatenate((ar, ma))[:, None]) / step
    variance = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    return (ar, ma), np.sqrt(np.where(variance >= 0.0, variance, np.inf)).tolist()
