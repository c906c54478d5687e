"""No single term may explain more than was measured: each stays below the Allan deviation of its record.

The Allan variances of independent terms add, so the variance of one term exceeds the measured one only by the scatter
of that. A coefficient whose term lies above the upper limit of the measured deviation anywhere, from the shortest
cluster that the terms describe, is lowered to that limit, with the cluster time as its reason.

The limit is that of one point (95 %) where χ² already contradicts the sum of terms. Elsewhere it holds for all points
together, with 0.1 % of false alarms a record: a true N crosses the 95 % limit of a single long cluster time in one of
five clean records, and must not be corrected by a number a hundred times less certain than itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.noise import NoiseModel, Term
from models.probability import chi2_quantile
from tuner.identification.estimates import Estimates
from tuner.identification.periodogram import FALSE_ALARMS
from tuner.types import LEVEL, AllanCurve, TermEstimate


def below_the_curve(
    estimates: Estimates, allan: AllanCurve, interval: float, *, shortest: float, contradicted: bool
) -> Estimates:
    """Return estimates none of whose terms lies above the measured Allan deviation.

    Parameters
    ----------
    estimates : Estimates
        Fitted terms of one axis.
    allan : AllanCurve
        Measured curve of that axis.
    interval : float
        Sampling interval, s.
    shortest : float
        Shortest cluster time that the terms describe, s.
    contradicted : bool
        Whether χ² contradicts the sum of terms.
    """
    described = allan.tau >= shortest
    if not described.any():
        return estimates
    tail = 0.5 * (1.0 - LEVEL) if contradicted else FALSE_ALARMS / np.count_nonzero(described)
    dof = allan.dof[described, 0]
    limit = allan.variance[described, 0] * dof / chi2_quantile(tail, dof)
    tau = allan.tau[described]
    terms: list[TermEstimate] = []
    kept: list[Term] = []
    for estimate, term in estimates.with_terms():
        if term is None:
            terms.append(estimate)
            continue
        excess = term.allan_variance(tau, interval=interval) / limit
        worst = int(np.argmax(excess))
        factor = float(excess[worst]) ** -0.5
        if factor >= 1.0:
            terms.append(estimate)
            kept.append(term)
        else:
            terms.append(_lowered(estimate, factor, float(tau[worst])))
            kept.append(term.scaled(factor))
    model = NoiseModel(tuple(kept))
    return Estimates(model, tuple(terms), estimates.parameters, estimates.covariance)


def _lowered(estimate: TermEstimate, factor: float, tau: float) -> TermEstimate:
    """Return the estimate with its amplitude, the first parameter, and the interval of that multiplied."""
    (name, amplitude), *others = estimate.coefficients.items()
    assert amplitude.value is not None
    assert amplitude.interval is not None
    value = factor * amplitude.value
    reason = (
        f"{amplitude.value:.4g} was fitted; {factor:.3g} of it is the most that the Allan deviation "
        f"at {tau:.3g} s allows"
    )
    lowered = replace(amplitude, value=value, interval=(factor * amplitude.interval[0], value), reason=reason)
    return TermEstimate(estimate.name, {name: lowered, **dict(others)})
