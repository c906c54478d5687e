"""Φ, process noise and the effect of unknown constants between fixes, in compiled code.

A second run over the steps: from the state that a filter had after each fix, the mechanisation runs again to the next
one, and `propagation_kernels` accumulates what every covariance step does to the errors.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numba
import numpy as np
from numpy.typing import NDArray

from models import earth, strapdown, taylor
from models import error_state as errorstate
from models import vector3 as triples
from models.strapdown import correct_increments, mean_attitude, step
from models.vector3 import add, scale, transform
from tuner.diagnosis.drive.linear_model import propagation_kernels as propagation
from tuner.diagnosis.drive.linear_model.propagation_kernels import (
    Columns,
    PropagationState,
    advance,
    begin,
    compiled,
    new_state,
    set_matrices,
)
from tuner.navigation.engine import compilation, layout
from tuner.navigation.engine.compilation import checksum
from tuner.navigation.engine.layout import Layout

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Trace(NamedTuple):
    """What happens to the errors before each of k fixes, with n states and p constants.

    Attributes
    ----------
    phi : ndarray, shape (k, n, n)
        Transition.
    white : ndarray, shape (2, k, 9, 9)
        Process noise from the white noise of gyros and accelerometers.
    slow : ndarray, shape (3, k, n, n)
        From the noise that drives gyro biases, accelerometer biases, receiver states.
    pull : ndarray, shape (k, 9, p)
        B of the navigation states.
    prior : ndarray, shape (k, 10)
        State just before each fix.
    x : ndarray, shape (k, n)
        Other estimates there.
    rates : ndarray, shape (k, 6)
        Mean calibrated rate and force in b of the last covariance step before the fix.
    force : ndarray, shape (k, 2, 3)
        Mean specific force in n of the covariance steps before and after it.
    """

    phi: FloatArray
    white: FloatArray
    slow: FloatArray
    pull: FloatArray
    prior: FloatArray
    x: FloatArray
    rates: FloatArray
    force: FloatArray


@compiled
def _calibrate(lay: Layout, x: FloatArray, bias: FloatArray, inverse: FloatArray) -> None:
    """Set the biases and A⁻¹ (6, 6)."""
    bias[:] = 0.0
    for j in range(9, lay.size):
        if lay.row[j] >= 0 and lay.source[j] < 0:
            bias[lay.row[j]] += x[j]
    if lay.ideal:
        return
    matrix = np.eye(6)
    for j in range(9, lay.size):
        if lay.row[j] >= 0 and lay.source[j] >= 0:
            matrix[lay.row[j], lay.source[j]] += x[j]
    inverse[:] = np.linalg.inv(matrix)


@compiled
def _leave(lay: Layout, state: PropagationState, out: Trace, i: int) -> None:
    """Store what has accumulated until fix i."""
    n, W = lay.size, state.wide
    noise = 2 * n - 9
    out.phi[i] = 0.0
    out.slow[:, i] = 0.0
    out.phi[i, :9] = W[:, :n]
    out.pull[i] = W[:, noise + 36 :]
    for r in range(9):
        for c in range(9):
            for g in range(2):
                out.white[g, i, r, c] = W[r, noise + 9 * g + c]
                out.slow[g, i, r, c] = W[r, noise + 18 + 9 * g + c]
    for j in range(9, n):
        out.phi[i, j, j] = state.own[j]
        if lay.slope[j] >= 0:
            out.phi[i, j, lay.slope[j]] = state.tie[j]
        g = lay.row[j] // 3 if lay.row[j] >= 0 else 2
        out.slow[g, i, j, j] = state.variance[j]
        for r in range(9):
            out.slow[g, i, r, j] = out.slow[g, i, j, r] = W[r, n - 9 + j]


@compiled
def trace(
    lay: Layout,
    columns: Columns,
    dt: FloatArray,
    increments: FloatArray,
    start: FloatArray,
    x_start: FloatArray,
    after: IntArray,
    states: FloatArray,
    xs: FloatArray,
    out: Trace,
) -> None:
    """Fill `out` from the start (10,), (n,), the steps and the states after each fix (k, 10), (k, n)."""
    k = len(after)
    x, bias, inverse = x_start.copy(), np.zeros(6), np.eye(6)
    _calibrate(lay, x, bias, inverse)
    pos, vel = (start[0], start[1], start[2]), (start[3], start[4], start[5])
    quat = (start[6], start[7], start[8], start[9])
    start_pos, start_vel, start_quat = pos, vel, quat
    elapsed, last_dt, i, fresh = 0.0, 0.0, 0, True
    sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    before_angle, before_velocity = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    true, sample, force_n = np.zeros(6), np.zeros(6), (0.0, 0.0, 0.0)
    state = new_state(lay.size, columns)
    begin(state)
    for s in range(len(dt) + 1):
        if s > 0:
            d = dt[s - 1]
            for c in range(6):
                sample[c] = 0.0
                for m in range(6):
                    sample[c] += inverse[c, m] * (increments[s - 1, m] - bias[m] * d)
            angle, velocity = (sample[0], sample[1], sample[2]), (sample[3], sample[4], sample[5])
            if last_dt > 0.0:
                stretch = 2.0 * d * d / (last_dt + d) / last_dt
                before_angle = scale(stretch, before_angle)
                before_velocity = scale(stretch, before_velocity)
            else:
                before_angle, before_velocity = angle, velocity
            rotvec, dvel = correct_increments(angle, velocity, before_angle, before_velocity)
            pos, vel, quat, force = step(pos, vel, quat, rotvec, dvel, d)
            before_angle, before_velocity, last_dt = angle, velocity, d
            elapsed += d
            sum_angle = add(sum_angle, angle)
            sum_force = add(sum_force, scale(d, force))
        due = i < k and after[i] == s
        if elapsed > 0.0 and (due or (s < len(dt) and elapsed + 0.5 * dt[s] > lay.covariance_step)):
            mat = mean_attitude(start_quat, quat)
            force_n, rate = scale(1.0 / elapsed, sum_force), scale(1.0 / elapsed, sum_angle)
            columns_b = (
                (mat[0][0], mat[1][0], mat[2][0]),
                (mat[0][1], mat[1][1], mat[2][1]),
                (mat[0][2], mat[1][2], mat[2][2]),
            )
            force_b = transform(columns_b, force_n)
            for c in range(3):
                true[c], true[3 + c] = rate[c], force_b[c]
                if fresh and i > 0:
                    out.force[i - 1, 1, c] = force_n[c]
            fresh = False
            middle_pos, middle_vel = scale(0.5, add(start_pos, pos)), scale(0.5, add(start_vel, vel))
            set_matrices(middle_pos, middle_vel, mat, force_n, elapsed, inverse, state.A, state.G)
            advance(lay, columns, state, true, elapsed, x)
            _calibrate(lay, x, bias, inverse)
            start_pos, start_vel, start_quat = pos, vel, quat
            elapsed, sum_angle, sum_force = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        while i < k and after[i] == s:
            _leave(lay, state, out, i)
            for c in range(3):
                out.prior[i, c], out.prior[i, 3 + c] = pos[c], vel[c]
                out.force[i, 0, c] = out.force[i, 1, c] = force_n[c]
            for c in range(4):
                out.prior[i, 6 + c] = quat[c]
            out.x[i], out.rates[i] = x, true
            begin(state)
            pos, vel = (states[i, 0], states[i, 1], states[i, 2]), (states[i, 3], states[i, 4], states[i, 5])
            quat = (states[i, 6], states[i, 7], states[i, 8], states[i, 9])
            x[:] = xs[i]
            _calibrate(lay, x, bias, inverse)
            start_pos, start_vel, start_quat = pos, vel, quat
            fresh = True
            i += 1
        if i == k:
            break


def _kept(number: int) -> Callable[..., None]:
    """Return `trace`, kept on disk for as long as no source of it changes."""

    def entry(*arguments: Any) -> None:
        if number > 0:
            trace(*arguments)

    return cast(Callable[..., None], numba.njit(cache=True, nogil=True)(entry))


kept_trace = _kept(
    checksum(
        triples, taylor, earth, strapdown, errorstate, compilation, layout, propagation, sys.modules[__name__]
    )
)
