"""Gross outliers among GNSS fixes, removed before any filter runs by comparison with neighbouring fixes.

A gate compares a fix with the filter, which wrong fixes may have misled. Here each fix is compared with the others
within a second: moved to its time by their median velocity, they lie around a median; a fix much further from it than
their scatter is left out. Velocities are compared with the median of theirs. Only gross errors are found in this way;
the rest is left to the gate.

Fixes with too few neighbours are compared with the one before and the one after: a fix that cannot be reached from
either at any possible speed, while those two agree with each other, is left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import distance_along
from tuner.types.records import Gnss

NEIGHBOUR_TIME = 1.0
"""Time within which fixes are neighbours, s."""
MIN_NEIGHBOURS = 6
"""Neighbours that a comparison needs."""
MAX_SCATTERS = 6.0
"""Distance from the median from which a fix is an outlier, in scatters (1.48 median absolute deviations)."""
POSITION_FLOOR, VELOCITY_FLOOR = 5.0, 3.0
"""Least distance of an outlier from the median, m and m/s: what a vehicle may do within a second."""
MAX_JUMP, MAX_ACCELERATION, MAX_SPEED = 50.0, 10.0, 100.0
"""Largest distance (m), acceleration (m/s²) and, without velocities, speed (m/s) between two fixes that agree."""


def without_gross_outliers(gnss: Gnss) -> tuple[Gnss, int, int]:
    """Return the fixes without gross outliers, and how many positions and velocities these were.

    A fix with a wrong position is left out, a wrong velocity becomes NaN.
    """
    metres = distance_along(gnss.llh)
    first = np.searchsorted(gnss.t, gnss.t - NEIGHBOUR_TIME)
    last = np.searchsorted(gnss.t, gnss.t + NEIGHBOUR_TIME, side="right")
    wrong, slips = np.zeros(len(gnss), dtype=bool), np.zeros(len(gnss), dtype=bool)
    with_velocity: NDArray[np.bool_] = np.isfinite(gnss.vel_n.sum(axis=1))
    count = last - first
    for n in np.unique(count[count > MIN_NEIGHBOURS]).tolist():
        rows = np.flatnonzero(count == n)
        near = first[rows, None] + np.arange(n)
        near = near[near != rows[:, None]].reshape(len(rows), n - 1)
        moving = with_velocity[near]
        usual = moving.all(axis=1)
        parts = [(rows[usual], near[usual], near[usual])]
        parts += [
            (rows[i : i + 1], near[i : i + 1], near[i : i + 1, moving[i]]) for i in np.flatnonzero(~usual)
        ]
        for i, others, known in parts:
            if not len(i) or known.shape[1] < MIN_NEIGHBOURS:
                continue
            around = gnss.vel_n[known]
            velocity = np.median(around, axis=1, keepdims=True)
            there = metres[others] - velocity * (gnss.t[others] - gnss.t[i, None])[..., None]
            wrong[i] = _are_far(metres[i], there, POSITION_FLOOR)
            slips[i] = with_velocity[i] & _are_far(gnss.vel_n[i], around, VELOCITY_FLOOR)
    wrong |= _contradicts_both_neighbours(gnss, metres) & (last - first <= MIN_NEIGHBOURS)
    vel_n = np.where(slips[:, None], np.nan, gnss.vel_n)
    return replace(gnss, vel_n=vel_n).rows(~wrong), int(wrong.sum()), int(slips.sum())


def _are_far(value: FloatArray, others: FloatArray, floor: float) -> NDArray[np.bool_]:
    """Whether values (k, 3) lie horizontally further from the median of others (k, n, 3) than they scatter."""
    middle = np.median(others[..., :2], axis=1)
    scatter = 1.48 * np.median(np.linalg.norm(others[..., :2] - middle[:, None], axis=2), axis=1)
    return np.asarray(
        np.linalg.norm(value[:, :2] - middle, axis=1) > np.maximum(MAX_SCATTERS * scatter, floor)
    )


def _contradicts_both_neighbours(gnss: Gnss, metres: FloatArray) -> NDArray[np.bool_]:
    """Whether a fix contradicts both the one before and the one after, which agree with each other; (k,)."""
    alone = np.zeros(len(gnss), dtype=bool)
    if len(gnss) < 4:
        return alone
    sd = np.linalg.norm(np.nan_to_num(gnss.position_sd), axis=1)

    def leaps(span: int) -> NDArray[np.bool_]:
        dt = gnss.t[span:] - gnss.t[:-span]
        mean = 0.5 * (gnss.vel_n[span:] + gnss.vel_n[:-span])
        known: NDArray[np.bool_] = np.isfinite(mean.sum(axis=1))
        off = metres[span:] - metres[:-span] - np.where(known[:, None], mean, 0.0) * dt[:, None]
        possible = MAX_JUMP + MAX_SCATTERS * (sd[span:] + sd[:-span])
        possible += np.where(known, 0.5 * MAX_ACCELERATION * dt**2, MAX_SPEED * dt)
        return np.asarray(np.linalg.norm(off, axis=1) > possible)

    step, over = leaps(1), leaps(2)
    alone[1:-1] = step[:-1] & step[1:] & ~over
    alone[0] = step[0] and not step[1] and not alone[1]
    alone[-1] = step[-1] and not step[-2] and not alone[-2]
    return alone
