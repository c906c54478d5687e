"""Mechanisation in compiled code: calibrated samples, and position, velocity and attitude from them.

The equations are those of `models.strapdown`; innermost loops go over filters.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.filter_states.declaration import NAVIGATION_STATES
from models.strapdown import correct_increments, step
from models.vector3 import add, dot, scale
from tuner.navigation.engine.compilation import (
    block,
    count,
    inlined,
    merged,
    prefer_small_code,
    prefer_wide_vectors,
    put,
    put_quaternion,
    quaternion,
    vector,
)
from tuner.navigation.engine.further_couplings import add_to_calibration
from tuner.navigation.engine.layout import BIAS_STATES, ROW, SOURCE
from tuner.navigation.engine.random_normal import normal_numbers
from tuner.navigation.engine.state import (
    ANGLE_SUM_ROW,
    ATTITUDE_ROW,
    BIAS_ROW,
    CALIBRATION_ROW,
    ESTIMATE,
    INVERSE_ROW,
    POSITION_ROW,
    PREVIOUS_ROW,
    SAMPLE_ROW,
    START_ROW,
    TRUE_DENSITY_ROW,
    VELOCITY_ROW,
    VELOCITY_SUM_ROW,
)


@block
def set_biases(m: Any) -> None:
    """Set the biases of the six sensors to the sums of the estimates that belong to each."""
    N, S, groups, filters, group_count = m.rows, m.states, m.groups, count(m), m.group_count
    for r in range(BIAS_STATES):
        for w in range(filters):
            N[BIAS_ROW + r, w] = S[ESTIMATE, NAVIGATION_STATES + r, w]
    for g in range(group_count):
        if groups[g, 3] == 1:
            r, s = BIAS_ROW + groups[g, 0], groups[g, 1]
            if groups[g, 2] == 4:
                for w in range(filters):
                    N[r, w] += (S[ESTIMATE, s, w] + S[ESTIMATE, s + 1, w]) + (
                        S[ESTIMATE, s + 2, w] + S[ESTIMATE, s + 3, w]
                    )
            else:
                members = groups[g, 2]
                for k in range(members):
                    for w in range(filters):
                        N[r, w] += S[ESTIMATE, s + k, w]


@block
def invert_calibration(m: Any) -> None:
    """Set A and, by Gauss–Jordan elimination, its inverse: A is near the identity and needs no pivots."""
    prefer_small_code()
    N, S, filters = m.rows, m.states, m.rows.shape[1]
    for i in range(36):
        for w in range(filters):
            N[CALIBRATION_ROW + i, w] = 1.0 if i % 7 == 0 else 0.0
            N[INVERSE_ROW + i, w] = 1.0 if i % 7 == 0 else 0.0
    for s in range(NAVIGATION_STATES, m.size):
        row, source = m.table[ROW, s], m.table[SOURCE, s]
        if source >= 0:
            for w in range(filters):
                N[CALIBRATION_ROW + 6 * row + source, w] += S[ESTIMATE, s, w]
    if m.further_count > 0:
        add_to_calibration(m, True)
    for i in range(6):
        for w in range(filters):
            pivot = 1.0 / N[CALIBRATION_ROW + 7 * i, w]
            for j in range(6):
                N[CALIBRATION_ROW + 6 * i + j, w] *= pivot
                N[INVERSE_ROW + 6 * i + j, w] *= pivot
        for r in range(6):
            if r != i:
                for w in range(filters):
                    c = N[CALIBRATION_ROW + 6 * r + i, w]
                    for j in range(6):
                        N[CALIBRATION_ROW + 6 * r + j, w] -= c * N[CALIBRATION_ROW + 6 * i + j, w]
                        N[INVERSE_ROW + 6 * r + j, w] -= c * N[INVERSE_ROW + 6 * i + j, w]


@inlined
def start_step(m: Any) -> None:
    """Begin a covariance step: keep the state and clear the sums."""
    N, filters = m.rows, count(m)
    for i in range(10):
        for w in range(filters):
            N[START_ROW + i, w] = N[i, w]
    for i in range(6):
        for w in range(filters):
            N[ANGLE_SUM_ROW + i, w] = 0.0


@inlined
def take_sample(m: Any, increments: FloatArray, k: int, dt: float) -> None:
    """Set the sample to row k of the measured increments, without biases."""
    N, filters = m.rows, count(m)
    for r in range(6):
        measured = increments[k, r]
        for w in range(filters):
            N[SAMPLE_ROW + r, w] = measured - dt * N[BIAS_ROW + r, w]


@merged
def disturb_sample(m: Any, slow: FloatArray, k: int, dt: float) -> None:
    """Add the sensor errors of a step to the sample: row k of the slow ones, and white noise."""
    prefer_wide_vectors()
    normal_numbers(m)
    N, z, root, filters = m.rows, m.numbers, np.sqrt(dt), count(m)
    for r in range(6):
        for w in range(filters):
            N[SAMPLE_ROW + r, w] += dt * slow[k, r, w] + root * N[TRUE_DENSITY_ROW + r, w] * z[r, w]


@block
def calibrate_sample(m: Any) -> None:
    """Replace the sample by A⁻¹ times it."""
    prefer_wide_vectors()
    N = m.rows
    for w in range(m.rows.shape[1]):
        s, t = vector(N, SAMPLE_ROW, w), vector(N, SAMPLE_ROW + 3, w)
        for r in range(6):
            a, b = vector(N, INVERSE_ROW + 6 * r, w), vector(N, INVERSE_ROW + 6 * r + 3, w)
            N[SAMPLE_ROW + r, w] = dot(a, s) + dot(b, t)


@inlined
def mechanise(m: Any, dt: float, stretch: float) -> None:
    """Advance position, velocity and attitude of each filter by its sample; add to the sums of the step.

    Parameters
    ----------
    m : record
        See `state`.
    dt : float
        Length of the sample, s.
    stretch : float
        Factor that scales the previous increments to a sample of this length; 0 where there are none.
    """
    prefer_wide_vectors()
    N = m.rows
    for w in range(m.rows.shape[1]):
        angle, velocity = vector(N, SAMPLE_ROW, w), vector(N, SAMPLE_ROW + 3, w)
        angle_before = scale(stretch, vector(N, PREVIOUS_ROW, w))
        velocity_before = scale(stretch, vector(N, PREVIOUS_ROW + 3, w))
        rotvec, dvel = correct_increments(angle, velocity, angle_before, velocity_before)
        pos, vel, quat, force = step(
            vector(N, POSITION_ROW, w),
            vector(N, VELOCITY_ROW, w),
            quaternion(N, ATTITUDE_ROW, w),
            rotvec,
            dvel,
            dt,
        )
        put(N, ANGLE_SUM_ROW, w, add(vector(N, ANGLE_SUM_ROW, w), angle))
        put(N, VELOCITY_SUM_ROW, w, add(vector(N, VELOCITY_SUM_ROW, w), scale(dt, force)))
        put(N, PREVIOUS_ROW, w, angle)
        put(N, PREVIOUS_ROW + 3, w, velocity)
        put(N, POSITION_ROW, w, pos)
        put(N, VELOCITY_ROW, w, vel)
        put_quaternion(N, ATTITUDE_ROW, w, quat)
