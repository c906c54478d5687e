"""Maximum-likelihood fit of a given sum of noise terms, with intervals.

`fit` summarises the record once (`periodogram`), maximises the likelihood of the sum (`objective`) and
puts an interval on every parameter (`intervals`). The rate of a ramp is the one parameter that may be
negative; its interval is the profile likelihood over every noise that could have made the line, so it is
wide where a random walk does as well. Sinusoids are taken out first (`lines`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.noise import NoiseModel, Ramp, Sinusoid, Term
from models.probability import REACH_95
from tuner.identification.intervals import interval as score_interval
from tuner.identification.law_of_samples import variance_by_law
from tuner.identification.objective import Objective
from tuner.identification.periodogram import CosinePeriodogram, cosine_periodogram
from tuner.identification.sinusoids import Line, line_sd, take_out_line

Interval = tuple[float, float]


@dataclass(frozen=True)
class LikelihoodFit:
    """Terms fitted to a record.

    Attributes
    ----------
    terms : tuple of str
        Names of the terms, the ramp and sinusoids last.
    names : tuple of str
        Parameters, such as ``white.density``; a second Gauss–Markov term has ``gauss_markov_2.sd`` and so on.
    estimate : ndarray, shape (p,)
        Natural logs of the parameters.
    covariance : ndarray, shape (p, p)
        Covariance of the logs by the Fisher information and the law of the samples; huge where the data do not hold
        the parameter.
    intervals : tuple of (float, float)
        95 % interval of each parameter: from 0 where the data allow none, to inf where they set no limit.
    log_likelihood : float
        Up to a constant that all fits to the same record share.
    slope : float
        Rate of the ramp with its sign, 0 without a ramp.
    model : NoiseModel
        The same as a noise model.
    """

    terms: tuple[str, ...]
    names: tuple[str, ...]
    estimate: FloatArray
    covariance: FloatArray
    intervals: tuple[Interval, ...]
    log_likelihood: float
    slope: float
    model: NoiseModel

    def value(self, name: str) -> float:
        """Return a parameter by its name."""
        return float(np.exp(self.estimate[self.names.index(name)]))

    def interval(self, name: str) -> Interval:
        """Return the 95 % interval of a parameter by its name."""
        return self.intervals[self.names.index(name)]


def fit(pieces: Sequence[FloatArray], interval: float, terms: Sequence[str]) -> LikelihoodFit:
    """Fit a given sum of terms to gap-free segments of one channel.

    Parameters
    ----------
    pieces : sequence of ndarray
        Samples of each segment, unit.
    interval : float
        Sampling interval, s.
    terms : sequence of str
        Names of terms; a Gauss–Markov term or a sinusoid may come more than once.

    Returns
    -------
    LikelihoodFit

    Raises
    ------
    ValueError
        If a term is unknown, or all pieces are too short or constant.
    """
    lines, rest = take_out_lines(pieces, interval, list(terms).count(Sinusoid.name))
    noise = [name for name in terms if name != Sinusoid.name]
    data = replace(cosine_periodogram(rest, interval), law_variance=variance_by_law(rest, interval))
    return with_lines(fit_periodogram(data, noise), lines, rest, interval)


def take_out_lines(
    pieces: Sequence[FloatArray], interval: float, number: int
) -> tuple[list[Line], list[FloatArray]]:
    """Return the sinusoids that stand out most, so many of them, and the segments without them."""
    lines, rest = [], list(pieces)
    for _ in range(number):
        line, rest = take_out_line(rest, interval)
        lines.append(line)
    return lines, rest


def with_lines(
    found: LikelihoodFit, lines: Sequence[Line], rest: Sequence[FloatArray], interval: float
) -> LikelihoodFit:
    """Return a fit to segments without sinusoids with those that were taken out of them."""
    for line in lines:
        density = float(found.model.psd(np.array([line.frequency]), interval=interval)[0])
        found = _with_line(found, line, line_sd(line, density, rest, interval))
    return found


def fit_periodogram(data: CosinePeriodogram, terms: Sequence[str]) -> LikelihoodFit:
    """Fit a given sum of terms, other than sinusoids, to a cosine periodogram; see `fit`."""
    objective = Objective.of(data, terms)
    return describe(objective, objective.maximum())


def describe(objective: Objective, theta: FloatArray) -> LikelihoodFit:
    """Return the fit whose maximum is at these logs of the parameters."""
    terms: list[Term] = []
    names: list[str] = []
    at = 0
    for number, kind in enumerate(objective.kinds):
        repeat = objective.kinds[:number].count(kind)
        label = kind.name if not repeat else f"{kind.name}_{repeat + 1}"
        size = len(kind.PARAMETERS)
        terms.append(kind(*np.exp(theta[at : at + size]).tolist()))
        names += [f"{label}.{parameter}" for parameter in kind.PARAMETERS]
        at += size
    normal, by_law = objective.covariances(theta)
    covariance = normal + by_law
    intervals = [score_interval(objective, theta, j) for j in range(len(theta))]
    log_likelihood = objective.log_likelihood(theta)
    slope = 0.0
    if objective.columns.size:
        slope, slope_sd = _slope(objective, theta)
        intervals.append(magnitude(slope_interval(objective, theta)))
        rate = max(abs(slope), 1e-6 * slope_sd)
        terms.append(Ramp(rate))
        names.append("ramp.rate")
        covariance = np.pad(covariance, (0, 1))
        covariance[-1, -1] = (slope_sd / rate) ** 2
        theta = np.append(theta, np.log(rate))
    kinds = tuple(term.name for term in terms)
    model = NoiseModel(tuple(terms))
    return LikelihoodFit(
        kinds, tuple(names), theta, covariance, tuple(intervals), log_likelihood, slope, model
    )


def _with_line(found: LikelihoodFit, line: Line, sd: FloatArray) -> LikelihoodFit:
    """Return the fit with one more sinusoid, whose errors are independent of the rest."""
    repeat = found.terms.count(Sinusoid.name)
    label = Sinusoid.name if not repeat else f"{Sinusoid.name}_{repeat + 1}"
    covariance = np.pad(found.covariance, (0, 2))
    covariance[[-2, -1], [-2, -1]] = sd**2
    values = np.array([line.amplitude, line.frequency])
    low, high = values * (1.0 - REACH_95 * sd), values * (1.0 + REACH_95 * sd)
    return replace(
        found,
        terms=(*found.terms, Sinusoid.name),
        names=(*found.names, f"{label}.amplitude", f"{label}.frequency"),
        estimate=np.append(found.estimate, np.log(values)),
        covariance=covariance,
        intervals=(
            *found.intervals,
            *((max(float(a), 0.0), float(b)) for a, b in zip(low, high, strict=True)),
        ),
        model=found.model + Sinusoid(*values.tolist()),
    )


def magnitude(ends: Interval) -> Interval:
    """Return the interval of |x| for an interval of x."""
    low, high = sorted((abs(ends[0]), abs(ends[1])))
    return (0.0 if ends[0] <= 0.0 <= ends[1] else low), high


def slope_interval(objective: Objective, theta: FloatArray) -> Interval:
    """Return where the likelihood, the noise refitted for each slope, is not refuted at 95 %, that is, by χ²₁.

    Parameters
    ----------
    objective : Objective
        Terms with a ramp, and data.
    theta : ndarray, shape (p,)
        Logs of the parameters at the maximum.

    Returns
    -------
    (float, float)
        Ends of the interval, unit/s.
    """
    centre, sd = _slope(objective, theta)

    def value(slope: float) -> float:
        return objective.with_size(0, slope).minimise(theta)[1]

    best = value(centre)
    return _reach(value, centre, -sd, best + REACH_95**2), _reach(value, centre, sd, best + REACH_95**2)


def _slope(objective: Objective, theta: FloatArray) -> tuple[float, float]:
    """Return the rate of the ramp and its standard error."""
    size, covariance = objective.sizes(objective.expected(theta)[0])
    return float(size[0]), float(covariance[0, 0] ** 0.5)


def _reach(value: Callable[[float], float], centre: float, step: float, goal: float) -> float:
    """Return where a function that rises from `centre` along `step` reaches `goal`, by bisection."""
    far = 2.0
    while value(centre + far * step) < goal and far < 1e4:
        far *= 2.0
    near = 0.0 if far == 2.0 else 0.5 * far
    while far - near > 0.01 * far:
        middle = 0.5 * (near + far)
        near, far = (middle, far) if value(centre + middle * step) < goal else (near, middle)
    return centre + far * step
