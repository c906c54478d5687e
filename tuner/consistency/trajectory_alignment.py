"""One trajectory put on the clock and into the frame of another: interpolation, and the best rigid motion.

Positions are interpolated by cubics through positions and velocities, without velocities through positions alone;
attitudes along the shortest turn; covariances linearly. Between two trajectories whose world frames differ, the
rotation (about all axes, or about the vertical) and shift that bring the positions nearest [1]_ are taken out.

References
----------
.. [1] S. Umeyama, Least-squares estimation of transformation parameters between two point patterns, IEEE T-PAMI 13
       (1991).
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.earth import in_tangent_plane, metres_per_radian, without_jumps
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

FloatArray = NDArray[np.float64]

SAME_INSTANT = 1e-6
"""Stamps this close, s, are one instant: nothing is interpolated."""
MAX_GAP_INTERVALS = 3.0
"""Gap of a trajectory, in its usual intervals, in which it is not interpolated."""


class Alignment(StrEnum):
    """Which rigid motion of a trajectory is taken out."""

    NONE = "none"
    YAW = "yaw"
    """Shift and turn about the vertical: what gravity leaves open."""
    SE3 = "se3"
    """Shift and rotation."""

    @property
    def parameters(self) -> int:
        """Degrees of freedom that it removes."""
        return {Alignment.NONE: 0, Alignment.YAW: 4, Alignment.SE3: 6}[self]


def at_times(given: FilterOutput, t: FloatArray) -> FilterOutput:
    """Return a trajectory at other times, NaN outside of it and in its gaps.

    Parameters
    ----------
    given : FilterOutput
        The trajectory.
    t : ndarray, shape (k,)
        Rising, s.
    """
    after = np.clip(np.searchsorted(given.t, t), 1, len(given.t) - 1)
    nearer = np.where(np.abs(given.t[after - 1] - t) < np.abs(given.t[after] - t), after - 1, after)
    if np.abs(given.t[nearer] - t).max() < SAME_INSTANT:
        return replace(given.rows(nearer), t=t)
    before = after - 1
    step = given.t[after] - given.t[before]
    u = (t - given.t[before]) / step
    usual = MAX_GAP_INTERVALS * float(np.median(np.diff(given.t)))
    exact = np.abs(given.t[nearer] - t) < SAME_INSTANT
    outside = ((u < -1e-9) | (u > 1.0 + 1e-9) | (step > usual)) & ~exact

    def linear(values: FloatArray) -> FloatArray:
        if not np.isfinite(values[0]).any() and not np.isfinite(values).any():
            return np.asarray(np.broadcast_to(np.nan, (len(t), *values.shape[1:])))
        w = u.reshape(-1, *[1] * (values.ndim - 1))
        found = (1.0 - w) * values[before] + w * values[after]
        found[outside] = np.nan
        return np.asarray(found)

    llh = local = None
    if given.llh is not None:
        speed = given.vel_n / metres_per_radian(given.llh)
        llh = cubic(without_jumps(given.llh), speed, given.t, before, u, step)
        llh[outside] = np.nan
    elif given.local is not None:
        local = cubic(given.local, given.vel_n, given.t, before, u, step)
        local[outside] = np.nan
    quat = np.full((len(t), 4), np.nan)
    if np.isfinite(given.quat_nb).any():
        first, second = given.quat_nb[before], given.quat_nb[after]
        turn = rotation.rotvec_from_quat(rotation.quat_multiply(second, rotation.quat_conjugate(first)))
        quat = rotation.quat_multiply(rotation.quat_from_rotvec(u[:, None] * turn), first)
        quat[outside] = np.nan
    return replace(
        given,
        t=t,
        llh=llh,
        local=local,
        vel_n=linear(given.vel_n),
        quat_nb=quat,
        bias=linear(given.bias),
        covariance=linear(given.covariance),
        innovation=np.broadcast_to(np.nan, (len(t), 6)),
        innovation_covariance=np.broadcast_to(np.nan, (len(t), 6, 6)),
    )


def cubic(
    values: FloatArray,
    slope: FloatArray,
    t: FloatArray,
    before: NDArray[np.intp],
    u: FloatArray,
    step: FloatArray,
) -> FloatArray:
    """Return cubics through values and slopes; slopes that are not known are those of the neighbours."""
    slope = np.where(np.isfinite(slope), slope, np.gradient(values, t, axis=0))
    u, step = u[:, None], step[:, None]
    p, q = values[before], values[before + 1]
    m, k = step * slope[before], step * slope[before + 1]
    return np.asarray(
        (1.0 + 2.0 * u) * (1.0 - u) ** 2 * p
        + u * (1.0 - u) ** 2 * m
        + u**2 * (3.0 - 2.0 * u) * q
        + u**2 * (u - 1.0) * k
    )


def to_tangent_plane(given: FilterOutput, origin: FloatArray) -> FilterOutput:
    """Return a trajectory in metres north, east, down of one point, and all axes those of that point.

    Parameters
    ----------
    given : FilterOutput
        With latitude, longitude, height.
    origin : ndarray, shape (3,)
        Latitude, longitude, rad, height, m.
    """
    assert given.llh is not None
    local, turn = in_tangent_plane(given.llh, origin)
    return replace(turned(given, turn), llh=None, local=local)


def turned(given: FilterOutput, mat: FloatArray) -> FilterOutput:
    """Return velocity, attitude and covariance in world axes turned by `mat`, shape (n, 3, 3) or (3, 3)."""
    n = len(given)
    mat = np.broadcast_to(mat, (n, 3, 3))
    whole = np.zeros((n, 15, 15))
    whole[:, range(15), range(15)] = 1.0
    for i in range(3):
        whole[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = mat
    known = np.isfinite(np.einsum("kii->ki", given.covariance))
    cov = np.where(known[:, :, None] & known[:, None, :], given.covariance, 0.0)
    cov = whole @ cov @ np.swapaxes(whole, -1, -2)
    cov[~(known[:, :, None] & known[:, None, :])] = np.nan
    quat = given.quat_nb
    if np.isfinite(quat).any():
        quat = rotation.quat_multiply(rotation.quat_from_mat(mat), quat)
    return replace(given, vel_n=np.einsum("nij,nj->ni", mat, given.vel_n), quat_nb=quat, covariance=cov)


def aligned(
    estimate: FilterOutput, truth: FilterOutput, how: Alignment
) -> tuple[FilterOutput, tuple[str, ...]]:
    """Return an estimate moved as a whole onto a truth at the same times, and what was done.

    Parameters
    ----------
    estimate, truth : FilterOutput
        Both in local metres, at the same times.
    how : Alignment
        The motion that is taken out.

    Raises
    ------
    DataError
        Positions on a line, that leave the rotation open.
    """
    if how is Alignment.NONE or estimate.local is None or truth.local is None:
        return estimate, ()
    good = np.isfinite(estimate.local).all(axis=1) & np.isfinite(truth.local).all(axis=1)
    a, b = estimate.local[good], truth.local[good]
    middle_a, middle_b = a.mean(axis=0), b.mean(axis=0)
    product = (b - middle_b).T @ (a - middle_a)
    if how is Alignment.YAW:
        angle = np.arctan2(product[1, 0] - product[0, 1], product[0, 0] + product[1, 1])
        mat = rotation.mat_from_rpy(np.array([0.0, 0.0, angle]))
    else:
        u, size, vt = np.linalg.svd(product)
        if size[1] < 1e-6 * size[0]:
            msg = f"{estimate.name}: expected positions off a line for --align se3, found them on one: use --align yaw"
            raise DataError(msg)
        mat = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    shift = middle_b - mat @ middle_a
    moved = replace(turned(estimate, mat), local=estimate.local @ mat.T + shift)
    angles = np.degrees(rotation.rpy_from_mat(mat))
    note = (
        f"estimate aligned to the truth ({how.value}): turned by roll {angles[0]:.3g}, pitch {angles[1]:.3g}, yaw "
        f"{angles[2]:.4g} deg, {how.parameters} degrees of freedom removed"
    )
    return moved, (note,)
