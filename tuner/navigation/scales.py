"""Units of a drive against one another: turns of the gyros and of the course, velocities and positions.

A vehicle turns where its course turns, Δψ = n · ∫ ω dt with the upright direction n in the axes of the sensor,
|n| = 1 whatever the mounting. Least squares over windows in motion give n; where they explain the course,
1 / |n| is the factor that the gyros are too large by. In the same way velocities are held against differences
of positions, ∫ v dt = factor · Δp.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.earth import metres_per_radian
from tuner.navigation.initial import velocities
from tuner.records import DataError, Drive, Gnss

FloatArray = NDArray[np.float64]

WINDOW = 4.0
"""Length of a window, s."""
SLOWEST = 3.0
"""Speed below which fixes have no course, m/s."""
FEWEST, TURNED, EXPLAINED = 10, 0.1, 0.8
"""Windows, rms turn in them, rad, and share of a square explained, from which a factor is believed."""
FACTOR = 30.0
"""Units wrong by more than this are refused: degrees for radians are 57."""


def gyro_factor(drive: Drive, gnss: Gnss) -> float | None:
    """Return how many times too large the gyros are by the course of the fixes; None where it does not tell."""
    if len(gnss) < FEWEST:
        return None
    vel = velocities(gnss)
    first, last = _windows(gnss.t, np.hypot(vel[:, 0], vel[:, 1]) > SLOWEST)
    course = np.arctan2(vel[:, 1], vel[:, 0])
    turn = np.remainder(course[last] - course[first] + np.pi, 2.0 * np.pi) - np.pi
    if len(turn) < FEWEST or np.sqrt(np.mean(turn**2)) < TURNED:
        return None
    steps = drive.rates[1:, :3] * np.diff(drive.imu_t)[:, None]
    angle = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    at = np.stack([np.interp(gnss.t, drive.imu_t, a) for a in angle.T], axis=-1)
    return _factor(at[last] - at[first], turn)


def velocity_factor(gnss: Gnss) -> float | None:
    """Return how many times too large the velocities are by the positions; None where these do not tell."""
    known: NDArray[np.bool_] = np.isfinite(gnss.vel_n.sum(axis=1))
    gnss = gnss.rows(known)
    first, last = _windows(gnss.t, np.ones(len(gnss), dtype=bool))
    if len(first) < FEWEST:
        return None
    moved = (gnss.llh[last] - gnss.llh[first]) * metres_per_radian(gnss.llh[first])
    mean = 0.5 * (gnss.vel_n[first] + gnss.vel_n[last]) * (gnss.t[last] - gnss.t[first])[:, None]
    return _factor(mean[:, :2].reshape(-1, 1), moved[:, :2].ravel())


def refuse_wrong_units(drive: Drive, gnss: Gnss) -> None:
    """Refuse gyros or velocities in another unit than the positions speak of.

    Raises
    ------
    DataError
        With the factor.
    """
    found = velocity_factor(gnss)
    if found is not None and not 1.0 / FACTOR < found < FACTOR:
        msg = (
            f"{drive.source}: expected velocities, m/s, and positions, degrees, that agree, "
            f"got velocities {_times(found)}; check the units of both"
        )
        raise DataError(msg)
    found = gyro_factor(drive, gnss)
    if found is not None and not 1.0 / FACTOR < found < FACTOR:
        msg = (
            f"{drive.source}: expected gyros that turn as the course of the fixes does, "
            f"got {_times(found)}; check their unit"
        )
        raise DataError(msg)


def _windows(t: FloatArray, usable: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first and last fixes of windows without a gap, both of them usable."""
    first = np.arange(len(t))
    last = np.searchsorted(t, t + WINDOW)
    inside = last < len(t)
    first, last = first[inside], last[inside]
    good = usable[first] & usable[last] & (t[last] - t[first] < 1.5 * WINDOW)
    return first[good], last[good]


def _factor(values: FloatArray, by: FloatArray) -> float | None:
    """Return 1 / |n| of the least squares values · n = by; None where they leave too much of it."""
    n = np.linalg.lstsq(values, by, rcond=None)[0]
    left = by - values @ n
    size = float(np.linalg.norm(n))
    return 1.0 / size if size > 0.0 and left @ left < (1.0 - EXPLAINED) * (by @ by) else None


def _times(factor: float) -> str:
    return f"{factor:.3g} times too large" if factor > 1.0 else f"{1.0 / factor:.3g} times too small"
