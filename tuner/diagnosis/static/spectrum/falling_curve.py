"""White noise behind a filter that no formula of the catalogue describes: a curve that falls, as measured.

Filters with a finite impulse response (windowed sinc, half-band, equal ripple) have a passband, a transition and a stop
band of any form. The spectrum in bins is fitted by the likeliest curve that nowhere rises [1]_, for means of
exponential ordinates the monotonic regression by least squares; in the stop band, where next to nothing passes, it is
what was measured, ripple included. It is taken for a filter where it falls faster than one pole does, and where nothing
but noise is above or below it in the passband: a resonance falls, too, and rises before.

References
----------
.. [1] T. Robertson, F. T. Wright, R. L. Dykstra, Order Restricted Statistical Inference, ch. 1.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.optimize import isotonic_regression

from models.arrays import FloatArray
from models.probability import REACH_95, chi2_beyond
from tuner.diagnosis.static.spectrum.binned import BIN_COUNT, MIN_RELATIVE_FREQUENCY, Bins

CURVE = "curve"
"""Name of such a filter."""
STOP_BAND = 1e-3
"""Power, of that in the passband, below which ripple counts as part of the filter: nothing there moves a mean."""
HALF_POWER, TENTH_POWER = 0.5, 0.1
"""Powers, of that in the passband, between which the steepness of the fall is measured."""
ONE_POLE_RATIO = 3.0
"""Frequency at a tenth of the power ÷ that at half of it, of one pole: 1/(1 + (f/cutoff)²)."""
FLAT_SHARE = 0.5
"""Share of the cutoff below which the power is averaged for that of the passband: the first level is the highest."""
PASSBAND_P_VALUE = 1e-6
"""Chance of the scatter of the bins in the passband below which something else than a filter shapes it."""
LEAST_POWER = 1e-7
"""Power, of that in the passband, where nothing passes: what the ends of a record leak there."""
RECURSION_ORDER = 32
"""Coefficients of the recursion in its place: a quarter of the bins, so that it does not follow their noise."""
GRID_CYCLES = (
    MIN_RELATIVE_FREQUENCY + (0.5 - MIN_RELATIVE_FREQUENCY) * (np.arange(BIN_COUNT) + 0.5) / BIN_COUNT
)
"""Middle of each bin, frequency × interval, of a long record."""


@dataclass(frozen=True)
class FallingCurve:
    """Squared response of a filter in bins.

    Attributes
    ----------
    response : ndarray, shape (b,)
        Power in each bin ÷ that in the passband.
    expected : ndarray, shape (b,)
        Expected power, with the slow noise and the rounding.
    cost : float
        Minus the log likelihood.
    numbers : int
        Free numbers: levels that differ.
    cutoff, reach : float
        Frequency × interval at half the power, and half of its 95 % interval.
    """

    response: FloatArray
    expected: FloatArray
    cost: float
    numbers: int
    cutoff: float
    reach: float


def falling_curve(data: Bins) -> FallingCurve | None:
    """Return the likeliest curve of white noise that nowhere rises; None where it falls no faster than behind one pole.

    The slow noise beside it is as fitted, or none: what was fitted to the filter's own fall is no slow noise.
    """
    found = [one for share in (1.0, 0.0) if (one := _beside(data, share)) is not None]
    return min(found, key=lambda one: one.cost, default=None)


def _beside(data: Bins, share: float) -> FallingCurve | None:
    """Return the curve beside a share of the slow noise."""
    known = share * data.rest + data.rounding + data.peaks
    white = data.power - known
    monotonic = isotonic_regression(white, weights=data.count, increasing=False).x
    level = float(monotonic[0])
    if level <= 0.0 or monotonic[-1] >= TENTH_POWER * level:
        return None
    flat = data.cycles < FLAT_SHARE * _crossing(data.cycles, monotonic / level, HALF_POWER)
    level = float(white[flat].mean()) if flat.any() else level
    if level <= 0.0:
        return None
    ends = [_crossing(data.cycles, monotonic / level, part) for part in (HALF_POWER, TENTH_POWER)]
    if ends[1] > ONE_POLE_RATIO * ends[0]:
        return None
    response = monotonic / level
    measured = response < STOP_BAND
    numbers = len(np.unique(response[~measured])) + int(measured.sum())
    response[measured] = white[measured] / level
    response = np.maximum(response, LEAST_POWER)
    expected = level * response + known
    ratio = data.power / expected
    deviance = data.count * (ratio - 1.0 - np.log(ratio))
    passed = response > HALF_POWER
    if chi2_beyond(deviance[passed].sum(), passed.sum()) < PASSBAND_P_VALUE:
        return None
    at = int(np.searchsorted(data.cycles, ends[0]))
    near = slice(max(at - 2, 0), at + 2)
    fall = float(np.log(response[near][0] / response[near][-1])) / float(np.ptp(data.cycles[near]))
    noise = REACH_95 * float(np.sqrt(2.0 / data.count[at]))
    reach = 0.5 * data.width + noise / max(fall, 1e-9)
    return FallingCurve(response, expected, 0.5 * float(deviance.sum()), numbers, ends[0], reach)


def _crossing(cycles: FloatArray, response: FloatArray, share: float) -> float:
    """Return where a curve that falls passes a share, between two bins evenly in the log of the power."""
    after = int(np.argmax(response < share))
    before = max(after - 1, 0)
    logs = np.log(np.maximum(response[[after, before]], LEAST_POWER))
    return float(np.interp(np.log(share), logs, cycles[[after, before]]))


def curve_recursion(response: FloatArray) -> tuple[float, ...]:
    """Return AR coefficients of white noise behind such a filter, from its covariance (Yule and Walker).

    A recursion from a covariance is stationary, whatever the curve.
    """
    even = np.arange(4 * BIN_COUNT) / (4.0 * BIN_COUNT)
    power = np.maximum(curve_power(response, np.minimum(even, 1.0 - even)), STOP_BAND)
    covariance = np.fft.ifft(power).real[: RECURSION_ORDER + 1]
    return tuple(solve_toeplitz(covariance[:-1], covariance[1:]).tolist())


def curve_power(response: FloatArray, cycles: FloatArray) -> FloatArray:
    """Return the squared response at frequencies × interval, between the bins evenly in its log."""
    return np.asarray(np.exp(np.interp(cycles, GRID_CYCLES, np.log(response))))
