"""Velocities of a receiver that lag behind its positions, brought to the time of their stamps by the inertial unit.

A receiver that reports v(t − lag) at t lacks the acceleration measured since::

    v(t) = v_reported + C(t) ∫ C_b(t)b(τ) f dτ + (γ e_D − (2 ω_ie + ω_en) × v) lag        τ from t − lag to t

with the attitude of a filter at t. Nothing is interpolated, so the noise of a fix stays its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models import rotation
from models.arrays import FloatArray
from models.earth import earth_rate, gravity, transport_rate
from tuner.navigation.data import Fixes, Solution, Steps
from tuner.types.records import velocity_known


def interpolated(fixes: Fixes, lag: float) -> Fixes:
    """Return the fixes with velocities between theirs: for a first pass, whose attitude is near enough."""
    if np.count_nonzero(velocity_known(fixes.vel_n)) < 2:
        return fixes
    there = velocities_at(fixes.t, fixes.vel_n, fixes.t + lag)
    return replace(fixes, vel_n=np.where(np.isfinite(fixes.vel_n), there, np.nan))


def velocities_at(t: FloatArray, vel_n: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return velocities (k, 3) given at times (k,), NaN where unknown, at other times (m,) by interpolation."""
    out = np.full((len(wanted), 3), np.nan)
    for column, v in zip(out.T, vel_n.T, strict=True):
        if (known := np.isfinite(v)).any():
            column[:] = np.interp(wanted, t[known], v[known])
    return out


def advanced(fixes: Fixes, steps: Steps, solution: Solution, lag: float) -> Fixes:
    """Return the fixes with velocities at their stamps.

    Parameters
    ----------
    fixes : Fixes
        As reported.
    steps : Steps
        Increments.
    solution : Solution
        Of a filter with nearly these fixes.
    lag : float
        s; negative where velocities are early.
    """
    state, back = solution.state, lag > 0.0
    turn = np.broadcast_to(np.eye(3), (len(fixes), 3, 3))
    change, left = np.zeros((len(fixes), 3)), np.full(len(fixes), abs(lag))
    at = fixes.after - 1 if back else fixes.after.copy()
    while np.any((left > 0.0) & (at >= 0) & (at < len(steps.dt))):
        inside = (left > 0.0) & (at >= 0) & (at < len(steps.dt))
        k = np.clip(at, 0, len(steps.dt) - 1)
        share = np.where(inside, np.minimum(left / steps.dt[k], 1.0), 0.0)
        part = steps.increments[k] * share[:, None]
        angle = -part[:, :3] if back else part[:, :3]
        middle = turn @ rotation.mat_from_rotvec(0.5 * angle)
        change += (middle @ part[:, 3:, None])[..., 0]
        turn = turn @ rotation.mat_from_rotvec(angle)
        left = left - share * steps.dt[k]
        at = at - 1 if back else at + 1
    felt = (rotation.mat_from_quat(state.quat_nb) @ change[..., None])[..., 0]
    sin_lat, cos_lat, vel = np.sin(state.llh[:, 0]), np.cos(state.llh[:, 0]), state.vel_n
    of_earth = np.stack(earth_rate(sin_lat, cos_lat), axis=-1)
    of_frame = np.stack(transport_rate(sin_lat, cos_lat, state.llh[:, 2], tuple(vel.T)), axis=-1)
    fall = -np.cross(2.0 * of_earth + of_frame, vel)
    fall[:, 2] += gravity(sin_lat, state.llh[:, 2])
    since = (abs(lag) - left)[:, None]
    sign = 1.0 if back else -1.0
    return replace(fixes, vel_n=fixes.vel_n + sign * (felt + fall * since))
