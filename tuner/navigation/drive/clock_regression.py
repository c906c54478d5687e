"""Regression of fixes on integrated inertial increments, segment by segment, to measure the offset of the clocks.

Within a segment of `SEGMENT_DURATION` the increments, rotated and integrated by themselves (`integrated_increments`),
must be the change of the fixes less gravity (`free_of_gravity`), u being the time since the begin of the segment and δ
the delay of the stamps::

    v(t) = c + C [S + C_b (ω × l)](t − δ)
    p(t) = c + c₁ u + C [P + C_b l](t − δ)

with the lever arm l, which swings as fast as the unit turns. The constants c and c₁, the attitude C and the biases of
the sensors belong to the segment alone; the delays of positions and of velocities, the lever arm, the scale factors of
the sensors and the mean biases of the gyros are common to all. No noise density enters: rows are weighted by the
scatter of what is left in their own segment, and a fix far outside it counts less or nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.robust import normal_sd
from tuner.navigation.drive.free_of_gravity import free_of_gravity
from tuner.navigation.drive.integrated_increments import IntegratedIncrements
from tuner.types.records import Gnss

SEGMENT_DURATION = 20.0
"""Length of a segment, s: long enough for a turn of a boat, short enough that free gyros lose less than a degree."""
MIN_SEGMENT_FIXES = 8
"""Fixes that a segment needs: its own constants are 18."""
MAX_GAP = 5.0
"""Time without fixes, in intervals of theirs and at least as many seconds, that ends a segment."""
GYRO_BIAS_SD, ACCEL_BIAS_SD = 3e-3, 0.3
"""Prior sds of what is left of the biases in a segment, rad/s and m/s²: those of consumer sensors."""
SCALE_FACTOR_SD = 0.02
"""Prior sd of the scale factors of the sensors: 2 %, that of consumer sensors."""
MAX_RESIDUAL = 5.0
"""Distance of a fix from its segment, in its scatter, from which it does not count (biweight)."""
OWN_SHARE, OTHERS_SHARE = np.sqrt(0.7), np.sqrt(0.3)
"""Shares of the variance of a segment and of the others in its weight: that of few correlated fixes is known badly."""
POSITION_SD_FLOOR, VELOCITY_SD_FLOOR = 3e-3, 3e-3
"""Least scatter of fixes, m and m/s: millimetres are the digits of a receiver."""
DELAYS = ("position", "velocity")
"""The first two common parameters: delays of positions and of velocities, s."""
MIN_FREE_SHARE = 0.1
"""Least share of the rows that counts as free: below it a scatter is not known."""
DERIVATIVE_HALF_WIDTHS = (0.1, 0.25)
"""Bounds of half of the time over which the acceleration is taken, s; between them a quarter of the fixes' interval.

With quick fixes no vibration of engines is in it, and a walker's bobbing at 2 Hz keeps three quarters; a receiver with
fixes once a second averages its velocities about as long."""
SWING_HALF_WIDTH = 0.05
"""The same of the velocity with which the antenna swings about the unit, s: a walker takes two steps in a second."""
COMMON_PARAMETERS = 2 + 3 + 3 + 3 + 3
"""Delays, lever arm, scale factors of gyros and accelerometers, biases of the gyros."""
OWN_PARAMETERS = 9 + 3 + 6
"""Attitude and biases; constants of velocities; constants and slopes of positions."""
OWN_PRIOR_SD = np.array([10.0] * 3 + [GYRO_BIAS_SD] * 3 + [ACCEL_BIAS_SD] * 3 + [1e4] * 9)
"""Prior sds of the own parameters; apart from the biases they say nothing."""


@dataclass(frozen=True)
class Segment:
    """Fixes of one segment as functions of time since its begin.

    Attributes
    ----------
    t, since : ndarray, shape (k,)
        Stamps, and time since the first of them, s.
    position, velocity : ndarray, shape (k, 3)
        Fixes without the effects of gravity and of the Earth's rotation, m and m/s; NaN where there is none.
    """

    t: FloatArray
    since: FloatArray
    position: FloatArray
    velocity: FloatArray


@dataclass(frozen=True)
class Weights:
    """Weight of every fix, 0 … 1, and sd of positions (h, v) and velocities (h, v) in one segment."""

    position: FloatArray
    velocity: FloatArray
    sd: tuple[float, float, float, float]


@dataclass(frozen=True)
class Rows:
    """Weighted residuals (r,) of a segment and derivatives (r, 14), its own constants projected out.

    `raw_position`, `raw_velocity` are what is left of the fixes unweighted, (k, 3); `free` the share of the rows that
    the own constants leave.
    """

    residual: FloatArray
    design: FloatArray
    raw_position: FloatArray
    raw_velocity: FloatArray
    free: float


def segments(gnss: Gnss, duration: float = SEGMENT_DURATION) -> list[Segment]:
    """Cut the fixes into segments of about a duration, s, without gaps."""
    t = gnss.t
    longest = MAX_GAP * max(1.0, float(np.median(np.diff(t))))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(t) > longest) + 1, [len(t)]])
    out = []
    for first, last in pairwise(edges.tolist()):
        count = max(1, round((t[last - 1] - t[first]) / duration))
        cuts = np.searchsorted(
            t[first:last], t[first] + (t[last - 1] - t[first]) / count * np.arange(count + 1)[1:-1]
        )
        for a, b in pairwise([first, *(first + cuts).tolist(), last]):
            if b - a >= MIN_SEGMENT_FIXES:
                out.append(_segment(gnss.rows(slice(a, b))))
    return out


def _segment(fixes: Gnss) -> Segment:
    """Take gravity, Coriolis forces and the rotation of the axes out of the fixes of a segment."""
    return Segment(
        fixes.t, fixes.t - fixes.t[0], *free_of_gravity(fixes.t, fixes.llh, fixes.vel_n, inertial=True)
    )


def unweighted(segment: Segment, sd: tuple[float, float, float, float]) -> Weights:
    """Return full weights of all fixes that are there."""
    return Weights(
        np.isfinite(segment.position).all(axis=1).astype(float),
        np.isfinite(segment.velocity).all(axis=1).astype(float),
        sd,
    )


def regression(
    increments: IntegratedIncrements,
    segment: Segment,
    weights: Weights,
    delays: tuple[float, float],
    lever_arm: FloatArray,
) -> Rows:
    """Linearise a segment about delays of positions and velocities, and project its own constants out.

    Parameters
    ----------
    increments : IntegratedIncrements
        Of the drive.
    segment : Segment
        Fixes.
    weights : Weights
        Of these fixes.
    delays : tuple of 2 floats
        Of positions and velocities, s.
    lever_arm : ndarray, shape (3,)
        Assumed, in b, m.
    """
    at = _linearized(increments, segment, weights, delays, lever_arm)
    q, triangle = np.linalg.qr(at.own)
    found = np.linalg.solve(triangle, q.T @ at.residual)
    counted = 3.0 * float(np.count_nonzero(weights.position) + np.count_nonzero(weights.velocity))
    k, left = len(segment.t), np.split(at.raw - at.raw_own @ found, 2)
    return Rows(
        at.residual - q @ (q.T @ at.residual),
        at.common - q @ (q.T @ at.common),
        left[0].reshape(k, 3) + 0.0 * segment.position,
        left[1].reshape(k, 3) + 0.0 * segment.velocity,
        max(1.0 - OWN_PARAMETERS / max(counted, 1.0), MIN_FREE_SHARE),
    )


def residuals_by_delay(
    increments: IntegratedIncrements,
    segment: Segment,
    sd: tuple[float, float, float, float],
    delays: FloatArray,
    lever_arm: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return what a regression leaves of positions and velocities for d common delays, its derivatives those of none.

    Parameters
    ----------
    increments, segment, lever_arm
        As of `regression`.
    sd : tuple of 4 floats
        Of positions (h, v) and velocities (h, v).
    delays : ndarray, shape (d,)
        s.

    Returns
    -------
    positions, velocities : ndarray, shape (d, k, 3)
        NaN where there is no fix.
    """
    weights, k = unweighted(segment, sd), len(segment.t)
    at = _linearized(increments, segment, weights, (0.0, 0.0), lever_arm)
    q, _ = np.linalg.qr(at.own)
    times = segment.t - delays[:, None]
    of = _Interpolator(increments.t, times.ravel())
    s, p = (of(y).reshape(*times.shape, 3) for y in (increments.velocity, increments.position))
    arm_p, arm_v = _swing(of(increments.mat).reshape(-1, 3, 3), of(increments.rate), lever_arm)
    x_p = p - p[:, :1] - s[:, :1] * segment.since[:, None] + arm_p.reshape(p.shape)
    x_v = s - s[:, :1] + arm_v.reshape(s.shape)
    fixes = (np.nan_to_num(segment.position), np.nan_to_num(segment.velocity))
    mats = _attitudes(segment, (x_p, x_v), fixes, at.weight)
    turned = np.concatenate([x_p, x_v], axis=1) @ np.swapaxes(mats, 1, 2)
    raw = (np.concatenate(fixes) - turned).reshape(len(delays), -1)
    weighted = raw * at.weight
    left = weighted - (weighted @ q[: 6 * k]) @ q[: 6 * k].T
    left = np.divide(left, at.weight, out=np.full_like(left, np.nan), where=at.weight > 0.0)
    return left[:, : 3 * k].reshape(-1, k, 3), left[:, 3 * k :].reshape(-1, k, 3)


@dataclass(frozen=True)
class _Linearized:
    """A segment about two delays: residuals and derivatives of 6 k rows, positions first.

    `weight` (6 k,) is one over the sd of a row; `raw`, `raw_own` are residuals and own derivatives unweighted;
    `residual`, `own`, `common` are weighted and have a prior row for each own parameter.
    """

    weight: FloatArray
    raw: FloatArray
    raw_own: FloatArray
    residual: FloatArray
    own: FloatArray
    common: FloatArray


def _linearized(
    increments: IntegratedIncrements,
    segment: Segment,
    weights: Weights,
    delays: tuple[float, float],
    lever_arm: FloatArray,
) -> _Linearized:
    """Return residuals and derivatives of a segment."""
    k, u = len(segment.t), segment.since[:, None, None]
    of_p, of_v = (_at(increments, segment.t - delay, lever_arm) for delay in delays)
    sd_p, sd_v = np.array(weights.sd)[[0, 0, 1]], np.array(weights.sd)[[2, 2, 3]]
    weight = np.concatenate(
        [
            (np.sqrt(weights.position)[:, None] / sd_p).ravel(),
            (np.sqrt(weights.velocity)[:, None] / sd_v).ravel(),
        ]
    )
    fixes = (np.nan_to_num(segment.position), np.nan_to_num(segment.velocity))
    integrals = (of_p.position[None], of_v.velocity[None])
    mat = _attitudes(segment, integrals, fixes, weight)[0]
    x_p, x_v = of_p.position @ mat.T, of_v.velocity @ mat.T
    line, zero = np.zeros((k, 3, 3)) + np.eye(3), np.zeros((k, 3, 3))
    own = np.concatenate(
        [
            np.concatenate([-rotation.skew(x_p), mat @ of_p.biases[0], zero, line, line * u], axis=2),
            np.concatenate([-rotation.skew(x_v), mat @ of_v.biases[1], line, zero, zero], axis=2),
        ]
    ).reshape(6 * k, OWN_PARAMETERS)
    shift_p, shift_v = np.zeros((k, 3, 2)), np.zeros((k, 3, 2))
    shift_p[:, :, 0] = -(of_p.velocity @ mat.T)
    shift_v[:, :, 1] = -(of_v.acceleration @ mat.T)
    arm_p, arm_v = mat @ of_p.mat, mat @ of_v.mat @ rotation.skew(of_v.rate)
    common = np.concatenate(
        [
            np.concatenate([shift_p, arm_p, mat @ of_p.scales[0], mat @ of_p.biases[0][:, :, :3]], axis=2),
            np.concatenate([shift_v, arm_v, mat @ of_v.scales[1], mat @ of_v.biases[1][:, :, :3]], axis=2),
        ]
    ).reshape(6 * k, COMMON_PARAMETERS)
    raw = np.concatenate([fixes[0] - x_p, fixes[1] - x_v]).ravel()
    nothing = np.zeros((OWN_PARAMETERS, COMMON_PARAMETERS))
    return _Linearized(
        weight,
        raw,
        own,
        np.append(raw * weight, nothing[:, 0]),
        np.vstack([own * weight[:, None], np.diag(1.0 / OWN_PRIOR_SD)]),
        np.vstack([common * weight[:, None], nothing]),
    )


def reweighted(segment: Segment, rows: Rows, usual: Sequence[float] | None = None) -> Weights:
    """Return weights and scatter by what a regression left of the fixes; `usual` is the scatter of other segments."""
    sds: list[float] = []
    distance = []
    for raw, values, floor in (
        (rows.raw_position, segment.position, POSITION_SD_FLOOR),
        (rows.raw_velocity, segment.velocity, VELOCITY_SD_FLOOR),
    ):
        there = np.isfinite(values).all(axis=1)
        two = []
        for columns in ([0, 1], [2]):
            part = np.abs(raw[there][:, columns])
            sd = float(normal_sd(part)) if len(part) else 1.0
            two.append(max(sd / np.sqrt(rows.free), floor))
        if usual is not None:
            others = usual[len(sds) : len(sds) + 2]
            two = [float(np.hypot(OWN_SHARE * s, OTHERS_SHARE * m)) for s, m in zip(two, others, strict=True)]
        sds += two
        scaled = raw / np.array([two[0], two[0], two[1]])
        distance.append(np.where(there, np.sqrt(np.mean(scaled**2, axis=1)), np.inf))
    position, velocity = (np.maximum(1.0 - (d / MAX_RESIDUAL) ** 2, 0.0) ** 2 for d in distance)
    return Weights(position, velocity, (sds[0], sds[1], sds[2], sds[3]))


@dataclass(frozen=True)
class _Interpolated:
    """Integrals at k times from the first of them on, derivatives (k, 3, 6) by biases and by scale factors."""

    velocity: FloatArray
    position: FloatArray
    acceleration: FloatArray
    mat: FloatArray
    rate: FloatArray
    biases: tuple[FloatArray, FloatArray]
    scales: tuple[FloatArray, FloatArray]


def _swing(mat: FloatArray, rate: FloatArray, arm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return place and velocity of the end of a lever arm against the unit, in the axes b₀; (k, 3) each."""
    return mat @ arm, (mat @ np.cross(rate, arm)[..., None])[..., 0]


def _at(increments: IntegratedIncrements, t: FloatArray, arm: FloatArray) -> _Interpolated:
    """Interpolate the integrals, those of the end of a lever arm, at times and refer them to the first time."""
    at = _Interpolator(increments.t, t)
    velocity, position = at(increments.velocity), at(increments.position)
    by_v, by_p, angles = at(increments.by_velocity), at(increments.by_position), at(increments.angles)[0]
    since = (t - t[0])[:, None]
    s = velocity - velocity[0]
    p = position - position[0] - velocity[0] * since
    d_v = (by_v - by_v[0]).reshape(-1, 4, 3, 3)
    d_p = (by_p - by_p[0] - by_v[0] * since).reshape(-1, 4, 3, 3)
    for i, first in ((0, angles[:9].reshape(3, 3)), (2, angles[9:].reshape(3, 3))):
        # Errors of the gyros count from the first time on: what they turned before belongs to the attitude.
        d_v[:, i] -= rotation.skew(s) @ first
        d_p[:, i] -= rotation.skew(p) @ first
    mat, rate = at(increments.mat).reshape(-1, 3, 3), at(increments.rate)
    arm_p, arm_v = _swing(mat, rate, arm)

    def slope(half: float, value: Callable[[_Interpolator], FloatArray]) -> FloatArray:
        ends = (value(_Interpolator(increments.t, t + side)) for side in (half, -half))
        return np.asarray(next(ends) - next(ends)) / (2.0 * half)

    half_width = float(np.clip(0.25 * np.median(np.diff(t)), *DERIVATIVE_HALF_WIDTHS))
    acceleration = slope(half_width, lambda of: of(increments.velocity)) + slope(
        SWING_HALF_WIDTH,
        lambda of: _swing(of(increments.mat).reshape(-1, 3, 3), of(increments.rate), arm)[1],
    )
    return _Interpolated(
        s + arm_v,
        p + arm_p,
        acceleration,
        mat,
        rate,
        (np.concatenate([d_p[:, 0], d_p[:, 1]], axis=2), np.concatenate([d_v[:, 0], d_v[:, 1]], axis=2)),
        (np.concatenate([d_p[:, 2], d_p[:, 3]], axis=2), np.concatenate([d_v[:, 2], d_v[:, 3]], axis=2)),
    )


class _Interpolator:
    """Linear interpolation of rows (n, m) given at rising times, at k other times."""

    def __init__(self, t: FloatArray, wanted: FloatArray) -> None:
        self.after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
        dt = t[self.after] - t[self.after - 1]
        self.share = np.clip((wanted - t[self.after - 1]) / dt, 0.0, 1.0)[:, None]

    def __call__(self, y: FloatArray) -> FloatArray:
        before = y[self.after - 1]
        return np.asarray(before + self.share * (y[self.after] - before))


def _attitudes(
    segment: Segment,
    integrals: tuple[FloatArray, FloatArray],
    fixes: tuple[FloatArray, FloatArray],
    weight: FloatArray,
) -> FloatArray:
    """Return the attitudes (d, 3, 3) that turn d integrals (d, k, 3) to fixes (k, 3) best, lines taken out."""
    product = np.zeros((len(integrals[0]), 3, 3))
    first = np.split(weight.reshape(-1, 3)[:, :1], 2)
    for degree, x, y, w in zip((1, 0), integrals, fixes, first, strict=True):
        if not w.any():
            continue
        base, _ = np.linalg.qr(w * np.vander(segment.since, degree + 1))
        y = w * y
        product += np.swapaxes((w * (y - base @ (base.T @ y))), 0, 1) @ x
    u, _, vt = np.linalg.svd(product)
    proper = np.zeros_like(product) + np.eye(3)
    proper[:, 2, 2] = np.linalg.det(u) * np.linalg.det(vt)
    return np.asarray(u @ proper @ vt)
