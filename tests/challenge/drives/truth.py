"""The true motion of a drive: splines through Earth-fixed positions and angles, seen by the unit and the antenna.

Position is a quintic spline by definition, so that velocity and acceleration belong to it exactly::

    f = C_be (a + 2 Ω × v − g)            ω_ib = ω_nb + C_be (Ω + ω_en),   ω_en from the change of the axes
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from challenge.drives.earth import SPIN, axes, geodetic, gravity, place, radii
from challenge.drives.route import Motion
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

FloatArray = NDArray[np.float64]

KNOTS = 0.1
"""Spacing of the knots, s."""
FINE = 5
"""Steps of the dead reckoning between knots."""
GAUSS = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)]), np.array([5.0, 8.0, 5.0]) / 18.0


@dataclass(frozen=True)
class State:
    """Motion at n times: coordinates, Earth-fixed matrices of local axes and body, velocities."""

    llh: FloatArray
    local: FloatArray
    body: FloatArray
    vel_n: FloatArray
    omega: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class Truth:
    """A route from a place on Earth."""

    route: Motion
    start: tuple[float, float, float]

    @cached_property
    def _splines(self) -> tuple[BSpline, BSpline]:
        step = KNOTS / FINE
        t = np.arange(-2.0, self.route.duration + 2.0 + step, step)
        vel, rpy = self.route.motion(t)
        llh = np.tile(np.array(self.start), (len(t), 1))
        for _ in range(3):  # the radii depend weakly on where it goes
            north, east = radii(llh)
            rates = np.column_stack([vel[:, 0] / north, vel[:, 1] / east, -vel[:, 2]])
            sums = np.cumsum(0.5 * step * (rates[1:] + rates[:-1]), axis=0)
            llh = np.array(self.start) + np.vstack([np.zeros(3), sums])
        knots = slice(None, None, FINE)
        return (
            make_interp_spline(t[knots], place(llh[knots]), k=5),
            make_interp_spline(t[knots], rpy[knots], k=5),
        )

    def state(self, t: FloatArray) -> State:
        """Return the motion at times t, s."""
        path, angles = self._splines
        x, v, a = (np.asarray(path(t, nu=order)) for order in range(3))
        llh = geodetic(x)
        local = axes(llh)
        (roll, pitch, yaw), rate = np.asarray(angles(t)).T, np.asarray(angles(t, nu=1))
        body_n = turn(roll, pitch, yaw)
        body = local @ body_n
        vel_n = np.einsum("nji,nj->ni", local, v)
        north, east = radii(llh)
        of_axes = np.column_stack(
            [
                vel_n[:, 1] / east * np.cos(llh[:, 0]),
                -vel_n[:, 0] / north,
                -vel_n[:, 1] / east * np.sin(llh[:, 0]),
            ]
        )
        ones, zero = np.ones_like(roll), np.zeros_like(roll)
        euler = np.stack(
            [
                np.column_stack([ones, zero, -np.sin(pitch)]),
                np.column_stack([zero, np.cos(roll), np.sin(roll) * np.cos(pitch)]),
                np.column_stack([zero, -np.sin(roll), np.cos(roll) * np.cos(pitch)]),
            ],
            axis=1,
        )
        omega = (
            np.einsum("nij,nj->ni", euler, rate)
            + np.einsum("nji,nj->ni", body_n, of_axes)
            + np.einsum("nji,j->ni", body, SPIN)
        )
        felt = a + 2.0 * np.cross(SPIN, v) - gravity(llh)[:, None] * local[:, :, 2]
        return State(llh, local, body, vel_n, omega, np.einsum("nji,nj->ni", body, felt))

    def unit(self, rate: float, duration: float) -> tuple[FloatArray, FloatArray]:
        """Return stamps (n,) and the mean rates and forces since the stamp before, (n, 6)."""
        step = 1.0 / rate
        t = step * np.arange(1, round(duration * rate) + 1)
        total = np.zeros((len(t), 6))
        for node, weight in zip(*GAUSS, strict=True):
            state = self.state(t - 0.5 * step + 0.5 * step * node)
            total += weight * np.hstack([state.omega, state.force])
        return t, total

    def antenna(self, t: FloatArray, arm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Earth-fixed place and velocity north, east, down of an antenna; (k, 3) each."""
        state = self.state(t)
        path, _ = self._splines
        around = np.einsum("nji,j->ni", state.body, SPIN)
        swing = np.einsum("nij,nj->ni", state.body, np.cross(state.omega - around, arm))
        return np.asarray(path(t)) + state.body @ arm, state.vel_n + np.einsum(
            "nji,nj->ni", state.local, swing
        )


def turn(roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    """Return Rz(yaw) Ry(pitch) Rx(roll), (n, 3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = ([f(x) for x in (roll, pitch, yaw)] for f in (np.sin, np.cos))
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=-2,
    )
