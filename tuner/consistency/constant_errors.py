"""Constants between an estimate and its truth: clocks, datums, lever arms, frames and units of sds, before any noise.

An offset of the clocks or of the height, the arm to another point of the vehicle, turned axes act on all epochs alike.
Each has columns D of derivatives of the errors, known from the motion, and its size by least squares::

    w = (errors, D x) ÷ sd        S = mean of w² of a block        gain = Σ ½ ν ln(S_before/S_after) − ½ k ln Σ ν

over position, velocity and attitude, with the ν independent components of each (`correlated_errors`). The sds of a
block may be wrong by any one factor: they weigh epochs against each other, no more. The constant of most gain is taken
out, and the search goes on. Intervals are those of the jackknife over parts of the record.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.filter_states.declaration import NAVIGATION_STATES
from models.probability import REACH_95
from tuner.consistency.constants import BODY, OF_OUTPUT, Constant, Motion, by_leaving_out
from tuner.consistency.correlated_errors import independent_count
from tuner.consistency.frame_differences import errors_in_one_frame
from tuner.consistency.output_causes import MAX_CAUSES, MIN_GAIN
from tuner.consistency.output_errors import RECORD_PARTS, OutputErrors
from tuner.consistency.output_scores import aided_rows, error_scores, state_scores
from tuner.consistency.scores import BLOCKS, DIVERGED_RATIO
from tuner.consistency.trajectory_alignment import Alignment
from tuner.consistency.wrong_conventions import MIN_IMPROVEMENT
from tuner.limits import HONEST_RATIO, SHOWN_CHANGE, TOLERATED_RATIO
from tuner.types.consistency import ERROR_UNITS, Score
from tuner.types.filter_output import FilterOutput
from tuner.types.output_score import OutputCause, TimeOffset

LARGEST_TURN = 0.25 * math.pi
"""Turn, rad, up to which errors are about linear in it."""
RADIAN_IN_DEGREES = math.degrees(1.0)
"""Degrees of a radian."""


class Squares(NamedTuple):
    """Mean square and number of independent components of the whitened errors of each block, shape (3,); 0 of none."""

    mean: FloatArray
    independent: FloatArray


class Fitted(NamedTuple):
    """A constant with what it gains, nats, and the errors without it and their squares."""

    cause: OutputCause
    rest: list[OutputErrors]
    squares: Squares


def motion_of(run: OutputErrors) -> Motion:
    """Return the motion by which constants act on the errors of a run: the way by the velocities of the truth."""
    speed = np.nan_to_num(run.rate[:, :3])
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(run.t)[:, None]
    way = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    attitude = rotation.mat_from_quat(run.estimate.quat_nb)
    return Motion(
        way, run.estimate.vel_n, run.rate[:, 3:6], run.rate[:, 6:9], attitude, run.estimate.vel_of_body
    )


def constant_errors(
    outputs: Sequence[FilterOutput],
    truths: Sequence[FilterOutput],
    how: Alignment,
    runs: Sequence[OutputErrors],
    offset: TimeOffset | None,
) -> tuple[tuple[OutputCause, ...], list[OutputErrors]]:
    """Return the constants between estimates and truths that matter, the clearest first, and the errors without them.

    Parameters
    ----------
    outputs, truths : sequence of FilterOutput
        What is compared, a truth for each output.
    how : Alignment
        What is taken out of the positions.
    runs : sequence of OutputErrors
        Their errors.
    offset : TimeOffset or None
        Offset of the clocks, where one was found.
    """
    rest, squares = list(runs), _squares(runs)
    first = squares
    aligned = {
        "time_offset": offset is None or offset.removed,
        "mounting": any(run.body is not None for run in runs),
    }
    found: list[OutputCause] = []
    while len(found) < MAX_CAUSES:
        taken = {(one.cause, one.subject) for one in found}
        tried = [
            fit
            for constant in OF_OUTPUT
            if (constant.cause, constant.subject) not in taken and not aligned.get(constant.cause)
            if (fit := _fitted(rest, squares, constant)) is not None
        ]
        if all(one.cause in aligned for one in found):  # these do not act linearly: before all others
            tried += [
                fit
                for cause, known in aligned.items()
                if not known
                and (fit := _aligned(outputs, truths, how, rest, squares, aligned | {cause: True}, cause))
            ]
        best, known = None, (False, MIN_GAIN)  # what leaves nothing far off goes before what gains more
        for one in tried:
            mine = (_explain(squares, one.squares), one.cause.gain)
            more = one.cause.gain > MIN_GAIN and mine > known
            if more and _matters(best.squares if best else squares, one.squares):
                best, known = one, mine
        if best is None:
            break
        found.append(best.cause)
        rest, squares = best.rest, best.squares
        aligned |= {best.cause.cause: True} if best.cause.cause in aligned else {}
    return (tuple(found), rest) if _explain(first, squares) else ((), list(runs))


def _aligned(
    outputs: Sequence[FilterOutput],
    truths: Sequence[FilterOutput],
    how: Alignment,
    runs: Sequence[OutputErrors],
    before: Squares,
    wanted: Mapping[str, bool],
    cause: str,
) -> Fitted | None:
    """Return an offset of the clocks or a rotation of the body, and the errors with these taken out as wanted."""
    clock = wanted["time_offset"] and any(np.isfinite(run.rate[:, :NAVIGATION_STATES]).any() for run in runs)
    offset, rest = errors_in_one_frame(outputs, truths, how, align_time=clock, align_body=wanted["mounting"])
    squares = _squares(rest)
    if cause == "time_offset":
        if offset is None or np.prod(offset.interval) <= 0.0:
            return None
        gain, stamps = _gain(before, squares, 1), "stamps of the output or of the truth"
        late = OutputCause(cause, offset.value, offset.interval, "s", gain, {}, stamps, (), True)
        return Fitted(late, rest, squares)
    body = rest[0].body
    if body is None or not np.isfinite(body.vector).all():
        return None
    gain = _gain(before, squares, 3)
    found = BODY.found(body.vector, np.diag(body.sd**2), REACH_95, gain, constant=True)
    return Fitted(found, rest, squares)


def _fitted(runs: Sequence[OutputErrors], before: Squares, constant: Constant) -> Fitted | None:
    """Return a constant at its likeliest size, None where the errors do not show it."""
    tables = []
    each = [constant.columns(motion_of(run)) for run in runs]
    for run, columns in zip(runs, each, strict=True):
        error, sd = run.error[:, :NAVIGATION_STATES], _sds(run)
        known = np.isfinite(error) & np.isfinite(columns).all(axis=2)
        known[np.setdiff1d(np.arange(len(run)), aided_rows(run))] = False
        w = np.where(known, error / sd, 0.0)
        x = np.where(known[..., None], columns / sd[..., None], 0.0)
        for rows in np.array_split(np.arange(len(run)), max(2, RECORD_PARTS // len(runs))):
            tables.append(
                (np.einsum("njk,njl->kl", x[rows], x[rows]), np.einsum("njk,nj->k", x[rows], w[rows]))
            )
    solved = by_leaving_out(*(np.stack(one) for one in zip(*tables, strict=True)))
    if solved is None:
        return None
    value, covariance, wide = solved
    rest = [_without(run, columns, value) for run, columns in zip(runs, each, strict=True)]
    after = _squares(rest)
    found = constant.found(value, covariance, wide, _gain(before, after, len(value)), constant=True)
    low, high = found.interval
    if 0.5 * (high - low) > abs(found.size) or (constant.unit == "rad" and abs(found.size) > LARGEST_TURN):
        return None
    return Fitted(found, rest, after)


def _without(run: OutputErrors, columns: FloatArray, value: FloatArray) -> OutputErrors:
    """Return the errors without a constant, whose derivatives join those of what was taken out."""
    error, more = run.error.copy(), np.zeros((len(run), 15, len(value)))
    more[:, :NAVIGATION_STATES] = np.nan_to_num(columns)
    error[:, :NAVIGATION_STATES] -= columns @ value
    return replace(run, error=error, directions=np.concatenate([run.directions, more], axis=2))


def _sds(run: OutputErrors) -> FloatArray:
    """Return the sds of position, velocity and attitude, shape (n, 9); 1 for states of which not all are stated."""
    variance = np.einsum("kii->ki", run.covariance)[:, :NAVIGATION_STATES]
    stated = np.all(variance > 0.0, axis=0)
    return np.sqrt(np.where(stated, variance, 1.0))


def _squares(runs: Sequence[OutputErrors]) -> Squares:
    """Return the squares of the whitened errors of position, velocity and attitude while aided."""
    whitened = [(run.error[:, :NAVIGATION_STATES] / _sds(run))[aided_rows(run)] for run in runs]
    found = []
    for own in (BLOCKS[name] for name in ERROR_UNITS):
        parts = [w[np.isfinite(w[:, own]).all(axis=1), own] for w in whitened]
        parts = [part for part in parts if len(part) > 1]
        mean = np.mean(np.concatenate(parts) ** 2) if parts else 0.0
        found.append((mean, sum(3.0 * independent_count(part) for part in parts)))
    return Squares(*np.array(found, dtype=float).T)


def _gain(before: Squares, after: Squares, numbers: int) -> float:
    """Return the log likelihood that errors gain without constants, less the price of these numbers, nats."""
    known = before.mean * after.mean > 0.0
    count = after.independent[known]
    ratio = np.log(before.mean[known] / after.mean[known])
    return float(0.5 * count @ ratio) - 0.5 * numbers * math.log(max(float(count.sum()), 1.0))


def _explain(before: Squares, after: Squares) -> bool:
    """Return whether the errors of each block without constants are not far, or nearer by as much as makes them far."""
    return bool(
        (np.sqrt(after.mean) < np.maximum(DIVERGED_RATIO, np.sqrt(before.mean) / DIVERGED_RATIO)).all()
    )


def _matters(before: Squares, after: Squares) -> bool:
    """Return whether errors of a block that are not honest are smaller without a constant by a change that is shown."""
    smaller = np.sqrt(after.mean) < (1.0 - SHOWN_CHANGE) * np.sqrt(before.mean)
    return bool((smaller & (before.mean > HONEST_RATIO**2)).any())


def unit_of_sds(
    runs: Sequence[OutputErrors], blocks: Sequence[Score]
) -> tuple[tuple[OutputCause, ...], list[OutputErrors]]:
    """Return in which other unit sds are stated, or that they are variances, and the errors with sds as meant.

    That is so where the errors of each state of these blocks fit its sd then within `TOLERATED_RATIO`, and no block is
    `MIN_IMPROVEMENT` off any more, as one was: a filter may be wrong by any factor, and meets that of a unit in all its
    states by chance only. `blocks` are the scores of the runs.
    """
    worst = _worst(blocks)
    if worst is None:
        return (), list(runs)
    readings = {subject: meant for subject, meant in READINGS.items() if worst.name in meant}
    for subject, meant in readings.items():
        tried = list(runs)
        for name, of in meant.items():
            tried = [_with_sds(run, BLOCKS[name], of) for run in tried]
        each = [one.ratio for one in state_scores(tried) if one.name.rpartition("_")[0] in meant]
        near = min(each) > 1.0 / TOLERATED_RATIO and max(each) < TOLERATED_RATIO
        alone = len(meant) == 1 and not subject.startswith("attitude in")
        shaped = not alone or _shape_gain(runs, tried, worst.name) >= MIN_GAIN
        if near and shaped and _worst(error_scores(tried)[1]) is None:
            gain = 0.5 * worst.effective * (worst.mean / worst.dof - 1.0 - math.log(worst.mean / worst.dof))
            cause = OutputCause("unit_of_sds", worst.ratio, worst.interval, "1", gain, {}, subject, (), True)
            return (cause,), tried
    return (), list(runs)


def _shape_gain(before: Sequence[OutputErrors], after: Sequence[OutputErrors], block: str) -> float:
    """Return the log likelihood that errors of a block gain by other sds, each times the factor that fits best, nats.

    Constant sds, whose roots are as constant, gain nothing.
    """
    own, costs = BLOCKS[block], []
    for runs in (before, after):
        pairs = [(run.error[:, own], _sds(run)[:, own]) for run in runs]
        e, sd = (np.concatenate(one) for one in zip(*pairs, strict=True))
        known = np.isfinite(e)
        costs.append(0.5 * math.log(np.mean((e[known] / sd[known]) ** 2)) + float(np.mean(np.log(sd[known]))))
    return float((costs[0] - costs[1]) * _squares(after).independent[own.start // 3])


def _worst(blocks: Sequence[Score]) -> Score | None:
    """Return the score of the block that is off most; None where none is off by `MIN_IMPROVEMENT`."""
    known = [one for one in blocks if one.name in ERROR_UNITS and one.ratio > 0.0]
    worst = max(known, key=lambda one: abs(math.log(one.ratio)), default=None)
    if worst is None or 1.0 / MIN_IMPROVEMENT < worst.ratio < MIN_IMPROVEMENT:
        return None
    return worst


Reading = Callable[[FloatArray], FloatArray]
"""Makes the sds that are meant of those that were taken."""
IN_DEGREES: tuple[Reading, Reading] = (
    lambda sd: np.sqrt(sd / RADIAN_IN_DEGREES),
    lambda sd: RADIAN_IN_DEGREES * sd**2,
)
"""What roots and squares of numbers in deg mean."""
READINGS: dict[str, dict[str, Reading]] = {
    "attitude in rad": {"attitude": lambda sd: sd * RADIAN_IN_DEGREES},
    "attitude in deg": {"attitude": lambda sd: sd / RADIAN_IN_DEGREES},
    "variances": {"position": np.sqrt, "velocity": np.sqrt, "attitude": np.sqrt},
    "variances in deg²": {"position": np.sqrt, "velocity": np.sqrt, "attitude": IN_DEGREES[0]},
    "roots": {"position": np.square, "velocity": np.square, "attitude": np.square},
    "roots in deg": {"position": np.square, "velocity": np.square, "attitude": IN_DEGREES[1]},
    "position variances": {"position": np.sqrt},
    "velocity variances": {"velocity": np.sqrt},
    "attitude variances": {"attitude": IN_DEGREES[0]},
}
"""What sds may be instead, by the name of the block."""


def _with_sds(run: OutputErrors, own: slice, of: Reading) -> OutputErrors:
    """Return errors whose covariance has other sds of a block of the estimate, correlations as they are."""
    factor = np.ones((len(run), 15))
    sd = np.sqrt(np.einsum("kii->ki", run.estimate.covariance)[:, own])
    factor[:, own] = np.where(sd > 0.0, of(sd) / np.where(sd > 0.0, sd, 1.0), 1.0)
    return replace(run, covariance=factor[:, :, None] * run.covariance * factor[:, None, :])
