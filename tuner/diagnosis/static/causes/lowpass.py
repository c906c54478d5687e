"""Low-pass: the sensor's own filter, or an anti-alias filter, shapes the white noise.

Statistic: likelihood ratio of first-order colour on the bins of the fast spectrum (χ²₁, two shapes), or
their scatter about white noise.
Extension: the filter in the noise model; the white density is read where the filter is flat. The cutoff is fitted again
with everything that was found besides; its interval covers all orders and kinds of filter that explain the spectrum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from models.arrays import BoolArray, FloatArray
from models.effects.static.spectral import LowPass as Effect
from models.noise.arma import Arma
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.shaped_white_noise import ShapedWhiteNoise
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.spectrum.binned import Bins, bins
from tuner.diagnosis.static.spectrum.falling_curve import (
    CURVE,
    HALF_POWER,
    curve_power,
    curve_recursion,
    falling_curve,
)
from tuner.diagnosis.static.spectrum.filters import (
    filter_arma,
    filter_kind,
    filter_power,
    is_mean,
)
from tuner.diagnosis.static.spectrum.shape import ShapeFit, ShapeTest, cutoffs, fit_filters
from tuner.formats.customary_units import digits

if TYPE_CHECKING:
    from tuner.diagnosis.static.model.fitted_channel import FittedChannel


MIN_INTERVAL_CHANGE = 0.05
"""Share of its length by which an interval must move for the model to be fitted again: 0.2 sd of the cutoff."""

MOTION_BELOW = 2.0
"""Cutoff below which a filter takes motion away, Hz: the steps of a walk come at 2 Hz, a vehicle sways at 1 to 2 Hz,
and turns and brakes within a second."""
FILTERED_BESIDES = 0.1
"""Cutoff × interval below which a filter takes more than sampling does: the mean over one interval, 0.44, keeps all
motion that is integrated, and one of this cutoff is longer than four intervals."""


@dataclass(frozen=True)
class LowPass(ShapedWhiteNoise):
    """ARMA of unit gain at frequency 0 in place of white noise; `cutoff` in Hz, `rounding` the sd of codes, scales."""

    cause = "lowpass"
    effect = Effect
    excludes = ("colour",)
    meaning = "a low-pass filter shapes the white noise: the Allan curve starts flatter than −1/2"
    consequence = (
        "read the white density beyond ten filter time constants; samples closer together are not independent"
    )
    kind: str
    cutoff: float
    response: tuple[float, ...] = ()
    """Squared response in bins, of a filter that is known as a curve."""

    def arma(self, interval: float, density: float = 1.0) -> Arma:
        """Return the filtered white noise as an ARMA term."""
        ar, ma = (
            (curve_recursion(np.array(self.response)), ())
            if self.response
            else filter_arma(self.kind, self.cutoff * interval)
        )
        gain = (1.0 + sum(ma)) / (1.0 - sum(ar))
        return Arma(ar, _invertible(ma), density**2 / interval / gain**2, interval)

    @property
    def order(self) -> int:
        """Number of poles; 0 of a filter without any."""
        return 0 if self.response or is_mean(self.kind) else filter_kind(self.kind)[0]

    def gain(self, f: FloatArray, interval: float) -> FloatArray:
        """Return the squared response of the filter, in closed form where an ARMA blurs its nulls or edges."""
        if self.response:
            return curve_power(np.array(self.response), np.asarray(f) * interval)
        if is_mean(self.kind):
            return filter_power(self.kind, self.cutoff * interval, np.asarray(f) * interval)
        return super().gain(f, interval)

    def delay(self, interval: float) -> float:
        """Return how late slow motion is in samples every `interval`, s: the least of any filter of this response, s.

        Minus the slope of the phase at frequency 0 of the filter whose zeros and poles are inside the unit circle.
        """
        shape = self.arma(interval)
        above, below = np.array([1.0, *shape.ma]), np.array([1.0, *(-a for a in shape.ar)])
        mean = [float(np.arange(c.size) @ c / c.sum()) for c in (above, below)]
        return interval * (mean[0] - mean[1])

    def in_motion(self, interval: float) -> str:
        """Return how fast motion must be to be lost, and how late it is, where the filter is that slow."""
        if self.cutoff >= min(MOTION_BELOW, FILTERED_BESIDES / interval):
            return ""
        delay = digits(self.delay(interval), 1)
        return f"motion faster than {digits(self.cutoff, 2)} Hz is lost, delay at least {delay} s: record it unfiltered"

    def hides(self, f: FloatArray, interval: float) -> BoolArray | bool:
        """Return whether less than half of the white noise passes a sharp filter.

        What is there is not noise of its own: behind a resampler it is the image of what passed, so that its variance
        swings with the clock of the resampler, and in a deep stop band it leaks from the ends of the record.
        """
        return self.gain(f, interval) < HALF_POWER if self.response else False

    def refit(self, fitted: FittedChannel, index: int) -> LowPass:
        """Fit the filter again beside everything else, unless that hardly moves it."""
        data = bins(fitted, without=fitted.extensions[index])
        filters = fit_filters(data)
        again = extension(data, filters)
        value, now = self.values["cutoff"], again.values["cutoff"]
        moved = max(abs(np.log(now.lower / value.lower)), abs(np.log(now.upper / value.upper)))
        near = moved < MIN_INTERVAL_CHANGE * np.log(value.upper / value.lower)
        return self if near and again.kind == self.kind else again


def _invertible(ma: tuple[float, ...]) -> tuple[float, ...]:
    """Return MA coefficients with a zero on the unit circle moved just inside."""
    return tuple(0.9995 ** (j + 1) * b for j, b in enumerate(ma))


def test(tested: ShapeTest) -> TestResult:
    """Test for white noise that passed a low-pass filter."""
    name = "likelihood ratio of a filtered spectrum"
    if not tested.filters:
        return TestResult("lowpass", tested.any_p_value, NO_GAIN, 0.0, name)
    best = tested.filters[0]
    ratio = 2.0 * (tested.null.cost - best.cost)
    return TestResult(
        "lowpass",
        tested.any_p_value,
        tested.filter_gain,
        ratio,
        name,
        lambda: (extension(tested.data, tested.filters),),
    )


def extension(data: Bins, filters: tuple[ShapeFit, ...]) -> LowPass:
    """Return the best filter with its cutoff."""
    rate = 1.0 / data.interval
    curve = falling_curve(data) if filters[0].name == CURVE else None
    if curve is not None:
        cutoff, reach = rate * curve.cutoff, rate * curve.reach
        known = {"cutoff": Value(cutoff, max(cutoff - reach, 0.0), cutoff + reach, "Hz")}
        return LowPass(data.rounding_sd, CURVE, cutoff, tuple(curve.response.tolist()), values=known)
    low, high = (rate * float(np.exp(end)) for end in cutoffs(data, filters))
    cutoff = rate * float(np.exp(filters[0].x[0]))
    return LowPass(
        data.rounding_sd, filters[0].name, cutoff, values={"cutoff": Value(cutoff, low, high, "Hz")}
    )
