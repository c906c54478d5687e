"""Findings from the search results of all channels: a cause that channels share is one finding; SI in numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from models.arrays import LEAST_DIVISOR
from models.noise import NoiseModel
from models.probability import REACH_95
from tuner.diagnosis.cause import Cause
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.shaped_white_noise import MIN_ENLARGEMENT
from tuner.diagnosis.static.held_out_gain import summed
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.profile_likelihood import first_column
from tuner.diagnosis.static.outcome import Accepted
from tuner.diagnosis.static.search import SearchResult
from tuner.formats.customary_units import amount
from tuner.formats.grouping import grouped
from tuner.formats.parameter_words import meaning_text, parameter_words, with_sign
from tuner.synthesis.findings import LEFT_OUT
from tuner.types import Alternative, Coefficient, Enlargement, Finding, Quantity
from tuner.types.coefficient import apart
from tuner.types.diagnosis import of_each

AGREEMENT_SDS = 4.0
"""Standard deviations within which parameters of two channels agree: normal deviates exceed 4 in 6e-5."""


@dataclass(frozen=True)
class Single:
    """A finding of one channel.

    `cause` says what it is: the extension that was accepted, or its family where a defining parameter is not known.
    `wrong` are the times of its samples that are no measurement, s.
    """

    axis: str
    unit: str
    scale: float
    accepted: Accepted
    cause: Extension | type[Cause]
    parameters: Mapping[str, Coefficient]
    inflation: Enlargement | None
    in_motion: str = ""
    wrong: tuple[float, ...] = ()


def findings(every: Iterable[Single]) -> tuple[Finding, ...]:
    """Return the findings of all channels, shared ones once, the clearest first."""
    found = [_finding(group) for group in grouped(every, _shared)]
    return tuple(sorted(found, key=lambda finding: finding.p_value))


def singles(axis: str, outcome: SearchResult, base: NoiseModel) -> tuple[Single, ...]:
    """Return the findings of one channel; `base`, its noise without any, SI, is what enlargements refer to."""
    channel = outcome.final.channel
    given = len(outcome.final.extensions) - len(outcome.accepted)
    found = []
    tails = any(joins(one.extension.cause) == joins("heavy_tails") for one in outcome.accepted)
    for index, accepted in enumerate(outcome.accepted, given):
        extension = accepted.extension
        if not extension.named:
            continue
        cause: Extension | type[Cause] = extension
        values = {name: _bounded(extension.cause, name, value) for name, value in extension.values.items()}
        if extension.family is not None and not extension.defined:
            cause, values = extension.family, {"sd": _explained_sd(outcome.final, index)}
            itself = Alternative(extension.cause, 1.0)
            accepted = replace(accepted, alternatives=(itself, *accepted.alternatives))
        parameters = {name: value.coefficient(channel.unit, channel.scale) for name, value in values.items()}
        inflation = _inflation(axis, outcome, accepted, base)
        moving = extension.in_motion(channel.interval)
        places = () if tails else extension.wrong_samples(channel)
        wrong = tuple(channel.times(places).tolist())
        found.append(
            Single(axis, channel.unit, channel.scale, accepted, cause, parameters, inflation, moving, wrong)
        )
    return tuple(found)


def _explained_sd(fitted: FittedChannel, index: int) -> Value:
    """Return the standard deviation of the bias that the templates of an extension explain, scales."""
    columns = fitted.extensions[index].columns(fitted.channel)
    columns = columns - columns.mean(axis=0)
    at = first_column(fitted, index)
    mine = slice(at, at + columns.shape[1])
    beta, covariance = fitted.fit.beta[mine], fitted.fit.beta_covariance[mine, mine]
    gram = columns.T @ columns / len(columns)
    sd = float(np.sqrt(beta @ gram @ beta))
    gradient = gram @ beta / sd
    return Value.of(sd, float(np.sqrt(gradient @ covariance @ gradient)), "{u}").positive


def _bounded(cause: str, name: str, value: Value) -> Value:
    """Return a parameter whose interval ends at 0 where it cannot be negative."""
    effect = CAUSES[cause].effect
    return value.positive if effect is not None and name in effect.positive else value


def _inflation(axis: str, outcome: SearchResult, accepted: Accepted, base: NoiseModel) -> Enlargement | None:
    """Return what to enlarge in a filter that is set from the base model; None where that is large enough.

    None, too, where the base model has no white noise that could be enlarged: a filter then gets its white noise from
    the Allan curve, which contains the cause.
    """
    enlargement = accepted.extension.white_noise_enlargement(outcome.base, outcome.final)
    if enlargement is None or base.white_density() == 0.0:
        return None
    factor, reason = enlargement
    share = accepted.extension.enlarged_share(outcome.final.channel)
    if share == 1.0:  # else a ratio to the rms over the record, whatever a model says of that
        factor *= outcome.base.model.white_density() * outcome.base.channel.scale / base.white_density()
    if factor <= MIN_ENLARGEMENT:
        return None
    return Enlargement(Quantity(axis, "white_density"), factor, reason, time_share=share)


def _shared(group: Sequence[Single], single: Single) -> bool:
    """Return whether a finding of another channel is the same cause, of which held-out data say the same."""
    first = group[0]
    alike = first.cause.cause == single.cause.cause and first.unit == single.unit
    worse = {one.accepted.gain is not None and one.accepted.gain.contradicts for one in (first, single)}
    if not alike or len(worse) > 1 or any(g.axis == single.axis for g in group):
        return False
    return all(
        _agree(one.parameters[name], single.parameters[name])
        for one in group
        for name in _locating(first.cause.cause)
        if name in one.parameters and name in single.parameters
    )


def _locating(cause: str) -> tuple[str, ...]:
    """Return the parameters that must agree for two channels to share a cause."""
    effect = CAUSES[cause].effect
    return () if effect is None else effect.locates


def _agree(a: Coefficient, b: Coefficient) -> bool:
    (mean_a, sd_a), (mean_b, sd_b) = moments(a), moments(b)
    return abs(mean_a - mean_b) <= AGREEMENT_SDS * float(np.hypot(sd_a, sd_b)) + 1e-12 * abs(mean_a)


def moments(c: Coefficient) -> tuple[float, float]:
    """Return a coefficient and the sd that its interval shows."""
    assert c.value is not None
    assert c.interval is not None
    return c.value, max((c.interval[1] - c.interval[0]) / (2.0 * REACH_95), LEAST_DIVISOR)


def pooled(coefficients: Sequence[Coefficient]) -> Coefficient:
    """Return the mean weighted by inverse variance where it is in the interval of each, else the first.

    Numbers whose intervals are all positive are pooled by their logarithms, and so is the interval of the mean;
    where some begin at 0, that of the mean does not reach below.
    """
    first = coefficients[0]
    if len(coefficients) == 1 or not all(_agree(first, other) for other in coefficients[1:]):
        return first
    least = min(c.interval[0] for c in coefficients if c.interval is not None)
    if least > 0.0:
        value, half = _mean([_log_moments(c) for c in coefficients])
        value, low, high = np.exp((value, value - half, value + half)).tolist()
    else:
        value, half = _mean([moments(c) for c in coefficients])
        low, high = max(value - half, 0.0) if least == 0.0 else value - half, value + half
    mean = Coefficient.known(value, low, high, first.unit)
    return first if any(apart(replace(mean, interval=(value, value)), c) for c in coefficients) else mean


def _mean(moments: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the mean of numbers and sds, weighted, and half of its 95 % interval."""
    weight = np.array([sd**-2 for _, sd in moments])
    return float(weight @ [mean for mean, _ in moments] / weight.sum()), REACH_95 * float(
        weight.sum()
    ) ** -0.5


def _log_moments(c: Coefficient) -> tuple[float, float]:
    """Return the logarithm of a positive coefficient and its sd."""
    assert c.value is not None
    assert c.interval is not None
    low, high = np.log(c.interval).tolist()
    return float(np.log(c.value)), max((high - low) / (2.0 * REACH_95), 1e-15)


def _finding(group: list[Single]) -> Finding:
    clearest = sorted(group, key=lambda single: -single.accepted.result.gain)
    best = clearest[0]
    cause, result = best.cause, best.accepted.result
    parameters = {
        name: pooled([s.parameters[name] for s in clearest if name in s.parameters])
        for name in best.parameters
    }
    channels = tuple(single.axis for single in group)
    by_channel = {single.axis: dict(single.parameters) for single in group}
    extension: dict[str, object] = {"cause": cause.cause, "joins": joins(cause.cause)}
    if cause is best.accepted.extension.family:
        extension["members"] = {single.axis: _member(single) for single in group}
    if best.in_motion:
        extension["in_motion"] = best.in_motion
    if wrong := {single.axis: list(single.wrong) for single in group if single.wrong}:
        extension[LEFT_OUT] = wrong
    consequence = cause.consequence if isinstance(cause, type) else cause.consequence_as_found
    return Finding(
        cause=cause.cause,
        channels=channels,
        statistic=result.name,
        value=result.statistic,
        p_value=min(1.0, result.p_value),
        parameters=parameters,
        text=words(cause.cause, channels, cause.meaning, parameters, by_channel),
        consequence="; ".join(filter(None, (best.in_motion, consequence))),
        extension=extension,
        gain=summed([single.accepted.gain for single in group]),
        alternatives=alternatives([single.accepted for single in group]),
        inflations=tuple(single.inflation for single in group if single.inflation is not None),
        by_channel=by_channel,
    )


def _member(single: Single) -> dict[str, object]:
    """Return which cause of a family was fitted, and its parameters, unit of the channel: for a simulation."""
    extension = single.accepted.extension
    values = {
        name: {"value": value.value * (single.scale if "{u}" in value.unit else 1.0)}
        for name, value in extension.values.items()
    }
    return {"cause": extension.cause, "parameters": values}


def joins(cause: str) -> str:
    """Return which part of the model an extension of a cause joins."""
    effect = CAUSES[cause].effect
    return "preprocessing" if effect is None else effect.joins


def alternatives(accepted: Sequence[Accepted]) -> tuple[Alternative, ...]:
    """Return the alternatives that all channels have in common, with the product of their weights."""
    first, *others = ([a.cause for a in one.alternatives] for one in accepted)
    common = [cause for cause in dict.fromkeys(first) if all(cause in other for other in others)]
    scores = {
        cause: float(np.prod([a.score for one in accepted for a in one.alternatives if a.cause == cause]))
        for cause in common
    }
    return tuple(
        Alternative(cause, score) for cause, score in sorted(scores.items(), key=lambda item: -item[1])
    )


def words(
    cause: str,
    channels: Sequence[str],
    meaning: str,
    parameters: Mapping[str, Coefficient],
    by_channel: Mapping[str, Mapping[str, Coefficient]] = MappingProxyType({}),
) -> str:
    """Return a finding in one sentence; a parameter in which channels differ is given for each."""
    figures = ", ".join(
        f"{said} {amount(value)}{where}"
        for name, said in parameter_words(parameters).items()
        for where, value in _by_axis(of_each(name, parameters[name], by_channel), parameters[name])
    )
    said = f"{cause} in {', '.join(channels)}: {meaning_text(with_sign(meaning, parameters), {})}"
    return f"{said} ({figures})" if figures else said


def _by_axis(each: Mapping[str, Coefficient], shown: Coefficient) -> Sequence[tuple[str, Coefficient]]:
    return [(f" in {axis}", value) for axis, value in each.items()] or [("", shown)]
