"""Where in frequency a record is what noise terms describe: filters and vibration spoil its upper end.

Most sensors pass their samples through a digital low-pass filter, and a table is never quite still. Above the
corner, or about a peak, no sum of the base terms fits, and since nearly all coefficients of a record lie
there, a likelihood of the whole band would bend the slow terms to please it. So the highest frequency is sought up to
which the mean powers of octaves are white noise plus anything slow (quantization too, where all samples take part),
within one percent of the deviation: the base terms with Gauss–Markov processes of fixed, long time constants,
amplitudes free. Where all samples take part shorter ones may join, if white noise beside them is clear: what has passed
a filter has none. The powers of octaves are independent, and a peak stays in its own octave, while the Allan variance
of one cluster time takes in some of every frequency. Of a curve without a record its octaves are tested as if
they were powers.

Where octaves up to 1/(2 τ) agree, the likelihood uses the frequencies f ≤ 1/(4 τ), away from what begins above, and
the curve the octaves from 4 τ on. What was left out is for a diagnosis to name.

References
----------
.. [1] R. J. Vaccaro, A. S. Zaki, Statistical modeling of rate gyros, IEEE Trans. Instrum. Meas. 61, 2012
   (sensors whose white noise is not white to the end).
.. [2] E. B. Wilson, M. M. Hilferty, The distribution of chi-square, Proc. Natl. Acad. Sci. 17 (1931).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from models.arrays import FloatArray
from models.noise import BiasInstability, GaussMarkov, Quantization, Ramp, RandomWalk, Term, White
from models.probability import chi2_beyond
from tuner.identification.allan_octaves import OctaveCurve
from tuner.identification.expected_periodogram import expected_power
from tuner.identification.nonnegative import nonnegative
from tuner.identification.periodogram import FALSE_ALARMS, CosinePeriodogram

CURVE_TOLERANCE = 0.01
"""Relative deviation from a sum of terms that is tolerated of every sensor."""


_TOLERATED_VARIANCE = (2.0 * CURVE_TOLERANCE) ** 2
"""Relative variance of a power that the tolerance grants."""

_MIN_OCTAVES = 6
"""Fewest octaves that must be left."""

_MIN_SLOW_CLUSTERS = 50.0
"""Time constants of the slow processes, in shortest clusters: below they could pass for a filter."""
_MIN_FAST_SAMPLES = 10.0
"""Time constants of processes beside clear white noise, in samples: a filter as slow has its corner at rate/63."""
_MIN_WHITE_SHARE = 0.1
"""Share of the power of the highest octave from which white noise is clear: ten times the tolerance."""
_WEIGHT_PASSES = 8
"""Fits of amplitudes, each with weights by the powers of the one before.

The last changes these by less than 0.1 % where a band agrees, else by up to 3 %.
"""
_LEAST_POWER_RATIO = 1e-3
"""Fitted ÷ measured power of an octave below which it has the weight that belongs to this ratio."""


_TIME_RATIO = np.sqrt(2.0)
"""Factor from one of their time constants to the next: a sum of them is within one percent, the tolerance, of a
process between two of them at every cluster time (1.2 % for a factor of 1.5, 32 % for one of 10)."""


@dataclass(frozen=True)
class Band:
    """The part of a record that the terms are fitted to.

    Attributes
    ----------
    m : int
        Cluster size whose 1/(2 τ) is the highest frequency that agrees; 1 where all samples take part.
    highest : float
        Highest frequency of the likelihood, Hz; infinite where all samples take part.
    ratio : float
        Root of the power of the highest octave of the samples ÷ what the terms, fitted to the band, say.
    """

    m: int
    highest: float
    ratio: float


@dataclass(frozen=True)
class Octaves:
    """Powers of a record at octaves of frequency, or the octaves of an Allan curve, shortest clusters first.

    Attributes
    ----------
    m : ndarray, shape (k,)
        Cluster sizes: a power is that of the frequencies from 1/(4mτ0) to 1/(2mτ0).
    power : ndarray, shape (k,)
        Mean power, unit²/Hz, or Allan variance, unit².
    dof : ndarray, shape (k,)
        Degrees of freedom of each.
    longest : int
        Samples of the longest segment.
    interval : float
        Sampling interval τ0, s.
    of_term : callable
        What a term adds to each power, shape (k,).
    """

    m: FloatArray
    power: FloatArray
    dof: FloatArray
    longest: int
    interval: float
    of_term: Callable[[Term], FloatArray]

    @classmethod
    def of_periodogram(cls, data: CosinePeriodogram) -> Octaves:
        """Take the mean of the cells of each octave."""
        number = np.maximum(np.floor(np.log2(0.5 / (data.interval * data.frequency))), 0.0)
        octaves = np.unique(number)
        count = (number == octaves[:, None]) * data.count
        dof = count.sum(axis=1)

        def of_term(term: Term) -> FloatArray:
            cells = data.line**2 if isinstance(term, Ramp) else expected_power(term, data)[0]
            return np.asarray(count @ cells / dof)

        power = np.maximum(count @ data.power / dof, np.finfo(float).eps * data.power.max())  # rounding
        return cls(2.0**octaves, power, dof, round(data.longest / data.interval), data.interval, of_term)

    @classmethod
    def of_curve(cls, curve: OctaveCurve) -> Octaves:
        """Take the octaves as if they were independent, with the degrees of freedom of white noise."""
        dof = np.maximum(1.2 * sum(curve.lengths) / curve.m, 1.5)

        def of_term(term: Term) -> FloatArray:
            return term.allan_variance(curve.tau, interval=curve.interval)

        m = curve.m.astype(float)
        return cls(m, curve.variance, dof, max(curve.lengths), curve.interval, of_term)


def find_band(measured: Octaves) -> Band:
    """Find the highest octave up to which a record is white noise plus anything slow.

    Where none is accepted, the one that fits best is taken.
    """
    tried: list[tuple[float, int, Band]] = []
    m = 1
    while np.sum(measured.m >= m) >= _MIN_OCTAVES or m == 1:
        p_value, band, _ = _plausible(measured, m, _MIN_SLOW_CLUSTERS * m)
        tried.append((p_value, m, band))
        if p_value >= FALSE_ALARMS:
            return band
        if m == 1:
            p_value, band, white_share = _plausible(measured, m, _MIN_FAST_SAMPLES)
            if p_value >= FALSE_ALARMS and white_share >= _MIN_WHITE_SHARE:
                return band
        m *= 2
    return max(tried, key=lambda trial: trial[:2])[2]


def narrowed(measured: Octaves, band: Band) -> Band | None:
    """Return the next band of longer clusters, or None where too few octaves would be left."""
    m = 2 * band.m
    if np.sum(measured.m >= m) < _MIN_OCTAVES:
        return None
    return _plausible(measured, m, _MIN_SLOW_CLUSTERS * m)[1]


def curve_within(curve: OctaveCurve, band: Band) -> OctaveCurve:
    """Return the octaves of the band."""
    inside = curve.m >= (1 if band.m == 1 else 4 * band.m)
    return replace(curve, m=curve.m[inside], variance=curve.variance[inside])


def periodogram_within(data: CosinePeriodogram, band: Band) -> CosinePeriodogram:
    """Return the cells of the band."""
    inside = data.frequency <= band.highest
    others = ("interval", "law_variance", "lines")
    cells = {f.name: getattr(data, f.name)[inside] for f in fields(data) if f.name not in others}
    lines = tuple(line for line in data.lines if line[0] <= band.highest)
    return replace(data, **cells, lines=lines)


def _plausible(measured: Octaves, m: int, shortest: float) -> tuple[float, Band, float]:
    """Return the probability of the octaves from m on, with slow processes of so many samples and more, and their band.

    And the share of white noise in the highest octave of all. Octaves below the corner 1/(2πT) of a slow process may
    have any power: a daily wave, say. The cube root of a mean of squares is nearly normal [2]_.
    """
    shapes = np.stack([measured.of_term(term) for term in _slow_terms(measured, m, shortest)], axis=1)
    inside = (measured.m >= m) & (measured.m < np.pi * _MIN_SLOW_CLUSTERS * m)
    power, spread = measured.power[inside], 2.0 / (9.0 * measured.dof[inside])
    sd = np.sqrt(spread + _TOLERATED_VARIANCE / 9.0)
    fitted = power
    for _ in range(_WEIGHT_PASSES):
        weight = 1.0 / (sd * fitted)
        shares = nonnegative(shapes[inside] * weight[:, None], weight * power)
        fitted = np.maximum(shapes[inside] @ shares, _LEAST_POWER_RATIO * power)
    residual = (np.cbrt(power / fitted) - 1.0 + spread) / sd
    freedom = max(len(power) - int(np.count_nonzero(shares)), 1)
    highest = max(float(shapes[0] @ shares), _LEAST_POWER_RATIO * float(measured.power[0]))
    ratio = float(np.sqrt(measured.power[0] / highest))
    band = Band(m, np.inf if m == 1 else 0.25 / (m * measured.interval), ratio)
    return chi2_beyond(float(residual @ residual), freedom), band, float(shapes[0, 0] * shares[0]) / highest


def _slow_terms(measured: Octaves, m: int, shortest: float) -> list[Term]:
    """Return white noise and what can stand for any slow process, of unit amplitude, above cluster size m.

    Gauss–Markov processes have time constants of at least `shortest` samples.
    """
    terms: list[Term] = [White(1.0), BiasInstability(1.0), RandomWalk(1.0), Ramp(1.0)]
    if m == 1:
        terms.append(Quantization(1.0))
    number = np.floor(np.log(0.1 * measured.longest / shortest) / np.log(_TIME_RATIO)) + 1.0
    times = shortest * measured.interval * _TIME_RATIO ** np.arange(number)
    return [*terms, *(GaussMarkov(1.0, float(time)) for time in times)]
