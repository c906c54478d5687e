"""Errors of any filter's output against a truth, on one clock and in one frame.

The errors are truth minus estimate: position, m, and velocity north, east, down, attitude as the rotation vector from
estimate to truth, biases. The error of a velocity stated along the axes of the body is the difference along these. What
the truth states of its own accuracy adds to the filter's covariance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.earth import ned_between
from tuner.consistency.trajectory_alignment import Alignment, aligned, at_times, to_tangent_plane
from tuner.consistency.wrong_conventions import refuse_wrong_conventions
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

FloatArray = NDArray[np.float64]

COARSE_OFFSET_STEP = 0.05
"""Step of the search for a time offset, s: motion of vehicles is linear over it."""
MAX_TIME_OFFSET = 3.0
"""Largest time offset that is looked for, s: stamps by another clock differ by more and do not overlap."""
DENSER_TRUTH_RATIO = 0.5
"""Interval of an estimate ÷ that of its truth below which the estimate is taken to the times of the truth."""


@dataclass(frozen=True)
class OutputErrors:
    """Errors of one run of a filter at n epochs; NaN where estimate or truth state nothing.

    Attributes
    ----------
    name : str
        Of the run.
    t : ndarray, shape (n,)
        s.
    error : ndarray, shape (n, 15)
        Truth minus estimate.
    covariance : ndarray, shape (n, 15, 15)
        As the filter predicts it, and the truth's own added.
    correlated : bool
        Whether it is known beyond the sds.
    estimate : FilterOutput
        The estimate at these epochs.
    removed : int
        Degrees of freedom that an alignment took out.
    notes : tuple of str
        What was done.
    """

    name: str
    t: FloatArray
    error: FloatArray
    covariance: FloatArray
    correlated: bool
    estimate: FilterOutput
    removed: int = 0
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.t)


def output_errors(
    estimate: FilterOutput,
    truth: FilterOutput,
    *,
    how: Alignment = Alignment.NONE,
    time_offset: float = 0.0,
) -> OutputErrors:
    """Return the errors of an estimate.

    Parameters
    ----------
    estimate, truth : FilterOutput
        The two.
    how : Alignment
        What is taken out of the positions.
    time_offset : float
        Subtracted from the stamps of the estimate, s.

    Raises
    ------
    DataError
        Where the two share no time or no frame, in one line.
    """
    moved = replace(estimate, t=estimate.t - time_offset, outages=estimate.outages - time_offset)
    begin, end = max(moved.t[0], truth.t[0]), min(moved.t[-1], truth.t[-1])
    inside = (moved.t >= begin - 1e-9) & (moved.t <= end + 1e-9)
    if np.count_nonzero(inside) < 2:
        msg = (
            f"{estimate.name}: expected times within those of {truth.name}, {truth.t[0]:.3f} … {truth.t[-1]:.3f} s, "
            f"found {estimate.t[0]:.3f} … {estimate.t[-1]:.3f} s: put both on one clock"
        )
        raise DataError(msg)
    notes: list[str] = []
    moved = moved.rows(inside)
    dense = float(np.median(np.diff(moved.t))) < DENSER_TRUTH_RATIO * float(np.median(np.diff(truth.t)))
    if dense and not moved.has_innovations:
        own = (truth.t >= begin - 1e-9) & (truth.t <= end + 1e-9)
        truth = truth.rows(own)
        moved = replace(at_times(moved, truth.t), outages=moved.outages)
        notes.append("estimate interpolated at the times of the truth, which are fewer")
    there = at_times(truth, moved.t)
    moved, there, done = _in_one_frame(moved, there, how)
    refuse_wrong_conventions(moved, there)
    error = np.full((len(moved), 15), np.nan)
    error[:, :3] = _position_error(moved, there)
    error[:, 3:6] = there.vel_n - moved.vel_n
    if np.isfinite(there.quat_nb).any() and np.isfinite(moved.quat_nb).any():
        turn = rotation.quat_multiply(there.quat_nb, rotation.quat_conjugate(moved.quat_nb))
        error[:, 6:9] = rotation.rotvec_from_quat(turn)
        if moved.vel_of_body:
            same = rotation.mat_from_quat(rotation.quat_conjugate(turn))
            error[:, 3:6] = np.einsum("nij,nj->ni", same, there.vel_n) - moved.vel_n
    error[:, 9:] = there.bias - moved.bias
    stated = np.where(np.isfinite(there.covariance), there.covariance, 0.0)
    return OutputErrors(
        estimate.name,
        moved.t,
        error,
        moved.covariance + stated,
        moved.correlated,
        moved,
        how.parameters,
        (*notes, *done),
    )


def _in_one_frame(
    estimate: FilterOutput, truth: FilterOutput, how: Alignment
) -> tuple[FilterOutput, FilterOutput, tuple[str, ...]]:
    mixed = (estimate.llh is None) != (truth.llh is None) and (
        estimate.local is not None or truth.local is not None
    )
    placed = all(one.llh is not None or one.local is not None for one in (estimate, truth))
    if mixed and placed and how is Alignment.NONE:
        msg = (
            f"{estimate.name}: expected positions in the frame of {truth.name}, found metres in one and latitude, "
            "longitude in the other: add --align yaw or --align se3"
        )
        raise DataError(msg)
    if how is Alignment.NONE:
        return estimate, truth, ()
    if not placed:
        msg = f"{estimate.name}: --align {how.value}: expected positions in estimate and truth, found none"
        raise DataError(msg)
    source = truth if truth.llh is not None else estimate
    if source.llh is not None:
        good = np.flatnonzero(np.isfinite(source.llh).all(axis=1))
        origin = source.llh[good[0]]
        estimate, truth = (
            one if one.llh is None else to_tangent_plane(one, origin) for one in (estimate, truth)
        )
    moved, notes = aligned(estimate, truth, how)
    return moved, truth, notes


def _position_error(estimate: FilterOutput, truth: FilterOutput) -> FloatArray:
    if estimate.llh is not None and truth.llh is not None:
        return ned_between(truth.llh, estimate.llh)
    if estimate.local is not None and truth.local is not None:
        return truth.local - estimate.local
    return np.full((len(estimate), 3), np.nan)


def find_time_offset(estimate: FilterOutput, truth: FilterOutput) -> float | None:
    """Return by how much the stamps of an estimate are late, s; None where nothing moves.

    The offset with the least squared difference of speeds, and of attitudes where there are no velocities; to a
    thousandth of a second. Speeds do not depend on the frame.
    """
    a, b = _speed(estimate), _speed(truth)
    good_a, good_b = np.isfinite(a), np.isfinite(b)
    if np.count_nonzero(good_a) < 10 or np.count_nonzero(good_b) < 10 or np.nanstd(b) < 1e-3:
        return None
    ta, tb, a, b = estimate.t[good_a], truth.t[good_b], a[good_a], b[good_b]
    ta = ta.copy()
    inside = (ta >= tb[0] + MAX_TIME_OFFSET) & (ta <= tb[-1] - MAX_TIME_OFFSET)
    if np.count_nonzero(inside) < 10:
        return None
    ta, a = ta[inside], a[inside]

    def misfit(offset: float) -> float:
        return float(np.mean((a - np.interp(ta - offset, tb, b)) ** 2))

    grid = np.arange(-MAX_TIME_OFFSET, MAX_TIME_OFFSET + 1e-9, COARSE_OFFSET_STEP)
    values = [misfit(x) for x in grid]
    best = int(np.argmin(values))
    from scipy.optimize import minimize_scalar  # loaded when used: slow to import

    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    return float(minimize_scalar(misfit, bounds=(low, high), method="bounded", options={"xatol": 1e-4}).x)


def _speed(given: FilterOutput) -> FloatArray:
    """Return the speed, from positions where there is no velocity; shape (n,)."""
    if np.isfinite(given.vel_n).any():
        return np.asarray(np.linalg.norm(given.vel_n, axis=1))
    local = given.local
    if given.llh is not None:
        local = ned_between(given.llh, given.llh[0])
    if local is None:
        return np.full(len(given), np.nan)
    return np.asarray(np.linalg.norm(np.gradient(local, given.t, axis=0), axis=1))
