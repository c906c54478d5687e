"""Errors of a drive's filter: against a reference, or where there is none against the smoother.

One rotation between the bodies of filter and reference is unknown: it is taken out of the attitudes, the one that
suits most of the drive, and so is an offset of the reference's clock that matters. Errors are scored as those of any
filter's output (`output_errors`, `correlated_errors`). The smoother is the same filter with later fixes: filter minus
smoother has the covariance P − P_smoothed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from tuner.consistency.frame_differences import errors_in_one_frame, matters
from tuner.consistency.output_errors import in_axes_of, output_errors
from tuner.consistency.output_scores import error_scores
from tuner.consistency.scores import rms_errors, score
from tuner.consistency.trajectory_alignment import Alignment, at_times, difference
from tuner.navigation.data import USED, Solution
from tuner.navigation.drive.run import Stretch, initial_estimates, initial_state
from tuner.navigation.settings import FilterSettings
from tuner.navigation.smoother import separation, smooth
from tuner.types.consistency import ERROR_UNITS, RmsError, Score
from tuner.types.filter_output import FilterOutput, filter_output
from tuner.types.records import DataError, Reference

BLOCK_LENGTH = 30.0
"""Length of the blocks of a drive that count as independent, s."""
NEIGHBOUR_ROWS = 8
"""Rows of a reference to either side that a curve through it needs: further ones act below a thousandth."""
MAX_SMOOTHED_SAMPLES = 250_000
"""Inertial samples up to which a drive is smoothed: the smoother keeps a covariance for every sample."""


def settled(stretch: Stretch, solution: Solution) -> NDArray[np.intp]:
    """Return the epochs after the initial transient of a filter."""
    return np.flatnonzero(solution.t >= stretch.settled)


def blocks(solution: Solution, rows: NDArray[np.intp]) -> list[tuple[Solution, NDArray[np.intp]]]:
    """Return epochs by blocks that count as independent, each with its solution."""
    number = ((solution.t[rows] - solution.t[rows[:1]]) // BLOCK_LENGTH).astype(int)
    return [(solution, rows[number == n]) for n in np.unique(number)]


def as_truth(reference: Reference) -> FilterOutput:
    """Return a reference as the truth of a filter's output."""
    covariance = None
    if reference.sd is not None:
        covariance = np.full((len(reference.t), 15, 15), np.nan)
        covariance[:, range(9), range(9)] = reference.sd**2
    return filter_output(
        "the reference",
        reference.t,
        llh=reference.llh,
        vel_n=reference.vel_n,
        quat_nb=rotation.quat_from_rpy(reference.rpy),
        covariance=covariance,
    )


def as_output(solution: Solution, rows: NDArray[np.intp]) -> FilterOutput:
    """Return epochs of our filter as the output of any filter."""
    return filter_output(
        "the filter",
        solution.t[rows],
        llh=solution.state.llh[rows],
        vel_n=solution.state.vel_n[rows],
        quat_nb=solution.state.quat_nb[rows],
        covariance=solution.covariance[rows][:, :15, :15],
        correlated=True,
    )


def reference_at(reference: Reference, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position, velocity, attitude angles of the reference at times inside it, NaN outside or in gaps."""
    around = np.searchsorted(reference.t, t)[:, None] + np.arange(-NEIGHBOUR_ROWS, NEIGHBOUR_ROWS)
    near = reference.rows(np.unique(np.clip(around, 0, len(reference.t) - 1)))
    found = at_times(as_truth(near), t)
    assert found.llh is not None
    return found.llh, found.vel_n, rotation.rpy_from_quat(found.quat_nb)


def differences(reference: Reference, solution: Solution, rows: NDArray[np.intp]) -> FloatArray:
    """Return reference minus estimate: position, velocity, attitude less one constant rotation; (r, 9)."""
    mine = as_output(solution, rows)
    theirs, _ = in_axes_of(at_times(as_truth(reference), mine.t), mine)
    return difference(theirs, mine)[:, :9]


def stated(reference: Reference, t: FloatArray) -> FloatArray:
    """Return the variances that a reference reports for itself, 0 where it reports none; (k, 9)."""
    if reference.sd is None:
        return np.zeros((len(t), 9))
    own = np.stack([np.interp(t, reference.t, column) for column in reference.sd.T], axis=-1)
    return np.where(np.isfinite(own), own, 0.0) ** 2


def on_clock_of(
    reference: Reference, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]
) -> tuple[Reference, str | None]:
    """Return a reference on the clock of the filter, and by how much it was late where that mattered."""
    outputs = [as_output(s, rows) for s, rows in zip(solutions, scored, strict=True) if len(rows) > 1]
    try:
        offset, runs = errors_in_one_frame(
            outputs, [as_truth(reference)] * len(outputs), Alignment.NONE, False, True
        )
    except DataError:
        return reference, None
    if offset is None or not matters(offset, runs):
        return reference, None
    low, high = sorted(-limit for limit in offset.interval)
    note = (
        f"the reference is {-offset.value:+.3g} s ({low:+.3g} … {high:+.3g}) late against the filter, in position, "
        "velocity and attitude: it is put on the clock of the filter before it is compared"
    )
    return replace(reference, t=reference.t + offset.value), note


def against_reference(
    reference: Reference, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]], *, timed: bool
) -> tuple[tuple[Score, ...], tuple[str, ...]]:
    """Score position, velocity and attitude against a reference; return notes on what was taken out, too.

    `timed` tells whether the reference was put on the clock of the filter by these errors.
    """
    truth, shift = as_truth(reference), 0.0 if timed else None
    try:
        runs = [
            output_errors(as_output(solution, rows), truth, time_offset=shift, one_body=False)
            for solution, rows in zip(solutions, scored, strict=True)
            if len(rows) > 1
        ]
    except DataError as error:
        return (), (str(error),)
    _, blocks = error_scores(runs)
    notes = [note for run in runs for note in run.notes]
    if reference.sd is None:
        notes.append("the reference states no sds: its own errors count as errors of the filter")
    return blocks, tuple(dict.fromkeys(notes))


def errors(
    reference: Reference | None, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]
) -> dict[str, RmsError]:
    """Return rms differences to the reference in the quantities it has; without a reference, rms innovations."""
    if reference is None:
        z, use = (
            np.concatenate([own[rows] for own, rows in zip(values, scored, strict=True)])
            for values in ([s.innovation for s in solutions], [s.use for s in solutions])
        )
        used = {
            name: z[use[:, j] == USED, 3 * j : 3 * j + 3] for j, name in enumerate(("position", "velocity"))
        }
        return {f"nis_{name}": RmsError.of(z, ERROR_UNITS[name]) for name, z in used.items() if len(z)}
    pairs = zip(solutions, scored, strict=True)
    return rms_errors(np.concatenate([differences(reference, s, rows) for s, rows in pairs]))


def against_smoother(
    settings: FilterSettings, stretches: Sequence[Stretch], scored: Sequence[NDArray[np.intp]]
) -> tuple[Score, ...]:
    """Score the difference of filter and smoother in position, velocity and attitude, component by component.

    A test against later fixes: it needs no reference.
    """
    lags = settings.velocity_lag or any(stretch.lag for stretch in stretches)
    if sum(len(stretch.steps.dt) for stretch in stretches) > MAX_SMOOTHED_SAMPLES or lags:
        return ()
    from tuner.navigation import reference_filter as readable  # loaded when used: filterpy is slow to import

    parts: dict[str, list[FloatArray]] = {"position": [], "velocity": [], "attitude": []}
    before: Solution | None = None
    for stretch, rows in zip(stretches, scored, strict=True):
        x, p = initial_estimates(settings, stretch, before)
        before, kept = readable.run_for_smoother(
            settings,
            initial_state(settings, stretch, x),
            stretch.steps,
            stretch.fixes,
            parameters=x,
            covariance=p,
        )
        apart = separation(smooth(before, kept))
        for _, own in blocks(before, rows[rows < len(apart)]):
            for i, name in enumerate(parts):
                parts[name].append(apart[own, 3 * i : 3 * i + 3].sum(axis=1))
    return tuple(
        score(name, groups, 3)
        for name, groups in parts.items()
        if sum(len(group) > 0 for group in groups) > 1
    )
