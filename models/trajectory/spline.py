"""A motion through given positions: waypoints, or a track that was measured.

Latitude, longitude and height are the curves of least jerk through the points [1]_: quintic splines of
time, jerk and its derivative continuous, without both at the ends, which otherwise swing wildly. Attitude
follows the path: yaw is its course, pitch its slope; below the speed `MIN_COURSE_SPEED`, where a course means
nothing, both are carried over from the last faster point. Roll is level, or banked for a coordinated turn.
The angles are splines through their values at the points: the sensors are exact for that attitude, which
between the points follows the path only as closely as the points are dense.

References
----------
.. [1] I. J. Schoenberg, Spline interpolation and the higher derivatives, Proc. Nat. Acad. Sci. USA 51 (1964).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline

from models.earth import gravity, metres_per_radian, radii_gradient, without_jumps
from models.trajectory.motion import MotionState, motion_state, times_within

FloatArray = NDArray[np.float64]

MIN_COURSE_SPEED = 0.5
"""Speed below which the course is carried over, m/s."""


@dataclass(frozen=True)
class Track:
    """A motion through n ≥ 6 points.

    Attributes
    ----------
    name : str
        What it is called.
    t : ndarray, shape (n,)
        Time of each point, s, increasing; the motion starts at the first.
    llh : ndarray, shape (n, 3)
        Latitude, longitude (rad) and height (m).
    banked : bool
        Whether the roll balances the turns, as in an aeroplane.
    """

    name: str
    t: FloatArray
    llh: FloatArray
    banked: bool = False

    def __post_init__(self) -> None:
        t, llh = np.asarray(self.t, dtype=float), np.asarray(self.llh, dtype=float)
        if t.ndim != 1 or len(t) < 6 or llh.shape != (len(t), 3):
            msg = f"'t' and 'llh' must have shapes (n,) and (n, 3) with n ≥ 6, got {t.shape} and {llh.shape}"
            raise ValueError(msg)
        if not np.all(np.diff(t) > 0.0):
            msg = "'t' must increase strictly"
            raise ValueError(msg)
        object.__setattr__(self, "t", t - t[0])
        object.__setattr__(self, "llh", without_jumps(llh))

    @property
    def duration(self) -> float:
        """Length, s."""
        return float(self.t[-1])

    @cached_property
    def _position(self) -> BSpline:
        return _least_jerk(self.t, self.llh)

    @cached_property
    def _attitude(self) -> BSpline:
        """Spline of roll, pitch and yaw."""
        llh, vel, acc = self._path(self.t)
        level = np.hypot(vel[:, 0], vel[:, 1])
        moving = level >= MIN_COURSE_SPEED
        last = np.maximum.accumulate(np.where(moving, np.arange(len(level)), np.argmax(moving)))
        yaw = np.unwrap(np.arctan2(vel[:, 1], vel[:, 0])[last])
        pitch = np.arctan2(-vel[:, 2], level)[last]
        lateral = (vel[:, 0] * acc[:, 1] - vel[:, 1] * acc[:, 0]) / np.maximum(level, MIN_COURSE_SPEED)
        roll = (
            np.arctan(lateral / gravity(np.sin(llh[:, 0]), llh[:, 2])) if self.banked else np.zeros_like(yaw)
        )
        return _least_jerk(self.t, np.stack([roll, pitch, yaw], axis=-1))

    def _path(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration in n, each (n, 3)."""
        llh, rate, second = (self._position(t, nu=order) for order in range(3))
        sin_lat, cos_lat = np.sin(llh[:, 0]), np.cos(llh[:, 0])
        metres = metres_per_radian(llh)
        bend, _ = radii_gradient(sin_lat, cos_lat)
        # d/dt of (M+h, (N+h) cos L, −1), with d[(N+h) cos L]/dL = −(M+h) sin L.
        across = cos_lat * rate[:, 2] - metres[:, 0] * sin_lat * rate[:, 0]
        stretch = np.stack([bend * rate[:, 0] + rate[:, 2], across, np.zeros_like(across)], axis=-1)
        return llh, rate * metres, second * metres + rate * stretch

    def evaluate(self, t: ArrayLike) -> MotionState:
        """Return the motion at the times t, s after the first point, shape (n,)."""
        t = times_within(t, self.duration)
        return motion_state(t, *self._path(t), self._attitude(t), self._attitude(t, nu=1))


def _least_jerk(t: FloatArray, y: FloatArray) -> BSpline:
    """Return the curve through y (n, k) with the least ∫ |y‴|² dt: a quintic spline that ends without y‴ and y⁗."""
    ends = [(3, np.zeros(y.shape[1])), (4, np.zeros(y.shape[1]))]
    return make_interp_spline(t, y, k=5, bc_type=(ends, ends))
