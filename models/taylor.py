"""Sine and cosine by Taylor's series: plain arithmetic without branches, for floats, arrays and compiled loops."""

from __future__ import annotations

import math

from models.vector3 import Quat, Scalar, Vec, dot

COSINE = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(11))
SINE = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(11))
"""Coefficients of cos x and (sin x)/x in x²."""


def series(s: Scalar, c: tuple[float, ...]) -> Scalar:
    """Return Σ c_k s^k of eleven terms, four of them at a time (Estrin): few operations wait for others."""
    q = s * s
    r = q * q
    low = c[0] + c[1] * s + (c[2] + c[3] * s) * q
    middle = c[4] + c[5] * s + (c[6] + c[7] * s) * q
    return low + (middle + (c[8] + c[9] * s + c[10] * q) * r) * r


def sine_cosine(x: Scalar) -> tuple[Scalar, Scalar]:
    """Return sin x and cos x: exact to rounding for |x| ≤ π/2, as latitudes are."""
    s = x * x
    return x * series(s, SINE), series(s, COSINE)


def exponential(a: Vec) -> Quat:
    """Return the quaternion of a rotation vector, rad: exact to rounding for |a| ≤ π."""
    s = 0.25 * dot(a, a)
    k = 0.5 * series(s, SINE)
    return (series(s, COSINE), k * a[0], k * a[1], k * a[2])


KERNELS = (series, sine_cosine, exponential)
