"""The epochs of a run for a linear filter: the motion between them, and which of them have a fix."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.units import STANDARD_GRAVITY
from tuner.consistency.constants import Motion
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.trajectory_alignment import velocity_of

GRAVITY = np.array([0.0, 0.0, STANDARD_GRAVITY])
"""m/s²: its change from place to place is far below the noise of the errors."""
MIN_EPOCHS = 40
"""Epochs from which a filter is modelled: four times the numbers that are sought."""
MAX_EPOCHS = 1200
"""Epochs that are modelled: twenty minutes of fixes tell every fault that scores show."""
MIN_FIXED_DROP = 1e-4
"""Relative drop of the position variance that shows a fix."""
STEADY_GROWTH = 0.05
"""Relative growth of the position variance from epoch to epoch above which there was no fix between."""


@dataclass(frozen=True)
class Course:
    """Epochs of a run, the motion between them, and which of them have a fix.

    Attributes
    ----------
    rows : ndarray of int, shape (k + 1,)
        Epochs of the errors; the model starts at the first.
    dt : ndarray, shape (k,)
        s.
    mat_nb, force : ndarray, shapes (k, 3, 3), (k, 3)
        Attitude and specific force, north-east-down, in the middle.
    motion : Motion
        At the later epoch. A filter whose errors of velocity are those along the axes of the body carries its velocity
        in these axes, measures it there more often than the position, and turns it with its attitude: no force acts
        through errors of the attitude, and errors of the velocity fade.
    fixed : ndarray of bool, shape (k,)
        Epochs with a fix.
    """

    rows: NDArray[np.intp]
    dt: FloatArray
    mat_nb: FloatArray
    force: FloatArray
    motion: Motion
    fixed: NDArray[np.bool_]


def course_of(run: OutputErrors) -> Course | None:
    """Return the epochs of a run with their dynamics; None where it has no velocity or too few epochs."""
    estimate = run.estimate
    vel = velocity_of(estimate)
    quat = estimate.quat_nb
    if not np.isfinite(quat).any():
        heading = np.unwrap(np.arctan2(vel[:, 1], vel[:, 0]))
        quat = rotation.quat_from_rpy(np.column_stack([0.0 * heading, 0.0 * heading, heading]))
    rows = np.flatnonzero(np.isfinite(vel).all(axis=1) & np.isfinite(quat).all(axis=1))
    if len(rows) < MIN_EPOCHS:
        return None
    rows, fixed = _at_fixes(run.t, rows, fixes_of(run, rows))
    if len(rows) < MIN_EPOCHS:
        return None
    t, vel, quat = run.t[rows], vel[rows], quat[rows]
    dt = np.diff(t)
    turn = rotation.rotvec_from_quat(rotation.quat_multiply(quat[1:], rotation.quat_conjugate(quat[:-1])))
    middle = rotation.quat_multiply(rotation.quat_from_rotvec(0.5 * turn), quat[:-1])
    mean_acc = np.diff(vel, axis=0) / dt[:, None]
    acc = np.gradient(vel, t, axis=0)[1:]
    rate = np.concatenate([turn / dt[:, None], turn[-1:] / dt[-1]])
    motion = Motion(
        np.cumsum(vel[1:] * dt[:, None], axis=0),
        vel[1:],
        acc,
        0.5 * (rate[:-1] + rate[1:]),
        rotation.mat_from_quat(quat[1:]),
        estimate.vel_of_body,
    )
    return Course(rows, dt, rotation.mat_from_quat(middle), mean_acc - GRAVITY, motion, fixed[1:])


def _at_fixes(
    t: FloatArray, rows: NDArray[np.intp], fixed: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the first epochs with fixes and, where there are none, some as far apart; and which have one."""
    where = np.flatnonzero(fixed)
    if 2 < len(where) < 0.9 * len(rows):
        spacing = float(np.median(np.diff(t[rows[where]])))
        keep, last = np.zeros(len(rows), dtype=bool), -np.inf
        for i, now in enumerate(t[rows]):
            if fixed[i] or now - last > 1.5 * spacing:
                keep[i], last = True, now
        rows, fixed = rows[keep], fixed[keep]
    return rows[:MAX_EPOCHS], fixed[:MAX_EPOCHS]


def fixes_of(run: OutputErrors, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return at which epochs the filter used a fix: by innovations, else by drops of its position variance."""
    estimate = run.estimate
    outside = np.ones(len(rows), dtype=bool)
    for begin, end in estimate.outages:
        outside &= (run.t[rows] <= begin) | (run.t[rows] >= end)
    if estimate.has_innovations:
        return np.asarray(np.isfinite(estimate.innovation[rows, :3]).all(axis=1))
    variance = np.trace(run.covariance[rows][:, :3, :3], axis1=1, axis2=2)
    if not np.isfinite(variance).all():
        return outside
    growth = np.concatenate([[0.0], np.diff(np.log(variance))])
    drops = np.flatnonzero(growth < -MIN_FIXED_DROP)
    spacing = np.diff(drops)
    if len(spacing) > 10 and np.median(spacing) >= 2:
        fixed = np.zeros(len(rows), dtype=bool)
        fixed[drops] = True
        return fixed
    return outside & (growth < STEADY_GROWTH)


def head(course: Course, count: int) -> Course:
    """Return the first epochs of a course."""
    moved = {name: getattr(course.motion, name)[:count] for name in Motion._fields[:-1]}
    names = ("dt", "mat_nb", "force", "fixed")
    parts = {name: getattr(course, name)[:count] for name in names}
    return replace(course, rows=course.rows[: count + 1], motion=course.motion._replace(**moved), **parts)
