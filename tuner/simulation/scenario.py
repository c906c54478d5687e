"""What a Monte-Carlo run simulates: a motion, what a perfect inertial unit measures on it, receiver and outages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.strapdown import NavigationState
from models.trajectory.motion import Motion, increment_chunks, increments_of
from tuner.jobs import each
from tuner.navigation.data import Steps
from tuner.types import GnssNoise
from tuner.types.records import DataError

OUTAGE_DURATION = 300.0
"""Length of every outage of a simulated run, s: the longest that is scored."""
FIRST_OUTAGE_TIME = 900.0
"""Begin of the first outage, s: the biases of a consumer sensor are known by then."""
OUTAGE_SPACING = 900.0
"""Time from the begin of one outage to that of the next, s."""


@dataclass(frozen=True)
class Scenario:
    """What is simulated: a motion, its error-free inertial increments, the receiver.

    Attributes
    ----------
    motion : Motion
        The truth.
    steps : Steps
        Increments of a perfect unit.
    times : ndarray, shape (k,)
        Times of the fixes, s: ends of steps.
    after : ndarray of int, shape (k,)
        How many steps are done at each.
    truth : NavigationState
        At the fixes, arrays (k, 3), (k, 3), (k, 4).
    start : NavigationState
        At the beginning.
    receiver : GnssNoise
        Errors of the receiver.
    outages : ndarray, shape (w, 2)
        Begin and end of withheld fixes, s.
    start_sd : ndarray, shape (9,), or None
        By how much position, velocity and attitude err at the start; None, or NaN: as the filter says.
    lever_arm : tuple of 3 floats
        True lever arm less that of the filter, m.
    delay : float
        By how much the fixes are late beyond what the filter knows, s.
    """

    motion: Motion
    steps: Steps
    times: FloatArray
    after: NDArray[np.int64]
    truth: NavigationState
    start: NavigationState
    receiver: GnssNoise
    outages: FloatArray
    start_sd: FloatArray | None = None
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    delay: float = 0.0


def outage_windows(duration: float) -> FloatArray:
    """Return begin and end of the outages of a simulated drive, shape (w, 2), s."""
    begins = np.arange(FIRST_OUTAGE_TIME, duration - OUTAGE_DURATION + 1e-9, OUTAGE_SPACING)
    return np.stack([begins, begins + OUTAGE_DURATION], axis=-1)


def scenario(motion: Motion, receiver: GnssNoise, interval: float) -> Scenario:
    """Prepare a trajectory, with the outages of `outage_windows`.

    Parameters
    ----------
    motion : Motion
        The truth.
    receiver : GnssNoise
        Errors of the receiver; its interval is rounded to samples.
    interval : float
        Sampling interval of the inertial unit, s.

    Raises
    ------
    DataError
        Where the motion ends before the second fix.
    """
    if motion.duration < 2.0 * receiver.interval:
        raise DataError(
            f"receiver: expected two fixes or more in the {motion.duration:g} s of {motion.name}, found one every "
            f"{receiver.interval:g} s: is the clock of its log right?"
        )
    motion.evaluate([0.0])  # solves for the positions, once and not in every process
    chunks = increment_chunks(motion, interval)
    increments = np.concatenate(each(lambda chunk: np.hstack(increments_of(motion, interval, chunk)), chunks))
    n, stride = len(increments), max(1, round(receiver.interval / interval))
    after = np.arange(stride, n + 1, stride)
    times: FloatArray = np.asarray(after * interval, dtype=float)
    state = motion.evaluate(np.concatenate([[0.0], times]).clip(max=motion.duration))
    quat = rotation.quat_from_mat(state.mat_nb)
    return Scenario(
        motion,
        Steps(0.0, np.full(n, interval), increments),
        times,
        after,
        NavigationState(state.llh[1:], state.vel_n[1:], quat[1:]),
        NavigationState(state.llh[0], state.vel_n[0], quat[0]),
        receiver,
        outage_windows(motion.duration),
    )
