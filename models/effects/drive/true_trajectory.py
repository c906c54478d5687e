"""True course of a drive between its samples: position and velocity of the antenna, attitude of the unit.

Position is a cubic Hermite spline through positions and velocities, velocity a cubic spline, attitude the
shortest rotation between two samples. With the lever arm l in b, u = C l::

    antenna = llh ⊕ u          v_antenna = v + u' + ω_en × u

For samples every 0.1 s and a jerk of 2 m/s³ the position is exact to 1e-6 m, the velocity to 1e-4 m/s.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from models import rotation
from models.arrays import FloatArray
from models.earth import llh_displaced, metres_per_radian, transport_rate

if TYPE_CHECKING:  # loaded where a drive is moved, as it takes 0.2 s
    from scipy.interpolate import CubicHermiteSpline, CubicSpline


@dataclass(frozen=True)
class Course:
    """Motion of the inertial unit at m instants, increasing.

    Attributes
    ----------
    t : ndarray, shape (m,)
        s.
    llh : ndarray, shape (m, 3)
        Latitude, longitude, rad, height, m.
    vel_n : ndarray, shape (m, 3)
        North, east, down, m/s.
    quat_nb : ndarray, shape (m, 4)
        Attitude of the vehicle.
    """

    t: FloatArray
    llh: FloatArray
    vel_n: FloatArray
    quat_nb: FloatArray

    @cached_property
    def _position(self) -> CubicHermiteSpline:
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.llh, self.vel_n / metres_per_radian(self.llh))

    @cached_property
    def _velocity(self) -> CubicSpline:
        return self._through(self.vel_n)

    def _through(self, values: FloatArray) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.t, values)

    def mat_nb(self, t: ArrayLike) -> FloatArray:
        """Return the attitude at times t, (k,), clipped to the course; shape (k, 3, 3)."""
        times = np.clip(np.asarray(t, dtype=float), self.t[0], self.t[-1])
        i = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        share = (times - self.t[i]) / (self.t[i + 1] - self.t[i])
        turn = rotation.rotvec_from_quat(
            rotation.quat_multiply(rotation.quat_conjugate(self.quat_nb[i]), self.quat_nb[i + 1])
        )
        begin = rotation.mat_from_quat(self.quat_nb[i])
        return np.asarray(begin @ rotation.mat_from_rotvec(share[:, None] * turn))

    def antenna(self, t: ArrayLike, lever_arm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity, (k, 3) each, of a point at `lever_arm`, m, at times t, (k,).

        Before and after the course stand the values of its ends.
        """
        times, arm = np.clip(np.asarray(t, dtype=float), self.t[0], self.t[-1]), np.asarray(lever_arm)
        llh, vel = np.asarray(self._position(times)), np.asarray(self._velocity(times))
        if not arm.any():
            return llh, vel
        u = self.mat_nb(times) @ arm
        swing = self._through(rotation.mat_from_quat(self.quat_nb) @ arm)
        columns = (vel[:, 0], vel[:, 1], vel[:, 2])
        of_frame = transport_rate(np.sin(llh[:, 0]), np.cos(llh[:, 0]), llh[:, 2], columns)
        vel = vel + swing(times, 1) + np.cross(np.stack(of_frame, axis=-1), u)
        return llh_displaced(llh, u), vel
