"""The way of the errors between fixes in compiled code: Φ, process noise and the pull of unknown constants.

A second pass over the steps: from the state a filter had after each fix, the mechanisation runs again to the next.
Every covariance step has the matrices of `models.errorstate`, nine navigation states x and six sensors s::

    x⁺ = A x + Γ (S b + w)        b⁺ = D b + drive        Γ: answer to a constant sensor error, with −C A⁻¹ in it

so that products with Φ and with the noise cost 9 × 9 × n instead of n³.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from models import earth, errorstate, strapdown, triples
from models.errorstate import coupling
from models.strapdown import correct_increments, mean_attitude, step
from models.triples import add, scale, transform
from tuner.navigation import compiled as compiled_module
from tuner.navigation import straight
from tuner.navigation.compiled import Layout, checksum

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile a kernel when it is first called; nothing is inlined by force, which keeps that short."""
    return cast(Function, numba.njit(nogil=True, error_model="numpy")(function))


class Columns(NamedTuple):
    """Candidate constants that act on what is felt.

    Attributes
    ----------
    mix : ndarray, shape (p, 6, 6)
        Error of the six sensors by one unit of each constant: mix (ω, f), true rates and forces.
    down : ndarray, shape (p,)
        Acceleration down by one unit, m/s².
    """

    mix: FloatArray
    down: FloatArray


class Trace(NamedTuple):
    """What a pass leaves, of k fixes, n states, p constants.

    Attributes
    ----------
    phi : ndarray, shape (k, n, n)
        Transition.
    white : ndarray, shape (k, 2, 9, 9)
        Process noise from the white noise of gyros and accelerometers.
    slow : ndarray, shape (k, 3, n, n)
        From the drives of gyro biases, accelerometer biases, receiver states.
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
def _calibrate(lay: Layout, x: FloatArray, bias: FloatArray) -> FloatArray:
    """Set the biases and return A⁻¹ (6, 6)."""
    matrix_a = np.eye(6)
    bias[:] = 0.0
    for j in range(9, lay.size):
        if lay.row[j] >= 0:
            if lay.source[j] < 0:
                bias[lay.row[j]] += x[j]
            else:
                matrix_a[lay.row[j], lay.source[j]] += x[j]
    return np.linalg.inv(matrix_a).astype(np.float64)


@compiled
def _matrices(
    pos: Any, vel: Any, mat: Any, force: Any, dt: float, inverse: FloatArray, A: FloatArray, G: FloatArray
) -> None:
    """Set A (9, 9) and Γ (9, 6) of one covariance step."""
    f_rr, f_vr, f_vv, f_ar, f_av, omega = coupling(pos, vel)
    E = np.zeros((9, 6))
    A[:] = 0.0
    for i in range(9):
        A[i, i] = 1.0
    turn = ((0.0, -omega[2], omega[1]), (omega[2], 0.0, -omega[0]), (-omega[1], omega[0], 0.0))
    push = ((0.0, -force[2], force[1]), (force[2], 0.0, -force[0]), (-force[1], force[0], 0.0))
    for i in range(3):
        for j in range(3):
            A[6 + i, j] += dt * f_ar[i][j]
            A[6 + i, 3 + j] += dt * f_av[i][j]
            A[6 + i, 6 + j] -= dt * turn[i][j]
            E[6 + i, j] = dt * mat[i][j]
    for i in range(3):
        for j in range(9):
            y = 0.0
            for m in range(3):
                tilt = A[6 + m, j] + (1.0 if j == 6 + m else 0.0)
                y -= 0.5 * push[i][m] * tilt
            if j < 3:
                y += f_vr[i][j]
            elif j < 6:
                y += f_vv[i][j - 3]
            A[3 + i, j] += dt * y
        for j in range(3):
            y = 0.0
            for m in range(3):
                y -= 0.5 * push[i][m] * E[6 + m, j]
            E[3 + i, j] = dt * y
            E[3 + i, 3 + j] = dt * mat[i][j]
    for i in range(3):
        for j in range(9):
            y = 0.5 * (A[3 + i, j] + (1.0 if j == 3 + i else 0.0))
            if j < 3:
                y += f_rr[i][j]
            A[i, j] += dt * y
        for j in range(6):
            E[i, j] = 0.5 * dt * E[3 + i, j]
    G[:] = -E @ inverse


@compiled
def _advance(
    lay: Layout,
    columns: Columns,
    A: FloatArray,
    G: FloatArray,
    true: FloatArray,
    dt: float,
    phi: FloatArray,
    white: FloatArray,
    slow: FloatArray,
    pull: FloatArray,
    x: FloatArray,
) -> None:
    """Advance Φ, the noise, B and the other estimates by one covariance step."""
    n = lay.size
    phi[:9] = A @ np.ascontiguousarray(phi[:9])
    pull[:] = A @ pull
    coupled = np.zeros((9, n))
    for j in range(9, n):
        r = lay.row[j]
        if r >= 0:
            c = 1.0 if lay.source[j] < 0 else true[lay.source[j]]
            for i in range(9):
                coupled[i, j] = c * G[i, r]
                phi[i, j] += coupled[i, j] * phi[j, j]
                if lay.slope[j] >= 0:
                    phi[i, lay.slope[j]] += coupled[i, j] * phi[j, lay.slope[j]]
    if lay.gravity >= 0:
        phi[5, lay.gravity] += dt
        phi[2, lay.gravity] += 0.5 * dt * dt
    for q in range(len(columns.down)):
        error = G @ (columns.mix[q] @ true)
        for i in range(9):
            pull[i, q] += error[i]
        pull[5, q] += dt * columns.down[q]
        pull[2, q] += 0.5 * dt * dt * columns.down[q]
    for g in range(2):
        white[g] = A @ white[g] @ A.T
        for s in range(3 * g, 3 * g + 3):
            density = lay.white[s] / dt
            for i in range(9):
                for j in range(9):
                    white[g, i, j] += density * G[i, s] * G[j, s]
    for g in range(2):
        N, C = slow[g, :9, :9].copy(), slow[g, :9, :].copy()
        C[:, :9] = 0.0
        new = A @ C
        N = A @ N @ A.T
        cross = np.zeros((9, 9))
        for j in range(9, n):
            if lay.drive[j] > 0.0 and lay.row[j] // 3 == g and lay.row[j] >= 0:
                for i in range(9):
                    for m in range(9):
                        cross[i, m] += new[i, j] * coupled[m, j]
                        N[i, m] += coupled[i, j] * slow[g, j, j] * coupled[m, j]
                for i in range(9):
                    new[i, j] += coupled[i, j] * slow[g, j, j]
        slow[g, :9, :9] = N + cross + cross.T
        for j in range(9, n):
            if lay.drive[j] > 0.0 and lay.row[j] // 3 == g and lay.row[j] >= 0:
                u = lay.rate[j] * dt
                decay = np.exp(-u)
                for i in range(9):
                    slow[g, i, j] = slow[g, j, i] = decay * new[i, j]
                slow[g, j, j] = decay * decay * slow[g, j, j] + _driven(lay, j, dt)
    for j in range(9, n):
        decay = np.exp(-lay.rate[j] * dt)
        if lay.row[j] < 0 and lay.drive[j] > 0.0:
            slow[2, j, j] = decay * decay * slow[2, j, j] + _driven(lay, j, dt)
        if lay.slope[j] >= 0:
            phi[j, lay.slope[j]] = decay * phi[j, lay.slope[j]] + dt * phi[lay.slope[j], lay.slope[j]]
        phi[j, j] *= decay
        x[j] *= decay
        if lay.slope[j] >= 0:
            x[j] += dt * x[lay.slope[j]]


@compiled
def _driven(lay: Layout, j: int, dt: float) -> float:
    """Return the variance that drives state j in a step."""
    u = 2.0 * lay.rate[j] * dt
    return float(lay.drive[j] * dt * (1.0 if u == 0.0 else -np.expm1(-u) / u))


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
    n, k = lay.size, len(after)
    A, G, bias = np.zeros((9, 9)), np.zeros((9, 6)), np.zeros(6)
    x = x_start.copy()
    inverse = _calibrate(lay, x, bias)
    pos, vel = (start[0], start[1], start[2]), (start[3], start[4], start[5])
    quat = (start[6], start[7], start[8], start[9])
    start_pos, start_vel, start_quat = pos, vel, quat
    elapsed, last_dt, i, fresh = 0.0, 0.0, 0, True
    sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    before_angle, before_velocity = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    true, force_n = np.zeros(6), (0.0, 0.0, 0.0)
    phi, pull = np.eye(n), np.zeros((9, len(columns.down)))
    white, slow = np.zeros((2, 9, 9)), np.zeros((3, n, n))
    for s in range(len(dt) + 1):
        if s > 0:
            d = dt[s - 1]
            sample = np.zeros(6)
            for c in range(6):
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
            _matrices(middle_pos, middle_vel, mat, force_n, elapsed, inverse, A, G)
            _advance(lay, columns, A, G, true, elapsed, phi, white, slow, pull, x)
            inverse = _calibrate(lay, x, bias)
            start_pos, start_vel, start_quat = pos, vel, quat
            elapsed, sum_angle, sum_force = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        while i < k and after[i] == s:
            out.phi[i], out.white[i], out.slow[i], out.pull[i] = phi, white, slow, pull
            for c in range(3):
                out.prior[i, c], out.prior[i, 3 + c] = pos[c], vel[c]
                out.force[i, 0, c] = out.force[i, 1, c] = force_n[c]
            for c in range(4):
                out.prior[i, 6 + c] = quat[c]
            out.x[i], out.rates[i] = x, true
            phi[:], white[:], slow[:], pull[:] = 0.0, 0.0, 0.0, 0.0
            for j in range(n):
                phi[j, j] = 1.0
            pos, vel = (states[i, 0], states[i, 1], states[i, 2]), (states[i, 3], states[i, 4], states[i, 5])
            quat = (states[i, 6], states[i, 7], states[i, 8], states[i, 9])
            x[:] = xs[i]
            inverse = _calibrate(lay, x, bias)
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
    checksum(triples, earth, strapdown, errorstate, straight, compiled_module, sys.modules[__name__])
)
