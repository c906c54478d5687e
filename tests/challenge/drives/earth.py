"""The ellipsoid of WGS 84 in Earth-fixed coordinates: positions, axes, gravity; independent of the project."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

A, B = 6378137.0, 6356752.314245
"""Semi-axes, m."""
SPIN = np.array([0.0, 0.0, 7.292115e-5])
"""Rotation of the Earth, rad/s."""
E2 = 1.0 - (B / A) ** 2
GRAVITY_EQUATOR, GRAVITY_POLE = 9.7803253359, 9.8321849378
MU = 3.986004418e14


def place(llh: FloatArray) -> FloatArray:
    """Return Earth-fixed coordinates of latitude, longitude, rad, and height, m; (n, 3)."""
    lat, lon, h = llh.T
    n = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
    level = (n + h) * np.cos(lat)
    return np.column_stack([level * np.cos(lon), level * np.sin(lon), (n * (1.0 - E2) + h) * np.sin(lat)])


def geodetic(x: FloatArray) -> FloatArray:
    """Return latitude, longitude and height of Earth-fixed coordinates, by a fixed point in the latitude."""
    level = np.hypot(x[:, 0], x[:, 1])
    lat = np.arctan2(x[:, 2], level * (1.0 - E2))
    for _ in range(5):
        n = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
        lat = np.arctan2(x[:, 2] + E2 * n * np.sin(lat), level)
    n = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
    h = level * np.cos(lat) + x[:, 2] * np.sin(lat) - n * (1.0 - E2 * np.sin(lat) ** 2)
    return np.column_stack([lat, np.arctan2(x[:, 1], x[:, 0]), h])


def axes(llh: FloatArray) -> FloatArray:
    """Return the matrices whose columns are north, east, down in Earth-fixed axes; (n, 3, 3)."""
    lat, lon = llh[:, 0], llh[:, 1]
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    north = np.column_stack([-s * cl, -s * sl, c])
    east = np.column_stack([-sl, cl, 0.0 * sl])
    return np.stack([north, east, np.cross(north, east)], axis=-1)


def gravity(llh: FloatArray) -> FloatArray:
    """Return normal gravity along the normal of the ellipsoid, m/s²; to second order in the height."""
    s2, h = np.sin(llh[:, 0]) ** 2, llh[:, 2]
    k = B * GRAVITY_POLE / (A * GRAVITY_EQUATOR) - 1.0
    surface = GRAVITY_EQUATOR * (1.0 + k * s2) / np.sqrt(1.0 - E2 * s2)
    f, m = 1.0 - B / A, SPIN[2] ** 2 * A * A * B / MU
    return np.asarray(surface * (1.0 - 2.0 / A * (1.0 + f + m - 2.0 * f * s2) * h + 3.0 * (h / A) ** 2))


def radii(llh: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return metres per radian of latitude and of longitude."""
    w = 1.0 - E2 * np.sin(llh[:, 0]) ** 2
    meridian = A * (1.0 - E2) / w**1.5
    return meridian + llh[:, 2], (A / np.sqrt(w) + llh[:, 2]) * np.cos(llh[:, 0])
