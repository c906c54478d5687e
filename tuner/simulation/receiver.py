"""Errors of a simulated GNSS receiver: white and time-correlated errors of position, white errors of velocity.

::

    position = white + Σ Gauss–Markov processes       sd of a process down: `correlated_down` times that north and east
    velocity = white

All simulations draw their fixes here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.noise import GaussMarkov
from tuner.types import GnssNoise


@dataclass(frozen=True)
class FixErrors:
    """Errors of k fixes, north, east, down.

    Attributes
    ----------
    position, velocity : ndarray, shape (k, 3)
        m and m/s; velocity NaN where the receiver measures none.
    white : ndarray, shape (k, 6)
        Their white parts.
    """

    position: FloatArray
    velocity: FloatArray
    white: FloatArray


def draw_fix_errors(receiver: GnssNoise, count: int, interval: float, rng: np.random.Generator) -> FixErrors:
    """Draw the errors of fixes at equal intervals.

    Parameters
    ----------
    receiver : GnssNoise
        Standard deviations and correlated processes.
    count : int
        Number of fixes.
    interval : float
        Time between fixes, s.
    rng : numpy.random.Generator
        Source of the draw.
    """
    position = rng.standard_normal((count, 3)) * np.array(receiver.position_sd)
    correlated = np.zeros((count, 3))
    for state in receiver.correlated:
        process = GaussMarkov(state.sd, state.time_constant)
        correlated += np.stack([process.sample(count, interval, rng) for _ in range(3)], axis=-1)
    correlated[:, 2] *= receiver.correlated_down
    velocity = np.full((count, 3), np.nan)
    if receiver.velocity_sd is not None:
        velocity = rng.standard_normal((count, 3)) * np.array(receiver.velocity_sd)
    return FixErrors(position + correlated, velocity, np.hstack([position, velocity]))


def reported_sd(receiver: GnssNoise, count: int) -> FloatArray:
    """Return the sds that a receiver reports with its fixes, those of its white errors; NaN of no velocity; (k, 6)."""
    sds = (*receiver.position_sd, *(receiver.velocity_sd or (np.nan, np.nan, np.nan)))
    return np.tile(np.array(sds), (count, 1))
