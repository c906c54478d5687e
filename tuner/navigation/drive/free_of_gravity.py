"""Fixes without the effects of gravity and of the Earth's rotation: what is left is the integrated specific force.

In axes a that are those of north, east, down at the first fix, with s the integral of the velocity and T = C_an::

    v̇ = C_ab f + γ T e_D − ω × v        ω = 2 ω_ie in axes fixed to the Earth, ω_ie in axes that do not turn
    v − ∫ γ T e_D dt + ω × s = v₀ + ∫ C_ab f dt            s − ∫∫ γ T e_D dt² + ∫ ω × s dt = v₀ t + ∫∫ C_ab f dt²

Unlike north and east, these axes do not turn with the vehicle, which near a pole is fast.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from models.earth import earth_rate, gravity, in_tangent_plane
from models.rotation import mat_from_rotvec


def free_of_gravity(
    t: FloatArray, llh: FloatArray, vel_n: FloatArray, *, inertial: bool
) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities of fixes, (k, 3) each, m and m/s, in axes of the first; NaN stays NaN.

    Parameters
    ----------
    t : ndarray, shape (k,)
        s.
    llh : ndarray, shape (k, 3)
        Latitude, longitude, rad, height, m.
    vel_n : ndarray, shape (k, 3)
        North, east, down, m/s.
    inertial : bool
        Whether the axes do not turn, as those of gyros; else they are fixed to the Earth, as if the Earth's rate were
        a part of the biases of the gyros.
    """
    dt, sin_lat = np.diff(t)[:, None], np.sin(llh[:, 0])
    place, turn = in_tangent_plane(llh, llh[0])
    omega = np.array(earth_rate(sin_lat[0], np.cos(llh[0, 0])))
    if inertial:
        of_earth = mat_from_rotvec((t - t[0])[:, None] * omega)
        turn, place = of_earth @ turn, np.einsum("kij,kj->ki", of_earth, place)
        place = place - np.cross(omega, _integral(place, dt))
    rate = omega if inertial else 2.0 * omega
    fall = _integral(turn[:, :, 2] * gravity(sin_lat, llh[:, 2])[:, None], dt) - np.cross(rate, place)
    return place - _integral(fall, dt), np.einsum("kij,kj->ki", turn, vel_n) - fall


def _integral(y: FloatArray, dt: FloatArray) -> FloatArray:
    return np.vstack([np.zeros((1, 3)), np.cumsum(0.5 * (y[1:] + y[:-1]) * dt, axis=0)])
