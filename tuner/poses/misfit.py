"""What gyroscopes and accelerometers measure beyond a stream of poses.

Between two poses the gyroscopes turn by a rotation vector, which the poses have as well; over three poses the specific
force, turned into the world and integrated twice, has a second difference that the positions have as well, but for
gravity. Both are compared in the axes of the inertial unit. Errors of the poses, white from pose to pose, are those of
a moving average in axes of the world; in axes that turn, its autocovariance at a lag is multiplied by the mean
projection of an axis on itself that much later.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from tuner.poses.noise_beside_causes import WILD_RATIO, Misfit

LONGEST_DELAY, DELAY_STEP = 1.0, 0.02
"""Delays of a clock among which the first guess is sought, and their step, s."""
LONGEST_STEP = 1.5
"""Time from one pose to the next ÷ the usual one from which poses are missing."""
LONGEST_PART = 0.02
"""Parts of an interval in which the axis of the turn hardly moves, s."""


@dataclass(frozen=True)
class Inertial:
    """Samples of a unit on an even clock.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Middle of each sample, s.
    rate, force : ndarray, shape (n, 3)
        rad/s and m/s².
    interval : float
        s.
    gaps : ndarray, shape (g, 2)
        Begin and end of what is missing, s.
    """

    t: FloatArray
    rate: FloatArray
    force: FloatArray
    interval: float
    gaps: FloatArray

    def whole(self, begin: FloatArray, end: FloatArray) -> NDArray[np.bool_]:
        """Return whether there are samples for all of some periods, s."""
        found: NDArray[np.bool_] = (begin > self.t[0]) & (end < self.t[-1])
        for first, last in self.gaps:
            found &= (end < first) | (begin > last)
        return found

    @property
    def edges(self) -> FloatArray:
        """Beginning of each sample and end of the last, s; (n + 1,)."""
        return np.append(self.t - 0.5 * self.interval, self.t[-1] + 0.5 * self.interval)


@dataclass(frozen=True)
class Poses:
    """Poses of a body in world-fixed axes.

    Attributes
    ----------
    t : ndarray, shape (m,)
        s.
    place : ndarray, shape (m, 3)
        m.
    quat : ndarray, shape (m, 4)
        From the body to the world.
    declared : (float, float)
        Sds that their source declares, of an attitude, rad, and of a position, m, an axis; NaN where it declares none.
    """

    t: FloatArray
    place: FloatArray
    quat: FloatArray
    declared: tuple[float, float] = (math.nan, math.nan)

    @property
    def turned(self) -> FloatArray:
        """Rotation vector from each pose to the next, in its axes, rad; (m − 1, 3)."""
        return rotation.rotvec_from_quat(
            rotation.quat_multiply(rotation.quat_conjugate(self.quat[:-1]), self.quat[1:])
        )


class Turns:
    """The angle of the gyroscopes at any time: integrals of the samples, and of how the axis turns meanwhile."""

    def __init__(self, imu: Inertial) -> None:
        step = imu.rate * imu.interval
        self.edges = imu.edges
        self.angle = np.vstack([np.zeros(3), np.cumsum(step, axis=0)])
        middle = self.angle[:-1] + 0.5 * step
        self.coning = np.vstack([np.zeros(3), np.cumsum(np.cross(middle, step), axis=0)])

    def angle_at(self, t: FloatArray) -> FloatArray:
        """Return the integral of the rates up to times, rad."""
        return _at(t, self.edges, self.angle)

    def between(self, t: FloatArray) -> FloatArray:
        """Return the rotation vector from each time to the next, rad, of parts by Bortz (1971) to second order."""
        parts = max(1, round(float(np.median(np.diff(t))) / LONGEST_PART))
        within = np.linspace(t[:-1], t[1:], parts, endpoint=False, axis=1).ravel()
        ends = np.append(within, t[-1])
        s, c = self.angle_at(ends), _at(ends, self.edges, self.coning)
        turn = np.diff(s, axis=0)
        each = turn + 0.5 * (np.diff(c, axis=0) - np.cross(s[:-1], turn))
        quats = rotation.quat_from_rotvec(each.reshape(-1, parts, 3))
        return rotation.rotvec_from_quat(functools.reduce(rotation.quat_multiply, np.moveaxis(quats, 1, 0)))


def _at(t: FloatArray, of: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(t, of, one) for one in values.T])


def first_alignment(turns: Turns, poses: Poses) -> tuple[float, FloatArray, float]:
    """Return the offset of a clock at which sizes of rotations agree best, the rotation that fits there, and how well.

    Returns
    -------
    delay : float
        What must be added to stamps of poses to have the unit's time, s.
    matrix : ndarray, shape (3, 3)
        From axes of the body to those of the unit.
    correlation : float
        Of the ranks of the sizes, which single wrong poses hardly change.
    """
    turned = poses.turned
    sizes = _ranks(turned)
    delays = np.arange(-LONGEST_DELAY, LONGEST_DELAY + 0.5 * DELAY_STEP, DELAY_STEP)
    fits = [float(np.corrcoef(_ranks(turns.between(poses.t + delay)), sizes)[0, 1]) for delay in delays]
    best = int(np.argmax(fits))
    own = turns.between(poses.t + float(delays[best]))
    apart = np.abs(np.linalg.norm(own, axis=1) - np.linalg.norm(turned, axis=1))
    alike = apart <= WILD_RATIO * np.median(apart)
    return float(delays[best]), rotation.nearest_rotation(own[alike].T @ turned[alike]), fits[best]


def _ranks(turned: FloatArray) -> FloatArray:
    """Return the places of rotation vectors (n, 3) in the order of their sizes."""
    return np.asarray(np.argsort(np.argsort(np.linalg.norm(turned, axis=1))), dtype=float)


def gyro_misfit(imu: Inertial, turns: Turns, poses: Poses, c: FloatArray) -> Misfit:
    """Return what the gyroscopes measure beyond poses on the unit's clock, turned to its axes by a matrix.

    Causes are ``turn`` (of the axes, rad), ``scale`` (errors of scale, then of right angles about x, y, z),
    ``clock`` (an offset at the middle of the run, s, and a drift) and ``filter`` (a low-pass: s²).
    """
    t, h = poses.t, np.diff(poses.t)[:, None]
    own, turned = turns.between(t), poses.turned
    expected = turned @ c.T
    y = (own - expected) / h  # in axes half-way: to first order those of biases and of errors of both poses
    middle = rotation.quat_multiply(poses.quat[:-1], rotation.quat_from_rotvec(0.5 * turned))
    later = np.diff(_at(t, imu.t, imu.rate), axis=0) / h
    frames = np.einsum("ij,nkj->nik", c, rotation.mat_from_quat(middle))
    interval = float(np.median(h))
    covariance = np.array([2.0, -1.0]) / interval**2
    since = (0.5 * (t[1:] + t[:-1]) - 0.5 * (t[0] + t[-1]))[:, None]
    causes = {
        **_of_each_axis(own / h),
        "clock": np.stack([later, since * later]),
        "filter": _second_derivative(own / h, interval),
    }
    none = np.zeros((3, 1))
    kept = (h[:, 0] < LONGEST_STEP * interval) & imu.whole(t[:-1], t[1:])
    white = np.array([1.0 / interval])
    return Misfit(y, causes, interval, white, covariance * _projection(frames, 2, kept), none, MIXING, kept)


def accel_misfit(
    imu: Inertial,
    turns: Turns,
    poses: Poses,
    c: FloatArray,
    attitude_sd: float,
    usable: NDArray[np.bool_],
) -> Misfit:
    """Return what the accelerometers measure beyond poses whose attitudes err by a known sd, rad.

    `usable` are the rows of the gyroscopes' misfit. Causes are its own, with ``delay``, s, in place of the clock,
    ``gravity`` (m/s² in axes of the world) and ``arm`` (from the body of the poses to the unit, m, in its axes).
    """
    inside = (imu.t > poses.t[0]) & (imu.t < poses.t[-1])
    times, dt = imu.t[inside], imu.interval
    world = np.einsum("nij,nj->ni", _attitudes(times, turns, poses, c), imu.force[inside] @ c)
    edges = np.append(times - 0.5 * dt, times[-1] + 0.5 * dt)
    velocity = np.vstack([np.zeros(3), np.cumsum(world * dt, axis=0)])[:-1]
    place = np.vstack([np.zeros(3), np.cumsum(velocity * dt + 0.5 * world * dt**2, axis=0)])[:-1]
    within = (poses.t > edges[0]) & (poses.t < edges[-1])
    t, quat = poses.t[within], poses.quat[within]
    i = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(times) - 1)
    rest = (t - edges[i])[:, None]
    inertial = place[i] + velocity[i] * rest + 0.5 * world[i] * rest**2
    mat = rotation.mat_from_quat(quat)
    frames = np.einsum("ij,nkj->nik", c, mat)[1:-1]

    def turned(x: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("nij,nj->ni", frames, _second_difference(t, x)))

    force = turned(inertial)
    y = force - turned(poses.place[within])
    world_force = _second_difference(t, inertial)
    interval = float(np.median(np.diff(t)))
    causes = {
        **_of_each_axis(force),
        "delay": np.gradient(force, t[1:-1], axis=0)[None],
        "filter": _second_derivative(force, interval),
        "gravity": np.moveaxis(frames, -1, 0),
        "arm": -np.moveaxis(_curvature(turns.between(t), np.diff(t)), -1, 0),
    }
    first = int(np.flatnonzero(within)[0])
    kept = (usable[:-1] & usable[1:])[first : first + len(y)]
    kept = kept & np.append(True, kept[:-1]) & np.append(kept[1:], True)  # derivatives reach one row further
    spline = np.array([18.0, 8.0, 1.0]) / 36.0
    lever = np.cross(frames, world_force[:, None, :])
    return Misfit(
        y,
        causes,
        interval,
        np.array([2.0 / 3.0, 1.0 / 6.0]) / interval,
        np.array([6.0, -4.0, 1.0]) / interval**4 * _projection(frames, 3, kept),
        attitude_sd**2 * spline * _projection(lever, 3, kept),
        MIXING,
        kept,
    )


def _of_each_axis(measured: FloatArray) -> Mapping[str, FloatArray]:
    """Return what a turn and errors of scale and axes add, for measured values (n, 3)."""
    turn, scale = (np.zeros((3, len(measured), 3)) for _ in range(2))
    skew = np.zeros_like(turn)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        scale[i, :, i] = measured[:, i]
        turn[i, :, j], turn[i, :, k] = -measured[:, k], measured[:, j]
        skew[i, :, j], skew[i, :, k] = measured[:, k], measured[:, j]
    return {"turn": turn, "scale": np.concatenate([scale, skew])}


MIXING: Mapping[str, FloatArray] = {
    name: np.moveaxis(columns, 1, 2) for name, columns in _of_each_axis(np.eye(3)).items()
}
"""How the columns of a cause are made of measured values: cause, axis of the misfit, axis measured."""


def _second_derivative(x: FloatArray, interval: float) -> FloatArray:
    """Return the second derivative of (n, 3) that is nearly even, (1, n, 3): what a low-pass takes from motion."""
    padded = np.pad(x, ((1, 1), (0, 0)), mode="edge")
    return np.diff(padded, 2, axis=0)[None] / interval**2


def _projection(rows: FloatArray, lags: int, kept: NDArray[np.bool_]) -> FloatArray:
    """Return the mean product of each row (n, 3, 3) with itself some steps later, of those kept, by lag; (3, lags)."""
    n, found = len(rows), []
    for lag in range(lags):
        both = np.flatnonzero(kept[: n - lag] & kept[lag:])
        found.append(np.einsum("nij,nij->i", rows[both], rows[both + lag]) / max(1, len(both)))
    return np.stack(found, axis=1)


def _second_difference(t: FloatArray, x: FloatArray) -> FloatArray:
    """Return the second divided difference of (m, 3), twice: the mean second derivative; (m − 2, 3)."""
    h = np.diff(t)[:, None]
    slope = np.diff(x, axis=0) / h
    return np.asarray(2.0 * np.diff(slope, axis=0) / (h[1:] + h[:-1]))


def _curvature(turn: FloatArray, h: FloatArray) -> FloatArray:
    """Return the mean second derivative of a matrix that turns by vectors (m − 1, 3), in its axes; (m − 2, 3, 3)."""
    ahead = rotation.mat_from_rotvec(turn[1:]) - np.eye(3)
    behind = rotation.mat_from_rotvec(-turn[:-1]) - np.eye(3)
    both = (h[1:] + h[:-1])[:, None, None]
    return np.asarray(2.0 * (ahead / h[1:, None, None] + behind / h[:-1, None, None]) / both)


def _attitudes(t: FloatArray, turns: Turns, poses: Poses, c: FloatArray) -> FloatArray:
    """Return matrices from the body to the world at times of the unit: between poses as the gyroscopes turn."""
    stamps = poses.t
    k = np.clip(np.searchsorted(stamps, t, side="right") - 1, 0, len(stamps) - 2)
    angle, at_pose = turns.angle_at(t) @ c, turns.angle_at(stamps) @ c
    share = ((t - stamps[k]) / np.diff(stamps)[k])[:, None]
    beyond = poses.turned - np.diff(at_pose, axis=0)
    vector = angle - at_pose[k] + share * beyond[k]
    return rotation.mat_from_quat(rotation.quat_multiply(poses.quat[k], rotation.quat_from_rotvec(vector)))
