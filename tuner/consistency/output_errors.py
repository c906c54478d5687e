"""Errors of any filter's output against a truth, on one clock and in one frame.

The errors are truth minus estimate: position, m, and velocity north, east, down, attitude as the rotation vector from
estimate to truth, biases. The error of a velocity stated along the axes of the body is the difference along these. What
the truth states of its own accuracy, and what it leaves open between its rows, adds to the filter's covariance. Of
what was taken out, an offset of the clocks, a rotation between the bodies, a motion of the whole, the derivatives of
the errors are kept: the scores need them for the degrees of freedom that are left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.consistency.trajectory_alignment import (
    Alignment,
    Curves,
    aligned,
    at_times,
    curves_of,
    difference,
    interpolation_variance,
    rate_of,
    to_tangent_plane,
)
from tuner.consistency.velocity_of_positions import MATTERING_SHARE, velocity_contradiction
from tuner.consistency.wrong_conventions import refuse_wrong_conventions
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

DENSER_TRUTH_RATIO = 0.5
"""Interval of an estimate ÷ that of its truth below which the estimate is taken to the times of the truth."""
MAX_MEDIAN_DISTANCES = 4.0
"""Attitudes farther off than so many median distances do not decide on the rotation between the bodies."""
RECORD_PARTS = 10
"""Parts of a record whose scatter gives the sd of a constant that is fitted to all of it."""
SELECTION_ROUNDS = 5
"""Times that this selection and the rotation are repeated."""


@dataclass(frozen=True)
class BodyRotation:
    """A constant rotation from the body of a truth to that of an estimate: rotation vector and its sd, rad."""

    vector: FloatArray
    sd: FloatArray

    def note(self, estimate: str, truth: str) -> tuple[str, ...]:
        """Return a note that it was taken out."""
        if not np.isfinite(self.vector).all():
            return ()
        words = ", ".join(
            f"{value:.3g} ± {sd:.1g}"
            for value, sd in zip(np.degrees(self.vector), np.degrees(self.sd), strict=True)
        )
        return (
            f"a constant rotation between the bodies of {estimate} and {truth} is taken out of the attitudes: "
            f"{words} deg about forward, right and down",
        )


@dataclass(frozen=True)
class OutputErrors:
    """Errors of one run of a filter at n epochs; NaN where estimate or truth state nothing.

    Attributes
    ----------
    t : ndarray, shape (n,)
        s.
    error : ndarray, shape (n, 15)
        Truth minus estimate.
    covariance : ndarray, shape (n, 15, 15)
        As the filter predicts it, and the truth's own added.
    estimate : FilterOutput
        The estimate at these epochs.
    between : ndarray, shape (n, 9)
        Variances of what the truth leaves open, part of the covariance: position, velocity and attitude between its
        rows, velocities that contradict its positions.
    rate : ndarray, shape (n, 15)
        Derivatives of the truth by time: those of the errors by how late the estimate is, 1/s.
    body : BodyRotation or None
        The rotation between the bodies that was taken out.
    directions : ndarray, shape (n, 15, r)
        Derivatives of the errors by the r constants that were fitted to them and taken out.
    notes : tuple of str
        What was done.
    """

    t: FloatArray
    error: FloatArray
    covariance: FloatArray
    estimate: FilterOutput
    between: FloatArray
    rate: FloatArray
    directions: FloatArray
    body: BodyRotation | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.t)


def output_errors(
    estimate: FilterOutput,
    truth: FilterOutput,
    *,
    how: Alignment = Alignment.NONE,
    time_offset: float | None = None,
    one_body: bool = True,
    half_way: tuple[FloatArray, FloatArray] | None = None,
    curves: Curves | None = None,
    tried: bool = False,
) -> OutputErrors:
    """Return the errors of an estimate.

    Parameters
    ----------
    estimate, truth : FilterOutput
        The two.
    how : Alignment
        What is taken out of the positions.
    time_offset : float, optional
        Fitted to the errors, and subtracted from the stamps of the estimate, s.
    one_body : bool
        Whether both state the attitude of the same axes; otherwise the rotation between them is fitted and taken out.
    half_way : pair of ndarray, optional
        `half_way_variances` of the truth, where they are known: they take most of the time.
    curves : Curves, optional
        Cubics through the truth, where they are known.
    tried : bool
        Whether the offset is only tried: errors at a wrong one are those of no convention.

    Raises
    ------
    DataError
        Where the two share no time or no frame, in one line.
    """
    shift = time_offset or 0.0
    moved = replace(estimate, t=estimate.t - shift, outages=estimate.outages - shift)
    begin, end = max(moved.t[0], truth.t[0]), min(moved.t[-1], truth.t[-1])
    inside = (moved.t >= begin - 1e-9) & (moved.t <= end + 1e-9)
    if np.count_nonzero(inside) < 2:
        raise DataError(
            f"{estimate.name}: expected times within those of {truth.name}, {truth.t[0]:.3f} … {truth.t[-1]:.3f} s, "
            f"found {estimate.t[0]:.3f} … {estimate.t[-1]:.3f} s: put both on one clock"
        )
    notes: list[str] = []
    moved, within = moved.rows(inside), truth.rows((truth.t >= begin - 1e-9) & (truth.t <= end + 1e-9))
    dense = float(np.median(np.diff(moved.t))) < DENSER_TRUTH_RATIO * float(np.median(np.diff(truth.t)))
    if dense and not moved.has_innovations:
        truth, half_way, curves = within, None, None
        moved = replace(at_times(moved, truth.t), outages=moved.outages)
        notes.append("estimate interpolated at the times of the truth, which are fewer")
    curves = curves or curves_of(truth)
    rate = rate_of(truth, moved.t, curves)
    there, between = at_times(truth, moved.t, curves), interpolation_variance(truth, moved.t, half_way)
    moved, there, done = _in_one_frame(moved, there, how)
    fitted, body = [_of_alignment(moved, how)], None
    if time_offset is not None:
        fitted.append(rate[:, :, None])
    if not one_body:
        there, body = in_axes_of(there, moved)
        done = (*done, *body.note(moved.name, there.name))
        fitted.append(of_body_rotation(moved))
    if not tried:
        refuse_wrong_conventions(moved, there)
    noted = _note_between(between, moved, truth)
    wrong, said = velocity_contradiction(within, moved, np.mean(between[:, 3:6], axis=0))
    between = between + np.pad(wrong, (3, 3))
    error = difference(there, moved)
    if moved.vel_of_body:
        same = rotation.mat_from_quat(
            rotation.quat_multiply(moved.quat_nb, rotation.quat_conjugate(there.quat_nb))
        )
        turned_velocity = np.einsum("nij,nj->ni", same, there.vel_n)
        error[:, 3:6] = np.where(np.isfinite(turned_velocity), turned_velocity, there.vel_n) - moved.vel_n
    stated = np.where(np.isfinite(there.covariance), there.covariance, 0.0)
    stated[:, range(9), range(9)] += between
    return OutputErrors(
        moved.t,
        error,
        moved.covariance + stated,
        moved,
        between,
        rate,
        np.nan_to_num(np.concatenate(fitted, axis=2)),
        body,
        (*notes, *done, *noted, *said),
    )


def _note_between(between: FloatArray, estimate: FilterOutput, truth: FilterOutput) -> tuple[str, ...]:
    """Return a note where what the truth leaves open between its rows counts beside the sds of the filter."""
    own = np.einsum("kii->ki", estimate.covariance)[:, :9]
    known = np.isfinite(own) & (own > 0.0)
    share = np.where(known, between, 0.0).sum(axis=0) / np.where(known, own, 1e-300).sum(axis=0)
    parts = {
        name: np.sqrt(np.max(np.mean(between[:, 3 * i : 3 * i + 3], axis=0)))
        for i, name in enumerate(("m", "m/s", "rad"))
        if np.sqrt(share[3 * i : 3 * i + 3].max()) > MATTERING_SHARE
    }
    if not parts:
        return ()
    sizes = ", ".join(f"{value:.2g} {unit}" for unit, value in parts.items())
    rate = 1.0 / float(np.median(np.diff(truth.t)))
    return (
        f"{truth.name} has {rate:.3g} rows a second: between them it is known to {sizes} (sd), which adds to the "
        "filter's covariance",
    )


def in_axes_of(truth: FilterOutput, estimate: FilterOutput) -> tuple[FilterOutput, BodyRotation]:
    """Return a truth whose attitude is that of the estimate's body, and the constant rotation that was taken out.

    The rotation suits most of the epochs: attitudes far off do not decide. Its sd is that of the mean of ten parts.
    """
    good = np.isfinite(truth.quat_nb).all(axis=1) & np.isfinite(estimate.quat_nb).all(axis=1)
    if np.count_nonzero(good) <= RECORD_PARTS:
        return truth, BodyRotation(np.full(3, np.nan), np.full(3, np.nan))
    mine, theirs = rotation.mat_from_quat(estimate.quat_nb[good]), rotation.mat_from_quat(truth.quat_nb[good])
    product = np.einsum("nki,nkl->nil", mine, theirs)
    near = np.ones(len(mine), dtype=bool)
    for _ in range(SELECTION_ROUNDS):
        between = rotation.nearest_rotation(product[near].sum(axis=0))
        left = rotation.rotvec_from_mat(product @ between.T)
        distance = np.linalg.norm(left, axis=1)
        near = distance <= MAX_MEDIAN_DISTANCES * np.median(distance)
    quat = rotation.quat_multiply(truth.quat_nb, rotation.quat_conjugate(rotation.quat_from_mat(between)))
    parts = np.array([part.mean(axis=0) for part in np.array_split(left[near], RECORD_PARTS)])
    sd = parts.std(axis=0, ddof=1) / np.sqrt(RECORD_PARTS)
    return replace(truth, quat_nb=quat), BodyRotation(rotation.rotvec_from_mat(between), sd)


def of_body_rotation(estimate: FilterOutput) -> FloatArray:
    """Return the derivatives of the errors by a rotation of the truth's body; (n, 15, 3)."""
    found = np.zeros((len(estimate), 15, 3))
    found[:, 6:9] = rotation.mat_from_quat(estimate.quat_nb)
    return found


def _of_alignment(estimate: FilterOutput, how: Alignment) -> FloatArray:
    """Return the derivatives of the errors of positions, which decide on it, by a motion of the whole."""
    found = np.zeros((len(estimate), 15, how.parameters))
    if how is not Alignment.NONE and estimate.local is not None:
        found[:, :3, :3] = np.eye(3)
        arm = estimate.local - np.nanmean(estimate.local, axis=0)
        found[:, :3, 3:] = -rotation.skew(arm)[:, :, 2:] if how is Alignment.YAW else -rotation.skew(arm)
    return found


def _in_one_frame(
    estimate: FilterOutput, truth: FilterOutput, how: Alignment
) -> tuple[FilterOutput, FilterOutput, tuple[str, ...]]:
    mixed = (estimate.llh is None) != (truth.llh is None) and (
        estimate.local is not None or truth.local is not None
    )
    placed = all(one.llh is not None or one.local is not None for one in (estimate, truth))
    if mixed and placed and how is Alignment.NONE:
        raise DataError(
            f"{estimate.name}: expected positions in the frame of {truth.name}, found metres in one and latitude, "
            "longitude in the other: add --align yaw or --align se3"
        )
    if how is Alignment.NONE:
        return estimate, truth, ()
    if not placed:
        raise DataError(
            f"{estimate.name}: --align {how.value}: expected positions in estimate and truth, found none"
        )
    source = truth if truth.llh is not None else estimate
    if source.llh is not None:
        good = np.flatnonzero(np.isfinite(source.llh).all(axis=1))
        origin = source.llh[good[0]]
        estimate, truth = (
            one if one.llh is None else to_tangent_plane(one, origin) for one in (estimate, truth)
        )
    moved, notes = aligned(estimate, truth, how)
    return moved, truth, notes
