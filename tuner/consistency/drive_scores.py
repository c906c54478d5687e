"""Errors of a drive's filter: against a reference, or where there is none against the smoother.

One rotation between the bodies of filter and reference is unknown: it is taken out of the attitudes, the one that
suits most of the drive. The reference's own sds, where it states them, add to those of the filter. The smoother is
the same filter with later fixes: filter minus smoother has the covariance P − P_smoothed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.earth import metres_per_radian, ned_between
from tuner.consistency.scores import score, squares
from tuner.consistency.trajectory_alignment import cubic
from tuner.navigation import reference_filter as readable
from tuner.navigation.data import USED, Solution
from tuner.navigation.drive.run import Stretch, initial_estimates, initial_state
from tuner.navigation.settings import FilterSettings
from tuner.navigation.smoother import separation, smooth
from tuner.types.consistency import Score
from tuner.types.records import Reference

FloatArray = NDArray[np.float64]

BLOCK_LENGTH = 30.0
"""Length of the blocks of a drive that count as independent, s."""
MAX_MEDIAN_DISTANCES = 4.0
"""Attitudes farther off than so many median distances do not decide on the rotation between the bodies."""
SELECTION_ROUNDS = 5
"""Times that this selection and the rotation are repeated."""
MAX_SMOOTHED_SAMPLES = 250_000
"""Inertial samples up to which a drive is smoothed: the smoother keeps a covariance for every sample."""


def settled(stretch: Stretch, solution: Solution) -> NDArray[np.intp]:
    """Return the epochs after the initial transient of a filter."""
    return np.flatnonzero(solution.t >= stretch.settled)


def blocks(solution: Solution, rows: NDArray[np.intp]) -> list[tuple[Solution, NDArray[np.intp]]]:
    """Return epochs by blocks that count as independent, each with its solution."""
    if not len(rows):
        return []
    number = ((solution.t[rows] - solution.t[rows[0]]) // BLOCK_LENGTH).astype(int)
    return [(solution, rows[number == n]) for n in np.unique(number)]


def reference_at(reference: Reference, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position, velocity, attitude angles of the reference at times inside it, NaN outside or in gaps.

    Positions lie on cubics with the reference's velocities, velocities on cubics through theirs, attitudes on the
    shortest rotation: a straight line cuts the corners of a reference of 1 Hz by decimetres.
    """
    usual = float(np.median(np.diff(reference.t)))
    after = np.clip(np.searchsorted(reference.t, t), 1, len(reference.t) - 1)
    first = max(int(after.min(initial=len(reference.t))) - 2, 0)
    r = reference.rows(slice(first, int(after.max(initial=1)) + 2))
    after = after - first
    step = r.t[after] - r.t[after - 1]
    u = (t - r.t[after - 1]) / step
    unknown = np.full_like(r.vel_n, np.nan)
    llh = cubic(r.llh, r.vel_n / metres_per_radian(r.llh), r.t, after - 1, u, step)
    vel_n = cubic(r.vel_n, unknown, r.t, after - 1, u, step)
    quat = rotation.quat_from_rpy(r.rpy)
    turn = rotation.quat_multiply(quat[after], rotation.quat_conjugate(quat[after - 1]))
    between = rotation.quat_from_rotvec(u[:, None] * rotation.rotvec_from_quat(turn))
    rpy = rotation.rpy_from_quat(rotation.quat_multiply(between, quat[after - 1]))
    hole = (t < reference.t[0]) | (t > reference.t[-1]) | (step > 3.0 * usual)
    for part in (llh, vel_n, rpy):
        part[hole] = np.nan
    return llh, vel_n, rpy


def differences(reference: Reference, solution: Solution, rows: NDArray[np.intp]) -> FloatArray:
    """Return reference minus estimate: position, velocity, attitude less one constant rotation; (r, 9)."""
    llh, vel_n, rpy = reference_at(reference, solution.t[rows])
    out = np.full((len(rows), 9), np.nan)
    out[:, :3] = ned_between(llh, solution.state.llh[rows])
    out[:, 3:6] = vel_n - solution.state.vel_n[rows]
    good = np.isfinite(rpy).all(axis=1)
    if np.count_nonzero(good) > 10:
        mine = rotation.mat_from_quat(solution.state.quat_nb[rows][good])
        theirs = rotation.mat_from_rpy(rpy[good])
        product = np.einsum("nki,nkl->nil", mine, theirs)
        near = np.ones(len(mine), dtype=bool)
        for _ in range(SELECTION_ROUNDS):
            mounting = _nearest_rotation(product[near].sum(axis=0))
            turned = rotation.rotvec_from_mat(theirs @ mounting.T @ np.swapaxes(mine, -1, -2))
            distance = np.linalg.norm(turned, axis=1)
            near = distance <= MAX_MEDIAN_DISTANCES * np.median(distance)
        out[good, 6:9] = turned
    return out


def _nearest_rotation(mat: FloatArray) -> FloatArray:
    u, _, vt = np.linalg.svd(mat)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def stated(reference: Reference, t: FloatArray) -> FloatArray:
    """Return the variances that a reference reports for itself, 0 where it reports none; (k, 9)."""
    if reference.sd is None:
        return np.zeros((len(t), 9))
    own = np.stack([np.interp(t, reference.t, column) for column in reference.sd.T], axis=-1)
    return np.where(np.isfinite(own), own, 0.0) ** 2


def against_reference(
    reference: Reference, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]
) -> tuple[Score, ...]:
    """Score position, velocity and attitude against a reference, in blocks."""
    parts: dict[str, list[FloatArray]] = {"position": [], "velocity": [], "attitude": []}
    for solution, rows in zip(solutions, scored, strict=True):
        error = differences(reference, solution, rows)
        for block, own in blocks(solution, rows):
            part, extra = error[np.isin(rows, own)], stated(reference, solution.t[own])
            for i, name in enumerate(parts):
                at = slice(3 * i, 3 * i + 3)
                good = np.isfinite(part[:, at]).all(axis=1)
                spread = block.covariance[own][good, at, at] + extra[good, at, None] * np.eye(3)
                parts[name].append(squares(part[good, at], spread))
    return _scores(parts)


def errors(
    reference: Reference | None, solutions: Sequence[Solution], scored: Sequence[NDArray[np.intp]]
) -> dict[str, tuple[float, ...]]:
    """Return rms differences to the reference in the quantities it has; without a reference, rms innovations."""
    if reference is None:
        pairs = zip(solutions, scored, strict=True)
        chosen = [(s.innovation[rows], s.use[rows]) for s, rows in pairs]
        names = ("position_innovation_rms_m", "velocity_innovation_rms_m_s")
        used = [
            np.concatenate([z[use[:, j] == USED, 3 * j : 3 * j + 3] for z, use in chosen]) for j in (0, 1)
        ]
        return {
            name: tuple(np.sqrt(np.mean(z**2, axis=0)).tolist())
            for name, z in zip(names, used, strict=True)
            if len(z)
        }
    error = np.concatenate(
        [differences(reference, s, rows) for s, rows in zip(solutions, scored, strict=True)]
    )
    parts = zip(
        ("position_rms_m", "velocity_rms_m_s", "attitude_rms_rad"), np.split(error, 3, axis=1), strict=True
    )
    return {
        name: tuple(np.sqrt(np.nanmean(part**2, axis=0)).tolist())
        for name, part in parts
        if np.isfinite(part).any(axis=0).all()
    }


def against_smoother(
    settings: FilterSettings, stretches: Sequence[Stretch], scored: Sequence[NDArray[np.intp]]
) -> tuple[Score, ...]:
    """Score the difference of filter and smoother in position, velocity and attitude, component by component.

    A test against later fixes: it needs no reference.
    """
    lags = settings.velocity_lag or any(stretch.lag for stretch in stretches)
    if sum(len(stretch.steps.dt) for stretch in stretches) > MAX_SMOOTHED_SAMPLES or lags:
        return ()
    parts: dict[str, list[FloatArray]] = {"position": [], "velocity": [], "attitude": []}
    before: Solution | None = None
    for stretch, rows in zip(stretches, scored, strict=True):
        x, p = initial_estimates(settings, stretch, before)
        before, passages = readable.run_with_passages(
            settings,
            initial_state(settings, stretch, x),
            stretch.steps,
            stretch.fixes,
            parameters=x,
            covariance=p,
        )
        apart = separation(smooth(before, passages))
        for _, own in blocks(before, rows[rows < len(apart)]):
            for i, name in enumerate(parts):
                parts[name].append(apart[own, 3 * i : 3 * i + 3].sum(axis=1))
    return _scores(parts)


def _scores(parts: Mapping[str, Sequence[FloatArray]]) -> tuple[Score, ...]:
    """Return the scores of squares by name, in groups; none of a name with fewer than two groups."""
    return tuple(
        score(name, groups, 3)
        for name, groups in parts.items()
        if sum(len(group) > 0 for group in groups) > 1
    )
