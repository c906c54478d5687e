"""Fixes and constraints in compiled code: innovations and their Jacobians, as in `tuner.navigation.reference_filter`.

A constraint is a row like that of a fix, `CONSTRAINT` as what it offers, and longer: behind the six numbers of a
fix stand its kind (`KIND`), measured rates (`RATES`), the point that does not slip (`SLIP`), the mounting
(`MOUNTING`), the first of its states (`STATE`, −1: none) and the gate (`LIMIT`). What becomes of it is left in
z[3] (`inputs.USED` or `GATED`) and z[4] (its squared distance).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.earth import earth_rate, radii
from models.error_state import coupling
from models.strapdown import rates
from models.vector3 import add, cross, exponential, matrix, product, scale, transform
from tuner.navigation.engine.numba_pipeline import called, compiled
from tuner.navigation.engine.tracing import straight
from tuner.navigation.engine.types import Layout, Own, unmix

FloatArray = NDArray[np.float64]

CONSTRAINT = 3
KIND, RATES, SLIP, MOUNTING, STATE, LIMIT = 6, 7, 13, 16, 25, 26
LENGTH = 27


@straight
def _skew_into(H: FloatArray, row: int, column: int, a: Any, sign: float) -> None:
    """Add sign [a ×] to a block of H."""
    H[row, column + 1] -= sign * a[2]
    H[row, column + 2] += sign * a[1]
    H[row + 1, column] += sign * a[2]
    H[row + 1, column + 2] -= sign * a[0]
    H[row + 2, column] -= sign * a[1]
    H[row + 2, column + 1] += sign * a[0]


@compiled
def _sensor_rows(lay: Layout, true: FloatArray, mat: Any, inverse: FloatArray, out: FloatArray) -> None:
    """Set rows 0–2 to C δω and rows 3–5 to C δf of the states: −C A⁻¹ S; shape (6, n)."""
    out[:] = 0.0
    for s in range(9, lay.size):
        r = lay.row[s]
        if r >= 0:
            out[r, s] = -1.0 if lay.source[s] < 0 else -true[lay.source[s]]
    for s in range(9, lay.size):
        if lay.row[s] >= 0:
            if not lay.ideal:
                unmix(inverse, out, s)
            turn = transform(mat, (out[0, s], out[1, s], out[2, s]))
            push = transform(mat, (out[3, s], out[4, s], out[5, s]))
            for i in range(3):
                out[i, s] = turn[i]
                out[3 + i, s] = push[i]


@straight
def _metres(pos: Any) -> Any:
    """Return d(north, east, down)/d(latitude, longitude, height)."""
    meridian, normal = radii(np.sin(pos[0]))
    return (meridian + pos[2], (normal + pos[2]) * np.cos(pos[0]), -1.0)


@called
def _delay_rows(lay: Layout, pos: Any, vel: Any, force: Any, delay: float, own: Own) -> None:
    """Add what a delayed receiver sees of velocity and acceleration errors."""
    _, f_vr, f_vv, _, _, _ = coupling(pos, vel)
    F, H = own.rows, own.H
    for i in range(3):
        for j in range(3):
            F[i, j] = f_vr[i][j]
            F[i, 3 + j] = f_vv[i][j]
        for s in range(9, lay.size):
            F[i, s] = own.sensors[3 + i, s]
        for j in range(6, 9):
            F[i, j] = 0.0
    _skew_into(F, 0, 6, force, -1.0)
    if lay.gravity >= 0:
        F[2, lay.gravity] = 1.0
    for i in range(3):
        for j in range(lay.size):
            H[i, j] += -delay * H[3 + i, j] + 0.5 * delay * delay * F[i, j]
            H[3 + i, j] -= delay * F[i, j]


@straight
def _turned(m: Any, row: int, a: Any) -> Any:
    """Return component `row` of mᵀ a."""
    return m[0][row] * a[0] + m[1][row] * a[1] + m[2][row] * a[2]


@straight
def _to_body(m: Any, a: Any) -> Any:
    """Return mᵀ a."""
    return (_turned(m, 0, a), _turned(m, 1, a), _turned(m, 2, a))


@called
def constraint_model(
    lay: Layout,
    pos: Any,
    vel: Any,
    quat: Any,
    row: FloatArray,
    own: Own,
) -> None:
    """Set z (6,) and H (6, n) of a constraint: `non_holonomic`, `zero_velocity`, `zero_rate` of `models.measurements`.

    The third component of the first is nothing measured: z = 0, H = 0.
    """
    n, kind = lay.size, int(row[KIND])
    z, H, x, sensors, felt, true = own.z, own.H, own.x, own.sensors, own.felt, own.true
    z[:] = 0.0
    H[:] = 0.0
    z[5] = row[LIMIT]
    if kind == 2:
        for i in range(3):
            H[i, 3 + i] = 1.0
            z[i] = -vel[i]
        return
    for c in range(6):
        felt[c] = row[RATES + c]
    for s in range(9, n):
        if lay.row[s] >= 0 and lay.source[s] < 0:
            felt[lay.row[s]] -= x[s]
    for c in range(6):
        true[c] = felt[c]
        if not lay.ideal:
            true[c] = 0.0
            for s in range(6):
                true[c] += own.inverse[c, s] * felt[s]
    mat = matrix(quat)
    of_earth = earth_rate(np.sin(pos[0]), np.cos(pos[0]))
    of_earth_b = _to_body(mat, of_earth)
    _sensor_rows(lay, true, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), own.inverse, sensors)
    if kind == 3:
        for i in range(3):
            z[i] = true[i] - of_earth_b[i]
            for s in range(9, n):
                H[i, s] = -sensors[i, s]
        for j in range(3):
            axis = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            column = _to_body(mat, cross(of_earth, axis))
            for i in range(3):
                H[i, 6 + j] = column[i]
        return
    slip = (row[SLIP], row[SLIP + 1], row[SLIP + 2])
    turning = add((true[0], true[1], true[2]), scale(-1.0, of_earth_b))
    moving = add(_to_body(mat, vel), cross(turning, slip))
    k = int(row[STATE])
    m = (x[k], x[k + 1], x[k + 2]) if k >= 0 else (0.0, 0.0, 0.0)
    turn = matrix(exponential(m))
    for i in range(2):
        # Row i + 1 of (exp([m ×]) R₀)ᵀ: that column of the product.
        axis = (row[MOUNTING + 1 + i], row[MOUNTING + 4 + i], row[MOUNTING + 7 + i])
        sideways = transform(turn, axis)
        z[i] = -(sideways[0] * moving[0] + sideways[1] * moving[1] + sideways[2] * moving[2])
        for j in range(3):
            axis = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            faster = _to_body(mat, axis)
            tilted = _to_body(mat, cross(vel, axis))
            tilted = add(tilted, cross(slip, _to_body(mat, cross(of_earth, axis))))
            H[i, 3 + j] = sideways[0] * faster[0] + sideways[1] * faster[1] + sideways[2] * faster[2]
            H[i, 6 + j] = sideways[0] * tilted[0] + sideways[1] * tilted[1] + sideways[2] * tilted[2]
            if k >= 0:
                mounted = cross(moving, _left_jacobian(m, axis))
                H[i, k + j] = sideways[0] * mounted[0] + sideways[1] * mounted[1] + sideways[2] * mounted[2]
        for s in range(9, n):
            if lay.row[s] >= 0:
                w = cross(slip, (sensors[0, s], sensors[1, s], sensors[2, s]))
                H[i, s] -= sideways[0] * w[0] + sideways[1] * w[1] + sideways[2] * w[2]


@straight
def _left_jacobian(m: Any, a: Any) -> Any:
    """Return J a with exp([(m + δ) ×]) = exp([J δ ×]) exp([m ×]), by series: m is a small angle."""
    s = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    half = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0))))
    sixth = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
    once = cross(m, a)
    return add(a, add(scale(half, once), scale(sixth, cross(m, once))))


@called
def fix_model(lay: Layout, pos: Any, vel: Any, quat: Any, fix: FloatArray, own: Own) -> None:
    """Set z (6,) and H (6, n) of a fix (llh, velocity): `models.measurements.position_fix` and `velocity_fix`."""
    if len(fix) > 6 and fix[KIND] > 0.0:
        constraint_model(lay, pos, vel, quat, fix, own)
        return
    n, x, true, z, H, sensors = lay.size, own.x, own.true, own.z, own.H, own.sensors
    mat = matrix(quat)
    _sensor_rows(lay, true, mat, own.inverse, sensors)
    arm = (lay.arm[0], lay.arm[1], lay.arm[2])
    if lay.lever >= 0:
        arm = add(arm, (x[lay.lever], x[lay.lever + 1], x[lay.lever + 2]))
    u = transform(mat, arm)
    omega_b, force_b = (true[0], true[1], true[2]), (true[3], true[4], true[5])
    of_earth = earth_rate(np.sin(pos[0]), np.cos(pos[0]))
    omega = transform(mat, omega_b)
    relative = add(omega, scale(-1.0, of_earth))
    antenna = add(vel, cross(relative, u))
    H[:] = 0.0
    for i in range(3):
        H[i, i] = 1.0
        H[3 + i, 3 + i] = 1.0
    _skew_into(H, 0, 6, u, -1.0)
    # Velocity rows: −[u ×] C δω + v + ([ω_ie ×][u ×] − [(ω × u) ×]) φ + [ω_eb ×] C δl.
    for s in range(9, n):
        w = cross(u, (sensors[0, s], sensors[1, s], sensors[2, s]))
        for i in range(3):
            H[3 + i, s] = -w[i]
    _skew_into(H, 3, 6, cross(omega, u), -1.0)
    # [a ×][b ×] = b aᵀ − (a · b) I
    inner = of_earth[0] * u[0] + of_earth[1] * u[1] + of_earth[2] * u[2]
    for i in range(3):
        for j in range(3):
            H[3 + i, 6 + j] += u[i] * of_earth[j]
        H[3 + i, 6 + i] -= inner
    if lay.lever >= 0:
        for j in range(3):
            column = (mat[0][j], mat[1][j], mat[2][j])
            turned = cross(relative, column)
            for i in range(3):
                H[i, lay.lever + j] = column[i]
                H[3 + i, lay.lever + j] = turned[i]
    shift = (0.0, 0.0, 0.0)
    delay = 0.0
    acc = (0.0, 0.0, 0.0)
    if lay.delay >= 0:
        delay = x[lay.delay]
        _, acc, _ = rates(pos, vel, mat, omega_b, force_b)
        if lay.gravity >= 0:
            acc = (acc[0], acc[1], acc[2] + x[lay.gravity])
        shift = add(scale(-delay, antenna), scale(0.5 * delay * delay, acc))
        _delay_rows(lay, pos, vel, transform(mat, force_b), delay, own)
        for i in range(3):
            H[i, lay.delay] = delay * acc[i] - antenna[i]
            H[3 + i, lay.delay] = -acc[i]
    for k in range(lay.processes):
        j = lay.gnss + 3 * k
        shift = add(shift, (x[j], x[j + 1], x[j + 2]))
        for i in range(3):
            H[i, j + i] = 1.0
    metres = _metres(pos)
    for i in range(3):
        z[i] = (fix[i] - pos[i]) * metres[i] - u[i] - shift[i]
        z[3 + i] = fix[3 + i] - (antenna[i] - delay * acc[i])


@straight
def correct(pos: Any, vel: Any, quat: Any, dx: FloatArray) -> Any:
    """Return the state with nine errors added: `models.error_state.corrected`."""
    metres = _metres(pos)
    new = (pos[0] + dx[0] / metres[0], pos[1] + dx[1] / metres[1], pos[2] + dx[2] / metres[2])
    turned = product(exponential((dx[6], dx[7], dx[8])), quat)
    return new, (vel[0] + dx[3], vel[1] + dx[4], vel[2] + dx[5]), turned
