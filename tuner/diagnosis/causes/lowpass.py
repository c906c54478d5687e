"""Low-pass: the sensor's own filter, or an anti-alias filter, shapes the white noise.

Statistic: likelihood ratio of first-order colour on the bins of the fast spectrum (χ²₁, two shapes), or
their scatter about white noise.
Extension: the filter in the noise model; the white density is read where the filter is flat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from models.arma import Arma
from tuner.diagnosis.alarm import Alarm
from tuner.diagnosis.extension import Extension, Value
from tuner.diagnosis.shape import ShapeFit, ShapeTest, filter_arma, spread

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LowPass(Extension):
    """ARMA of unit gain at frequency 0 in place of white noise; `cutoff` in Hz."""

    cause: ClassVar[str] = "lowpass"
    meaning: ClassVar[str] = (
        "a low-pass filter shapes the white noise: the Allan curve starts flatter than −1/2"
    )
    consequence: ClassVar[str] = (
        "read the white density beyond ten filter time constants; samples closer together are not independent"
    )
    kind: str
    cutoff: float

    def arma(self, interval: float, density: float = 1.0) -> Arma:
        """Return the filtered white noise as an ARMA term."""
        ar, ma = filter_arma(self.kind, self.cutoff * interval)
        gain = (1.0 + sum(ma)) / (1.0 - sum(ar))
        return Arma(ar, _invertible(ma), density**2 / interval / gain**2, interval)

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the squared response of the filter."""
        return self.arma(interval).psd(f, interval=interval)


def _invertible(ma: tuple[float, ...]) -> tuple[float, ...]:
    """Return MA coefficients with a zero on the unit circle moved just inside."""
    return tuple(0.9995 ** (j + 1) * b for j, b in enumerate(ma))


def test(tested: ShapeTest, interval: float) -> Alarm:
    """Judge the filters."""
    p_value = min(1.0, 3.0 * min(tested.p_value, tested.misfit, tested.hump_p_value))
    name = "likelihood ratio of a filtered spectrum"
    if not tested.filters:
        return Alarm("lowpass", p_value, -9.0, 0.0, name)
    best = tested.filters[0]
    ratio = 2.0 * (tested.null.cost - best.cost)
    return Alarm(
        "lowpass", p_value, tested.gain(best), ratio, name, lambda: (extension(tested, best, interval),)
    )


def extension(tested: ShapeTest, fitted: ShapeFit, interval: float) -> LowPass:
    """Return the filter with its cutoff."""
    cutoff = float(np.exp(fitted.x[0])) / interval
    relative = float(np.sqrt(spread(tested.data, fitted)[0, 0]))
    return LowPass(fitted.name, cutoff, values={"cutoff": Value.log(cutoff, relative, "Hz")})
