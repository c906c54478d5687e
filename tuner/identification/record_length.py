"""How long must a static test be? The Cramér–Rao bound answers for terms, the cluster rule for the curve.

The bound on the logarithms of the parameters of a spectrum S(f; θ) from a record of length T is the inverse of the
Whittle information::

    I_ij = Σ_k ∂ln S(f_k)/∂ln θ_i · ∂ln S(f_k)/∂ln θ_j ,   f_k = k/T ≤ 1/(2 interval)

A ramp has no spectrum: its rate is known to √(2 AVAR(T/2))/(T/2), the spread of the difference of two half
means.
The cluster rule is the classical one, sd(σ)/σ = 1/√(2(T/τ − 1)): 25 % at τ needs nine clusters.

References
----------
.. [1] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2, 1953.
.. [2] IEEE Std 952-1997, Annex C (accuracy of the Allan variance from n/k clusters).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import NoiseModel, Ramp
from models.probability import REACH_95
from tuner.identification.periodogram import MIN_SEGMENT_SAMPLES

MAX_HOURS = 1e5
"""Longest test, h: more than eleven years."""
MIN_ACCURACY = 1e-6
"""Least relative sd: `MAX_HOURS` of white noise at 1 kHz, n samples, show it to 1/√(2n) = 1.2e-6."""
MAX_RELATIVE_SD = 1.0 / REACH_95
"""Relative sd up to which a record shows a term: its amplitude then differs from zero at 95 %."""

LONGEST_HOURS = 10_000.0
"""Beyond this many hours the answer is "more than"."""


@dataclass(frozen=True)
class PlannedParameter:
    """What a test of the planned length shows of one parameter.

    Attributes
    ----------
    name : str
        Such as ``random_walk.density``.
    value : float
        Assumed value, SI.
    relative_sd : float
        Best possible relative standard deviation after the planned hours.
    shown : bool
        Whether the record would show the term at all.
    hours : float or None
        Hours needed for the wanted accuracy; None beyond `LONGEST_HOURS`.
    """

    name: str
    value: float
    relative_sd: float
    shown: bool
    hours: float | None


@dataclass(frozen=True)
class Plan:
    """A planned static test: hours, wanted relative accuracy, each parameter's outcome, and the cluster rule.

    `longest_tau` is the longest cluster time, s, whose Allan deviation reaches the accuracy; `clusters`
    the number it takes.
    """

    hours: float
    accuracy: float
    parameters: tuple[PlannedParameter, ...]
    clusters: int
    longest_tau: float


def plan(model: NoiseModel, *, interval: float, hours: float, accuracy: float) -> Plan:
    """Plan a static test of a sensor with the given noise.

    Parameters
    ----------
    model : NoiseModel
        Noise to expect.
    interval : float
        Sampling interval, s.
    hours : float
        Length of the test, h.
    accuracy : float
        Wanted relative standard deviation, such as 0.1.

    Raises
    ------
    ValueError
        If `hours` is less than `MIN_SEGMENT_SAMPLES` samples or more than `MAX_HOURS`, or `accuracy` not between
        `MIN_ACCURACY` and 1.
    """
    least = MIN_SEGMENT_SAMPLES * interval / 3600.0
    if not least <= hours <= MAX_HOURS:
        raise ValueError(f"hours: expected a number from {least:.3g} to {MAX_HOURS:g}, found {hours:g}")
    if not MIN_ACCURACY <= accuracy < 1:
        raise ValueError(f"accuracy: expected a share from {MIN_ACCURACY:g} to below 1, found {accuracy:g}")
    names, values = _parameters(model)
    sd = relative_sd(model, interval=interval, span=3600.0 * hours)
    needed = _hours_needed(model, interval, accuracy)
    clusters = int(np.ceil(1.0 + 0.5 / accuracy**2 - 1e-9))
    return Plan(
        hours,
        accuracy,
        tuple(
            PlannedParameter(name, value, float(s), bool(s <= MAX_RELATIVE_SD), h)
            for name, value, s, h in zip(names, values, sd, needed, strict=True)
        ),
        clusters,
        3600.0 * hours / clusters,
    )


def relative_sd(model: NoiseModel, *, interval: float, span: float) -> FloatArray:
    """Return the Cramér–Rao relative sd of each parameter, in the order of the model's terms, shape (p,)."""
    spectral = [term for term in model.terms if not isinstance(term, Ramp)]
    bound: list[float] = []
    if spectral:
        f, count = _fourier_grid(interval, span)
        spectrum = np.sum([term.psd(f, interval=interval) for term in spectral], axis=0)
        gradient = np.vstack([term.psd_gradient(f, interval=interval) for term in spectral]) / spectrum
        information = (gradient * count) @ gradient.T
        scale = np.sqrt(np.diag(information))  # a hidden term has next to no information: keep the digits
        bound = list(np.sqrt(np.diag(np.linalg.inv(information / np.outer(scale, scale)))) / scale)
    noise = NoiseModel(tuple(spectral))
    answers: list[float] = []
    for term in model.terms:
        if isinstance(term, Ramp):
            half = 0.5 * span
            variance = float(noise.allan_variance(np.array([half]))[0])
            answers.append(float(np.sqrt(2.0 * variance)) / half / term.rate)
        else:
            answers += [bound.pop(0) for _ in term.PARAMETERS]
    return np.array(answers)


def _parameters(model: NoiseModel) -> tuple[list[str], list[float]]:
    pairs = [
        (f"{term.name}.{field}", float(getattr(term, field)))
        for term in model.terms
        for field in term.PARAMETERS
    ]
    return [name for name, _ in pairs], [value for _, value in pairs]


def _fourier_grid(interval: float, span: float) -> tuple[FloatArray, FloatArray]:
    """Return frequencies, Hz, and the number of Fourier frequencies in each (log-spaced) bin."""
    last = int(span / interval) // 2
    edges = np.unique(np.round(np.geomspace(1, last + 1, 600)).astype(np.int64))
    first, beyond = edges[:-1], edges[1:]
    return np.asarray(0.5 * (first + beyond - 1) / span, float), np.asarray(beyond - first, float)


def _hours_needed(model: NoiseModel, interval: float, accuracy: float) -> list[float | None]:
    """Return the hours after which each parameter is known to an accuracy; at least the shortest test."""
    hours = np.geomspace(MIN_SEGMENT_SAMPLES * interval / 3600.0, LONGEST_HOURS, 161)
    sd = np.array([relative_sd(model, interval=interval, span=3600.0 * h) for h in hours])
    answers: list[float | None] = []
    for column in sd.T:
        reached = np.flatnonzero(column <= accuracy)
        if reached.size == 0:
            answers.append(None)
        elif reached[0] == 0:
            answers.append(float(hours[0]))
        else:
            k = reached[0]
            share = np.log(column[k - 1] / accuracy) / np.log(column[k - 1] / column[k])
            answers.append(float(hours[k - 1] * (hours[k] / hours[k - 1]) ** share))
    return answers
