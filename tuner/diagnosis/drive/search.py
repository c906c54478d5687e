"""The search for the causes of a drive: filter, test all causes, accept the one with the largest gain, filter again.

Accepted constants are compensated and fitted again in every run (Gauss–Newton). Rivals within `RIVAL_NATS` nats that
are no longer significant once a cause is accepted become its alternatives. Causes the drive cannot separate from it,
whatever the noise, are named as inseparable. At the end each accepted constant is taken out once more and stays only
where its own test is significant and where it is no residue of a much stronger one (`residue_of_strong_causes`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tuner.diagnosis.drive.causes.base import is_noise_scale, is_of_single_fixes, noise_causes
from tuner.diagnosis.drive.causes.bias_jump import CAUSE as JUMP
from tuner.diagnosis.drive.causes.noise_scale import FINDING_NAMES
from tuner.diagnosis.drive.causes.registry import significance_threshold
from tuner.diagnosis.drive.causes.reported_sd import (
    coefficient,
    edge_coefficients,
    reported_levels,
    sd_model_factor,
    sd_model_parameters,
)
from tuner.diagnosis.drive.errors_in_variables_bias import errors_in_variables_bias
from tuner.diagnosis.drive.hypothesis import FilterRun, run_filter
from tuner.diagnosis.drive.hypothesis_tests import (
    Candidate,
    candidates,
    coefficients,
    noise_hypothesis_of,
    score_candidate,
)
from tuner.diagnosis.drive.linear_model.likelihood import as_configured, evaluate
from tuner.diagnosis.drive.linear_model.linearized_run import NOISE_GROUPS
from tuner.diagnosis.drive.linear_model.noise_fit import maximize_likelihood
from tuner.diagnosis.drive.linear_model.noise_parameters import noise_parameters, present
from tuner.diagnosis.drive.residue_of_strong_causes import (
    causes_stronger_than_jump,
    explained_by_stronger,
    jump_remains,
    rejection_note,
)
from tuner.diagnosis.drive.score_tests import (
    ConstantsFit,
    ScoreTest,
    fit_constants,
    inseparable,
    late_gain,
    retest,
)
from tuner.navigation.fix_sd_model import CAUSE as GNSS_NOISE_SCALE
from tuner.types import Alternative, Coefficient, Parameter
from tuner.types.records import DataError, Drive

MAX_ITERATIONS = 12
RIVAL_NATS = 3.0
"""Nats within which a rival counts as an alternative."""
MIN_CHANGE = 0.2
"""Change of an estimate, in standard deviations, from which it is worth another pass."""
MAX_STEP_LOSS, MAX_SQUARE = 3.0, 25.0
"""Nats by which a step may worsen the likelihood; largest square that counts in it."""
MAX_LATE_LOSS, MIN_LATE_SHARE = 2.0, 0.05
"""Nats that a shift may lose in the last part of a drive with constants from the first, and the share of all that it
gains which must be gained there before."""
MAX_GAUSS_NEWTON_STEPS = 3
"""Passes of Gauss–Newton after an acceptance, at most."""


@dataclass(frozen=True)
class Accepted:
    """A cause, what spoke for it, and how well it is known."""

    candidate: Candidate
    parameters: dict[str, Coefficient]
    alternatives: tuple[Alternative, ...] = ()
    inseparable: tuple[str, ...] = ()

    @property
    def cause(self) -> str:
        """Code of the cause."""
        return self.candidate.cause


@dataclass(frozen=True)
class SearchResult:
    """Outcome of the loop.

    Attributes
    ----------
    base, final : FilterRun
        Before and after.
    accepted : tuple of Accepted
        In order of acceptance.
    unexplained : tuple of Candidate
        What still alarms.
    shifts : tuple of str
        Accepted causes that are fitted in every pass.
    notes : tuple of str
        What was taken back, and why.
    """

    base: FilterRun
    final: FilterRun
    accepted: tuple[Accepted, ...]
    unexplained: tuple[Candidate, ...]
    shifts: tuple[str, ...]
    notes: tuple[str, ...] = ()


def search_causes(
    drive: Drive,
    base: FilterRun,
    coarse: Mapping[Parameter, float],
    progress: Callable[[str], None] | None = None,
) -> SearchResult:
    """Find the causes in a drive.

    Parameters
    ----------
    drive : Drive
        In sensor axes.
    base : FilterRun
        To begin with.
    coarse : mapping of Parameter to float
        What a coarse search found: compensated and fitted from the next pass on.
    progress : callable, optional
        Called with what is being done.
    """
    say = progress or (lambda _: None)
    run = base
    accepted: list[Accepted] = []
    known = tuple(dict.fromkeys(parameter.cause for parameter in coarse))
    if known:
        say("the clocks of receiver and inertial unit differ")
        run = refit_constants(drive, run_filter(drive, base.hypothesis.with_values(coarse)), known)
    alarms: tuple[Candidate, ...] = ()
    previous: tuple[Candidate, ...] = ()
    spent: set[str] = set()
    for _ in range(MAX_ITERATIONS):
        alarms = candidates(run, run.whitened, known, significance_threshold())
        shifts = [a for a in alarms if a.scored is not None and a.is_significant(significance_threshold())]
        if shifts and run.hypothesis.errors_in_variables_bias is None:
            run = _with_errors_in_variables_bias(drive, run)
            alarms = candidates(run, run.whitened, known, significance_threshold())
        if accepted:
            accepted[-1] = _with_rivals(accepted[-1], previous, alarms)
        previous = alarms
        raised = [
            a
            for a in alarms
            if a.is_significant(significance_threshold()) and a.credible and a.cause not in spent
        ]
        if not raised:
            break
        chosen = max(raised, key=lambda a: a.alarm.gain)
        say(f"{chosen.cause}: {chosen.alarm.gain:.0f} nats")
        if chosen.scored is not None:
            alike = inseparable(run.whitened, run.linearized.parameters, chosen.cause, (*known, chosen.cause))
            known = (*known, chosen.cause)
            # Fixes that a shift made look wrong are asked again.
            accepted = [a for a in accepted if not is_of_single_fixes(a.cause)]
            accepted.append(Accepted(chosen, {}, inseparable=alike))
            if run.hypothesis.position_out.any() or run.hypothesis.velocity_out.any():
                run = run_filter(drive, run.hypothesis.with_all_fixes())
            # What noise leans on is another thing where the shift is taken out.
            run = refit_constants(
                drive,
                replace(run, hypothesis=replace(run.hypothesis, errors_in_variables_bias=None)),
                known,
            )
        else:
            assert chosen.claim is not None
            # Factors on R and Q that were fitted together have one noise.
            together = [a for a in raised if a.claim is not None and a.claim.noise is chosen.claim.noise]
            then = noise_causes()[chosen.cause].accepted(run, chosen.claim)
            if then.is_equivalent_to(run.hypothesis):
                # What is asked for is at its bound: the filter can have no more of it.
                spent |= {a.cause for a in together}
                continue
            causes = {a.cause for a in together} - {"bias_jump"}
            accepted = [a for a in accepted if a.cause not in causes]
            for one in together:
                assert one.claim is not None
                accepted.append(
                    Accepted(one, {} if is_noise_scale(one.cause) else dict(one.claim.describe()))
                )
            run = refit_constants(
                drive, run_filter(drive, replace(then, errors_in_variables_bias=None)), known
            )
    if known:
        run = _with_errors_in_variables_bias(drive, run)
    run, accepted, known, notes = _without_unsupported_causes(drive, run, accepted, known)
    run, accepted, more = _without_weak_jumps(drive, run, accepted, known)
    accepted = _with_noise_scales(_with_estimates(run, accepted, known), base, run, known)
    accepted = [a for a in accepted if not is_noise_scale(a.cause) or not _consistent_with_one(a.parameters)]
    accepted = [a for a in accepted if any(c.value is not None for c in a.parameters.values())]
    left = tuple(a for a in alarms if a.is_significant(significance_threshold()))
    return SearchResult(base, run, tuple(accepted), left, known, (*notes, *more))


def _fit_constants(run: FilterRun, known: tuple[str, ...]) -> ConstantsFit:
    names = run.linearized.parameters
    at = run.hypothesis.compensation.vector(names)
    return fit_constants(run.whitened, names, known, at)


def refit_constants(drive: Drive, run: FilterRun, known: tuple[str, ...]) -> FilterRun:
    """Compensate accepted shifts as estimated and filter again until they stay, or the drive likes it no better.

    Parameters
    ----------
    drive : Drive
        In sensor axes.
    run : FilterRun
        To begin with.
    known : tuple of str
        The shifts.
    """
    if not known:
        return run
    for _ in range(MAX_GAUSS_NEWTON_STEPS):
        now = _fit_constants(run, known)
        names = [run.linearized.parameters[i] for i in now.columns]
        at = run.hypothesis.compensation.vector(names)
        if np.all(np.abs(now.shrunk - at) < MIN_CHANGE * np.sqrt(np.diag(now.covariance))):
            break
        values = dict(zip(names, now.shrunk.tolist(), strict=True))
        try:
            then = run_filter(drive, run.hypothesis.with_values(values))
        except DataError:  # so shifted, the drive cannot even be aligned
            break
        if _robust_log_likelihood(then) < _robust_log_likelihood(run) - MAX_STEP_LOSS:
            break
        run = then
    return run


def _with_errors_in_variables_bias(drive: Drive, run: FilterRun) -> FilterRun:
    """Return a pass with what noise makes of constants taken out."""
    if run.hypothesis.errors_in_variables_bias is not None:
        return run
    return replace(
        run,
        hypothesis=replace(run.hypothesis, errors_in_variables_bias=errors_in_variables_bias(drive, run)),
    )


def _robust_log_likelihood(run: FilterRun) -> float:
    """Return the log likelihood of a row, outliers limited, times the rows of a drive."""
    noise = as_configured(run.linearized)
    every = replace(noise, rows=run.linearized.available & (noise.rows | run.linearized.scored[:, None]))
    told, rows = evaluate(every), every.counted
    if not rows.any():
        return 0.0
    square = np.minimum(told.white[rows] ** 2, MAX_SQUARE)
    return -0.5 * float(np.mean(square + np.log(told.variance[rows]))) * len(run.index) * 6.0


def _with_rivals(one: Accepted, before: tuple[Candidate, ...], after: tuple[Candidate, ...]) -> Accepted:
    """Return what was accepted with the causes that did nearly as well and fell silent with it."""
    loud = {a.cause for a in after if a.is_significant(significance_threshold())}
    best = one.candidate.alarm.gain
    rivals = tuple(
        Alternative(a.cause, float(np.exp(min(a.alarm.gain - best, 0.0))))
        for a in before
        if a.cause != one.cause
        and a.cause not in loud
        and a.alarm.p_value < significance_threshold()
        and a.alarm.gain > max(best - RIVAL_NATS, 0.0)
    )
    return replace(one, alternatives=rivals)


def _without_unsupported_causes(
    drive: Drive, run: FilterRun, accepted: list[Accepted], known: tuple[str, ...]
) -> tuple[FilterRun, list[Accepted], tuple[str, ...], tuple[str, ...]]:
    """Take out shifts whose own test is silent beside all others, or that do harm where they were not fitted.

    Also what a strong shift may have left behind, with a note.
    """
    names, notes = run.linearized.parameters, []
    for cause in reversed(known):
        own = [parameter for parameter in names if parameter.cause == cause]
        at = run.hypothesis.compensation.vector(names)
        values = run.hypothesis.compensation.vector(own)
        w = run.whitened
        alarm = retest(w, names, known, cause, values)
        if (
            alarm.p_value < significance_threshold()
            and alarm.credible
            and _gains_late(alarm, late_gain(w, names, known, cause, at))
        ):
            if not (strong := explained_by_stronger(run, known, alarm, significance_threshold())):
                continue
            notes.append(rejection_note(cause, alarm.gain, strong))
        known = tuple(other for other in known if other != cause)
        accepted = [a for a in accepted if a.cause != cause]
        without = replace(run.hypothesis, compensation=run.hypothesis.compensation.without((cause,)))
        run = refit_constants(drive, run_filter(drive, without), known)
    return run, accepted, known, tuple(notes)


def _without_weak_jumps(
    drive: Drive, run: FilterRun, accepted: list[Accepted], known: tuple[str, ...]
) -> tuple[FilterRun, list[Accepted], tuple[str, ...]]:
    """Take out jumps of biases that a strong shift may have left behind, with a note."""
    jumps = [a.candidate.alarm for a in accepted if a.cause == JUMP]
    if len(jumps) != 1 or not (strong := causes_stronger_than_jump(run, known, jumps[0])):
        return run, accepted, ()
    less = run_filter(drive, replace(run.hypothesis, jumps=()))
    if jump_remains(less, known, strong, significance_threshold()):
        return run, accepted, ()
    note = rejection_note(JUMP, jumps[0].gain, strong)
    return refit_constants(drive, less, known), [a for a in accepted if a.cause != JUMP], (note,)


def _gains_late(alarm: ScoreTest, late: float) -> bool:
    """Whether a shift gains in the last part of a drive, too."""
    return late > MIN_LATE_SHARE * alarm.gain - MAX_LATE_LOSS


def _with_estimates(run: FilterRun, accepted: list[Accepted], known: tuple[str, ...]) -> list[Accepted]:
    """Return what was accepted with the estimates of the last pass, coarse findings first."""
    if not known:
        return accepted
    w = run.whitened
    now, names = _fit_constants(run, known), run.linearized.parameters
    by_cause = {a.cause: a for a in accepted}
    done = [a for a in accepted if a.cause not in known]
    for cause in known:
        rows = [k for k, i in enumerate(now.columns) if names[i].cause == cause]
        own = tuple(names[now.columns[k]] for k in rows)
        parameters = coefficients(own, now.value[rows], now.covariance[np.ix_(rows, rows)])
        one = by_cause.get(cause)
        if one is None:
            at = run.hypothesis.compensation.vector(own)
            one = Accepted(score_candidate(retest(w, names, known, cause, at)), {})
        done.append(replace(one, parameters=parameters))
    order = {a.cause: i for i, a in enumerate(accepted)}
    return sorted(done, key=lambda a: order.get(a.cause, -1))


def _with_noise_scales(
    accepted: list[Accepted], base: FilterRun, run: FilterRun, known: tuple[str, ...]
) -> list[Accepted]:
    """Return what was accepted, factors on noise as the last pass has them: all of them and shifts together."""
    causes = [one.cause for one in accepted if is_noise_scale(one.cause)]
    if not causes:
        return accepted
    noise = noise_hypothesis_of(run, known)
    values = run.hypothesis.compensation.of(GNSS_NOISE_SCALE)
    said = reported_levels(run.linearized, values)
    wanted = {"gnss_noise_scale": sd_model_parameters(values), "imu_noise_scale": NOISE_GROUPS}
    names = present(noise, tuple(name for cause in causes for name in wanted[cause]), said)
    fit = maximize_likelihood(noise, noise_parameters(names, said))
    told: dict[str, dict[str, Coefficient]] = {cause: {} for cause in causes}
    for name in names:
        if name in wanted["gnss_noise_scale"]:
            told["gnss_noise_scale"][name] = coefficient(fit, name, sd_model_factor(values, name))
        elif name in FINDING_NAMES:
            sensor = FINDING_NAMES[name]
            now, then = (each.hypothesis.config.channels[f"{sensor}_x"].white_density for each in (run, base))
            told["imu_noise_scale"][sensor] = fit.coefficient(name, scale=float(now / then))
    if "gnss_noise_scale" in causes:
        told["gnss_noise_scale"] |= edge_coefficients(values)
    return [replace(one, parameters=told.get(one.cause, one.parameters)) for one in accepted]


def _consistent_with_one(parameters: Mapping[str, Coefficient]) -> bool:
    """Whether all factors may be 1: what spoke for them has found another cause since."""
    return bool(parameters) and all(
        c.interval[0] < 1.0 < c.interval[1] if c.interval else c.upper is None or c.upper > 1.0
        for c in parameters.values()
    )
