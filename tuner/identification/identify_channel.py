"""One axis of a record: curve, terms, coefficients by the chosen method, and warnings.

The terms are chosen by the likelihood whatever the method of the coefficients, so that methods differ in
numbers and not in what they call noise. Where the Allan curve, judged with its full covariance,
disagrees with the fitted sum, a warning says at which τ: there is something in the data that the terms
do not describe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.noise import TERMS, GaussMarkov, NoiseModel, Quantization, Sinusoid
from models.noise.bias_instability import ALLAN_FLOOR
from tuner.curves import curve as empirical_curve
from tuner.formats.customary_units import digits
from tuner.identification.allan_leastsquares import Misfit, misfit
from tuner.identification.allan_leastsquares import fit as fit_curve
from tuner.identification.allan_octaves import OctaveCurve
from tuner.identification.curve_limit import below_the_curve
from tuner.identification.estimates import ALLOWS_NONE, BASE, Estimates, from_fit, from_segments
from tuner.identification.law_of_samples import variance_by_law
from tuner.identification.likelihood import (
    LikelihoodFit,
    fit,
    fit_periodogram,
    take_out_lines,
    with_lines,
)
from tuner.identification.limiting_quantizer import as_bounds, bounds_of
from tuner.identification.mean_and_earth_rate import mean_of_noise
from tuner.identification.periodogram import (
    FALSE_ALARMS,
    MIN_SEGMENT_SAMPLES,
    CosinePeriodogram,
    cosine_periodogram,
)
from tuner.identification.selection import Bound, select_periodogram
from tuner.identification.short_clusters import band_of_samples, down_to_samples
from tuner.identification.sinusoids import about_lines
from tuner.identification.slopes import read_segments
from tuner.identification.valid_band import (
    CURVE_TOLERANCE,
    Band,
    Octaves,
    curve_within,
    find_band,
    narrowed,
    periodogram_within,
)
from tuner.readers.value_checks import about_limiting_step
from tuner.types import AllanCurve, Candidate, ChannelIdentification, Coefficient, TermEstimate
from tuner.types.records import DataError, Record

METHODS = ("likelihood", "leastsquares", "slopes")


def identify_channel(
    record: Record,
    axis: str,
    *,
    terms: Sequence[str] | None = None,
    further: Sequence[str] = (),
    method: str = "likelihood",
) -> ChannelIdentification:
    """Identify the noise of one axis.

    Parameters
    ----------
    record : Record
        Samples at rest.
    axis : str
        Which of its channels.
    terms : sequence of str, optional
        Fit exactly this sum instead of choosing one.
    further : sequence of str
        Terms beside those that are chosen: ``sinusoid`` or ``gauss_markov``, as a diagnosis found them.
    method : str
        Where the coefficients come from: ``likelihood``, ``leastsquares`` or ``slopes``.

    Returns
    -------
    ChannelIdentification

    Raises
    ------
    DataError
        If the channel is constant or too short for an Allan variance.
    ValueError
        If the method or a term is unknown.
    """
    if method not in METHODS:
        raise ValueError(f"'method' must be one of {', '.join(METHODS)}, got {method!r}")
    single = single_axis(record, axis)
    pieces = single.pieces(axis)
    whole = OctaveCurve.of(pieces, single.interval)
    if terms is None:
        noise = choose_terms(pieces, single.interval, further)
        band, chosen, candidates = noise.band, noise.fit, noise.candidates
        bounds = tuple(_bounded(b, single.unit) for b in noise.bounds)
        whole = replace(whole, law_variance=noise.law_variance)
        left_out = about_lines(noise.lines, single.unit)
    else:
        band, left_out = Band(1, np.inf, 1.0), ()
        chosen, bounds, candidates = fit(pieces, single.interval, (*terms, *further)), (), ()
        whole = replace(whole, law_variance=variance_by_law(pieces, single.interval))
    octaves = curve_within(whole, band)
    allan = empirical_curve(single, "oadev", noise=chosen.model)
    estimates = _by_method(chosen, method, octaves, allan, forced=terms is not None)
    longest = max(pieces, key=len)
    compared = method in ("likelihood", "leastsquares")
    apart = contradiction(whole, band, estimates.model) if compared else None
    noisy = without_lines(chosen.model)
    robust = apart is not None and apart.p_value < ROBUST_P_VALUE and method == "likelihood" and terms is None
    robust = robust and len(octaves.m) >= len(noisy.parameters)
    if robust:
        found = fit_curve(curve_within(noise.curve, band), noisy)
        estimates = from_fit(found.model, found.covariance, found.intervals, allan.unit, forced=False)
    warnings = () if apart is None else disagreement(apart, robust=robust)
    estimates = below_the_curve(
        estimates,
        allan,
        single.interval,
        shortest=single.interval if band.m == 1 else 4 * band.m * single.interval,
        contradicted=bool(warnings),
    )
    minimum, floor, minimum_tau = _minimum(allan, len(longest) * single.interval)
    full = down_to_samples(allan, single, estimates.model)
    samples = single.interval / single.samples_a_mean
    described = None if band.m == 1 else band.m * single.interval
    warnings = (
        *about_band(band_of_samples(band, full, single, estimates.model), samples),
        *left_out,
        *warnings,
    )
    every = [
        _under_the_curve(_hidden(term, described), full, samples) for term in (*estimates.terms, *bounds)
    ]
    if axis in single.limiting_steps:
        step = single.limiting_steps[axis]
        estimates = as_bounds(estimates, step, full.tau, samples)
        every = [
            *estimates.terms,
            *bounds_of(every[-len(bounds) :] if bounds else [], step, full.tau, samples),
        ]
        warnings = (about_limiting_step(axis, step, single.unit), *warnings)
    order = list(TERMS)
    return ChannelIdentification(
        axis=axis,
        unit=single.unit,
        interval=samples,
        span=single.span,
        method=method,
        model=estimates.model,
        terms=tuple(sorted(every, key=lambda term: order.index(term.name))),
        parameters=estimates.parameters,
        covariance=estimates.covariance,
        mean=mean_of_noise(
            sum(float(p.sum()) for p in pieces) / sum(map(len, pieces)),
            chosen.model,
            single.span,
            single.unit,
        ),
        sigma_10s=_deviation_at(single, chosen.model, 10.0),
        minimum=minimum,
        floor=floor,
        minimum_tau=minimum_tau,
        allan=full,
        candidates=candidates,
        warnings=warnings,
    )


def single_axis(record: Record, axis: str) -> Record:
    """Return the record of one axis, without segments that are too short or stuck at one value."""
    column = record.column(axis)
    segments = tuple(
        (start, stop)
        for start, stop in record.segments
        if stop - start >= MIN_SEGMENT_SAMPLES and np.ptp(column[start:stop]) > 0.0
    )
    if not segments:
        where = f"{record.source or record.name}: {axis}"
        raise DataError(
            f"{where}: expected a gap-free stretch of {MIN_SEGMENT_SAMPLES} samples that vary, found none: too short"
        )
    return replace(record, y=column[:, None], axes=(axis,), segments=segments, covariates={})


def _deviation_at(record: Record, model: NoiseModel, tau: float) -> Coefficient:
    """Return the Allan deviation at one cluster time, or why there is none."""
    longest = max(stop - start for start, stop in record.segments) * record.interval
    if tau < record.interval:
        return Coefficient(None, None, None, record.unit, f"samples are {record.interval:g} s apart")
    if 2.0 * tau > longest:
        reason = f"the longest stretch without a gap has {longest:.3g} s, {2.0 * tau:g} s are needed"
        return Coefficient(None, None, None, record.unit, reason)
    point = empirical_curve(record, "oadev", tau=[tau], noise=model)
    low, high = point.interval()
    value = float(point.deviation()[0, 0])
    return Coefficient.known(value, float(low[0, 0]), float(high[0, 0]), record.unit)


def _hidden(estimate: TermEstimate, described: float | None) -> TermEstimate:
    """Return an absent term whose reason says from which cluster time on, s, it was sought; None: from all."""
    ((name, coefficient), *others) = estimate.coefficients.items()
    if described is None or coefficient.reason != ALLOWS_NONE[False]:
        return estimate
    reason = f"clusters from {described:.3g} s on, which the terms describe, show none; shorter ones may"
    return TermEstimate(estimate.name, {name: replace(coefficient, reason=reason), **dict(others)})


def _under_the_curve(estimate: TermEstimate, allan: AllanCurve, interval: float) -> TermEstimate:
    """Return the estimate with its bound no higher than the whole measured curve allows."""
    if estimate.present or estimate.name not in BASE:
        return estimate
    ((name, coefficient),) = estimate.coefficients.items()
    unit_deviation = np.sqrt(BASE[estimate.name].allan_variance(allan.tau, interval=interval))
    highest = float(np.min(allan.interval()[1][:, 0] / unit_deviation))
    if coefficient.upper is None or coefficient.upper <= highest:
        return estimate
    return TermEstimate(estimate.name, {name: replace(coefficient, upper=highest)})


def _minimum(allan: AllanCurve, longest: float) -> tuple[Coefficient, Coefficient, float]:
    """Return the smallest Allan deviation up to T/4 of the longest stretch, that ÷ 0.664, and its τ."""
    within = np.flatnonzero(allan.tau <= 0.25 * longest)
    usable = within if len(within) else np.array([0])
    deviation = allan.deviation()[usable, 0]
    low, high = (limit[usable, 0] for limit in allan.interval())
    at = int(np.argmin(deviation))
    value, ends = float(deviation[at]), (float(low[at]), float(high[at]))
    tau = float(allan.tau[usable[at]])
    if at == len(usable) - 1:
        reason = f"the curve still falls at {tau:.3g} s, a quarter of the record"
        limits = [Coefficient.bounded(ends[1] / by, allan.unit, reason) for by in (1.0, ALLAN_FLOOR)]
        return limits[0], limits[1], tau
    reason = f"smallest measured Allan deviation, at {tau:.3g} s"
    known = [
        Coefficient.known(value / by, ends[0] / by, ends[1] / by, allan.unit, reason)
        for by in (1.0, ALLAN_FLOOR)
    ]
    return known[0], known[1], tau


def _by_method(
    chosen: LikelihoodFit, method: str, octaves: OctaveCurve, allan: AllanCurve, *, forced: bool
) -> Estimates:
    """Return the coefficients of the chosen terms by the chosen method."""
    if method == "leastsquares":
        found = fit_curve(octaves, chosen.model)
        return from_fit(found.model, found.covariance, found.intervals, allan.unit, forced=forced)
    estimates = from_fit(chosen.model, chosen.covariance, chosen.intervals, allan.unit, forced=forced)
    if method == "slopes":
        return from_segments(estimates, read_segments(allan.tau, allan.deviation()[:, 0], allan.dof[:, 0]))
    return estimates


@dataclass(frozen=True)
class ChosenNoise:
    """Terms of gap-free segments.

    Attributes
    ----------
    fit : LikelihoodFit
        The chosen sum, sinusoids included.
    band : Band
        Part of the spectrum that it was fitted to.
    bounds : tuple of Bound
        Limits of the terms that are absent.
    candidates : tuple of Candidate
        Sums that were compared, the best first.
    law_variance : float
        Variance of the white power that comes from the law of the samples, unit⁴/Hz².
    lines : tuple of (float, float)
        Frequency, Hz, and amplitude, unit, of lines within the band that were left out of the fit.
    curve : OctaveCurve
        Of the segments without the sinusoids of the sum, which no curve in octaves can tell.
    """

    fit: LikelihoodFit
    band: Band
    bounds: tuple[Bound, ...]
    candidates: tuple[Candidate, ...]
    law_variance: float
    lines: tuple[tuple[float, float], ...]
    curve: OctaveCurve


def without_lines(model: NoiseModel) -> NoiseModel:
    """Return a sum without its sinusoids."""
    return NoiseModel(tuple(term for term in model.terms if not isinstance(term, Sinusoid)))


def choose_terms(pieces: Sequence[FloatArray], interval: float, further: Sequence[str] = ()) -> ChosenNoise:
    """Choose and fit the noise terms of gap-free segments of one channel: the one fit of the noise of a record.

    Parameters
    ----------
    pieces : sequence of ndarray
        Samples of each segment, unit.
    interval : float
        Sampling interval, s.
    further : sequence of str
        Terms beside those that are chosen: as many ``sinusoid`` are taken out first, the others join every sum.
    """
    lines, rest = take_out_lines(pieces, interval, list(further).count(Sinusoid.name))
    processes = [name for name in further if name != Sinusoid.name]
    curve = OctaveCurve.of(rest, interval)
    whole = cosine_periodogram(rest, interval)
    octaves = Octaves.of_periodogram(whole)
    band = find_band(octaves)
    data = _of_band(whole, rest, band)
    selection = select_periodogram(data, processes)
    refused = set()
    while GaussMarkov.name not in processes and _faster_than_samples(selection.fit.model, interval):
        longer = narrowed(octaves, band)
        if longer is None:
            refused.add(GaussMarkov.name)
            break
        band, data = longer, _of_band(whole, rest, longer)
        selection = select_periodogram(data, processes)
    chosen, absent = selection.fit, selection.bounded
    refused |= {Quantization.name} if band.m > 1 else set()
    if refused & set(chosen.terms):
        chosen = fit_periodogram(
            data, next(c.terms for c in selection.candidates if not refused & set(c.terms))
        )
    if band.m > 1:
        hidden = "hidden: it shows only in clusters shorter than those that the terms describe"
        below = Bound(Quantization.name, Quantization.PARAMETERS[0], np.inf, hidden)
        absent = (below, *(b for b in absent if b.name != Quantization.name))
    bounds = tuple(b for b in absent if b.name not in chosen.terms)
    noise = with_lines(chosen, lines, rest, interval)
    return ChosenNoise(noise, band, bounds, selection.candidates, data.law_variance, data.lines, curve)


def _of_band(whole: CosinePeriodogram, pieces: Sequence[FloatArray], band: Band) -> CosinePeriodogram:
    """Return the cells of a band, and what the law of its clusters adds to their variance."""
    by_law = variance_by_law(pieces, whole.interval, band.m)
    return replace(periodogram_within(whole, band), law_variance=by_law)


def _faster_than_samples(model: NoiseModel, interval: float) -> bool:
    """Return whether a Gauss–Markov process forgets within a sample: white noise, shown by longer clusters."""
    return any(isinstance(term, GaussMarkov) and term.time_constant < interval for term in model.terms)


def _bounded(bound: Bound, unit: str) -> TermEstimate:
    """Return the estimate of an absent term."""
    (of_parameter,) = BASE[bound.name].units(unit)
    return TermEstimate(
        bound.name, {bound.parameter: Coefficient.bounded(bound.upper, of_parameter, bound.reason)}
    )


ROBUST_P_VALUE = 1e-6
"""Probability below which the likelihood of that sum decides nothing: its thousands of fast cells would bend the slow
terms. The coefficients then come from the curve, octave by octave."""


def about_band(band: Band, interval: float) -> tuple[str, ...]:
    """Say what part of the record the terms do not describe."""
    if band.m == 1:
        return ()
    part, side = 100.0 * abs(band.ratio - 1.0), "stronger" if band.ratio > 1.0 else "weaker"
    return (
        f"below a cluster time of {band.m * interval:.3g} s no sum of noise terms follows the data (the fastest part "
        f"is {digits(part, 2)} % {side}: a filter in the sensor, vibration or a spectral line): fitted to longer ones, "
        f"f ≤ {band.highest:.3g} Hz",
    )


def contradiction(whole: OctaveCurve, band: Band, model: NoiseModel) -> Misfit | None:
    """Judge the fitted sum against the Allan curve; in a cut band, where little above it reaches."""
    if not model.terms:
        return None
    return misfit(curve_within(whole, band), model, tolerance=CURVE_TOLERANCE)


CURVE_DISAGREES = "the Allan curve disagrees with the sum of terms"
"""How the warning begins on an axis whose terms do not predict its curve."""


def disagreement(found: Misfit, *, robust: bool = False) -> tuple[str, ...]:
    """Say where the Allan curve contradicts the fitted sum, and what became of the coefficients."""
    if found.p_value >= FALSE_ALARMS:
        return ()
    part, side = 100.0 * abs(found.ratio - 1.0), "above" if found.ratio > 1.0 else "below"
    return (
        f"{CURVE_DISAGREES} (χ² = {found.statistic:.3g} on {found.freedom}, "
        f"p = {found.p_value:.1g}), most at τ = {found.tau:.3g} s, where it is {digits(part, 2)} % {side}: "
        "something in the data is not among the terms"
        + ("; the coefficients are those of weighted least squares on the curve" if robust else ""),
    )
