"""The Earth: ellipsoid, gravity, rotation and the changes of coordinates on it (WGS 84).

::

    W² = 1 − e² sin²L          M = a (1 − e²)/W³   N = a/W
    γ0 = γe (1 + k sin²L)/W    k = b γp/(a γe) − 1                                      (Somigliana)
    γ  = γ0 [1 − 2h/a (1 + f + m − 2 f sin²L) + 3 h²/a²]      m = ω² a² b/GM            (height h)

    ω_ie = ω (cos L, 0, −sin L)        ω_en = (v_E/(N+h), −v_N/(M+h), −v_E tan L/(N+h))

L latitude, λ longitude, rad; h height above the ellipsoid, m; ``llh`` = (L, λ, h). Gravity is taken along the
ellipsoid normal; its north component above the ellipsoid, −8.1e-9 s⁻² h sin 2L, is left out (0.8 µg at 1 km).
The functions of `KERNELS` take floats or arrays and can be compiled (see `models.vector3`).

References
----------
.. [1] NIMA TR8350.2, Department of Defense World Geodetic System 1984, 3rd ed.: tables 3.1, 3.3, 3.4;
       eqs. 4-1 (Somigliana) and 4-3 (height).
.. [2] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
       ch. 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.vector3 import Scalar, Vec

SEMI_MAJOR_AXIS = 6378137.0
"""a, m [1]_."""
FLATTENING = 1.0 / 298.257223563
"""f [1]_."""
EARTH_RATE = 7.292115e-5
"""ω, rad/s [1]_."""
GRAVITATIONAL_CONSTANT = 3.986004418e14
"""GM with the atmosphere, m³/s² [1]_."""
EQUATOR_GRAVITY = 9.7803253359
"""γe, m/s² [1]_."""
POLE_GRAVITY = 9.8321849378
"""γp, m/s² [1]_."""

SEMI_MINOR_AXIS = SEMI_MAJOR_AXIS * (1.0 - FLATTENING)
"""b, m."""
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
"""e²."""
GRAVITY_RATIO = EARTH_RATE**2 * SEMI_MAJOR_AXIS**2 * SEMI_MINOR_AXIS / GRAVITATIONAL_CONSTANT
"""m: centrifugal ÷ gravitational acceleration at the equator."""
SOMIGLIANA = SEMI_MINOR_AXIS * POLE_GRAVITY / (SEMI_MAJOR_AXIS * EQUATOR_GRAVITY) - 1.0
"""k."""


def inverse_w(sin_lat: Scalar) -> Scalar:
    """Return 1/W."""
    return 1.0 / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat)


def radii(sin_lat: Scalar) -> tuple[Scalar, Scalar]:
    """Return the radii of curvature M (meridian) and N (prime vertical), m."""
    r = inverse_w(sin_lat)
    return SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY_SQUARED) * r * r * r, SEMI_MAJOR_AXIS * r


def radii_gradient(sin_lat: Scalar, cos_lat: Scalar) -> tuple[Scalar, Scalar]:
    """Return dM/dL and dN/dL, m per rad."""
    meridian, normal = radii(sin_lat)
    r = inverse_w(sin_lat)
    bend = ECCENTRICITY_SQUARED * sin_lat * cos_lat * r * r
    return 3.0 * meridian * bend, normal * bend


def gravity(sin_lat: Scalar, height: Scalar) -> Scalar:
    """Return normal gravity γ, m/s², pointing down."""
    s2 = sin_lat * sin_lat
    surface = EQUATOR_GRAVITY * (1.0 + SOMIGLIANA * s2) * inverse_w(sin_lat)
    u = height / SEMI_MAJOR_AXIS
    return surface * (
        1.0 - 2.0 * u * (1.0 + FLATTENING + GRAVITY_RATIO - 2.0 * FLATTENING * s2) + 3.0 * u * u
    )


def gravity_gradient(sin_lat: Scalar, cos_lat: Scalar, height: Scalar) -> tuple[Scalar, Scalar]:
    """Return ∂γ/∂L, m/s² per rad, and ∂γ/∂h, 1/s²."""
    s2, r = sin_lat * sin_lat, inverse_w(sin_lat)
    bulge = 1.0 + SOMIGLIANA * s2
    surface = EQUATOR_GRAVITY * bulge * r
    u = height / SEMI_MAJOR_AXIS
    shape = 1.0 + FLATTENING + GRAVITY_RATIO - 2.0 * FLATTENING * s2
    d_s2 = 2.0 * sin_lat * cos_lat
    d_surface = EQUATOR_GRAVITY * r * (SOMIGLIANA + 0.5 * ECCENTRICITY_SQUARED * bulge * r * r) * d_s2
    by_lat = d_surface * (1.0 - 2.0 * u * shape + 3.0 * u * u) + surface * 4.0 * u * FLATTENING * d_s2
    return by_lat, surface * (6.0 * u - 2.0 * shape) / SEMI_MAJOR_AXIS


def earth_rate(sin_lat: Scalar, cos_lat: Scalar) -> Vec:
    """Return ω_ie in n, rad/s."""
    return (EARTH_RATE * cos_lat, 0.0 * cos_lat, -EARTH_RATE * sin_lat)


def transport_rate(sin_lat: Scalar, cos_lat: Scalar, height: Scalar, vel_n: Vec) -> Vec:
    """Return ω_en in n, rad/s: how fast the local frame turns by moving over the ellipsoid."""
    meridian, normal = radii(sin_lat)
    east = vel_n[1] / (normal + height)
    return (east, -vel_n[0] / (meridian + height), -east * sin_lat / cos_lat)


KERNELS = (inverse_w, radii, radii_gradient, gravity, gravity_gradient, earth_rate, transport_rate)


def ecef_from_llh(llh: ArrayLike) -> FloatArray:
    """Return Earth-centred Earth-fixed coordinates, m; shape (..., 3)."""
    lat, lon, height = np.moveaxis(np.asarray(llh, dtype=float), -1, 0)
    _, normal = radii(np.sin(lat))
    across = (normal + height) * np.cos(lat)
    up = ((1.0 - ECCENTRICITY_SQUARED) * normal + height) * np.sin(lat)
    return np.stack([across * np.cos(lon), across * np.sin(lon), up], axis=-1)


def llh_from_ecef(vec_e: ArrayLike) -> FloatArray:
    """Return latitude, longitude (rad) and height (m); shape (..., 3).

    Four rounds of Bowring's formula in the reduced latitude: exact to rounding for heights above −100 km.
    """
    x, y, z = np.moveaxis(np.asarray(vec_e, dtype=float), -1, 0)
    across = np.hypot(x, y)
    second = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
    reduced = np.arctan2(SEMI_MAJOR_AXIS * z, SEMI_MINOR_AXIS * across)
    lat = reduced
    for _ in range(4):
        s, c = np.sin(reduced), np.cos(reduced)
        lat = np.arctan2(
            z + second * SEMI_MINOR_AXIS * s**3, across - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * c**3
        )
        reduced = np.arctan2((1.0 - FLATTENING) * np.sin(lat), np.cos(lat))
    sin_lat, cos_lat = np.sin(lat), np.cos(lat)
    w = np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin_lat**2)
    return np.stack([lat, np.arctan2(y, x), across * cos_lat + z * sin_lat - SEMI_MAJOR_AXIS * w], axis=-1)


def mat_en(lat: ArrayLike, lon: ArrayLike) -> FloatArray:
    """Return the matrix that rotates north-east-down into the Earth-fixed frame; shape (..., 3, 3)."""
    lat, lon = np.broadcast_arrays(np.asarray(lat, dtype=float), np.asarray(lon, dtype=float))
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    rows = [-s * cl, -sl, -c * cl, -s * sl, cl, -c * sl, c, np.zeros_like(s), -s]
    return np.stack(rows, axis=-1).reshape(*s.shape, 3, 3)


def metres_per_radian(llh: ArrayLike) -> FloatArray:
    """Return d(north, east, down)/d(latitude, longitude, height) = (M+h, (N+h) cos L, −1); shape (..., 3)."""
    lat, _, height = np.moveaxis(np.asarray(llh, dtype=float), -1, 0)
    meridian, normal = radii(np.sin(lat))
    return np.stack([meridian + height, (normal + height) * np.cos(lat), -np.ones_like(lat)], axis=-1)


def ned_between(llh: ArrayLike, reference: ArrayLike) -> FloatArray:
    """Return the small displacement from `reference` to `llh` as metres north, east, down; (..., 3).

    Latitude and longitude differences times the radii at the reference: the position error of the filter.
    """
    difference = np.asarray(llh, dtype=float) - np.asarray(reference, dtype=float)
    difference[..., 1] = _within_half_turn(difference[..., 1])
    return np.asarray(difference * metres_per_radian(reference))


def llh_displaced(reference: ArrayLike, ned: ArrayLike) -> FloatArray:
    """Return `reference` moved by metres north, east, down: the inverse of `ned_between`; (..., 3)."""
    return np.asarray(reference, dtype=float) + np.asarray(ned, dtype=float) / metres_per_radian(reference)


def without_jumps(llh: ArrayLike) -> FloatArray:
    """Return a track (k, 3) whose longitudes begin within ±π and do not jump where it crosses the date line.

    Such positions can be interpolated and averaged. Rows of NaN stay and are passed over.
    """
    out = np.array(llh, dtype=float)
    known = np.flatnonzero(np.isfinite(out[:, 1]))
    lon = out[known, 1]
    if len(lon):
        steps = _within_half_turn(np.diff(lon))
        out[known[0], 1] = lon[0] if abs(lon[0]) <= np.pi else _within_half_turn(lon[0])
        jumps = np.cumsum(np.round((steps - np.diff(lon)) / (2.0 * np.pi)))
        out[known[1:], 1] = lon[1:] + (out[known[0], 1] - lon[0]) + 2.0 * np.pi * jumps
    return out


def in_degrees(llh: ArrayLike, *, wrapped: bool = True) -> FloatArray:
    """Return positions (k, 3) with latitude and longitude in degrees, longitudes within ±180 unless not `wrapped`."""
    out = np.array(llh, dtype=float)
    out[:, :2] = np.degrees(out[:, :2])
    far = wrapped & (np.abs(out[:, 1]) > 180.0)
    out[far, 1] = np.mod(out[far, 1] + 180.0, 360.0) - 180.0
    return out


def distance_along(llh: ArrayLike) -> FloatArray:
    """Return metres north, east, down along a track (k, 3) from its first point: the integral of the velocity; (k, 3).

    North and east are those of each place, as in a velocity: near a pole they turn with the track.
    """
    llh = np.asarray(llh, dtype=float)
    middle = llh[:-1] + 0.5 * (llh[1:] - llh[:-1]) * [1.0, 0.0, 1.0]
    steps = ned_between(llh[1:], llh[:-1]) / metres_per_radian(llh[:-1]) * metres_per_radian(middle)
    return np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def in_tangent_plane(llh: ArrayLike, origin: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return positions (k, 3) in metres north, east, down of one point, and the turns (k, 3, 3) of n into its axes."""
    llh, origin = np.asarray(llh, dtype=float), np.asarray(origin, dtype=float)
    mat_te = mat_en(origin[0], origin[1]).T
    local = (ecef_from_llh(llh) - ecef_from_llh(origin)) @ mat_te.T
    return local, mat_te @ mat_en(llh[:, 0], llh[:, 1])


def _within_half_turn(angle: ArrayLike) -> FloatArray:
    """Return angles plus whole turns, in [−π, π)."""
    return np.asarray(np.mod(np.asarray(angle, dtype=float) + np.pi, 2.0 * np.pi) - np.pi)
