"""Strapdown mechanisation of a whole record, step by step in Python: what tests compare compiled loops with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from models.strapdown import NavigationState, correct_increments, step


def mechanize(start: NavigationState, dtheta: ArrayLike, dvel: ArrayLike, dt: float) -> NavigationState:
    """Integrate increments from a starting state.

    Parameters
    ----------
    start : NavigationState
        State at the beginning, arrays of shapes (3,), (3,), (4,).
    dtheta, dvel : array_like, shape (n, 3)
        Increments of angle, rad, and velocity, m/s, in b; not yet corrected for coning and sculling.
    dt : float
        Interval, s.

    Returns
    -------
    NavigationState
        States at the n + 1 ends of the intervals, the first being `start`.
    """
    angles = np.asarray(dtheta, dtype=float).tolist()
    velocities = np.asarray(dvel, dtype=float).tolist()
    pos, vel, quat = (tuple(a.tolist()) for a in (start.llh, start.vel_n, start.quat_nb))
    states = np.empty((len(angles) + 1, 10))
    states[0] = pos + vel + quat
    for k, (angle, velocity) in enumerate(zip(angles, velocities, strict=True)):
        before = max(k - 1, 0)
        rotvec, force = correct_increments(angle, velocity, angles[before], velocities[before])
        pos, vel, quat, _ = step(pos, vel, quat, rotvec, force, dt)
        states[k + 1] = pos + vel + quat
    return NavigationState(states[:, :3], states[:, 3:6], states[:, 6:])
