"""Clocks that are too far apart for windows to show it: 18 s between UTC and GPS time, or each from its own start.

About the vertical a vehicle turns at the rate of its course. Both rates are correlated at every offset within
`MAX_OFFSET`; where one beyond what windows show agrees far better than all within, the search begins there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from tuner.examination.streams import Streams, Velocities
from tuner.examination.windows import Inertial

WINDOW_OFFSET, MAX_OFFSET, OFFSET_STEP = 3.0, 60.0, 0.2
"""Offset from which windows do not show it, largest that is looked at, and spacing, s: leap seconds, or a logger that
is switched on later.
"""
AVERAGING_TIME = 1.0
"""Time over which rates are taken, s: shorter than a turn, longer than a swing."""
MIN_CORRELATION = 0.8
"""Correlation from which the rates are those of one motion: noise and sideslip leave 0.9 of cars and walkers."""
MIN_ADVANTAGE = 4.0
"""Advantage over every offset within the search in sds of Fisher's z: chance reaches it in 600 offsets of 1 in 50."""
CORRELATION_TIME = 5.0
"""Time after which turns are independent, s."""
MIN_TIME = 60.0
"""Time in motion that a comparison needs, s."""
SLOW_SHARE, MAX_COURSE_RATE = 0.3, 2.0
"""Share of the usual speed below which a course is not known, and largest rate that is a turn, rad/s."""


def distant_delay(streams: Streams) -> float:
    """Return how late all stamps are where that is beyond what windows show, s; else, or where unknown, zero."""
    vel = next((one for one in streams.others if isinstance(one, Velocities)), None)
    imu = streams.imu
    if vel is None or vel.readings.sum() < 2 or np.ptp(imu.t) < MIN_TIME:
        return 0.0
    known = vel.readings
    sampled = np.arange(imu.t[0] + AVERAGING_TIME, imu.t[-1] - AVERAGING_TIME, OFFSET_STEP)
    rates = _turn_rate(imu, sampled)
    at = np.arange(vel.t[known][0], vel.t[known][-1], OFFSET_STEP)
    course, usable = _course_rate(vel.t[known], vel.values[known], at)
    offsets = np.arange(-MAX_OFFSET, MAX_OFFSET + 0.5 * OFFSET_STEP, OFFSET_STEP)
    found = np.full(len(offsets), -1.0)
    time = np.zeros(len(offsets))
    for i, offset in enumerate(offsets.tolist()):
        other = np.interp(at - offset, sampled, rates, left=np.nan, right=np.nan)
        both = usable & np.isfinite(other)
        time[i] = OFFSET_STEP * np.count_nonzero(both)
        if time[i] > MIN_TIME and np.ptp(other[both]) > 0.0 and np.ptp(course[both]) > 0.0:
            found[i] = np.corrcoef(other[both], course[both])[0, 1]
    within = np.abs(offsets) <= WINDOW_OFFSET
    best, usual = int(np.argmax(np.where(within, -1.0, found))), float(found[within].max())
    sd = 1.0 / np.sqrt(max(time[best] / CORRELATION_TIME - 3.0, 1.0))
    ahead = float(np.diff(np.arctanh(np.clip([usual, found[best]], 0.0, 1.0 - 1e-9)))[0])
    return float(offsets[best]) if found[best] >= MIN_CORRELATION and ahead >= MIN_ADVANTAGE * sd else 0.0


def _turn_rate(imu: Inertial, at: FloatArray) -> FloatArray:
    """Return the angular rate about the vertical at times, rad/s, mean bias taken out; up is where the force points."""
    sums = np.vstack([np.zeros(6), np.cumsum(imu.rates[1:] * np.diff(imu.t)[:, None], axis=0)])
    ends = at[:, None] + 0.5 * AVERAGING_TIME * np.array([-1.0, 1.0])
    mean = np.column_stack([np.diff(np.interp(ends, imu.t, x)) for x in sums.T]) / AVERAGING_TIME
    up = mean[:, 3:] / np.maximum(np.linalg.norm(mean[:, 3:], axis=1, keepdims=True), 1e-9)
    return np.asarray(-np.sum((mean[:, :3] - np.median(mean[:, :3], axis=0)) * up, axis=1))


def _course_rate(t: FloatArray, vel: FloatArray, at: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the rate of the course at times, rad/s, and where the vehicle is fast enough for one."""
    course = vel[:, 0] + 1j * vel[:, 1]
    before, now, after = (np.interp(at + k * AVERAGING_TIME, t, course) for k in (-0.5, 0.0, 0.5))
    square = np.abs(now) ** 2
    rate = (now.conj() * (after - before)).imag / (AVERAGING_TIME * np.maximum(square, 1e-6))
    fast = np.sqrt(square) > max(SLOW_SHARE * float(np.sqrt(np.quantile(square, 0.9))), 0.1)
    return rate, fast & (np.abs(rate) < MAX_COURSE_RATE)
