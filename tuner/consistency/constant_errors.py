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
from functools import partial
from typing import NamedTuple

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.probability import student_quantile
from tuner.consistency.correlated_errors import independent_count
from tuner.consistency.frame_differences import errors_in_one_frame
from tuner.consistency.output_causes import INTERVAL_SDS, MAX_CAUSES, MIN_GAIN
from tuner.consistency.output_errors import RECORD_PARTS, OutputErrors, of_body_rotation
from tuner.consistency.output_scores import aided_rows, error_scores, state_scores
from tuner.consistency.scores import BLOCKS, DIVERGED_RATIO
from tuner.consistency.trajectory_alignment import Alignment
from tuner.consistency.wrong_conventions import MIN_IMPROVEMENT
from tuner.limits import HONEST_RATIO, SHOWN_CHANGE, TOLERATED_RATIO
from tuner.types.consistency import ERROR_UNITS, Score
from tuner.types.filter_output import FilterOutput
from tuner.types.output_score import OutputCause, TimeOffset

FITTED_STATES = 9
"""Position, velocity and attitude: what a constant acts on."""
LARGEST_TURN = 0.25 * math.pi
"""Turn, rad, up to which errors are about linear in it."""
RADIAN_IN_DEGREES = math.degrees(1.0)
"""Degrees of a radian."""


class Constant(NamedTuple):
    """A constant that errors of an output may have: the code and subject of its cause, its parts and their columns."""

    cause: str
    subject: str
    unit: str
    parts: tuple[str, ...]
    size: int
    """First parts whose norm is its size; of one, its value."""
    columns: Callable[[OutputErrors], FloatArray]
    """Derivatives of the errors by the parts, shape (n, 9, k)."""


class Squares(NamedTuple):
    """Mean square and number of independent components of the whitened errors of each block, shape (3,); 0 of none."""

    mean: FloatArray
    independent: FloatArray


class Fitted(NamedTuple):
    """A constant with what it gains, nats, and the errors without it and their squares."""

    cause: OutputCause
    rest: list[OutputErrors]
    squares: Squares


def _offset(run: OutputErrors) -> FloatArray:
    """Return derivatives by how far north, east and down the estimate is of the truth."""
    found = np.zeros((len(run), FITTED_STATES, 3))
    found[:, :3] = -np.eye(3)
    return found


def _height(run: OutputErrors) -> FloatArray:
    """Return the derivative by how far up the estimate is."""
    return -_offset(run)[..., 2:]


def _antenna(run: OutputErrors) -> FloatArray:
    """Return derivatives by how far forward, right and down the positions are of those of the truth."""
    found = np.zeros((len(run), FITTED_STATES, 3))
    found[:, :3] = -rotation.mat_from_quat(run.estimate.quat_nb)
    return found


def _point(run: OutputErrors) -> FloatArray:
    """Return derivatives by how far forward, right and down the point of positions and velocities is."""
    found, arm = _antenna(run), rotation.mat_from_quat(run.estimate.quat_nb)
    if not run.estimate.vel_of_body:
        found[:, 3:6] = -np.cross(run.rate[:, None, 6:9], np.swapaxes(arm, 1, 2)).swapaxes(1, 2)
    return found


def _turn(run: OutputErrors, blocks: int) -> FloatArray:
    """Return derivatives by a turn of so many blocks about the vertical of any point, and by their scale.

    A map has both, and a turn by many degrees shortens the way that it began with.
    """
    found = np.zeros((len(run), FITTED_STATES, 4))
    for own, of in ((slice(0, 3), _travelled(run)), (slice(3, 6), run.estimate.vel_n)):
        found[:, own, 0] = -np.cross([0.0, 0.0, 1.0], of)
        found[:, own, 1] = -of * [1.0, 1.0, 0.0]
    found[:, 8, 0] = -1.0
    found[:, :3, 2:] = -np.eye(3)[:, :2]
    found[:, 3 * blocks :] = 0.0
    return found


def _scale(run: OutputErrors) -> FloatArray:
    """Return derivatives by how much too long horizontal ways and velocities are, from a point north and east."""
    return _turn(run, blocks=2)[..., 1:]


def _travelled(run: OutputErrors) -> FloatArray:
    """Return the way since the first epoch, m, by the velocities of the truth; shape (n, 3)."""
    speed = np.nan_to_num(run.rate[:, :3])
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(run.t)[:, None]
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def _body(run: OutputErrors) -> FloatArray:
    """Return derivatives by a rotation from the body of the estimate to that of the truth."""
    return of_body_rotation(run.estimate)[:, :FITTED_STATES]


CONSTANTS = (
    Constant("gnss_frame", "height", "m", ("up",), 1, _height),
    Constant("gnss_frame", "offset", "m", ("north", "east", "down"), 3, _offset),
    Constant("lever_arm", "output", "m", ("x", "y", "z"), 3, _antenna),
    Constant("lever_arm", "output", "m", ("x", "y", "z"), 3, _point),
    Constant("gnss_frame", "scale", "1", ("scale", "north", "east"), 1, _scale),
    *(
        Constant(
            "gnss_frame",
            "rotation",
            "rad",
            ("yaw", "scale", "north", "east"),
            1,
            partial(_turn, blocks=number),
        )
        for number in (1, 2, 3)
    ),
    Constant("mounting", "", "rad", ("roll", "pitch", "yaw"), 3, _body),
)
"""Constants that act linearly, the simplest first."""


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
            for constant in CONSTANTS
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
    clock = wanted["time_offset"] and any(np.isfinite(run.rate[:, :FITTED_STATES]).any() for run in runs)
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
    found = _cause(CONSTANTS[-1], body.vector, np.diag(body.sd**2), INTERVAL_SDS, _gain(before, squares, 3))
    return Fitted(found, rest, squares)


def _fitted(runs: Sequence[OutputErrors], before: Squares, constant: Constant) -> Fitted | None:
    """Return a constant at its likeliest size, None where the errors do not show it."""
    tables = []
    each = [constant.columns(run) for run in runs]
    for run, columns in zip(runs, each, strict=True):
        error, sd = run.error[:, :FITTED_STATES], _sds(run)
        known = np.isfinite(error) & np.isfinite(columns).all(axis=2)
        known[np.setdiff1d(np.arange(len(run)), aided_rows(run))] = False
        w = np.where(known, error / sd, 0.0)
        x = np.where(known[..., None], columns / sd[..., None], 0.0)
        for rows in np.array_split(np.arange(len(run)), max(2, RECORD_PARTS // len(runs))):
            tables.append(
                (np.einsum("njk,njl->kl", x[rows], x[rows]), np.einsum("njk,nj->k", x[rows], w[rows]))
            )
    squares, products = (np.stack(one) for one in zip(*tables, strict=True))
    whole = squares.sum(axis=0)
    if np.linalg.matrix_rank(whole, hermitian=True) != len(whole):
        return None
    value = np.linalg.solve(whole, products.sum(axis=0))
    left = [
        np.linalg.lstsq(whole - square, products.sum(axis=0) - product, rcond=None)[0]
        for square, product in zip(squares, products, strict=True)
    ]
    off = np.stack(left) - np.mean(left, axis=0)
    covariance = (len(left) - 1) / len(left) * off.T @ off
    wide = float(student_quantile(0.975, len(left) - 1))
    rest = [_without(run, columns, value) for run, columns in zip(runs, each, strict=True)]
    after = _squares(rest)
    found = _cause(constant, value, covariance, wide, _gain(before, after, len(value)))
    low, high = found.interval
    if 0.5 * (high - low) > abs(found.size) or (constant.unit == "rad" and abs(found.size) > LARGEST_TURN):
        return None
    return Fitted(found, rest, after)


def _cause(
    constant: Constant, value: FloatArray, covariance: FloatArray, wide: float, gain: float
) -> OutputCause:
    """Return a constant of this value as a cause, with intervals of `wide` sds."""
    vector, own = value[: constant.size], covariance[: constant.size, : constant.size]
    length = float(np.linalg.norm(vector))
    size = length if constant.size > 1 else float(value[0])
    spread = wide * math.sqrt(float(vector @ own @ vector)) / max(length, 1e-300)
    halves = wide * np.sqrt(np.diag(covariance))
    parts = {
        name: (float(v), float(v - half), float(v + half))
        for name, v, half in zip(constant.parts, value, halves, strict=True)
    }
    interval = (size - spread, size + spread)
    return OutputCause(constant.cause, size, interval, constant.unit, gain, parts, constant.subject, (), True)


def _without(run: OutputErrors, columns: FloatArray, value: FloatArray) -> OutputErrors:
    """Return the errors without a constant, whose derivatives join those of what was taken out."""
    error, more = run.error.copy(), np.zeros((len(run), 15, len(value)))
    more[:, :FITTED_STATES] = np.nan_to_num(columns)
    error[:, :FITTED_STATES] -= columns @ value
    return replace(run, error=error, directions=np.concatenate([run.directions, more], axis=2))


def _sds(run: OutputErrors) -> FloatArray:
    """Return the sds of position, velocity and attitude, shape (n, 9); 1 for states of which not all are stated."""
    variance = np.einsum("kii->ki", run.covariance)[:, :FITTED_STATES]
    stated = np.all(variance > 0.0, axis=0)
    return np.sqrt(np.where(stated, variance, 1.0))


def _squares(runs: Sequence[OutputErrors]) -> Squares:
    """Return the squares of the whitened errors of position, velocity and attitude while aided."""
    whitened = [(run.error[:, :FITTED_STATES] / _sds(run))[aided_rows(run)] for run in runs]
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
