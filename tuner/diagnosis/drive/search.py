"""The loop over a drive: filter, test, hold true what gains most, filter again, until all families are silent.

Accepted shifts of the innovations are compensated and fitted again in every pass (Gauss–Newton). Rivals within
`CLOSE` nats that fall silent with what was accepted are its alternatives. What the drive cannot tell apart from it,
whatever the noise, is named as inseparable. At the end each accepted shift is taken out once more and stays only
where its own test alarms, and where it is no leftover of a much stronger one (`doubt`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tuner.diagnosis.drive.causes.bias_jump import CAUSE as JUMP
from tuner.diagnosis.drive.causes.gnss_outliers import KINDS
from tuner.diagnosis.drive.causes.noise_scale import SHORT
from tuner.diagnosis.drive.causes.reported_sd import coefficient, edges_told, factor_in, names_in, said_by
from tuner.diagnosis.drive.errors_in_variables_bias import leaning
from tuner.diagnosis.drive.hypothesis import Pass, examine
from tuner.diagnosis.drive.hypothesis_tests import (
    Candidate,
    adopted,
    candidates,
    coefficients,
    noise_hypothesis_of,
    shift,
)
from tuner.diagnosis.drive.linear_model.likelihood import as_configured, evaluate
from tuner.diagnosis.drive.linear_model.linearized_run import GROUPS
from tuner.diagnosis.drive.linear_model.noise_fit import maximise
from tuner.diagnosis.drive.linear_model.noise_parameters import factors, present
from tuner.diagnosis.drive.residue_of_strong_causes import doubted, jump_left_by, jumps_still, left_by
from tuner.diagnosis.drive.score_tests import PRIORS, Fit, Scored, carried, fit, inseparable, retested
from tuner.types import Alternative, Coefficient
from tuner.types.records import DataError, Drive

BUDGET = 3e-3
"""Chance of any finding in a clean drive."""
FAMILIES = len(PRIORS) + 8
THRESHOLD = BUDGET / FAMILIES
"""Chance below which a family alarms."""
FACTORS = ("gnss_noise_scale", "imu_noise_scale")
"""Causes that are factors on groups of noise: estimated once, at the end."""
PASSES = 12
CLOSE = 3.0
"""Nats within which a rival counts as an alternative."""
MOVED = 0.2
"""Change of an estimate, in standard deviations, from which it is worth another pass."""
SLACK, LIMIT = 3.0, 25.0
"""Nats by which a step may worsen the likelihood; largest square that counts in it."""
HARM, LASTING = 2.0, 0.05
"""Nats that a shift may lose in the last part of a drive with constants from the first, and the share of all that it
gains which must be gained there before."""
STEPS = 3
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
class Criticism:
    """Outcome of the loop.

    Attributes
    ----------
    base, final : Pass
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

    base: Pass
    final: Pass
    accepted: tuple[Accepted, ...]
    unexplained: tuple[Candidate, ...]
    shifts: tuple[str, ...]
    notes: tuple[str, ...] = ()


def criticise(
    drive: Drive, base: Pass, coarse: Mapping[str, float], progress: Callable[[str], None] | None = None
) -> Criticism:
    """Find the causes in a drive.

    Parameters
    ----------
    drive : Drive
        In sensor axes.
    base : Pass
        To begin with.
    coarse : mapping of str to float
        What a coarse search found: compensated and fitted from the next pass on.
    progress : callable, optional
        Called with what is being done.
    """
    say = progress or (lambda _: None)
    found = base
    accepted: list[Accepted] = []
    known = tuple(dict.fromkeys(name.partition(".")[0] for name in coarse))
    if known:
        say("the clocks of receiver and inertial unit differ")
        found = refined(drive, examine(drive, base.hypothesis.with_values(coarse)), known)
    alarms: tuple[Candidate, ...] = ()
    previous: tuple[Candidate, ...] = ()
    spent: set[str] = set()
    for _ in range(PASSES):
        alarms = candidates(found, found.whitened, known, THRESHOLD)
        shifts = [a for a in alarms if a.scored is not None and a.raised(THRESHOLD)]
        if shifts and found.hypothesis.leaning is None:
            found = _upright(drive, found)
            alarms = candidates(found, found.whitened, known, THRESHOLD)
        if accepted:
            accepted[-1] = _with_rivals(accepted[-1], previous, alarms)
        previous = alarms
        raised = [a for a in alarms if a.raised(THRESHOLD) and a.credible and a.cause not in spent]
        if not raised:
            break
        chosen = max(raised, key=lambda a: a.alarm.gain)
        say(f"{chosen.cause}: {chosen.alarm.gain:.0f} nats")
        if chosen.scored is not None:
            alike = inseparable(found.whitened, found.record.parameters, chosen.cause, (*known, chosen.cause))
            known = (*known, chosen.cause)
            # Fixes that a shift made look wrong are asked again.
            accepted = [a for a in accepted if a.cause not in KINDS]
            accepted.append(Accepted(chosen, {}, inseparable=alike))
            if found.hypothesis.position_out.any() or found.hypothesis.velocity_out.any():
                found = examine(drive, found.hypothesis.with_all_fixes())
            # What noise leans on is another thing where the shift is taken out.
            found = refined(drive, replace(found, hypothesis=replace(found.hypothesis, leaning=None)), known)
        else:
            assert chosen.claim is not None
            # Factors on R and Q that were fitted together have one noise.
            together = [a for a in raised if a.claim is not None and a.claim.noise is chosen.claim.noise]
            then = adopted(found, chosen.claim)
            if then.is_like(found.hypothesis):
                # What is asked for is at its bound: the filter can have no more of it.
                spent |= {a.cause for a in together}
                continue
            causes = {a.cause for a in together} - {"bias_jump"}
            accepted = [a for a in accepted if a.cause not in causes]
            for one in together:
                assert one.claim is not None
                accepted.append(Accepted(one, {} if one.cause in FACTORS else dict(one.claim.describe())))
            found = refined(drive, examine(drive, replace(then, leaning=None)), known)
    if known:
        found = _upright(drive, found)
    found, accepted, known, notes = _pruned(drive, found, accepted, known)
    found, accepted, more = _without_weak_jumps(drive, found, accepted, known)
    accepted = _rescaled(_estimated(found, accepted, known), base, found, known)
    accepted = [a for a in accepted if a.cause not in FACTORS or not _as_told(a.parameters)]
    accepted = [a for a in accepted if any(c.value is not None for c in a.parameters.values())]
    left = tuple(a for a in alarms if a.raised(THRESHOLD))
    return Criticism(base, found, tuple(accepted), left, known, (*notes, *more))


def _fit(found: Pass, known: tuple[str, ...]) -> Fit:
    names = found.record.parameters
    at = np.array([found.hypothesis.values.get(name, 0.0) for name in names])
    return fit(found.whitened, names, known, at)


def refined(drive: Drive, found: Pass, known: tuple[str, ...]) -> Pass:
    """Compensate accepted shifts as estimated and filter again until they stay, or the drive likes it no better.

    Parameters
    ----------
    drive : Drive
        In sensor axes.
    found : Pass
        To begin with.
    known : tuple of str
        The shifts.
    """
    if not known:
        return found
    for _ in range(STEPS):
        now = _fit(found, known)
        names = [found.record.parameters[i] for i in now.columns]
        at = np.array([found.hypothesis.values.get(name, 0.0) for name in names])
        if np.all(np.abs(now.shrunk - at) < MOVED * np.sqrt(np.diag(now.covariance))):
            break
        values = dict(zip(names, now.shrunk.tolist(), strict=True))
        try:
            then = examine(drive, found.hypothesis.with_values(values))
        except DataError:  # so shifted, the drive cannot even be aligned
            break
        if _likelihood(then) < _likelihood(found) - SLACK:
            break
        found = then
    return found


def _upright(drive: Drive, found: Pass) -> Pass:
    """Return a pass with what noise makes of constants taken out."""
    if found.hypothesis.leaning is not None:
        return found
    return replace(found, hypothesis=replace(found.hypothesis, leaning=leaning(drive, found)))


def _likelihood(found: Pass) -> float:
    """Return the log likelihood of a row, outliers limited, times the rows of a drive."""
    noise = as_configured(found.record)
    every = replace(noise, rows=found.record.available & (noise.rows | found.record.scored[:, None]))
    told, rows = evaluate(every), every.counted
    if not rows.any():
        return 0.0
    square = np.minimum(told.white[rows] ** 2, LIMIT)
    return -0.5 * float(np.mean(square + np.log(told.variance[rows]))) * len(found.index) * 6.0


def _with_rivals(one: Accepted, before: tuple[Candidate, ...], after: tuple[Candidate, ...]) -> Accepted:
    """Return what was accepted with the causes that did nearly as well and fell silent with it."""
    loud = {a.cause for a in after if a.raised(THRESHOLD)}
    best = one.candidate.alarm.gain
    rivals = tuple(
        Alternative(a.cause, float(np.exp(min(a.alarm.gain - best, 0.0))))
        for a in before
        if a.cause != one.cause
        and a.cause not in loud
        and a.alarm.p_value < THRESHOLD
        and a.alarm.gain > max(best - CLOSE, 0.0)
    )
    return replace(one, alternatives=rivals)


def _pruned(
    drive: Drive, found: Pass, accepted: list[Accepted], known: tuple[str, ...]
) -> tuple[Pass, list[Accepted], tuple[str, ...], tuple[str, ...]]:
    """Take out shifts whose own test is silent beside all others, or that do harm where they were not fitted.

    Also what a strong shift may have left behind, with a note.
    """
    names, notes = found.record.parameters, []
    for cause in reversed(known):
        own = [name for name in names if name.partition(".")[0] == cause]
        at = np.array([found.hypothesis.values.get(name, 0.0) for name in names])
        values = np.array([found.hypothesis.values.get(name, 0.0) for name in own])
        w = found.whitened
        alarm = retested(w, names, known, cause, values)
        if (
            alarm.p_value < THRESHOLD
            and alarm.credible
            and _lasts(alarm, carried(w, names, known, cause, at))
        ):
            if not (strong := left_by(found, known, alarm, THRESHOLD)):
                continue
            notes.append(doubted(cause, alarm.gain, strong))
        known = tuple(other for other in known if other != cause)
        accepted = [a for a in accepted if a.cause != cause]
        kept = {n: v for n, v in found.hypothesis.values.items() if n not in own}
        found = refined(drive, examine(drive, replace(found.hypothesis, values=kept)), known)
    return found, accepted, known, tuple(notes)


def _without_weak_jumps(
    drive: Drive, found: Pass, accepted: list[Accepted], known: tuple[str, ...]
) -> tuple[Pass, list[Accepted], tuple[str, ...]]:
    """Take out jumps of biases that a strong shift may have left behind, with a note."""
    jumps = [a.candidate.alarm for a in accepted if a.cause == JUMP]
    if len(jumps) != 1 or not (strong := jump_left_by(found, known, jumps[0])):
        return found, accepted, ()
    less = examine(drive, replace(found.hypothesis, jumps=()))
    if jumps_still(less, known, strong, THRESHOLD):
        return found, accepted, ()
    note = doubted(JUMP, jumps[0].gain, strong)
    return refined(drive, less, known), [a for a in accepted if a.cause != JUMP], (note,)


def _lasts(alarm: Scored, late: float) -> bool:
    """Whether a shift gains in the last part of a drive, too."""
    return late > LASTING * alarm.gain - HARM


def _estimated(found: Pass, accepted: list[Accepted], known: tuple[str, ...]) -> list[Accepted]:
    """Return what was accepted with the estimates of the last pass, coarse findings first."""
    if not known:
        return accepted
    w = found.whitened
    now, names = _fit(found, known), found.record.parameters
    by_cause = {a.cause: a for a in accepted}
    done = [a for a in accepted if a.cause not in known]
    for cause in known:
        rows = [k for k, i in enumerate(now.columns) if names[i].partition(".")[0] == cause]
        own = tuple(names[now.columns[k]] for k in rows)
        parameters = coefficients(own, now.value[rows], now.covariance[np.ix_(rows, rows)])
        one = by_cause.get(cause)
        if one is None:
            at = np.array([found.hypothesis.values.get(name, 0.0) for name in own])
            one = Accepted(shift(retested(w, names, known, cause, at)), {})
        done.append(replace(one, parameters=parameters))
    order = {a.cause: i for i, a in enumerate(accepted)}
    return sorted(done, key=lambda a: order.get(a.cause, -1))


def _rescaled(accepted: list[Accepted], base: Pass, found: Pass, known: tuple[str, ...]) -> list[Accepted]:
    """Return what was accepted, factors on noise as the last pass has them: all of them and shifts together."""
    causes = [one.cause for one in accepted if one.cause in FACTORS]
    if not causes:
        return accepted
    noise, values = noise_hypothesis_of(found, known), found.hypothesis.values
    said = said_by(found.record, values)
    wanted = {"gnss_noise_scale": names_in(values), "imu_noise_scale": GROUPS}
    names = present(noise, tuple(name for cause in causes for name in wanted[cause]), said)
    fit = maximise(noise, factors(names, said))
    told: dict[str, dict[str, Coefficient]] = {cause: {} for cause in causes}
    for name in names:
        if name in wanted["gnss_noise_scale"]:
            told["gnss_noise_scale"][name] = coefficient(fit, name, factor_in(values, name))
        elif name in SHORT:
            sensor = SHORT[name]
            now, then = (
                each.hypothesis.config.channels[f"{sensor}_x"].white_density for each in (found, base)
            )
            told["imu_noise_scale"][sensor] = fit.coefficient(name, scale=float(now / then))
    if "gnss_noise_scale" in causes:
        told["gnss_noise_scale"] |= edges_told(values)
    return [replace(one, parameters=told.get(one.cause, one.parameters)) for one in accepted]


def _as_told(parameters: Mapping[str, Coefficient]) -> bool:
    """Whether all factors may be 1: what spoke for them has found another cause since."""
    return bool(parameters) and all(
        c.interval[0] < 1.0 < c.interval[1] if c.interval else c.upper is None or c.upper > 1.0
        for c in parameters.values()
    )
