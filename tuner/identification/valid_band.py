"""Where in frequency a record is what noise terms describe: filters and vibration spoil its upper end.

Most sensors pass their samples through a digital low-pass filter, and a table is never quite still. Above the
corner, or about a peak, no sum of the base terms fits, and since nearly all coefficients of a record lie
there, a likelihood of the whole band would bend the slow terms to please it. So the shortest cluster
time is sought from which the Allan curve is white noise plus anything slow (quantization too, where all
samples take part), within one percent: the base terms with Gauss–Markov processes of fixed, long time
constants, amplitudes free. Where all samples take part shorter ones may join, if white noise beside them is clear: what
has passed a filter has none.

The likelihood then uses the frequencies f ≤ 1/(4 τ), the curve the octaves from τ on. What was left out
is for a diagnosis to name.

References
----------
.. [1] R. J. Vaccaro, A. S. Zaki, Statistical modeling of rate gyros, IEEE Trans. Instrum. Meas. 61, 2012
   (sensors whose white noise is not white to the end).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.special import polygamma

from models.arrays import FloatArray
from models.noise import BiasInstability, GaussMarkov, NoiseModel, Quantization, Ramp, RandomWalk, Term, White
from models.probability import chi2_beyond
from tuner.curves import dof as dof_of
from tuner.identification.allan_leastsquares import log_bias
from tuner.identification.allan_octaves import OctaveCurve, nonnegative
from tuner.identification.periodogram import FALSE_ALARMS, CosinePeriodogram

CURVE_TOLERANCE = 0.01
"""Relative deviation from a sum of terms that is tolerated of every sensor."""


_TOLERATED_VARIANCE = (2.0 * CURVE_TOLERANCE) ** 2
"""Variance of ln AVAR that the tolerance grants."""

_NEIGHBOUR_CORRELATION = 0.5
"""Correlation of ln AVAR at neighbouring octaves, as of white noise; slower noise has more, which makes the
test milder."""

_CLUSTER_RATIO = 4
"""Factor by which the shortest cluster grows from one trial band to the next."""
_MIN_OCTAVES = 6
"""Fewest octaves that must be left."""

_MIN_SLOW_CLUSTERS = 50.0
"""Time constants of the slow processes, in shortest clusters: below they could pass for a filter."""
_MIN_FAST_SAMPLES = 10.0
"""Time constants of processes beside clear white noise, in samples: a filter as slow has its corner at rate/63."""
_MIN_WHITE_SHARE = 0.1
"""Share of the Allan variance of the samples from which white noise is clear: ten times the tolerance."""

_TIME_RATIO = np.sqrt(2.0)
"""Factor from one of their time constants to the next: a sum of them is within one percent, the tolerance, of a
process between two of them at every cluster time (1.2 % for a factor of 1.5, 32 % for one of 10)."""


@dataclass(frozen=True)
class Band:
    """The part of a record that the terms are fitted to.

    Attributes
    ----------
    m : int
        Smallest cluster size of the curve; 1 where all samples take part.
    highest : float
        Highest frequency of the likelihood, Hz; infinite where all samples take part.
    ratio : float
        Measured Allan deviation of the samples ÷ what the terms, fitted to the band, say.
    """

    m: int
    highest: float
    ratio: float


def find_band(curve: OctaveCurve) -> Band:
    """Find the shortest cluster time from which a curve is white noise plus anything slow.

    Where no cluster time is accepted, the one that fits best is taken.
    """
    tried: list[tuple[float, int, float]] = []
    m = 1
    while np.sum(curve.m >= m) >= _MIN_OCTAVES or m == 1:
        p_value, ratio, _ = _plausible(curve, m, _MIN_SLOW_CLUSTERS * m)
        tried.append((p_value, m, ratio))
        if p_value >= FALSE_ALARMS:
            break
        if m == 1:
            p_value, ratio, white_share = _plausible(curve, m, _MIN_FAST_SAMPLES)
            if p_value >= FALSE_ALARMS and white_share >= _MIN_WHITE_SHARE:
                return Band(1, np.inf, ratio)
        m *= _CLUSTER_RATIO
    _, m, ratio = max(tried, key=lambda trial: (trial[0], trial[1]))
    return Band(m, np.inf if m == 1 else 0.25 / (m * curve.interval), ratio)


def narrowed(curve: OctaveCurve, band: Band) -> Band | None:
    """Return the next band of longer clusters, or None where too few octaves would be left."""
    m = band.m * _CLUSTER_RATIO
    if np.sum(curve.m >= m) < _MIN_OCTAVES:
        return None
    _, ratio, _ = _plausible(curve, m, _MIN_SLOW_CLUSTERS * m)
    return Band(m, 0.25 / (m * curve.interval), ratio)


def curve_within(curve: OctaveCurve, band: Band) -> OctaveCurve:
    """Return the octaves of the band."""
    inside = curve.m >= band.m
    return replace(curve, m=curve.m[inside], variance=curve.variance[inside])


def periodogram_within(data: CosinePeriodogram, band: Band) -> CosinePeriodogram:
    """Return the cells of the band."""
    inside = data.frequency <= band.highest
    others = ("interval", "law_variance", "lines")
    cells = {f.name: getattr(data, f.name)[inside] for f in fields(data) if f.name not in others}
    lines = tuple(line for line in data.lines if line[0] <= band.highest)
    return replace(data, **cells, lines=lines)


def _plausible(curve: OctaveCurve, m: int, shortest: float) -> tuple[float, float, float]:
    """Return the probability of the curve from m on, with slow processes of so many samples and more.

    And, of the samples, measured ÷ fitted deviation, and the share of white noise in their fitted Allan variance.
    """
    cut = replace(curve, m=curve.m[curve.m >= m], variance=curve.variance[curve.m >= m])
    terms = _slow_terms(curve, m, shortest)
    dof = np.maximum(1.2 * sum(curve.lengths) / cut.m, 1.5)
    shares = nonnegative(terms, cut, 1.0 / np.sqrt(2.0 / dof + _TOLERATED_VARIANCE))
    model = NoiseModel(
        tuple(t.scaled(float(np.sqrt(s))) for t, s in zip(terms, shares, strict=True) if s > 0.0)
    )
    dof = _dof(cut, model)
    sd = np.sqrt(polygamma(1, 0.5 * dof))
    apart = np.abs(np.subtract.outer(np.arange(len(dof)), np.arange(len(dof))))
    sigma = np.outer(sd, sd) * _NEIGHBOUR_CORRELATION**apart
    mean = model.allan_variance(np.append(cut.tau, curve.interval), interval=curve.interval)
    residual = np.log(cut.variance) - log_bias(dof) - np.log(mean[:-1])
    statistic = float(residual @ np.linalg.solve(sigma + _TOLERATED_VARIANCE * np.eye(len(cut.m)), residual))
    freedom = max(len(cut.m) - len(model.terms), 1)
    white = float(shares[0] * terms[0].allan_variance(np.array([curve.interval]), interval=curve.interval)[0])
    return (
        chi2_beyond(statistic, freedom),
        float(np.sqrt(curve.variance[0] / mean[-1])),
        white / float(mean[-1]),
    )


def _dof(curve: OctaveCurve, model: NoiseModel) -> FloatArray:
    """Return the degrees of freedom of a pooled curve."""
    total = np.zeros(len(curve.m))
    for length, number in zip(*np.unique(curve.lengths, return_counts=True), strict=True):
        fits = 2 * curve.m <= length
        total[fits] += number * dof_of("oadev", int(length), curve.m[fits], model, interval=curve.interval)
    return total


def _slow_terms(curve: OctaveCurve, m: int, shortest: float) -> list[Term]:
    """Return white noise and what can stand for any slow process, of unit amplitude, above cluster size m.

    Gauss–Markov processes have time constants of at least `shortest` samples.
    """
    terms: list[Term] = [White(1.0), BiasInstability(1.0), RandomWalk(1.0), Ramp(1.0)]
    if m == 1:
        terms.append(Quantization(1.0))
    number = np.floor(np.log(0.1 * max(curve.lengths) / shortest) / np.log(_TIME_RATIO)) + 1.0
    times = shortest * curve.interval * _TIME_RATIO ** np.arange(number)
    return [*terms, *(GaussMarkov(1.0, float(time)) for time in times)]
