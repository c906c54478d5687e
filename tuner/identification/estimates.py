"""From fitted parameters to what a user sees: every term with its coefficients, their intervals or bounds.

The four ways to coefficients (`likelihood`, `leastsquares`, `slopes`, and a tabulated curve) end in one form,
`Estimates`: the model, the logarithms' covariance, and one `TermEstimate` a term.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import POWER_LAW, NoiseModel, Term
from models.probability import normal_reach
from tuner.identification.slopes import Segment
from tuner.types import LEVEL, Coefficient, TermEstimate

Interval = tuple[float, float]

BASE: dict[str, Term] = {kind.name: kind(**{kind.PARAMETERS[0]: 1.0}) for kind in POWER_LAW}
"""The terms whose Allan variance is one power of τ, of unit amplitude, in the order of their slopes."""

ALLOWS_NONE = {True: "requested, but the data allow none of it", False: "the data allow none of it"}


@dataclass(frozen=True)
class Estimates:
    """Fitted terms in the form of a result.

    Attributes
    ----------
    model : NoiseModel
        Sum of the terms that have values.
    terms : tuple of TermEstimate
        Every fitted term.
    parameters : tuple of str
        Names of the parameters of `model`.
    covariance : ndarray, shape (p, p)
        Of the logarithms of the parameters; NaN where the method gives none.
    """

    model: NoiseModel
    terms: tuple[TermEstimate, ...]
    parameters: tuple[str, ...]
    covariance: FloatArray

    def with_terms(self) -> list[tuple[TermEstimate, Term | None]]:
        """Return every estimate with its term of the model; None where the term is absent."""
        present = iter(self.model.terms)
        return [(estimate, next(present) if estimate.present else None) for estimate in self.terms]


def from_fit(
    model: NoiseModel, covariance: FloatArray, intervals: Sequence[Interval], unit: str, *, forced: bool
) -> Estimates:
    """Return the estimates of a fit with intervals.

    Parameters
    ----------
    model : NoiseModel
        Fitted terms.
    covariance : ndarray, shape (p, p)
        Of the logarithms of all their parameters.
    intervals : sequence of (float, float)
        95 % interval of each parameter.
    unit : str
        Unit of the samples.
    forced : bool
        Whether the terms were requested, not found.

    Returns
    -------
    Estimates
        A term whose amplitude may be zero is a bound, or nothing where the data set no limit.
    """
    terms: list[TermEstimate] = []
    kept: list[Term] = []
    rows: list[int] = []
    at = 0
    for term in model.terms:
        size = len(term.PARAMETERS)
        ends = intervals[at : at + size]
        units = term.units(unit)
        absent = ends[0][0] <= 0.0
        coefficients = {
            name: Coefficient(None, None, high if high < np.inf else None, u, ALLOWS_NONE[forced])
            if absent
            else Coefficient.known(float(getattr(term, name)), low, high, u)
            for name, (low, high), u in zip(term.PARAMETERS, ends, units, strict=True)
        }
        terms.append(TermEstimate(term.name, coefficients))
        if not absent:
            kept.append(term)
            rows += range(at, at + size)
        at += size
    remaining = NoiseModel(tuple(kept))
    return Estimates(remaining, tuple(terms), remaining.parameters, covariance[np.ix_(rows, rows)])


def from_segments(estimates: Estimates, segments: Sequence[Segment]) -> Estimates:
    """Return estimates whose coefficients are read off the segments; a term without a segment is bounded.

    Terms that have no segment by nature (Gauss–Markov, …) keep their coefficients.
    """
    read = {segment.term: segment for segment in segments}
    spread = 2.0 * normal_reach(LEVEL)
    terms: list[TermEstimate] = []
    kept: list[Term] = []
    variances: list[float] = []
    for estimate, term in estimates.with_terms():
        if term is None:
            terms.append(estimate)
            continue
        (name, own), *others = estimate.coefficients.items()
        segment = read.get(estimate.name)
        if estimate.name not in BASE:
            kept.append(term)
            variances += [np.nan] * (1 + len(others))
            terms.append(estimate)
        elif segment is not None:
            low, high = segment.interval
            kept.append(term.scaled(segment.value / float(getattr(term, name))))
            variances.append((np.log(high / low) / spread) ** 2)
            coefficient = Coefficient.known(segment.value, low, high, own.unit, _stretch(segment))
            terms.append(TermEstimate(estimate.name, {name: coefficient}))
        else:
            upper = own.interval[1] if own.interval else np.inf
            missing = Coefficient.bounded(upper, own.unit, "no stretch of the curve has its slope")
            terms.append(TermEstimate(estimate.name, {name: missing}))
    model = NoiseModel(tuple(kept))
    return Estimates(model, tuple(terms), model.parameters, np.diag(variances))


def _stretch(segment: Segment) -> str:
    low, high = segment.tau
    return f"read on the stretch {low:.3g} … {high:.3g} s of slope {segment.slope:+g}"
