"""The search for the causes of a drive: filter, test all causes, accept the one with the largest gain, filter again.

Accepted constants are compensated and fitted again in every run (Gauss–Newton). Rivals within `RIVAL_NATS` nats that
are no longer significant once a cause is accepted become its alternatives. Causes the drive cannot separate from it,
whatever the noise, are named as inseparable. At the end each accepted constant is taken out once more and stays only
where its own test is significant and where it is no residue of a much stronger one (`residue_of_strong_causes`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tuner.diagnosis.drive.cause_test import MIN_FACTOR
from tuner.diagnosis.drive.causes.base import is_noise_scale, is_of_single_fixes, noise_causes
from tuner.diagnosis.drive.causes.bias_jump import BIAS_JUMP
from tuner.diagnosis.drive.causes.registry import significance_threshold
from tuner.diagnosis.drive.causes.rejected_solutions import rejected_solutions
from tuner.diagnosis.drive.errors_in_variables_bias import errors_in_variables_bias
from tuner.diagnosis.drive.fitted_noise_scales import consistent_with_one, fitted_noise_scales
from tuner.diagnosis.drive.hypothesis import FilterRun, run_filter
from tuner.diagnosis.drive.hypothesis_tests import (
    Candidate,
    candidates,
    coefficients,
    noise_hypothesis_of,
    score_candidate,
)
from tuner.diagnosis.drive.linear_model.noise_parameters import EXPONENT_ENDING, ROW_GROUPS
from tuner.diagnosis.drive.residue_of_strong_causes import (
    causes_stronger_than_jump,
    explained_by_stronger,
    jump_remains,
    model_error_note,
)
from tuner.diagnosis.drive.score_tests import (
    ConstantsFit,
    ScoreTest,
    fit_constants,
    inseparable,
    late_gain,
    retest,
    undetermined,
)
from tuner.diagnosis.static.outcome import TestResult
from tuner.linear_run.likelihood import as_configured, evaluate
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE
from tuner.stages import stage, task
from tuner.types import Alternative, Coefficient, Compensation, Parameter
from tuner.types.records import DataError, Drive

MAX_ITERATIONS = 12
"""Most causes that are accepted one after another; chosen to bound the search above the number a drive has."""
STAGES_AFTER = 2
"""Stages after the last cause is taken, for those who watch: weak causes are tried without, then the intervals."""
RIVAL_NATS = 3.0
"""Nats within which a rival counts as an alternative: a Bayes factor of 20."""
MIN_CHANGE = 0.2
"""Change of an estimate, in sds, from which another filter run is worth its time: below, it costs 0.02 nats."""
MAX_STEP_LOSS, MAX_SQUARE = 3.0, 25.0
"""Loss of log likelihood, nats, that ends Gauss–Newton, and largest squared whitened innovation that counts in it.

The loss, a likelihood ratio of 20, allows for the linearisation; squares beyond 25, five sds, are outliers, which must
not decide on a step.
"""
MAX_LATE_LOSS, MIN_LATE_SHARE = 2.0, 0.05
"""Share of a constant's gain that must be gained in the last part of a drive, beyond `MAX_LATE_LOSS` nats.

A true constant gains in proportion to the length of that part on average; chosen so low that only those that lose there
are rejected.
"""
MIN_JUMP_SHARE = 0.7
"""Share of the gain of noise that a jump must gain to be taken first.

Of noise all the time, one impulse is few per cent; of a true jump only the choice of its time is lost, some ten nats.
"""
MAX_GAUSS_NEWTON_STEPS = 3
"""Most filter runs of Gauss–Newton after a cause is accepted; enough where errors of linearisation are small."""


@dataclass(frozen=True)
class Accepted:
    """An accepted cause, its test, parameters, alternatives and the causes that the drive cannot separate from it."""

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
    """Causes accepted on a drive, with the filter runs before and after.

    Attributes
    ----------
    base, final : FilterRun
        Before and after.
    accepted : tuple of Accepted
        In order of acceptance.
    unexplained : tuple of Candidate
        Tests that are still significant.
    shifts : tuple of str
        Accepted constant causes, fitted in every run.
    notes : tuple of str
        Causes that were rejected again, and why.
    undetermined : tuple of Parameter
        Fitted constants that the drive does not determine: findings name them, no setting takes them.
    """

    base: FilterRun
    final: FilterRun
    accepted: tuple[Accepted, ...]
    unexplained: tuple[Candidate, ...]
    shifts: tuple[str, ...]
    notes: tuple[str, ...] = ()
    undetermined: tuple[Parameter, ...] = ()

    def doubted(self, one: Accepted) -> tuple[str, ...]:
        """Return the parameters of an accepted cause that the drive does not determine.

        Of constants those of `undetermined`; of noise estimates at their bound, and those of a wide interval. An
        exponent is no size, what has no interval is given.
        """
        if one.cause in self.shifts:
            return tuple(p.name for p in self.undetermined if p.cause == one.cause)
        return tuple(
            name
            for name, figure in one.parameters.items()
            if not (figure.determined or name.endswith(EXPONENT_ENDING))
            and (figure.value is None or figure.interval is not None)
        )

    def as_measured(self, constants: Mapping[str, dict[str, Coefficient]]) -> SearchResult:
        """Return the result with constants, by cause, that the drive shows without a filter: these are determined."""
        return replace(
            self,
            accepted=tuple(
                replace(one, parameters=constants.get(one.cause, one.parameters)) for one in self.accepted
            ),
            undetermined=tuple(p for p in self.undetermined if p.cause not in constants),
        )

    def determined(self, compensation: Compensation) -> Compensation:
        """Return a compensation without what the drive does not determine; a class of fixes is then as reported."""
        doubted = {Parameter(one.cause, name) for one in self.accepted for name in self.doubted(one)}
        values = {
            p: value
            for p, value in compensation.items()
            if p not in self.undetermined
            and p not in doubted
            and not (_is_factor_of_sds(p) and value <= MIN_FACTOR)
        }
        common = {p: values.get(replace(p, name=p.name.partition("_class_")[0]), 1.0) for p in doubted}
        return Compensation(values).with_values({p: 1.0 / one for p, one in common.items() if one != 1.0})


def _is_factor_of_sds(parameter: Parameter) -> bool:
    return parameter.cause == GNSS_NOISE_SCALE and parameter.name.partition("_class_")[0] in ROW_GROUPS


@task()
def search_causes(
    drive: Drive,
    base: FilterRun,
    coarse: Mapping[Parameter, float],
    progress: Callable[[str], None] | None = None,
) -> SearchResult:
    """Search for the causes of a drive.

    Parameters
    ----------
    drive : Drive
        In the axes of the sensor.
    base : FilterRun
        To begin with.
    coarse : mapping of Parameter to float
        Result of a coarse search for the clocks: compensated, and fitted from the next run on.
    progress : callable, optional
        Called with what is being done.
    """
    report = progress or (lambda _: None)
    run = base
    stage("searching for causes", 1 / (2 + STAGES_AFTER))
    accepted: list[Accepted] = []
    fitted = tuple(dict.fromkeys(parameter.cause for parameter in coarse))
    if fitted:
        report("the clocks of receiver and inertial unit differ")
        run = refit_constants(drive, run_filter(drive, base.hypothesis.with_values(coarse)), fitted)
    run = _with_rejected_solutions(drive, run, fitted, accepted, report)
    tests: tuple[Candidate, ...] = ()
    previous: tuple[Candidate, ...] = ()
    exhausted: set[str] = set()
    for done in range(MAX_ITERATIONS):
        tests = candidates(run, run.whitened, fitted, significance_threshold())
        shifts = [a for a in tests if a.score_test is not None and a.is_significant(significance_threshold())]
        if shifts and run.hypothesis.errors_in_variables_bias is None:
            run = _with_errors_in_variables_bias(drive, run)
            tests = candidates(run, run.whitened, fitted, significance_threshold())
        if accepted:
            accepted[-1] = _with_rivals(accepted[-1], previous, tests)
        previous = tests
        significant = [
            a
            for a in tests
            if a.is_significant(significance_threshold()) and a.credible and a.cause not in exhausted
        ]
        stage("searching for causes", (done + 2) / (done + 2 + len(significant) + STAGES_AFTER))
        if not significant:
            break
        chosen = _best(significant)
        report(f"{chosen.cause}: {chosen.result.gain:.0f} nats")
        if chosen.score_test is not None:
            inseparable_causes = inseparable(
                run.whitened, run.linearized.parameters, chosen.cause, (*fitted, chosen.cause)
            )
            fitted = (*fitted, chosen.cause)
            # Fixes that this constant made look wrong are tested again.
            accepted = [a for a in accepted if not is_of_single_fixes(a.cause)]
            accepted.append(Accepted(chosen, {}, inseparable=inseparable_causes))
            if run.hypothesis.position_out.any() or run.hypothesis.velocity_out.any():
                run = run_filter(drive, run.hypothesis.with_all_fixes())
            # The errors-in-variables bias differs once the constant is taken out.
            run = refit_constants(
                drive,
                replace(run, hypothesis=replace(run.hypothesis, errors_in_variables_bias=None)),
                fitted,
            )
        else:
            assert chosen.test is not None
            # Factors on R and Q that were fitted together have one noise.
            together = [a for a in significant if a.test is not None and a.test.noise is chosen.test.noise]
            then = noise_causes()[chosen.cause].accepted(run, chosen.test)
            if then.is_equivalent_to(run.hypothesis):
                # The estimate is at its bound: the filter cannot follow it any further.
                exhausted |= {a.cause for a in together}
                continue
            exhausted |= set(noise_causes()[chosen.cause].covers)
            causes = {a.cause for a in together} - {"bias_jump"}
            accepted = [a for a in accepted if a.cause not in causes]
            for one in together:
                assert one.test is not None
                accepted.append(Accepted(one, {} if is_noise_scale(one.cause) else dict(one.test.describe())))
            run = refit_constants(
                drive, run_filter(drive, replace(then, errors_in_variables_bias=None)), fitted
            )
    stage("testing the causes again", 1.0)
    if fitted:
        run = _with_errors_in_variables_bias(drive, run)
    run, accepted, fitted, notes = _without_unsupported_causes(drive, run, accepted, fitted)
    run, accepted, more = _without_weak_jumps(drive, run, accepted, fitted)
    accepted = _with_noise_scales(_with_estimates(run, accepted, fitted), base, run, fitted)
    accepted = [a for a in accepted if any(c.value is not None for c in a.parameters.values())]
    left = tuple(a for a in tests if a.is_significant(significance_threshold()))
    names = run.linearized.parameters
    unclear = undetermined(run.whitened, names, fitted, run.hypothesis.compensation.vector(names))
    return SearchResult(base, run, tuple(accepted), left, fitted, (*notes, *more), unclear)


def _best(significant: Sequence[Candidate]) -> Candidate:
    """Return the cause of the largest gain, a jump of a bias before noise of the sensors that gains hardly more.

    Noise takes up a jump at once, nearly in full; a jump takes up little of what is noise all the time.
    """
    best = max(significant, key=lambda a: a.result.gain)
    if best.cause != "imu_noise_scale":
        return best
    least = MIN_JUMP_SHARE * best.result.gain
    return next((a for a in significant if a.cause == BIAS_JUMP and a.result.gain > least), best)


def _with_rejected_solutions(
    drive: Drive,
    run: FilterRun,
    fitted: tuple[str, ...],
    accepted: list[Accepted],
    report: Callable[[str], None],
) -> FilterRun:
    """Return a run with the sds of stated solutions that it rejects, which join the accepted causes."""
    values, p_value = rejected_solutions(run, significance_threshold())
    if not values:
        return run
    gain = -float(np.log(max(p_value, np.finfo(float).tiny)))
    report(f"{GNSS_NOISE_SCALE}: a class of solution of the receiver is rejected")
    result = TestResult(GNSS_NOISE_SCALE, p_value, gain, gain, "share of rejected fixes by stated solution")
    accepted.append(Accepted(Candidate(result), {}))
    sds = {Parameter(GNSS_NOISE_SCALE, name): value for name, value in values.items()}
    return refit_constants(drive, run_filter(drive, run.hypothesis.with_values(sds)), fitted)


def _fit_constants(run: FilterRun, fitted: tuple[str, ...]) -> ConstantsFit:
    names = run.linearized.parameters
    at = run.hypothesis.compensation.vector(names)
    return fit_constants(run.whitened, names, fitted, at)


def refit_constants(drive: Drive, run: FilterRun, fitted: tuple[str, ...]) -> FilterRun:
    """Compensate accepted constants as estimated and filter again until they stay, or the likelihood falls.

    Parameters
    ----------
    drive : Drive
        In the axes of the sensor.
    run : FilterRun
        To begin with.
    fitted : tuple of str
        The constant causes.
    """
    if not fitted:
        return run
    for _ in range(MAX_GAUSS_NEWTON_STEPS):
        now = _fit_constants(run, fitted)
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
    """Return a run with the errors-in-variables bias of its constants, which is then subtracted."""
    if run.hypothesis.errors_in_variables_bias is not None:
        return run
    return replace(
        run,
        hypothesis=replace(run.hypothesis, errors_in_variables_bias=errors_in_variables_bias(drive, run)),
    )


def _robust_log_likelihood(run: FilterRun) -> float:
    """Return the mean log likelihood of a row, outliers limited, times the rows of a drive."""
    noise = as_configured(run.linearized)
    every = replace(noise, rows=run.linearized.available & (noise.rows | run.linearized.scored[:, None]))
    estimates, rows = evaluate(every), every.counted
    if not rows.any():
        return 0.0
    square = np.minimum(estimates.white[rows] ** 2, MAX_SQUARE)
    return -0.5 * float(np.mean(square + np.log(estimates.variance[rows]))) * len(run.index) * 6.0


def _with_rivals(one: Accepted, before: tuple[Candidate, ...], after: tuple[Candidate, ...]) -> Accepted:
    """Return an accepted cause with the causes that did nearly as well and are not significant beside it."""
    still_significant = {a.cause for a in after if a.is_significant(significance_threshold())}
    best = one.candidate.result.gain
    rivals = tuple(
        Alternative(a.cause, float(np.exp(min(a.result.gain - best, 0.0))))
        for a in before
        if a.cause != one.cause
        and a.cause not in still_significant
        and a.result.p_value < significance_threshold()
        and a.result.gain > max(best - RIVAL_NATS, 0.0)
    )
    return replace(one, alternatives=rivals)


def _without_unsupported_causes(
    drive: Drive, run: FilterRun, accepted: list[Accepted], fitted: tuple[str, ...]
) -> tuple[FilterRun, list[Accepted], tuple[str, ...], tuple[str, ...]]:
    """Take out constants that are not significant beside all others, or lose likelihood where they were not fitted.

    Also those that may be the residue of a strong cause, with a note.
    """
    names, notes = run.linearized.parameters, []
    for cause in reversed(fitted):
        own = [parameter for parameter in names if parameter.cause == cause]
        at = run.hypothesis.compensation.vector(names)
        values = run.hypothesis.compensation.vector(own)
        w = run.whitened
        test = retest(w, names, fitted, cause, values)
        if (
            test.p_value < significance_threshold()
            and test.credible
            and _gains_late(test, late_gain(w, names, fitted, cause, at))
        ):
            if not (strong := explained_by_stronger(run, fitted, test, significance_threshold())):
                continue
            notes.append(model_error_note(cause, test.gain, strong))
        fitted = tuple(other for other in fitted if other != cause)
        accepted = [a for a in accepted if a.cause != cause]
        without = replace(run.hypothesis, compensation=run.hypothesis.compensation.without((cause,)))
        run = refit_constants(drive, run_filter(drive, without), fitted)
    return run, accepted, fitted, tuple(notes)


def _without_weak_jumps(
    drive: Drive, run: FilterRun, accepted: list[Accepted], fitted: tuple[str, ...]
) -> tuple[FilterRun, list[Accepted], tuple[str, ...]]:
    """Take out jumps of biases that may be the residue of a strong cause, with a note."""
    jumps = [a.candidate.result for a in accepted if a.cause == BIAS_JUMP]
    if len(jumps) != 1 or not (strong := causes_stronger_than_jump(run, fitted, jumps[0])):
        return run, accepted, ()
    less = run_filter(drive, replace(run.hypothesis, jumps=()))
    if jump_remains(less, fitted, strong, significance_threshold()):
        return run, accepted, ()
    note = model_error_note(BIAS_JUMP, jumps[0].gain, strong)
    return refit_constants(drive, less, fitted), [a for a in accepted if a.cause != BIAS_JUMP], (note,)


def _gains_late(test: ScoreTest, late: float) -> bool:
    """Whether a constant gains likelihood in the last part of a drive, too."""
    return late > MIN_LATE_SHARE * test.gain - MAX_LATE_LOSS


def _with_estimates(run: FilterRun, accepted: list[Accepted], fitted: tuple[str, ...]) -> list[Accepted]:
    """Return the accepted causes with the estimates of the last run, those of the coarse search first."""
    if not fitted:
        return accepted
    w = run.whitened
    now, names = _fit_constants(run, fitted), run.linearized.parameters
    by_cause = {a.cause: a for a in accepted}
    done = [a for a in accepted if a.cause not in fitted]
    for cause in fitted:
        rows = [k for k, i in enumerate(now.columns) if names[i].cause == cause]
        own = tuple(names[now.columns[k]] for k in rows)
        parameters = coefficients(own, now.value[rows], now.covariance[np.ix_(rows, rows)])
        one = by_cause.get(cause)
        if one is None:
            at = run.hypothesis.compensation.vector(own)
            one = Accepted(score_candidate(retest(w, names, fitted, cause, at)), {})
        done.append(replace(one, parameters=parameters))
    order = {a.cause: i for i, a in enumerate(accepted)}
    return sorted(done, key=lambda a: order.get(a.cause, -1))


def _with_noise_scales(
    accepted: list[Accepted], base: FilterRun, run: FilterRun, fitted: tuple[str, ...]
) -> list[Accepted]:
    """Return the accepted causes with factors on noise as fitted to the last run, without those that may all be 1."""
    causes = [one.cause for one in accepted if is_noise_scale(one.cause)]
    scales = fitted_noise_scales(causes, base, run, noise_hypothesis_of(run, fitted)) if causes else {}
    found = [replace(one, parameters=scales.get(one.cause, one.parameters)) for one in accepted]
    return [one for one in found if not is_noise_scale(one.cause) or not consistent_with_one(one.parameters)]
