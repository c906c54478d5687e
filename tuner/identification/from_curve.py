"""Noise terms from an Allan curve alone, published or measured, where no samples exist.

Generalised least squares of ln AVAR with the full covariance of overlapping estimates
(`tuner.identification.allan_leastsquares`) needs the length of the record behind the curve. A column of degrees of
freedom tells it: at the longest τ, flicker noise has v = 5u²/(4(u + 3)) for u = T/τ. Without one, T = 2τ is
taken, the shortest record that has such a point, which makes the intervals as wide as they can be.

Terms are added one at a time, each the one that lowers −2 ln L most, as long as the fall exceeds the
95 % point of the largest of as many boundary tests as terms are tried. As with samples, short clusters that no
sum of terms describes are left out (`tuner.identification.valid_band`).

References
----------
.. [1] C. A. Greenhall and W. J. Riley, Uncertainty of stability variances based on finite differences,
   PTTI 35, 2003 (equivalent degrees of freedom).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import (
    POWER_LAW,
    TERMS,
    NoiseModel,
    Term,
    White,
)
from models.noise.bias_instability import ALLAN_FLOOR
from models.probability import chi2_quantile
from tuner.identification.allan_leastsquares import CurveFit, fit, log_covariance
from tuner.identification.allan_octaves import OctaveCurve
from tuner.identification.estimates import Estimates, from_fit
from tuner.identification.identify_channel import about_band, contradiction, disagreement
from tuner.identification.objective import expect_terms
from tuner.identification.valid_band import Band, Octaves, curve_within, find_band
from tuner.types import (
    AllanCurve,
    Candidate,
    ChannelIdentification,
    Coefficient,
    Identification,
    TermEstimate,
)
from tuner.types.records import DataError

FALSE_TERM = 0.05
"""Probability of a term too many at one step of the selection."""

_SAMPLES_PER_FIRST_TAU = 8
"""Sampling intervals assumed within the shortest τ where the τ are no whole multiples of it."""


@dataclass(frozen=True)
class _Tried:
    terms: tuple[str, ...]
    fit: CurveFit
    score: float


def identify_curve(
    curve: AllanCurve, *, source: str = "", terms: Sequence[str] | None = None
) -> Identification:
    """Fit noise terms to an overlapping Allan curve.

    Parameters
    ----------
    curve : AllanCurve
        One axis or more; `dof` NaN where unknown.
    source : str, optional
        Name of the file.
    terms : sequence of str, optional
        Fit exactly this sum instead of choosing one.

    Raises
    ------
    DataError
        If the curve has fewer than three octaves, or no curve is fitted by the terms.
    """
    expect_terms(terms)
    channels = {axis: _identify_axis(curve.axis(axis), terms) for axis in curve.axes}
    known = bool(np.isfinite(curve.dof).all())
    note = (
        "fitted to a curve: the length of the record follows from the stated degrees of freedom"
        if known
        else "fitted to a curve without degrees of freedom: intervals assume the shortest record "
        "that reaches "
        "the longest τ"
    )
    return Identification({"name": source or "curve", "files": [source] if source else []}, channels, (note,))


def record_span(curve: AllanCurve) -> float:
    """Return the length of the record behind a curve, s (see the module's page)."""
    tau, v = float(curve.tau[-1]), float(curve.dof[-1, 0])
    if not math.isfinite(v):
        return 2.0 * tau
    ratio = 0.4 * v * (1.0 + math.sqrt(1.0 + 15.0 / v))  # u of v = 5u²/(4(u + 3))
    return max(2.0, ratio) * tau


def _identify_axis(curve: AllanCurve, terms: Sequence[str] | None) -> ChannelIdentification:
    whole = _octaves(curve)
    band = find_band(Octaves.of_curve(whole)) if terms is None else Band(1, np.inf, 1.0)
    octaves = curve_within(whole, band)
    if terms is not None:
        chosen = fit(octaves, NoiseModel(tuple(_start(TERMS[name]) for name in terms)), generalised=True)
        bounds: tuple[TermEstimate, ...] = ()
        candidates: tuple[Candidate, ...] = ()
    else:
        tried = _select(octaves)
        chosen = tried[-1].fit
        bounds = _bounds(octaves, chosen, curve.unit)
        candidates = tuple(Candidate(t.terms, t.score, "tried") for t in tried)
    estimates = from_fit(
        chosen.model, chosen.covariance, chosen.intervals, curve.unit, forced=terms is not None
    )
    order = [cls.name for cls in POWER_LAW]
    shown = sorted(
        (*estimates.terms, *bounds), key=lambda t: order.index(t.name) if t.name in order else len(order)
    )
    apart = contradiction(whole, band, estimates.model)
    warnings = (*about_band(band, octaves.interval), *(() if apart is None else disagreement(apart)))
    return _channel(curve, octaves, estimates, tuple(shown), candidates, chosen, warnings)


def _channel(
    curve: AllanCurve,
    octaves: OctaveCurve,
    estimates: Estimates,
    terms: tuple[TermEstimate, ...],
    candidates: tuple[Candidate, ...],
    chosen: CurveFit,
    warnings: tuple[str, ...],
) -> ChannelIdentification:
    span = octaves.interval * octaves.lengths[0]
    dof = _dof(curve, octaves, chosen)
    whole = AllanCurve(curve.estimator, curve.tau, curve.variance, dof[:, None], curve.unit, curve.axes)
    deviation, (low, high) = whole.deviation()[:, 0], (limit[:, 0] for limit in whole.interval())
    at = int(np.argmin(deviation))
    return ChannelIdentification(
        axis=curve.axes[0],
        unit=curve.unit,
        interval=octaves.interval,
        span=span,
        method="curve",
        model=estimates.model,
        terms=terms,
        parameters=estimates.parameters,
        covariance=estimates.covariance,
        mean=Coefficient(None, None, None, curve.unit, "an Allan curve cannot show a constant"),
        sigma_10s=_interpolated(whole, 10.0),
        minimum=Coefficient.known(float(deviation[at]), float(low[at]), float(high[at]), curve.unit),
        floor=Coefficient.known(
            float(deviation[at]) / ALLAN_FLOOR,
            float(low[at]) / ALLAN_FLOOR,
            float(high[at]) / ALLAN_FLOOR,
            curve.unit,
        ),
        minimum_tau=float(curve.tau[at]),
        allan=whole,
        candidates=candidates,
        warnings=warnings,
    )


def _octaves(curve: AllanCurve) -> OctaveCurve:
    """Thin the curve to octaves up to a quarter of the record, as whole multiples of an assumed interval."""
    multiples = curve.tau / curve.tau[0]
    whole = np.allclose(multiples, np.round(multiples), rtol=1e-3)
    interval = float(curve.tau[0]) / (1 if whole else _SAMPLES_PER_FIRST_TAU)
    span = record_span(curve)
    usable = np.flatnonzero(curve.tau <= 0.25 * span * (1 + 1e-9))
    wanted = float(curve.tau[0]) * 2.0 ** np.arange(64)
    nearest = (
        {int(usable[np.argmin(np.abs(np.log(curve.tau[usable] / t)))]) for t in wanted}
        if usable.size
        else set()
    )
    picked = np.array(sorted(nearest), dtype=np.int64)
    if picked.size < 3:
        raise DataError(
            f"the curve: expected three octaves of τ or more, found {picked.size}; give a longer curve"
        )
    m = np.round(curve.tau[picked] / interval).astype(np.int64)
    return OctaveCurve(m, curve.variance[picked, 0], (int(span / interval),), interval)


def _start(term: type[Term]) -> Term:
    """Return a term of unit parameters: amplitudes are found anew, time constants start at 100 s."""
    values = (100.0 if unit == "s" else 1.0 for unit in term.UNITS)
    return term(**dict(zip(term.PARAMETERS, values, strict=True)))


def _select(octaves: OctaveCurve) -> list[_Tried]:
    accepted = [_try(octaves, (White,))]
    while len(accepted[-1].terms) < min(len(POWER_LAW), len(octaves.m) - 1):
        used = accepted[-1].terms
        rest = [term for term in POWER_LAW if term.name not in used]
        best = min(
            (_try(octaves, (*(TERMS[n] for n in used), term)) for term in rest), key=lambda tried: tried.score
        )
        # The amplitude is at its boundary under the null: half of χ²₁; the largest of len(rest) tests.
        if accepted[-1].score - best.score <= chi2_quantile(1.0 - 2.0 * FALSE_TERM / len(rest), 1.0):
            break
        accepted.append(best)
    return accepted


def _try(octaves: OctaveCurve, terms: Sequence[type[Term]]) -> _Tried:
    found = fit(octaves, NoiseModel(tuple(_start(term) for term in terms)), generalised=True)
    _, sigma = log_covariance(found.model, octaves)
    score = found.statistic + float(np.linalg.slogdet(sigma)[1])
    return _Tried(tuple(term.name for term in terms), found, score)


def _bounds(octaves: OctaveCurve, chosen: CurveFit, unit: str) -> tuple[TermEstimate, ...]:
    bounds = []
    for term in POWER_LAW:
        if any(present.name == term.name for present in chosen.model.terms):
            continue
        wider = fit(octaves, NoiseModel((*chosen.model.terms, _start(term))), generalised=True)
        field = term.PARAMETERS[0]
        reason = "absent: adding it does not improve the fit of the curve"
        limit = Coefficient.bounded(wider.intervals[-1][1], _start(term).units(unit)[0], reason)
        bounds.append(TermEstimate(term.name, {field: limit}))
    return tuple(bounds)


def _dof(curve: AllanCurve, octaves: OctaveCurve, chosen: CurveFit) -> FloatArray:
    """Return the stated degrees of freedom, or those of the fitted model interpolated between octaves."""
    stated = curve.dof[:, 0]
    if np.isfinite(stated).all():
        return stated
    tau = octaves.tau
    interpolated = np.exp(np.interp(np.log(curve.tau), np.log(tau), np.log(chosen.dof)))
    beyond = curve.tau > tau[-1]
    interpolated[beyond] = np.maximum(1.0, chosen.dof[-1] * tau[-1] / curve.tau[beyond])
    return np.asarray(interpolated, float)


def _interpolated(curve: AllanCurve, tau: float) -> Coefficient:
    if not curve.tau[0] <= tau <= curve.tau[-1]:
        return Coefficient(None, None, None, curve.unit, f"the curve has no point at {tau:g} s")
    low, high = curve.interval()
    value, below, above = (
        float(np.exp(np.interp(np.log(tau), np.log(curve.tau), np.log(column[:, 0]))))
        for column in (curve.deviation(), low, high)
    )
    return Coefficient.known(value, below, above, curve.unit)
