"""Search for causes: fit, test, extend the model by the cause that gains most, fit again, until no test rejects.

An extension is accepted where its test rejects and its penalised gain is the largest. A cause whose test rejected too
and no longer does is a rival; rivals within `ALTERNATIVE_NATS` nats, near twins within `NEAR_TWIN_NATS`, are its
alternatives. When no test rejects any more, each extension is taken out in turn and stays out unless its own test then
rejects.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tuner.diagnosis.cause import Group
from tuner.diagnosis.static.causes import spikes, step
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.causes.burst import Burst
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.step import Step
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.filter_beside_resonance import with_joint_resonance
from tuner.diagnosis.static.hypothesis_tests import (
    CERTAIN_GAIN,
    hypothesis_tests,
    is_tested_alone,
    retest,
    significant,
    with_tests_anew,
)
from tuner.diagnosis.static.line_of_resonance import without_line_of_resonance
from tuner.diagnosis.static.model.fitted_channel import (
    FittedChannel,
    fit_channel,
    refitted,
    relabelled,
    without,
)
from tuner.diagnosis.static.model.profile_likelihood import first_column
from tuner.diagnosis.static.outcome import ALTERNATIVE_NATS, NEAR_TWIN_NATS, Accepted, TestResult
from tuner.diagnosis.static.residual_checks import checks
from tuner.diagnosis.static.slow_shapes import judged, settled
from tuner.stages import stage, task
from tuner.types import Alternative

SPECTRUM_TWINS = frozenset({"lowpass", "colour"})
"""Shapes of the fast spectrum that differ in the order of a filter only."""
MAX_PASSES = 32
"""Largest number of passes; chosen to bound the search above the number of causes that one record has."""
MAX_REFITS = 2
"""Largest number of refits of all parameters after a new extension, chosen as enough for spectra that overlap.

A refit that changes nothing ends them earlier.
"""
PASS_SHARE = 0.7
"""Share of a search that seems to be left after each pass, for those who watch: some three passes, then estimates."""


@dataclass(frozen=True)
class SearchResult:
    """Causes found in one channel, with its residuals before and after.

    Attributes
    ----------
    base, final : FittedChannel
        Before and after all extensions.
    accepted : tuple of Accepted
        In the order of `final.extensions`.
    unexplained : tuple of TestResult
        Tests that still reject and have no cause.
    """

    base: FittedChannel
    final: FittedChannel
    accepted: tuple[Accepted, ...]
    unexplained: tuple[TestResult, ...]


@task()
def search_causes(channel: Channel, threshold: float, given: tuple[Extension, ...] = ()) -> SearchResult:
    """Search one channel for causes by tests of its residuals.

    Parameters
    ----------
    channel : Channel
        Samples of one axis.
    threshold : float
        P-value below which a family with one share of the budget rejects.
    given : tuple of Extension
        What is known beforehand, such as stretches of motion.
    """
    now = _begun(channel, given)
    for passed in range(MAX_PASSES):
        stage("", 1.0 - PASS_SHARE ** (passed + 1))
        now = _after_pass(now, threshold)
        if now.done:
            break
    stage("", 1.0)
    found, accepted = _prune(now.found, list(now.accepted), threshold)
    found, accepted = without_line_of_resonance(found, accepted)
    tested = (*now.results, *checks(found))  # before caches are lost
    found = with_joint_estimates(found)
    estimated = found.extensions[len(found.extensions) - len(accepted) :]
    accepted = [
        replace(a, extension=x, result=replace(a.result, cause=x.cause))
        for a, x in zip(accepted, estimated, strict=True)
    ]
    nameless = [a.result for a in accepted if not a.extension.named]
    left = (*nameless, *(a for a in tested if significant(a, threshold) and a.propose is None))
    return SearchResult(relabelled(now.base, now.base.extensions), found, tuple(accepted), left)


@dataclass(frozen=True)
class _Progress:
    """What a search has after a pass; nothing else that was computed in it is kept.

    The accepted are the last extensions of `found`, and not in `base`; `fresh` of them are new. The results of the pass
    are without residuals; those in `quiet` need not be computed again. It is `done` where no test rejected.
    """

    base: FittedChannel
    found: FittedChannel
    accepted: tuple[Accepted, ...]
    results: tuple[TestResult, ...] = ()
    quiet: tuple[TestResult, ...] = ()
    fresh: int = 0
    done: bool = False


def _begun(channel: Channel, given: tuple[Extension, ...]) -> _Progress:
    """Return the search before its first pass, gross spikes and steps accepted."""
    still = channel
    for one in given:
        still = one.clean_samples(still)
    gross = spikes.gross(still)
    accepted = (
        [Accepted(x, gross.without_proposal) for x in gross.propose()] if gross and gross.propose else []
    )
    off = tuple(one.extension for one in accepted)
    base = fit_channel(channel, given)
    found = fit_channel(channel, (*given, *off)) if off else base
    jumped = step.gross(found.cleaned, [(x.first, x.last) for x in given if isinstance(x, Motion)])
    if jumped and jumped.propose:
        accepted += [Accepted(x, jumped.without_proposal) for x in jumped.propose()]
        off = tuple(one.extension for one in accepted)
        found = fit_channel(channel, (*given, *off))
    return _Progress(base, found, tuple(accepted))


def _after_pass(last: _Progress, threshold: float) -> _Progress:
    """Return the search after one more pass: test, accept what gains most, fit again."""
    base, found, accepted = last.base, last.found, list(last.accepted)
    channel, given = found.channel, len(found.extensions) - len(accepted)
    results = hypothesis_tests(found, last.quiet)
    groups = {group_of(result.cause) for result in _candidates(results, threshold)}
    anew = {result.cause for result in last.quiet if not groups or group_of(result.cause) in groups}
    results = with_tests_anew(found, results, anew) if anew else results
    results = _settled(results, threshold)
    bare = tuple(result.without_fit for result in results)
    if last.fresh:
        known = [_with_rivals(one, last.results, results, threshold) for one in accepted[-last.fresh :]]
        accepted = [*accepted[: -last.fresh], *known]
    candidates = _candidates(results, threshold)
    if not candidates:
        moved, accepted = settled(found, accepted, threshold, pairs=True)
        return _Progress(base, moved, tuple(accepted), bare, done=moved is found)
    chosen = _clearest(candidates)
    paths = chosen.cause == "telegraph"
    jumps = [result for result in candidates if result is chosen or (paths and result.cause == "step")]
    wider = _wider(found, jumps, given)
    if wider is not None:
        found = fit_channel(channel, wider, starts=found.starts, near=found)
        base = fit_channel(channel, wider[:given], starts=base.starts)
        return _Progress(base, found, tuple(accepted), bare)
    if found is base:
        base = relabelled(base, base.extensions)  # without what was computed from it, ten times its size
    for result in sorted(_not_superseded(candidates), key=lambda result: -result.gain):
        assert result.propose is not None
        new = result.propose()
        accepted += [Accepted(extension, result.without_proposal) for extension in new]
        starts = None if any(map(_shapes_noise, new)) else found.starts
        found = fit_channel(channel, (*found.extensions, *new), starts=starts, near=found)
        fast = any(x.group == "fast spectrum" for x in new)
        found = refitted(found, MAX_REFITS if fast else 1)
        found = with_joint_resonance(found) if fast else found
        if any(isinstance(x, Template) for x in new):
            found, accepted = settled(found, accepted, threshold)
        if sorted(x.cause for x in found.extensions) != sorted(x.cause for x in last.found.extensions):
            quiet = tuple(one.without_fit for one in _still_quiet(results, threshold, new))
            return _Progress(base, found, tuple(accepted), bare, quiet, len(new))
    return _Progress(base, found, tuple(accepted), bare, done=True)


def group_of(cause: str) -> Group | None:
    """Return the group of a cause; None for a statistic that no cause owns."""
    declared = CAUSES.get(cause)
    return None if declared is None else declared.group


def _shapes_noise(extension: Extension) -> bool:
    """Return whether an extension is a filter of the white noise, which is then fitted afresh."""
    return type(extension).gain is not Extension.gain


def _clearest(candidates: list[TestResult]) -> TestResult:
    """Return the candidate of largest gain that may be accepted now."""
    return max(_not_superseded(candidates), key=lambda result: result.gain)


def _settled(results: tuple[TestResult, ...], threshold: float) -> tuple[TestResult, ...]:
    """Return the results, the clearest candidate judged closely, until that is the clearest one still."""
    while candidates := _candidates(results, threshold):
        clearest = _clearest(candidates)
        if clearest.confirm is None:
            break
        closer = clearest.confirm()
        results = tuple(closer if one is clearest else one for one in results)
    return results


def _not_superseded(candidates: list[TestResult]) -> list[TestResult]:
    """Return the results without those of causes that wait for another pass; one that waits itself keeps none back."""
    for code, cause in CAUSES.extensions().items():
        if any(result.cause == code for result in candidates):
            candidates = [result for result in candidates if result.cause not in cause.supersedes]
    return candidates


def _candidates(results: tuple[TestResult, ...], threshold: float) -> list[TestResult]:
    """Return the significant results that propose an extension with a gain."""
    return [a for a in results if significant(a, threshold) and a.gain > 0 and a.propose is not None]


def _still_quiet(
    results: tuple[TestResult, ...], threshold: float, new: tuple[Extension, ...]
) -> tuple[TestResult, ...]:
    """Return the results of groups in which no test rejects and which nothing new touches.

    They need not be computed again until another test of their group rejects, or nothing else is found.
    """
    if any(map(_shapes_noise, new)):
        return ()
    heard = {group_of(result.cause) for result in _candidates(results, threshold)} | {x.group for x in new}
    return tuple(r for r in results if group_of(r.cause) not in heard and is_tested_alone(r.cause))


def _wider(fitted: FittedChannel, candidates: list[TestResult], given: int) -> tuple[Extension, ...] | None:
    """Return the extensions with a stretch of motion widened by an event at its edge; None where there is none.

    Motion has no sharp end: a jump or a burst close by belongs to it.
    """
    for result in candidates if given else []:
        if result.cause not in ("step", "burst") or result.propose is None:
            continue
        for event in result.propose():
            assert isinstance(event, Step | Burst)
            last = event.last if isinstance(event, Burst) else event.first
            for i, moved in enumerate(fitted.extensions[:given]):
                if isinstance(moved, Motion) and moved.near(event.first, last, fitted.channel.interval):
                    wider = moved.including(event.first, last, len(fitted.channel))
                    return (*fitted.extensions[:i], wider, *fitted.extensions[i + 1 :])
    return None


def _with_rivals(
    one: Accepted, before: tuple[TestResult, ...], after: tuple[TestResult, ...], threshold: float
) -> Accepted:
    """Return what was accepted with its alternatives: causes of its group that no longer reject either."""
    group = group_of(one.result.cause)
    silent = {a.cause for a in before} - {a.cause for a in after if significant(a, threshold) and a.gain > 0}
    rivals = {
        a.cause: Alternative(a.cause, float(np.exp(min(a.gain - one.result.gain, 0.0))))
        for a in before
        if a.propose is not None
        and CAUSES[a.cause].named
        and (one.result.cause, a.cause)
        != ("telegraph", "gauss_markov")  # its statistic has beaten that already
        and a.cause in silent
        and group is not None
        and group_of(a.cause) == group
        and a.cause != one.result.cause
        and significant(a, threshold)
        and a.gain
        > max(
            one.result.gain
            - (NEAR_TWIN_NATS if {one.result.cause, a.cause} == SPECTRUM_TWINS else ALTERNATIVE_NATS),
            0.0,
        )
    }
    if one.result.cause == "gauss_markov":
        rivals |= {
            a.cause: _twin(a) for a in before if a.cause == "telegraph" and a.statistic > -ALTERNATIVE_NATS
        }
    return replace(one, alternatives=tuple(rivals.values()))


def _twin(result: TestResult) -> Alternative:
    """Return telegraph noise beside a Gauss–Markov process: the path does not contradict two levels.

    The statistic of telegraph noise is its lead over the best Gaussian model, in nats, such a process included.
    """
    return Alternative(result.cause, float(np.exp(min(result.statistic, 0.0))))


def _prune(
    fitted: FittedChannel, accepted: list[Accepted], threshold: float
) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model without the extensions whose own test does not reject once they are taken out."""
    at = 0
    given = len(fitted.extensions) - len(accepted)
    while len(accepted) > 1 and at < len(accepted):
        if accepted[at].result.gain > CERTAIN_GAIN:
            at += 1
            continue
        fewer = without(fitted, given + at)
        own = fitted.extensions[given + at]
        slow = isinstance(own, Template)
        result = judged(fewer, fitted, (own,), "") if slow else retest(fewer, own.cause)
        if result is not None and not (significant(result, threshold) and result.gain > 0):
            fitted = fewer
            accepted = [a for i, a in enumerate(accepted) if i != at]
        else:
            at += 1
    return fitted, accepted


def with_joint_estimates(fitted: FittedChannel) -> FittedChannel:
    """Return the fitted channel whose extensions carry the parameters of the joint fit."""
    estimated = []
    for index, extension in enumerate(fitted.extensions):
        at = first_column(fitted, index)
        if extension.columns(fitted.channel).shape[1] and extension.cause != "motion":
            lower, upper = fitted.reach(at)
            size = Value(float(fitted.fit.beta[at]), lower, upper)
            extension = extension.with_joint_estimate(fitted, index, size)
        estimated.append(extension)
    return relabelled(fitted, tuple(estimated)) if estimated else fitted
