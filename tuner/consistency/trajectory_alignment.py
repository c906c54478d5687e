"""One trajectory put on the clock and into the frame of another: interpolation, and the best rigid motion.

Positions are interpolated by cubics through positions and velocities, without velocities through positions alone;
velocities by cubics, too, attitudes by cubics of the turn since the row before, whose slopes are the turn rates [2]_;
covariances linearly. What a trajectory leaves open between its rows is measured on itself: every other row is
interpolated from the rest. Between two trajectories whose world frames differ, the rotation (about all axes, or about
the vertical) and shift that bring the positions nearest [1]_ are taken out.

References
----------
.. [1] S. Umeyama, Least-squares estimation of transformation parameters between two point patterns, IEEE T-PAMI 13
       (1991).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.earth import in_tangent_plane, metres_per_radian, ned_between, without_jumps
from tuner.types.filter_output import FilterOutput
from tuner.types.records import DataError

SAME_INSTANT = 1e-6
"""Stamps this close, s, are one instant: nothing is interpolated."""
MAX_GAP_INTERVALS = 3.0
"""Gap of a trajectory, in its usual intervals, in which it is not interpolated."""
NOISE_OF_MIDDLE = 1.0 + 2.0 * (9.0 / 16.0) ** 2 + 2.0 * (1.0 / 16.0) ** 2
"""Variance of white noise in the difference of a row and the cubic through its neighbours ÷ that of one row."""


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


@dataclass(frozen=True)
class Curves:
    """Cubics through the rows of a trajectory, which take longer than to read them at other times.

    Attributes
    ----------
    acceleration : ndarray, shape (n, 3)
        Slopes of the velocities at the rows, m/s².
    turns, turn_rate : ndarray, shapes (n − 1, 3) and (n, 3), or None
        Turns from each row to the next, rad, and turn rates at the rows, rad/s; None without attitudes.
    """

    acceleration: FloatArray
    turns: FloatArray | None
    turn_rate: FloatArray | None


def curves_of(given: FilterOutput) -> Curves:
    """Return the cubics through the rows of a trajectory."""
    acceleration = node_slopes(given.t, given.vel_n)
    if not np.isfinite(given.quat_nb).any():
        return Curves(acceleration, None, None)
    quat = given.quat_nb
    turns = rotation.rotvec_from_quat(rotation.quat_multiply(rotation.quat_conjugate(quat[:-1]), quat[1:]))
    total = np.cumsum(np.where(np.isfinite(turns), turns, 0.0), axis=0)
    return Curves(acceleration, turns, node_slopes(given.t, np.vstack([np.zeros(3), total])))


def at_times(
    given: FilterOutput, t: FloatArray, curves: Curves | None = None, *, covariances: bool = True
) -> FilterOutput:
    """Return a trajectory at other times, NaN outside of it and in its gaps.

    Parameters
    ----------
    given : FilterOutput
        The trajectory.
    t : ndarray, shape (k,)
        Rising, s.
    curves : Curves, optional
        Cubics through its rows, where they are known.
    covariances : bool
        Whether its covariances are wanted; else they are NaN between its rows.
    """
    after = np.clip(np.searchsorted(given.t, t), 1, len(given.t) - 1)
    nearer = np.where(np.abs(given.t[after - 1] - t) < np.abs(given.t[after] - t), after - 1, after)
    if np.abs(given.t[nearer] - t).max(initial=0.0) < SAME_INSTANT:
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

    def curve(values: FloatArray, slope: FloatArray) -> FloatArray:
        found = cubic(values, slope, given.t, before, u, step)
        found[outside] = np.nan
        return found

    curves = curves or curves_of(given)
    llh = local = None
    if given.llh is not None:
        llh = curve(without_jumps(given.llh), given.vel_n / metres_per_radian(given.llh))
    elif given.local is not None:
        local = curve(given.local, given.vel_n)
    quat = np.full((len(t), 4), np.nan)
    if curves.turns is not None and curves.turn_rate is not None:
        quat = _attitude_between(given.quat_nb, curves.turns, curves.turn_rate, before, u, step)
        quat[outside] = np.nan
    covariance = linear(given.covariance) if covariances else np.broadcast_to(np.nan, (len(t), 15, 15))
    return replace(
        given,
        t=t,
        llh=llh,
        local=local,
        vel_n=curve(given.vel_n, curves.acceleration),
        quat_nb=quat,
        bias=linear(given.bias),
        covariance=covariance,
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
    if not (known := np.isfinite(slope)).all():
        slope = np.where(known, slope, np.gradient(values, t, axis=0))
    u, step = u[:, None], step[:, None]
    p, q = values[before], values[before + 1]
    m, k = step * slope[before], step * slope[before + 1]
    return np.asarray(
        (1.0 + 2.0 * u) * (1.0 - u) ** 2 * p
        + u * (1.0 - u) ** 2 * m
        + u**2 * (3.0 - 2.0 * u) * q
        + u**2 * (u - 1.0) * k
    )


def node_slopes(t: FloatArray, values: FloatArray) -> FloatArray:
    """Return the slopes at rows of the cubic splines through them, one for each part without gaps; (n, k) → (n, k)."""
    from scipy.interpolate import CubicSpline  # loaded when used: slow to import

    slope = np.full_like(values, np.nan)
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(rows) < 2:
        return slope
    ends = np.flatnonzero(np.diff(t[rows]) > MAX_GAP_INTERVALS * np.median(np.diff(t))) + 1
    for own in np.split(rows, ends):
        if len(own) > 3:
            slope[own] = CubicSpline(t[own], values[own])(t[own], 1)
        elif len(own) > 1:
            slope[own] = np.gradient(values[own], t[own], axis=0)
    return slope


def _attitude_between(
    quat: FloatArray,
    turns: FloatArray,
    rate: FloatArray,
    before: NDArray[np.intp],
    u: FloatArray,
    step: FloatArray,
) -> FloatArray:
    """Return attitudes a share `u` of the way from the row `before` to the next; quaternions (n, 4) → (k, 4)."""
    interval, turn, share = step[:, None], turns[before], u[:, None]
    first = interval * rate[before]
    last = np.linalg.solve(rotation.left_jacobian(-turn), (interval * rate[before + 1])[..., None])[..., 0]
    part = share * (1.0 - share) ** 2 * first + share**2 * (3.0 - 2.0 * share) * turn
    part += share**2 * (share - 1.0) * last
    return np.asarray(rotation.quat_multiply(quat[before], rotation.quat_from_rotvec(part)))


def rate_of(given: FilterOutput, t: FloatArray, curves: Curves | None = None) -> FloatArray:
    """Return the derivatives by time of position, velocity, attitude and biases of a trajectory at times t; (n, 15).

    Differences over whole intervals to either side: noise of the rows is then uncorrelated with its derivative,
    whatever the place of t between them.
    """
    step = float(np.median(np.diff(given.t)))
    curves = curves or curves_of(given)

    def across(interval: float) -> FloatArray:
        late, early = (
            at_times(given, t + shift, curves, covariances=False) for shift in (interval, -interval)
        )
        return difference(late, early)

    far, near = across(2.0 * step), across(step)
    return np.where(np.isfinite(far), (8.0 * near - far) / (12.0 * step), near / (2.0 * step))


def half_way_variances(given: FilterOutput) -> tuple[FloatArray, FloatArray]:
    """Return mean squares of rows minus their interpolation: from the next rows, and from those beyond; (9,) each."""
    return _middle_variance(given, 1), _middle_variance(given, 2)


def interpolation_variance(
    given: FilterOutput, t: FloatArray, half_way: tuple[FloatArray, FloatArray] | None = None
) -> FloatArray:
    """Return variances of position, m, velocity and attitude of a trajectory interpolated at times t; (k, 9).

    Every other row, interpolated from the rest, is off by what twice the interval leaves open, every fourth by what
    four times does: their ratio, below one, leads on to the interval itself [3]_. What the stated sds of the rows
    explain is no error of interpolation. Half-way between rows the sd is largest; at a share u of the way it goes with
    u²(1 − u)² where the motion is resolved, as the next term of its series does, and with u(1 − u) where it is not.
    `half_way_variances` of the trajectory may be given where they are known.

    References
    ----------
    .. [3] L. F. Richardson, The approximate arithmetical solution by finite differences, Phil. Trans. A 210 (1911).
    """
    after = np.clip(np.searchsorted(given.t, t), 1, len(given.t) - 1)
    share = np.clip((t - given.t[after - 1]) / np.diff(given.t)[after - 1], 0.0, 1.0)
    twice, four = half_way or half_way_variances(given)
    own = np.einsum("kii->ki", given.covariance)[:, :9]
    known = np.isfinite(own)
    stated = np.where(known, own, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    smaller = np.divide(twice, four, out=np.ones(9), where=four > 0.0).clip(max=1.0)
    middle = np.maximum(twice - NOISE_OF_MIDDLE * stated, 0.0) * smaller
    return np.asarray((4.0 * share * (1.0 - share))[:, None] ** (4.0 - 2.0 * np.sqrt(smaller)) * middle)


def _middle_variance(given: FilterOutput, stride: int) -> FloatArray:
    """Return mean squares of rows minus their interpolation from rows `stride` away; (9,), 0 if unknown."""
    rows = given.rows(slice(None, None, stride))
    if len(rows) < 8:
        return np.zeros(9)
    true, found = rows.rows(slice(1, None, 2)), at_times(rows.rows(slice(None, None, 2)), rows.t[1::2])
    square = difference(true, found)[:, :9] ** 2
    known = np.isfinite(square)
    return np.asarray(np.where(known, square, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def difference(one: FilterOutput, other: FilterOutput) -> FloatArray:
    """Return one trajectory minus another at the same times: position, m, velocity, attitude, biases; (n, 15)."""
    error = np.full((len(one), 15), np.nan)
    if one.llh is not None and other.llh is not None:
        error[:, :3] = ned_between(one.llh, other.llh)
    elif one.local is not None and other.local is not None:
        error[:, :3] = one.local - other.local
    error[:, 3:6] = one.vel_n - other.vel_n
    if np.isfinite(one.quat_nb).any() and np.isfinite(other.quat_nb).any():
        turn = rotation.quat_multiply(one.quat_nb, rotation.quat_conjugate(other.quat_nb))
        error[:, 6:9] = rotation.rotvec_from_quat(turn)
    error[:, 9:] = one.bias - other.bias
    return error


def velocity_of(given: FilterOutput) -> FloatArray:
    """Return velocities, from positions where none are stated, NaN without either; (n, 3), m/s."""
    if np.isfinite(given.vel_n).any():
        return given.vel_n
    place = given.local if given.llh is None else ned_between(given.llh, given.llh[0])
    return given.vel_n if place is None else np.asarray(np.gradient(place, given.t, axis=0))


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
    whole = np.tile(np.eye(15), (n, 1, 1))
    for i in range(3):
        whole[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = mat
    known = np.isfinite(np.einsum("kii->ki", given.covariance))
    cov = np.where(known[:, :, None] & known[:, None, :], given.covariance, 0.0)
    cov = whole @ cov @ np.swapaxes(whole, -1, -2)
    cov[~(known[:, :, None] & known[:, None, :])] = np.nan
    quat = rotation.quat_multiply(rotation.quat_from_mat(mat), given.quat_nb)
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
        size = np.linalg.svd(product, compute_uv=False)
        if size[1] < 1e-6 * size[0]:
            raise DataError(
                f"{estimate.name}: expected positions off a line for --align se3, found them on one: use --align yaw"
            )
        mat = rotation.nearest_rotation(product)
    shift = middle_b - mat @ middle_a
    moved = replace(turned(estimate, mat), local=estimate.local @ mat.T + shift)
    angles = np.degrees(rotation.rpy_from_mat(mat))
    note = (
        f"estimate aligned to the truth ({how.value}): turned by roll {angles[0]:.3g}, pitch {angles[1]:.3g}, yaw "
        f"{angles[2]:.4g} deg, {how.parameters} degrees of freedom removed"
    )
    return moved, (note,)
