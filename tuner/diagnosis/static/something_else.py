"""Weight of causes outside the catalogue against the name that a finding has.

A cause is named because it explains more than the other causes of the catalogue. That is no evidence against a cause
that the catalogue lacks. Its weight, a likelihood ratio as that of every alternative, is the larger of

- what is left unexplained of the kind that the cause is about ÷ what the cause explains, 1 where more is left of all
  kinds together than it explains, and
- one for the law of samples whose codes may differ in width, which stands as ``lattice``, and
- the likelihood of a shape that no cause has, in place of the named cause: three levels for two, a change of slope,
  powers and the logarithm of time for a transient, and for causes that bend the spectrum power-law noise f^α with an α
  that is none of 0, −1 and −2 (white, flicker, random walk)::

    E(f) = S_base(f) + s f^α,    s ≥ 0, α on a grid, s and the noise of the base fitted together
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.noise import BiasInstability, RandomWalk
from tuner.diagnosis.cause import Group
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.comb import Comb
from tuner.diagnosis.static.causes.line import Line, resonance_lead
from tuner.diagnosis.static.causes.telegraph import Telegraph
from tuner.diagnosis.static.causes.transients import Transients
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel, without
from tuner.diagnosis.static.model.score_scan import scan
from tuner.diagnosis.static.model.slow_likelihood import FLICKER
from tuner.diagnosis.static.outcome import NEAR_TWIN_NATS, UNKNOWN, Accepted
from tuner.diagnosis.static.search import SearchResult, group_of
from tuner.identification.fisher_scoring import minimise
from tuner.segments.quantizer import may_be_uneven
from tuner.types import Alternative

LATTICE = "lattice"
"""Cause of a quantizer that shows."""
MIN_LEFT_SHARE = 0.05
"""Share of what a finding explains above which what it leaves makes it uncertain: a likelihood ratio of 20."""
OF_GROUPS: Mapping[str, tuple[Group, ...]] = {
    "spectrum": ("fast spectrum",),
    "slow spectrum": ("slow part",),
    "unnamed": ("slow part",),
    "periodic variance": ("distribution",),
    "variance by bias": ("distribution",),
    "irregular variance": ("distribution",),
    "law": ("distribution",),
    "law of means": ("distribution", "slow part"),
    "squares": ("distribution", "fast spectrum"),
    "spectrum in time": ("distribution", "fast spectrum"),
    "beside lines": ("fast spectrum",),
    "times of spikes": ("distribution",),
    "course": ("slow part",),
    Transients.cause: ("distribution", "slow part"),
}
"""Groups of the causes that statistics without one are about."""
OF_THE_LAW = ("skewed_noise", "heavy_tails")
"""Causes that are a law of the samples."""
CORRELATED = ("gauss_markov", "lowpass", "colour")
"""Causes that bend the spectrum over decades."""
TRIED_EXPONENTS = (-0.25, -0.5, -0.75, -1.25, -1.5, -1.75)
"""α that are tried, a quarter apart: one between two loses a nat in fifty, and −1 and −2 are in the base."""
LOG_SIZES, START_LOG_SIZE = (-12.0, 6.0), -2.0
"""Range of the log of the power ÷ that of the white noise, in the middle of the cells, and where a fit begins."""
SIZE_TOLERANCE = 0.01
"""Gain of -2 ln L in a step at which a fit ends; a lead counts in nats."""
CORNER_COUNT = 16
"""Places of a change of slope, and starts of a logarithm, that are tried; neighbours resemble each other by 0.95."""


def with_unknown(outcome: SearchResult) -> tuple[Accepted, ...]:
    """Return what was accepted with something else among its alternatives, where that has a share."""
    given = len(outcome.final.extensions) - len(outcome.accepted)
    power_law = power_law_lead(outcome.final) if outcome.final.count(*CORRELATED) else -np.inf
    found = []
    for index, accepted in enumerate(outcome.accepted, given):
        gain, shown = accepted.result.gain, groups(accepted.extension, outcome.final.channel)
        left = sum(r.nats for r in outcome.unexplained if shown & {*about(r.cause)})
        weight = left / gain if MIN_LEFT_SHARE * gain < left < gain else float(left >= gain and left > 0.0)
        if sum(r.nats for r in outcome.unexplained) > gain:
            weight = 1.0
        lead = power_law if accepted.extension.cause in CORRELATED else -np.inf
        if isinstance(accepted.extension, Telegraph):
            lead = accepted.extension.third_level_lead
        if isinstance(accepted.extension, Warmup):
            lead = other_transient_lead(outcome.final, index)
        if lead > -NEAR_TWIN_NATS:
            weight = max(weight, float(np.exp(min(lead, 0.0))))
        weight = max(weight, *(a.score for a in accepted.alternatives if a.cause == UNKNOWN), 0.0)
        known = tuple(a for a in accepted.alternatives if a.cause != UNKNOWN)
        unknown = (Alternative(UNKNOWN, weight),) if weight else ()
        twin = (
            *_line_twin(outcome.final, index, accepted),
            *_code_twin(outcome.final.channel, accepted),
        )
        found.append(replace(accepted, alternatives=(*known, *twin, *unknown)))
    return tuple(found)


def groups(extension: Extension, channel: Channel) -> set[Group | None]:
    """Return the groups of statistics that show an extension: what repeats slowly is in the slow part, too."""
    if isinstance(extension, Line | Vibration):
        frequency = extension.frequency
    else:
        frequency = 1.0 / (extension.period * channel.interval) if isinstance(extension, Comb) else np.inf
    slow: Group = "slow part"
    return {extension.group, *((slow,) if frequency < 0.5 / (channel.block * channel.interval) else ())}


def about(cause: str) -> tuple[Group | None, ...]:
    """Return the groups of the causes that a test is about, by the name of its cause or statistic; the first most."""
    return OF_GROUPS.get(cause, (group_of(cause),))


def _code_twin(channel: Channel, accepted: Accepted) -> tuple[Alternative, ...]:
    """Return the quantizer as the twin of a law of samples whose codes may differ in width."""
    known = any(a.cause == LATTICE for a in accepted.alternatives)
    if accepted.extension.cause not in OF_THE_LAW or known or channel.quantizer_step == 0.0:
        return ()
    uneven = may_be_uneven(channel.y[channel.valid], channel.quantizer_step)
    return (Alternative(LATTICE, 1.0),) if uneven else ()


def _line_twin(fitted: FittedChannel, index: int, accepted: Accepted) -> tuple[Alternative, ...]:
    """Return a resonance as the twin of a line that explains as much as it does: one whose phase wanders."""
    line = accepted.extension
    if not isinstance(line, Line) or any(a.cause == Vibration.cause for a in accepted.alternatives):
        return ()
    lead = resonance_lead(without(fitted, index), line.frequency)
    return (Alternative(Vibration.cause, float(np.exp(min(lead, 0.0)))),) if lead > -NEAR_TWIN_NATS else ()


def power_law_lead(fitted: FittedChannel) -> float:
    """Return the log likelihood that power-law noise gains in place of all correlated causes of a model, nats."""
    kept = tuple(x for x in fitted.extensions if x.cause not in CORRELATED)
    bare = fit_channel(fitted.channel, kept, near=fitted)
    fit = next(one for one in bare.fits if one.kinds == FLICKER)
    problem, f = bare.track.objective(FLICKER), bare.track.grid.frequency
    weak = fit.theta.copy()
    for kind in (RandomWalk, BiasInstability):
        at = sum(len(k.PARAMETERS) for k in FLICKER[: FLICKER.index(kind)])
        weak[at] = problem.lower[at] + 1.0
    lower, upper = (
        np.append(ends, end) for ends, end in zip((problem.lower, problem.upper), LOG_SIZES, strict=True)
    )
    best = -np.inf
    for exponent in TRIED_EXPONENTS:
        shape = fit.expected[-1] * (f / f[len(f) // 2]) ** exponent
        for start in (fit.theta, weak):
            first = np.clip(np.append(start, START_LOG_SIZE), lower, upper)
            _, value = minimise(
                problem.with_power(shape), first, lower=lower, upper=upper, tolerance=SIZE_TOLERANCE
            )
            best = max(best, -0.5 * value)
    return best - fitted.fit.log_likelihood


def other_transient_lead(fitted: FittedChannel, index: int) -> float:
    """Return the log likelihood that another course gains in place of the transient of this index, nats."""
    bare = without(fitted, index)
    scores, templates = scan(bare, _courses(fitted.channel))
    best = np.argsort(-np.abs(scores.score))[:2]
    return (
        max(bare.refit(templates[:, at]).log_likelihood for at in best.tolist()) - fitted.fit.log_likelihood
    )


def _courses(channel: Channel) -> FloatArray:
    """Return smooth functions of time with one free number that no cause has, on the blocks, shape (M, p)."""
    time = channel.block_time / channel.span
    corners = np.linspace(0.0, 1.0, CORNER_COUNT + 2)[1:-1]
    slopes = np.maximum(time[:, None] - corners, 0.0)
    logs = np.log(time[:, None] + np.geomspace(1e-3, 1.0, CORNER_COUNT))
    powers = time[:, None] ** np.array([0.25, 0.5, 1.5, 2.0, 3.0])
    return np.concatenate((slopes, logs, powers), axis=1)
