"""Score any filter by what it wrote: errors against a truth, or innovations against their S.

Several outputs are runs of a Monte Carlo. Scores, verdicts and their words are those of `tuner check`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from tuner.consistency.constant_errors import LARGEST_TURN, constant_errors, unit_of_sds
from tuner.consistency.correlated_errors import whitened
from tuner.consistency.frame_differences import errors_in_one_frame
from tuner.consistency.one_factor import one_factor
from tuner.consistency.output_causes import explain
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.output_rows import with_stated_sds, without_repeats
from tuner.consistency.output_scores import (
    aided_rows,
    error_scores,
    outage_scores,
    output_innovation_scores,
    output_whiteness,
    scored,
    state_scores,
)
from tuner.consistency.scores import DIVERGED_RATIO, rms_errors
from tuner.consistency.trajectory_alignment import Alignment
from tuner.consistency.unscored_start import unscored_start
from tuner.consistency.verdicts import NOT_FINITE, verdicts
from tuner.limits import HONEST_RATIO, TOLERATED_RATIO
from tuner.stages import stage, task
from tuner.types.consistency import Consistency, RmsError, Score
from tuner.types.filter_output import FilterOutput
from tuner.types.judgement import Use
from tuner.types.output_score import OutputCause, TimeOffset
from tuner.types.public import public
from tuner.types.records import DataError
from tuner.types.shown import Shown
from tuner.types.verdict import Severity, Verdict, VerdictCode

MOST_UNEVEN = 1e-3
"""Difference of two opposite elements of a covariance, relative to the two sds, that single precision leaves."""


@dataclass(frozen=True, repr=False)
class OutputScore(Shown):
    """The outcome of scoring a filter by its output.

    Attributes
    ----------
    consistency : Consistency
        Scores and verdicts.
    states : tuple of Score
        Of each state alone.
    causes : tuple of OutputCause
        What explains the errors of an inconsistent filter, the likeliest first.
    time_offset : TimeOffset or None
        None without a truth or motion.
    runs : tuple of OutputErrors
        Errors over time; none without a truth.
    outputs : tuple of FilterOutput
        What was scored.
    notes : tuple of str
        What was assumed, found and done.
    without_constants : Consistency or None
        Scores without the constants among the causes; None where there are none.
    """

    consistency: Consistency
    states: tuple[Score, ...]
    causes: tuple[OutputCause, ...]
    time_offset: TimeOffset | None
    runs: tuple[OutputErrors, ...]
    outputs: tuple[FilterOutput, ...]
    notes: tuple[str, ...]
    without_constants: Consistency | None = None


@task()
def score_outputs(
    outputs: Sequence[FilterOutput],
    truths: Sequence[FilterOutput] = (),
    *,
    how: Alignment = Alignment.NONE,
    align_time: bool = False,
    align_body: bool = False,
    outages: ArrayLike = (),
    sensor_noise: tuple[float, float] | None = None,
) -> OutputScore:
    """Score the output of a filter.

    Parameters
    ----------
    outputs : sequence of FilterOutput
        Runs of one filter.
    truths : sequence of FilterOutput
        One for all runs, one for each, or none: then the innovations are scored alone.
    how : Alignment
        What is taken out of the positions.
    align_time : bool
        Whether an offset of the clocks is taken out.
    align_body : bool
        Whether a constant rotation between the bodies of estimate and truth is taken out of the attitudes.
    outages : array_like, shape (w, 2)
        Begin and end of outages beyond those that the outputs mark, s.
    sensor_noise : (float, float), optional
        White densities of gyros (rad/s/√Hz) and accelerometers (m/s²/√Hz) at rest, to tell causes apart.

    Raises
    ------
    DataError
        Where there is nothing to score, in one line.
    """
    windows = np.asarray(outages, dtype=float).reshape(-1, 2)
    outputs = [
        with_stated_sds(without_repeats(replace(o, outages=np.concatenate([o.outages, windows]))))
        for o in outputs
    ]
    _refuse_idle(outputs, windows)
    stage("comparing with the truth", 0.2)
    if len(truths) not in (0, 1, len(outputs)):
        raise DataError(
            f"expected one truth, or one for each of {len(outputs)} estimates, found {len(truths)}"
        )
    notes = [note for output in (*outputs, *truths) for note in output.notes]
    every = list(truths) if len(truths) == len(outputs) else [*truths] * len(outputs)
    offset: TimeOffset | None = None
    runs: list[OutputErrors] = []
    if every:
        offset, runs = errors_in_one_frame(outputs, every, how, align_time, align_body)
        notes += [note for run in runs for note in run.notes]
    stage("scoring", 0.35)
    innovative = [output for output in outputs if output.has_innovations]
    if not runs and not innovative:
        raise DataError(
            f"{outputs[0].name}: expected a truth (--truth) or innovations with their sds (z_n, …, sd_z_n, …), found "
            "neither: there is nothing to score by"
        )
    found = _scores(runs, innovative)
    constants: tuple[OutputCause, ...] = ()
    rest, left = runs, found
    if runs and found.blocks:
        if not _fits(found) or any(one.ratio > HONEST_RATIO for one in found.scores):
            constants, rest = constant_errors(outputs, every, how, runs, offset)
            left = _scores(rest, innovative) if constants else found
        units, rest = unit_of_sds(rest, left.blocks)
        constants, left = (*constants, *units), _scores(rest, innovative) if units else left
    if runs and not found.blocks:
        sds = [np.diagonal(one.covariance, axis1=1, axis2=2) for one in runs]
        stated = any(np.isfinite(one.error * sd).any() for one, sd in zip(runs, sds, strict=True))
        few = f"{sum(len(one.t) for one in runs)} epochs are too few to compare its errors with its sds"
        none = "the estimate states no sds of what the truth has"
        notes.append(f"{few if stated else none}: only its errors are shown")
    stage("finding why it is not consistent", 0.9)
    lost = any(_not_finite(output) for output in outputs)
    causes: tuple[OutputCause, ...] = ()
    misfit: float | None = None
    if not lost:
        if constants and not (_is_far(found) and not _is_far(left)):
            of_filter, _ = explain(runs, sensor_noise=sensor_noise)
            # a model of the filter tells its fixes from its output
            if of_filter and (of_filter[0].subject == "fixes" or not left.consistent):
                causes = of_filter[:1] if left.consistent else of_filter  # one constant explains all
                constants, rest, left = (), runs, found
        if not (causes or _explained(left, constants)):
            of_what = rest or [_without_truth(o) for o in innovative]
            causes, misfit = explain(of_what, sensor_noise=sensor_noise)
    notes += unscored_start(rest, left.blocks)
    causes = _without_contradicted(causes, left.scores)
    grow = _is_far(left) and not causes and _grow(rest)
    stage("scoring each state", 1.0)
    states = state_scores(runs) if runs else ()
    if not (_explained(left, constants) or causes or lost or grow):
        factor = one_factor(left.scores, state_scores(rest) if rest else ())
        causes = () if factor is None else (factor,)
    causes = (*constants, *causes)
    if misfit is not None and not (left.consistent or causes):
        notes.append(
            "no cause is sought: no filter with states of position, velocity, attitude, biases and scale factors that "
            f"uses such fixes has these sds, whatever its noise ({100.0 * misfit:.0f} % off, rms)"
        )
    found = replace(found, diverged=lost or grow)
    return OutputScore(
        replace(found, verdicts=_verdicts(found, lost=lost, named=bool(causes) or misfit is not None)),
        states,
        causes,
        offset,
        tuple(runs),
        tuple(outputs),
        tuple(dict.fromkeys(notes)),
        left if constants else None,
    )


def _refuse_idle(outputs: Sequence[FilterOutput], windows: FloatArray) -> None:
    """Refuse outages outside of all outputs, and an output that comes twice: it is one run, not two.

    Raises
    ------
    DataError
        One line.
    """
    first, last = (float(f([f(o.t) for o in outputs])) for f in (np.min, np.max))
    for begin, end in windows:
        if end <= first or begin >= last:
            raise DataError(
                f"outage {begin:g},{end:g}: expected times of the estimates, {first:g} to {last:g} s, found none"
            )
    named: dict[bytes, str] = {}
    for one in outputs:
        parts = (one.t, one.llh, one.local, one.vel_n, one.quat_nb, one.bias, one.innovation)
        numbers = b" ".join(b"" if part is None else part.tobytes() for part in parts)
        if (digest := hashlib.sha256(numbers).digest()) in named:
            raise DataError(
                f"{one.name}: expected runs that differ, found the numbers of {named[digest]} again: name it once"
            )
        named[digest] = one.name


def _fits(found: Consistency) -> bool:
    """Return whether nothing speaks against the filter, nor calls it optimistic or pessimistic."""
    return found.consistent and found.honesty.use not in (Use.OPTIMISTIC, Use.PESSIMISTIC)


def _explained(left: Consistency, constants: Sequence[OutputCause]) -> bool:
    """Return whether scores without constants leave nothing to explain."""
    return _fits(left) or (bool(constants) and left.honesty.good and not _is_far(left))


def _is_far(found: Consistency) -> bool:
    """Return whether a score is as large as that of a filter that diverged."""
    return any(score.ratio > DIVERGED_RATIO for score in found.scores)


def _grow(runs: Sequence[OutputErrors]) -> bool:
    """Return whether the errors of a block are far larger in the last third of the runs than in the first."""
    for first in range(0, 9, 3):
        errors = [run.error[aided_rows(run), first : first + 3] for run in runs]
        parts = [np.array_split(e[np.isfinite(e).all(axis=1)], 3) for e in errors]
        begin, end = (np.concatenate([part[at] for part in parts]) for at in (0, 2))
        if len(begin) and np.mean(end**2) > TOLERATED_RATIO**2 * np.mean(begin**2):
            return True
    return False


def _scores(runs: Sequence[OutputErrors], innovative: Sequence[FilterOutput]) -> Consistency:
    """Return the scores of errors and of innovations, without a verdict."""
    nees, blocks = error_scores(runs) if runs else (None, ())
    return Consistency(
        nees,
        blocks,
        output_innovation_scores(innovative) if innovative else (),
        output_whiteness(innovative) if innovative else None,
        outage_scores(runs) if runs else (),
        rms_errors(np.concatenate([run.error[aided_rows(run)] for run in runs])) if runs else {},
        0.0,
        False,
    )


def _verdicts(found: Consistency, *, lost: bool, named: bool) -> tuple[Verdict, ...]:
    """Return the verdicts: that numbers are not finite, or those of the scores, and whether no cause is named."""
    if lost:
        return NOT_FINITE
    said = verdicts(found)
    if found.consistent or named or found.diverged:
        return said
    return (Verdict(VerdictCode.NOT_EXPLAINED, Severity.EXPLANATION), *said)


@public("score")
def score_arrays(
    errors: ArrayLike, covariances: ArrayLike, *, names: Sequence[str] | None = None
) -> Consistency:
    """Score errors of any states against the covariances that a filter predicts for them.

    Parameters
    ----------
    errors : array_like, shape (n, k) or (m, n, k)
        Of one run at n epochs, of m runs; of m runs at one epoch: ``errors[:, None]``.
    covariances : array_like, shape (..., k, k), or that of `errors`
        Covariances, one for all or one each; or sds.
    names : sequence of str, optional
        Of the k states; by default ``state 1`` and so on.

    Raises
    ------
    DataError
        Shapes that do not fit, or covariances that are not positive definite, in one line.
    """
    e = np.atleast_2d(np.asarray(errors, dtype=float))
    e = e[None] if e.ndim == 2 else e
    k = e.shape[-1]
    p = np.asarray(covariances, dtype=float)
    if np.isfinite(e).all() and not np.isfinite(p).all():
        raise DataError("covariances: expected finite numbers, found NaN or infinite ones")
    if p.shape == np.shape(errors) and p.ndim > 1:
        if (p <= 0.0).any():
            raise DataError(f"covariances: expected sds above 0, found {p.min():g}")
        p = p[..., None] ** 2 * np.eye(k)
    if e.ndim != 3 or 0 in e.shape or p.shape[-2:] != (k, k) or p.ndim > 4:
        shapes = f"{np.shape(errors)} and {np.shape(covariances)}"
        raise DataError(f"expected errors (m, n, k) and covariances (m, n, k, k), found shapes {shapes}")
    with np.errstate(invalid="ignore"):
        size = np.sqrt(np.abs(np.einsum("...ii->...i", p)))
        uneven = np.abs(p - np.swapaxes(p, -1, -2)) > MOST_UNEVEN * size[..., :, None] * size[..., None, :]
    if uneven.any():
        i, j = (int(at[0]) for at in np.nonzero(uneven)[-2:])
        raise DataError(
            f"covariances: expected symmetric matrices, found {p[uneven][0]:g} of states {i + 1} and {j + 1} and "
            f"{np.swapaxes(p, -1, -2)[uneven][0]:g} of states {j + 1} and {i + 1}"
        )
    try:
        p = np.broadcast_to(p, (*e.shape, k))
        w = whitened(e[..., None], p)[..., 0]
    except (ValueError, np.linalg.LinAlgError) as error:
        raise DataError(
            f"expected positive definite covariances of shape {(*e.shape, k)}, found {p.shape}: {error}"
        ) from None
    states = tuple(names) if names is not None else tuple(f"state {j + 1}" for j in range(k))
    if len(set(states)) != k:
        raise DataError(f"expected {k} different names of states, found {', '.join(map(str, states))}")
    if not np.isfinite(w).all():
        return Consistency(None, (), (), None, (), {}, 0.0, True, NOT_FINITE)
    single = e / np.sqrt(np.einsum("mnii->mni", p))
    tests = k + 1 if k > 1 else 1
    single_epochs = e.shape[1] == 1
    nees = scored({"nees": list(w[..., None])}, tests, independent=single_epochs).get("nees")
    each = {name: list(single[..., j : j + 1, None]) for j, name in enumerate(states) if k > 1}
    rms = np.sqrt(np.mean(e**2, axis=(0, 1)))
    found = Consistency(
        nees,
        tuple(scored(each, tests, independent=single_epochs).values()),
        (),
        None,
        (),
        {name: RmsError((float(v),)) for name, v in zip(states, rms, strict=True)},
        0.0,
        nees is not None and nees.ratio > DIVERGED_RATIO,
    )
    return replace(found, verdicts=verdicts(found))


def _without_truth(output: FilterOutput) -> OutputErrors:
    """Return an output whose errors are not known."""
    n = len(output)
    unknown, nothing = np.full((n, 15), np.nan), np.zeros((n, 15, 0))
    return OutputErrors(
        output.t,
        unknown,
        output.covariance,
        output,
        np.zeros((n, 9)),
        unknown,
        nothing,
    )


def _not_finite(output: FilterOutput) -> bool:
    """Tell whether estimates that the filter had become infinite or NaN at the end."""
    parts: Mapping[str, FloatArray | None] = {
        "position": output.llh if output.llh is not None else output.local,
        "velocity": output.vel_n,
        "attitude": output.quat_nb,
    }
    return any(
        part is not None and np.isfinite(part).any() and not np.isfinite(part[-1]).all()
        for part in parts.values()
    )


def _without_contradicted(causes: Sequence[OutputCause], scores: Sequence[Score]) -> tuple[OutputCause, ...]:
    """Return the causes up to one that the scores contradict.

    A factor on the whole covariance divides each ratio of NEES by itself, one on R or Q alone by something between 1
    and itself: where none of these brings the first ratio into its band, the errors are not those of such a filter,
    whatever their likelihood.
    """
    kept: list[OutputCause] = []
    first = scores[0] if scores else None  # NEES of all states, or of the only block
    alone = len(causes) == 1
    for cause in causes:
        partly = alone and cause.cause in ("gnss_noise_scale", "imu_noise_scale")
        if first is not None and (partly or cause.cause == "noise_scale"):
            low, high = ((limit / first.dof) ** 0.5 for limit in first.band)
            after = [first.ratio / size for size in (*cause.interval, *([1.0] if partly else []))]
            if max(after) < low or min(after) > high:
                break
        if cause.unit == "rad" and cause.size > LARGEST_TURN:  # the model is linear
            break
        kept.append(cause)
    return tuple(kept)
