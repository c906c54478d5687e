"""Bounds on the noise of an axis whose quantizer hides it, from the codes that its samples take.

Samples y = x + e of a step q have |e| ≤ q/2. Where e is not independent of x (noise below 0.35 q), the variance of y
may be anything from none to that of codes that alternate, and e wanders with the mean between two codes. Two
neighbouring cluster means of e differ by q at most, so its Allan deviation is at most q/√2 at every τ::

    N ≤ max(0.35 q √τ0, N of y),    σ_term(τ) ≤ σ_term of y(τ) + q/√2    for each other term

A term of y is one of x where it rises above q/√2, which no e does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray
from models.noise import NoiseModel, Term, White
from tuner.identification.estimates import BASE, Estimates
from tuner.readers.value_checks import WELL_DITHERED
from tuner.types import Coefficient, TermEstimate
from tuner.types.coefficient import HIDDEN

MAX_ERROR_DEVIATION = float(np.sqrt(0.5))
"""Largest Allan deviation of the error of a quantizer, steps."""


def as_bounds(estimates: Estimates, step: float, tau: FloatArray, interval: float) -> Estimates:
    """Return the estimates of an axis that its quantizer limits, as bounds where the step can hide or make a term.

    Parameters
    ----------
    estimates : Estimates
        Terms of the codes.
    step : float
        Of the quantizer, unit.
    tau : ndarray, shape (k,)
        Cluster times of the measured curve, s.
    interval : float
        Sampling interval, s.
    """
    hidden = MAX_ERROR_DEVIATION * step
    terms: list[TermEstimate] = []
    kept: list[Term] = []
    rows: list[int] = []
    at = 0
    for estimate, term in estimates.with_terms():
        size = 0 if term is None else len(term.PARAMETERS)
        rises = term is not None and np.max(term.allan_variance(tau, interval=interval)) > hidden**2
        if term is not None and rises and estimate.name != White.name:
            terms.append(estimate)
            kept.append(term)
            rows += range(at, at + size)
        else:
            terms.append(_bounded(estimate, step, tau, interval))
        at += size
    remaining = NoiseModel(tuple(kept))
    return Estimates(remaining, tuple(terms), remaining.parameters, estimates.covariance[np.ix_(rows, rows)])


def bounds_of(
    terms: Sequence[TermEstimate], step: float, tau: FloatArray, interval: float
) -> list[TermEstimate]:
    """Return terms that the codes lack, with bounds that allow for what the quantizer hides."""
    return [_bounded(term, step, tau, interval) for term in terms]


def _bounded(estimate: TermEstimate, step: float, tau: FloatArray, interval: float) -> TermEstimate:
    coefficients = {}
    for place, (name, found) in enumerate(estimate.coefficients.items()):
        upper = found.upper if found.interval is None else found.interval[1]
        if upper is not None and place == 0:
            upper = _largest(estimate.name, upper, step, tau, interval)
        reason = f"{HIDDEN}: steps of {step:.4g}"
        coefficients[name] = Coefficient(None, None, upper, found.unit, reason)
    return TermEstimate(estimate.name, coefficients)


def _largest(name: str, amplitude: float, step: float, tau: FloatArray, interval: float) -> float:
    """Return the largest amplitude of a term of the noise whose codes have one up to `amplitude`."""
    if name == White.name:
        return max(amplitude, WELL_DITHERED * step * float(np.sqrt(interval)))
    unit = BASE.get(name)
    most = 1.0 if unit is None else float(np.sqrt(np.max(unit.allan_variance(tau, interval=interval))))
    return amplitude + MAX_ERROR_DEVIATION * step / most
