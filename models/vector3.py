"""Vectors and quaternions as tuples of numbers.

A vector is ``(x, y, z)``, a quaternion ``(w, x, y, z)`` (Hamilton product, scalar first), a matrix a tuple of
three rows. The components may be floats or arrays of one shape: the same lines serve the readable reference,
vectorised evaluation and compiled code.

`KERNELS` lists the functions that are written in the subset of Python which numba compiles; an engine makes
them callable from compiled code with ``numba.extending.register_jitable(function)``.
"""

from __future__ import annotations

from typing import Any, TypeAlias

Scalar: TypeAlias = Any  # float or ndarray: the arithmetic is the same
Vec: TypeAlias = tuple[Scalar, Scalar, Scalar]
Quat: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar]
Mat: TypeAlias = tuple[Vec, Vec, Vec]


def add(a: Vec, b: Vec) -> Vec:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def scale(c: Scalar, a: Vec) -> Vec:
    """Return c a."""
    return (c * a[0], c * a[1], c * a[2])


def dot(a: Vec, b: Vec) -> Scalar:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec, b: Vec) -> Vec:
    """Return a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def transform(m: Mat, a: Vec) -> Vec:
    """Return the matrix-vector product m a."""
    return (dot(m[0], a), dot(m[1], a), dot(m[2], a))


def product(p: Quat, q: Quat) -> Quat:
    """Return the Hamilton product p q: first q, then p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


def matrix(q: Quat) -> Mat:
    """Return the rotation matrix of a quaternion of any length but zero."""
    s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    xx, yy, zz = s * q[1] * q[1], s * q[2] * q[2], s * q[3] * q[3]
    xy, xz, yz = s * q[1] * q[2], s * q[1] * q[3], s * q[2] * q[3]
    wx, wy, wz = s * q[0] * q[1], s * q[0] * q[2], s * q[0] * q[3]
    return (
        (1.0 - yy - zz, xy - wz, xz + wy),
        (xy + wz, 1.0 - xx - zz, yz - wx),
        (xz - wy, yz + wx, 1.0 - xx - yy),
    )


def turned(q: Quat, a: Vec) -> Vec:
    """Return `transform(matrix(q), a)` by fewer operations in a row: a + s (w c + u × c), c = u × a, s = 2/|q|²."""
    u = (q[1], q[2], q[3])
    c = cross(u, a)
    s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return add(a, scale(s, add(scale(q[0], c), cross(u, c))))


KERNELS = (add, scale, dot, cross, transform, product, matrix, turned)
