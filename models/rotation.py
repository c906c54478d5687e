"""Rotations: quaternions, direction cosine matrices, Euler angles and rotation vectors.

All functions broadcast over leading axes. Conventions::

    quaternion   q = (w, x, y, z), unit length, Hamilton product, w ≥ 0 where it is computed from a rotation
    matrix       mat_ab rotates a vector of b into a:  v_a = mat_ab v_b
    Euler        rpy = (roll, pitch, yaw):  mat_nb = Rz(yaw) Ry(pitch) Rx(roll)
    vector       rotvec = axis · angle, |rotvec| ≤ π from the logarithm:  mat = exp([rotvec ×])

The exponential is written with sin(x)/x alone, (1 − cos x)/x² being ½ (sin(x/2)/(x/2))²: no cancellation at
small angles. The logarithm goes through the quaternion and its two-argument arctangent, exact at 0 and at π.

References
----------
.. [1] J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017 (exponential, Jacobians).
.. [2] S. W. Shepperd, Quaternion from rotation matrix, J. Guidance and Control 1 (1978).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from models import vector3 as triples
from models.arrays import FloatArray


def _components(a: ArrayLike) -> tuple[FloatArray, ...]:
    a = np.asarray(a, dtype=float)
    return tuple(a) if a.ndim == 1 else tuple(a[..., k] for k in range(a.shape[-1]))


def _vector(*components: FloatArray) -> FloatArray:
    answer = np.empty((*np.broadcast(*components).shape, len(components)))
    for k, x in enumerate(components):
        answer[..., k] = x
    return answer


def _matrix(rows: triples.Mat) -> FloatArray:
    answer = np.empty((*np.broadcast(*rows[0], *rows[1], *rows[2]).shape, 3, 3))
    for i, row in enumerate(rows):
        for j, x in enumerate(row):
            answer[..., i, j] = x
    return answer


def skew(a: ArrayLike) -> FloatArray:
    """Return the matrix [a ×] with [a ×] b = a × b; shape (..., 3) → (..., 3, 3)."""
    x, y, z = _components(a)
    return _matrix(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def quat_multiply(p: ArrayLike, q: ArrayLike) -> FloatArray:
    """Return the Hamilton product p q (rotate by q, then by p); shapes (..., 4)."""
    pw, px, py, pz = _components(p)
    qw, qx, qy, qz = _components(q)
    return _vector(*triples.product((pw, px, py, pz), (qw, qx, qy, qz)))


def quat_conjugate(q: ArrayLike) -> FloatArray:
    """Return the inverse of a unit quaternion; shape (..., 4)."""
    return np.asarray(np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0]))


def quat_from_rotvec(rotvec: ArrayLike) -> FloatArray:
    """Return the quaternion of a rotation vector, rad; shape (..., 3) → (..., 4)."""
    rotvec = np.asarray(rotvec, dtype=float)
    half = 0.5 * np.linalg.norm(rotvec, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * rotvec], axis=-1)


def rotvec_from_quat(q: ArrayLike) -> FloatArray:
    """Return the rotation vector, rad, of length at most π; shape (..., 4) → (..., 3)."""
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    length = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    safe = np.where(length > 0.0, length, 1.0)
    factor = np.where(length > 0.0, 2.0 * np.arctan2(length, q[..., :1]) / safe, 2.0)
    return np.asarray(factor * q[..., 1:])


def mat_from_quat(q: ArrayLike) -> FloatArray:
    """Return the rotation matrix; shape (..., 4) → (..., 3, 3)."""
    w, x, y, z = _components(q)
    return _matrix(triples.matrix((w, x, y, z)))


def quat_from_mat(mat: ArrayLike) -> FloatArray:
    """Return the quaternion, w ≥ 0, of a rotation matrix; shape (..., 3, 3) → (..., 4).

    Of the four equivalent formulas the one that divides by the largest component is used [2]_.
    """
    m = np.asarray(mat, dtype=float)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    yz, xz, xy = m[..., 2, 1] + m[..., 1, 2], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 0] + m[..., 0, 1]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    # Row i of 4 q qᵀ, for each choice i of the component that is divided by.
    rows = np.stack(
        [
            _vector(1.0 + xx + yy + zz, wx, wy, wz),
            _vector(wx, 1.0 + xx - yy - zz, xy, xz),
            _vector(wy, xy, 1.0 - xx + yy - zz, yz),
            _vector(wz, xz, yz, 1.0 - xx - yy + zz),
        ],
        axis=-2,
    )
    largest = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q))


def mat_from_rotvec(rotvec: ArrayLike) -> FloatArray:
    """Return exp([rotvec ×]); shape (..., 3) → (..., 3, 3)."""
    angle = np.linalg.norm(np.asarray(rotvec, dtype=float), axis=-1)[..., None, None]
    k = skew(rotvec)
    return np.asarray(
        np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (k @ k)
    )


def nearest_rotation(mat: FloatArray) -> FloatArray:
    """Return the rotation C of the largest tr(Cᵀ mat): of Σ a bᵀ that with a ≈ C b in least squares (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(mat)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def rotvec_from_mat(mat: ArrayLike) -> FloatArray:
    """Return the rotation vector, rad, of length at most π; shape (..., 3, 3) → (..., 3)."""
    return rotvec_from_quat(quat_from_mat(mat))


def left_jacobian(rotvec: ArrayLike) -> FloatArray:
    """Return J with exp([(a + δ) ×]) = exp([J δ ×]) exp([a ×]) to first order; shape (..., 3) → (..., 3, 3).

    J = I + (1 − cos x)/x² [a ×] + (x − sin x)/x³ [a ×]², x = |a|; the last factor by series below 0.5.
    """
    x = np.linalg.norm(np.asarray(rotvec, dtype=float), axis=-1)[..., None, None]
    k = skew(rotvec)
    s = x * x
    series = (
        1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0 * (1.0 - s / 156.0))))
    ) / 6.0
    large = np.where(x < 0.5, 1.0, x)
    third = np.where(x < 0.5, series, (large - np.sin(large)) / large**3)
    return np.asarray(np.eye(3) + 0.5 * np.sinc(x / (2.0 * np.pi)) ** 2 * k + third * (k @ k))


def mat_from_rpy(rpy: ArrayLike) -> FloatArray:
    """Return Rz(yaw) Ry(pitch) Rx(roll); shape (..., 3) → (..., 3, 3)."""
    roll, pitch, yaw = _components(rpy)
    sr, cr, sp, cp, sy, cy = (
        np.sin(roll),
        np.cos(roll),
        np.sin(pitch),
        np.cos(pitch),
        np.sin(yaw),
        np.cos(yaw),
    )
    return _matrix(
        (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )
    )


def rpy_from_mat(mat: ArrayLike) -> FloatArray:
    """Return roll, yaw in (−π, π] and pitch in [−π/2, π/2], rad; shape (..., 3, 3) → (..., 3).

    At a pitch of ± π/2 only yaw ∓ roll is defined: the matrix of the answer is right, the split is arbitrary.
    """
    m = np.asarray(mat, dtype=float)
    pitch = np.arctan2(-m[..., 2, 0], np.hypot(m[..., 0, 0], m[..., 1, 0]))
    yaw = np.arctan2(m[..., 1, 0], m[..., 0, 0])
    # Roll after yaw has been taken out: well defined however small cos(pitch) is.
    s, c = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(s * m[..., 0, 2] - c * m[..., 1, 2], c * m[..., 1, 1] - s * m[..., 0, 1])
    return _vector(roll, pitch, yaw)


def quat_from_rpy(rpy: ArrayLike) -> FloatArray:
    """Return the quaternion, w ≥ 0, of Euler angles; shape (..., 3) → (..., 4)."""
    return quat_from_mat(mat_from_rpy(rpy))


def rpy_from_quat(q: ArrayLike) -> FloatArray:
    """Return roll, pitch, yaw, rad; shape (..., 4) → (..., 3)."""
    return rpy_from_mat(mat_from_quat(q))


def rate_from_rpy(rpy: ArrayLike, rpy_dot: ArrayLike) -> FloatArray:
    """Return the angular rate ω_nb in b, rad/s, of Euler angles and their derivatives; shapes (..., 3)."""
    roll, pitch, _ = _components(rpy)
    roll_dot, pitch_dot, yaw_dot = _components(rpy_dot)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return _vector(
        roll_dot - sp * yaw_dot, cr * pitch_dot + cp * sr * yaw_dot, cp * cr * yaw_dot - sr * pitch_dot
    )
