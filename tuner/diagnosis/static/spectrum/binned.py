"""The fast spectrum in bins, and the best sizes of given shapes of power.

The squared coefficients above a hundredth of the rate are averaged in 128 even bins. Where the variance v of the noise
changes along the record, they are correlated, and count for fewer: by the factor (mean v)²/mean v². The best sizes of
the shapes follow by Fisher scoring (`tuner.diagnosis.static.spectrum.fisher_scoring`). What depends on further
parameters is left with these alone (variable projection).

References
----------
.. [1] G. H. Golub, V. Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
   variables separate, SIAM J. Numer. Anal. 10 (1973).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.arrays import FloatArray
from models.noise import Quantization, White
from models.probability import rounding_variance
from models.robust import MEDIAN_OF_CHI2
from tuner.diagnosis.static.causes.base import Extension, gain_of, hidden_by, power_of
from tuner.diagnosis.static.model.dct import MAX_SQUARE
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, once, once_of_samples
from tuner.diagnosis.static.model.series_statistics import row_medians
from tuner.diagnosis.static.spectrum.fisher_scoring import sizes
from tuner.diagnosis.static.variance.local_variance import course

BIN_COUNT = 128
"""Bins of the fast spectrum; chosen so that each averages hundreds of ordinates of a record of 10⁵ samples."""
MIN_RELATIVE_FREQUENCY = 0.01
"""Lowest frequency, share of the rate; below, slow noise is part of the spectrum."""
PLACES_IN_A_BIN = (np.arange(8) + 0.5) / 8.0
"""Places within a bin at which the gain of a filter is averaged: at its nulls it is not that of the middle."""


@dataclass(frozen=True)
class Bins:
    """Fast spectrum: mean powers in bins of equal width.

    Attributes
    ----------
    interval : float
        Of the samples, s.
    cycles : ndarray, shape (b,)
        Frequency × interval.
    power, count : ndarray, shape (b,)
        Mean square and number of independent coefficients, the same in every bin.
    white, rest, peaks : ndarray, shape (b,)
        Shape of the white noise so far, power of the slow noise, and power that extensions have added.
    rounding : float
        Power of the rounding to codes, step²/12 a sample: it is white whatever the noise before it is.
    model : ndarray, shape (b,)
        Power that the fitted model expects.
    loose : bool
        Whether the size of the peaks is fitted with what is beside them: they were fitted over another shape.
    """

    interval: float
    cycles: FloatArray
    power: FloatArray
    count: FloatArray
    white: FloatArray
    rest: FloatArray
    peaks: FloatArray
    rounding: float
    model: FloatArray
    loose: bool = False

    @cached_property
    def fixed(self) -> FloatArray:
        """Power of the rounding and of peaks of known size, shape (b,)."""
        known = np.zeros_like(self.peaks) if self.loose else self.peaks
        return np.asarray(self.rounding + known, dtype=float)

    def beside(self, rises: bool = True) -> FloatArray:
        """Return the shapes beside the white noise, shape (k, b): slow noise, peaks of free size, quantization."""
        return np.stack((self.rest, *[self.peaks] * self.loose, *[rise(self.cycles)] * rises))

    @property
    def rounding_sd(self) -> float:
        """Standard deviation of the rounding of a sample."""
        return float(np.sqrt(self.rounding / self.interval))

    @property
    def width(self) -> float:
        """Width of a bin, frequency × interval."""
        return float(self.cycles[1] - self.cycles[0])

    @property
    def log_count(self) -> float:
        """Log of the number of coefficients, twice the price of a parameter."""
        return float(np.log(self.count.sum()))


@dataclass(frozen=True)
class Sizes:
    """Best sizes of shapes, the power they expect (b,) and minus its log likelihood (0 where all bins agree)."""

    size: FloatArray
    expected: FloatArray
    cost: float


def bins(fitted: FittedChannel, without: Extension | None = None) -> Bins:
    """Return the fast spectrum of a fitted channel in bins, the shape of one extension not counted as known.

    Without it peaks are known by their form alone: their size was fitted with it.
    """
    dt, n = fitted.channel.interval, len(fitted.coefficients) - 1
    first, width = _range(n)
    inside = slice(first, first + width * BIN_COUNT)
    total = _modelled(fitted)
    cycles = np.asarray((first + (np.arange(BIN_COUNT) + 0.5) * width + 0.5) / (2.0 * (n + 1)), dtype=float)
    within = [cycles + (part - 0.5) * width / (2.0 * (n + 1)) for part in PLACES_IN_A_BIN]
    terms = fitted.fit.terms()
    white = sum(t.density**2 for t in terms if isinstance(t, White))
    quantization = sum((t.increment_sd / dt) ** 2 * dt for t in terms if isinstance(t, Quantization))
    known = tuple(x for x in fitted.extensions if x is not without)
    shaped = any(x.cause in ("lowpass", "colour") for x in known)
    rounding = rounding_variance(fitted.channel.quantizer_step) * dt
    peaks = fitted.peaks[inside]
    if without in fitted.shapes:
        peaks = peaks - fitted.shapes[without][inside]
    peaks = peaks.reshape(BIN_COUNT, width).mean(axis=1)
    explained = power_of(fitted.extensions, cycles / dt, dt) - power_of(known, cycles / dt, dt) + peaks
    rest = (
        total - explained - white * gain_of(fitted.extensions, cycles / dt, dt) - quantization * rise(cycles)
    )
    return Bins(
        dt,
        cycles,
        np.where(hidden_by(known, cycles / dt, dt), total, _measured(fitted)),
        np.full(BIN_COUNT, width / float(np.mean(course(fitted) ** 2))),
        np.mean([gain_of(known, f / dt, dt) for f in within], axis=0),
        np.maximum(rest, 0.0),
        peaks,
        0.0 if shaped else rounding,
        total,
        loose=without is not None and not shaped and bool(peaks.any()),
    )


def _range(n: int) -> tuple[int, int]:
    """Return the first of n coefficients that is binned, and how many are in a bin."""
    first = int(2.0 * MIN_RELATIVE_FREQUENCY * n)
    return first, (n - first) // BIN_COUNT


@once
def _modelled(fitted: FittedChannel) -> FloatArray:
    """Return the expected power in bins, shape (b,)."""
    first, width = _range(len(fitted.coefficients) - 1)
    return fitted.expected_power.means(first, width, BIN_COUNT)


@once_of_samples
def _measured(fitted: FittedChannel) -> FloatArray:
    """Return the squared coefficients in bins, lines cut, shape (b,)."""
    first, width = _range(len(fitted.coefficients) - 1)
    inside = fitted.coefficients[1 + first : 1 + first + width * BIN_COUNT].reshape(BIN_COUNT, width)
    mean = np.empty(BIN_COUNT)
    for number, row in enumerate(inside):
        square = row * row
        mean[number] = np.minimum(square, MAX_SQUARE * row_medians(square[None])[0] / MEDIAN_OF_CHI2).mean()
    return mean


def rise(cycles: FloatArray) -> FloatArray:
    """Return the shape of quantization, 4 sin²(πfΔ)."""
    shape: FloatArray = 4.0 * np.sin(np.pi * cycles) ** 2
    return shape


def sized(data: Bins, shapes: FloatArray, more: FloatArray | float = 0.0) -> Sizes:
    """Return the best non-negative sizes of shapes, shape (k, b), over the rounding, the peaks and more power.

    The second shape is the slow noise, 1 as fitted: lower frequencies do not allow more of it here.
    """
    count, fixed = float(data.count[0]), data.fixed + more
    found = sizes(data.power, count, np.ascontiguousarray(shapes), fixed)
    if found[0][1] <= 1.0:
        return Sizes(*found)
    rest = np.concatenate((shapes[:1], shapes[2:]))
    size, expected, cost = sizes(data.power, count, rest, fixed + shapes[1])
    return Sizes(np.concatenate((size[:1], [1.0], size[1:])), expected, cost)


def costs(data: Bins, first: FloatArray, others: FloatArray) -> FloatArray:
    """Return the costs, shape (g,), of `sized` for each of first shapes, (g, b), with the same others, (k − 1, b)."""
    count, fixed = float(data.count[0]), data.fixed
    shapes, rest, known = (
        np.vstack((first[:1], others)),
        np.vstack((first[:1], others[1:])),
        fixed + others[0],
    )
    out = np.empty(len(first))
    for at, shapes[0] in enumerate(first):
        size, _, out[at] = sizes(data.power, count, shapes, fixed)
        if size[1] > 1.0:
            rest[0] = shapes[0]
            out[at] = sizes(data.power, count, rest, known)[2]
    return out
