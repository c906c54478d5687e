"""Mean velocities of a drive over windows of some seconds, from its positions and from its velocities.

::

    v_p = (p(t + T) − p(t)) / T              v_v = ∫ v dt / T

The velocities are integrated by trapezoids; windows with a gap in them are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import distance_along
from tuner.types.records import Gnss

WINDOW_DURATION = 10.0
"""Length of a window, s."""
MAX_GAP = 0.5 * WINDOW_DURATION
"""Time between fixes from which a window is left out, s."""


@dataclass(frozen=True)
class MeanVelocities:
    """Beginnings of w windows, s, and mean velocities north, east, down by positions and velocities, (w, 3), m/s."""

    t: FloatArray
    by_position: FloatArray
    by_velocity: FloatArray

    def __len__(self) -> int:
        return len(self.t)


def mean_velocities(gnss: Gnss) -> MeanVelocities:
    """Return the mean velocities of the windows that begin at the fixes, without those that have no velocity."""
    known: NDArray[np.bool_] = np.isfinite(gnss.vel_n.sum(axis=1))
    gnss = gnss.rows(known)
    dt = np.diff(gnss.t)
    first, last = windows(gnss.t, WINDOW_DURATION)
    holes = np.concatenate([[0], np.cumsum(dt > MAX_GAP)])
    whole = holes[first] == holes[last]
    first, last = first[whole], last[whole]
    pieces = 0.5 * (gnss.vel_n[1:] + gnss.vel_n[:-1]) * dt[:, None]
    path = np.vstack([np.zeros(3), np.cumsum(pieces, axis=0)])
    span = (gnss.t[last] - gnss.t[first])[:, None]
    metres = distance_along(gnss.llh)
    moved = metres[last] - metres[first]
    return MeanVelocities(
        gnss.t[first], np.asarray(moved / span), np.asarray((path[last] - path[first]) / span)
    )


def windows(t: FloatArray, length: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first and last of the times (k,) of the windows of a length that begin at each; none longer by half."""
    last = np.searchsorted(t, t + length)
    first = np.flatnonzero(last < len(t))
    last = last[first]
    good = t[last] - t[first] < 1.5 * length
    return first[good], last[good]
