"""Fixes and constraints in compiled code: innovations and their Jacobians, as in `tuner.navigation.reference_filter`.

A constraint is a row like that of a fix, marked by `CONSTRAINT_CODE`, and longer: behind the six numbers of a fix stand
its kind (`KIND_COLUMN`), measured rates (`RATE_COLUMNS`), the point that does not slip (`SLIP_COLUMNS`), the mounting
(`MOUNTING_COLUMNS`), the first of its states (`STATE_COLUMN`, −1: none) and the gate (`LIMIT_COLUMN`). Its use is
stored in z[3] (`USED` or `GATED` of `tuner.navigation.data`), its squared distance in z[4].
"""

from __future__ import annotations

from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.earth import earth_rate, radii
from models.error_state import coupling
from models.strapdown import rates
from models.taylor import exponential
from models.vector3 import add, cross, matrix, product, scale, transform
from tuner.navigation.engine.compilation import inlined, prefer_small_code
from tuner.navigation.engine.further_couplings import (
    add_down_derivative,
    add_receiver_errors,
    add_to_sensor_rows,
    down_estimate,
    subtract_biases,
)
from tuner.navigation.engine.layout import (
    ATTITUDE,
    KIND_COLUMN,
    LIMIT_COLUMN,
    MOUNTING_COLUMNS,
    RATE_COLUMNS,
    ROW,
    SLIP_COLUMNS,
    SOURCE,
    STATE_COLUMN,
    VELOCITY,
)
from tuner.navigation.engine.state import (
    CALIBRATED,
    CORRECTION,
    ESTIMATES,
    INNOVATION,
    INNOVATION_ROWS,
    JACOBIAN_ROWS,
    MEASURED,
    SENSOR_INVERSE_ROWS,
    SENSOR_ROWS,
)


@inlined
def _skew_into(H: FloatArray, row: int, column: int, a: Any, sign: float) -> None:
    """Add sign [a ×] to a block of an array."""
    H[row, column + 1] -= sign * a[2]
    H[row, column + 2] += sign * a[1]
    H[row + 1, column] += sign * a[2]
    H[row + 1, column + 2] -= sign * a[0]
    H[row + 2, column] -= sign * a[1]
    H[row + 2, column + 1] += sign * a[0]


@inlined
def _sensor_rows(m: Any, mat: Any) -> None:
    """Set `SENSOR_ROWS` to C δω and C δf of the states: −C A⁻¹ S."""
    prefer_small_code()
    T, mixed = m.scratch, m.ideal == 0
    for i in range(6):
        for j in range(m.size):
            T[SENSOR_ROWS + i, j] = 0.0
    for s in range(9, m.size):
        r, source = m.table[ROW, s], m.table[SOURCE, s]
        if r < 0:
            continue
        y = -1.0 if source < 0 else -T[CALIBRATED, source]
        if mixed:
            for i in range(6):
                T[SENSOR_ROWS + i, s] = T[SENSOR_INVERSE_ROWS + i, r] * y
        else:
            T[SENSOR_ROWS + r, s] = y
        turn = transform(mat, (T[SENSOR_ROWS, s], T[SENSOR_ROWS + 1, s], T[SENSOR_ROWS + 2, s]))
        push = transform(mat, (T[SENSOR_ROWS + 3, s], T[SENSOR_ROWS + 4, s], T[SENSOR_ROWS + 5, s]))
        for i in range(3):
            T[SENSOR_ROWS + i, s] = turn[i]
            T[SENSOR_ROWS + 3 + i, s] = push[i]


@inlined
def _metres(pos: Any) -> Any:
    """Return d(north, east, down)/d(latitude, longitude, height)."""
    meridian, normal = radii(np.sin(pos[0]))
    return (meridian + pos[2], (normal + pos[2]) * np.cos(pos[0]), -1.0)


@inlined
def _delay_rows(m: Any, pos: Any, vel: Any, force: Any, delay: float) -> None:
    """Add the effect of velocity and acceleration errors on the fixes of a delayed receiver."""
    prefer_small_code()
    _, f_vr, f_vv, _, _, _ = coupling(pos, vel)
    T, H, F = m.scratch, JACOBIAN_ROWS, INNOVATION_ROWS
    for i in range(3):
        for j in range(3):
            T[F + i, j] = f_vr[i][j]
            T[F + i, 3 + j] = f_vv[i][j]
        for s in range(9, m.size):
            T[F + i, s] = T[SENSOR_ROWS + 3 + i, s]
        for j in range(6, 9):
            T[F + i, j] = 0.0
    _skew_into(T, F, ATTITUDE, force, -1.0)
    add_down_derivative(m, F + 2)
    for i in range(3):
        for j in range(m.size):
            T[H + i, j] += -delay * T[H + 3 + i, j] + 0.5 * delay * delay * T[F + i, j]
            T[H + 3 + i, j] -= delay * T[F + i, j]


@inlined
def _to_body(m: Any, a: Any) -> Any:
    """Return mᵀ a."""
    north, east, down = m
    return add(scale(a[0], north), add(scale(a[1], east), scale(a[2], down)))


@inlined
def constraint_model(m: Any, pos: Any, vel: Any, quat: Any) -> None:
    """Set z (6,) and H (6, n) of a constraint: `non_holonomic`, `zero_velocity`, `zero_rate` of `models.measurements`.

    The first has two components only: z = 0 and H = 0 in the third. Arguments as of `fix_model`, `row` being the
    constraint.
    """
    prefer_small_code()
    T, row, n, kind = m.scratch, m.fix, m.size, int(m.fix[KIND_COLUMN])
    for i in range(6):
        T[INNOVATION, i] = 0.0
        for j in range(n):
            T[JACOBIAN_ROWS + i, j] = 0.0
    T[INNOVATION, 5] = row[LIMIT_COLUMN]
    if kind == 2:
        for i in range(3):
            T[JACOBIAN_ROWS + i, 3 + i] = 1.0
            T[INNOVATION, i] = -vel[i]
        return
    for c in range(6):
        T[MEASURED, c] = row[RATE_COLUMNS + c]
    for s in range(9, n):
        if m.table[ROW, s] >= 0 and m.table[SOURCE, s] < 0:
            T[MEASURED, m.table[ROW, s]] -= T[ESTIMATES, s]
    if m.further_count > 0:
        subtract_biases(m)
    for c in range(6):
        T[CALIBRATED, c] = T[MEASURED, c]
        if m.ideal == 0:
            T[CALIBRATED, c] = 0.0
            for s in range(6):
                T[CALIBRATED, c] += T[SENSOR_INVERSE_ROWS + c, s] * T[MEASURED, s]
    mat = matrix(quat)
    of_earth = earth_rate(np.sin(pos[0]), np.cos(pos[0]))
    of_earth_b = _to_body(mat, of_earth)
    unit = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    _sensor_rows(m, unit)
    if m.further_count > 0:
        add_to_sensor_rows(m, unit)
    if kind == 3:
        for i in range(3):
            T[INNOVATION, i] = T[CALIBRATED, i] - of_earth_b[i]
            for s in range(9, n):
                T[JACOBIAN_ROWS + i, s] = -T[SENSOR_ROWS + i, s]
        for j in range(3):
            axis = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            column = _to_body(mat, cross(of_earth, axis))
            for i in range(3):
                T[JACOBIAN_ROWS + i, 6 + j] = column[i]
        return
    slip = (row[SLIP_COLUMNS], row[SLIP_COLUMNS + 1], row[SLIP_COLUMNS + 2])
    turning = add((T[CALIBRATED, 0], T[CALIBRATED, 1], T[CALIBRATED, 2]), scale(-1.0, of_earth_b))
    moving = add(_to_body(mat, vel), cross(turning, slip))
    k = int(row[STATE_COLUMN])
    mounting = (T[ESTIMATES, k], T[ESTIMATES, k + 1], T[ESTIMATES, k + 2]) if k >= 0 else (0.0, 0.0, 0.0)
    turn = matrix(exponential(mounting))
    for i in range(2):
        # Row i + 1 of (exp([m ×]) R₀)ᵀ: that column of the product.
        axis = (row[MOUNTING_COLUMNS + 1 + i], row[MOUNTING_COLUMNS + 4 + i], row[MOUNTING_COLUMNS + 7 + i])
        sideways = transform(turn, axis)
        T[INNOVATION, i] = -(sideways[0] * moving[0] + sideways[1] * moving[1] + sideways[2] * moving[2])
        for j in range(3):
            axis = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            faster = _to_body(mat, axis)
            tilted = _to_body(mat, cross(vel, axis))
            tilted = add(tilted, cross(slip, _to_body(mat, cross(of_earth, axis))))
            T[JACOBIAN_ROWS + i, 3 + j] = (
                sideways[0] * faster[0] + sideways[1] * faster[1] + sideways[2] * faster[2]
            )
            T[JACOBIAN_ROWS + i, 6 + j] = (
                sideways[0] * tilted[0] + sideways[1] * tilted[1] + sideways[2] * tilted[2]
            )
            if k >= 0:
                mounted = cross(moving, _left_jacobian(mounting, axis))
                T[JACOBIAN_ROWS + i, k + j] = (
                    sideways[0] * mounted[0] + sideways[1] * mounted[1] + sideways[2] * mounted[2]
                )
        for s in range(9, n):
            w = cross(slip, (T[SENSOR_ROWS, s], T[SENSOR_ROWS + 1, s], T[SENSOR_ROWS + 2, s]))
            T[JACOBIAN_ROWS + i, s] -= sideways[0] * w[0] + sideways[1] * w[1] + sideways[2] * w[2]


@inlined
def _left_jacobian(m: Any, a: Any) -> Any:
    """Return J a with exp([(m + δ) ×]) = exp([J δ ×]) exp([m ×]), by series: m is a small angle."""
    s = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    half = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0))))
    sixth = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
    once = cross(m, a)
    return add(a, add(scale(half, once), scale(sixth, cross(m, once))))


@inlined
def fix_model(m: Any, pos: Any, vel: Any, quat: Any, full: bool | None) -> None:
    """Set z (6,) and H (6, n) of a fix (llh, velocity): `models.measurements.position_fix` and `velocity_fix`.

    Parameters
    ----------
    m : record
        See `state`; the scratch contains estimates, calibrated rates and forces and A⁻¹, and z and H are set in it.
    pos, vel, quat : tuple of floats
        State of the filter: latitude, longitude, height; velocity; attitude.
    full : bool, optional
        As of `propagation.advance`.
    """
    prefer_small_code()
    T, n = m.scratch, m.size
    mat = matrix(quat)
    _sensor_rows(m, mat)
    if full is not None and m.further_count > 0:
        add_to_sensor_rows(m, mat)
    arm = (m.constants[0], m.constants[1], m.constants[2])
    if m.lever >= 0:
        arm = add(arm, (T[ESTIMATES, m.lever], T[ESTIMATES, m.lever + 1], T[ESTIMATES, m.lever + 2]))
    u = transform(mat, arm)
    omega_b, force_b = (
        (T[CALIBRATED, 0], T[CALIBRATED, 1], T[CALIBRATED, 2]),
        (T[CALIBRATED, 3], T[CALIBRATED, 4], T[CALIBRATED, 5]),
    )
    of_earth = earth_rate(np.sin(pos[0]), np.cos(pos[0]))
    omega = transform(mat, omega_b)
    relative = add(omega, scale(-1.0, of_earth))
    antenna = add(vel, cross(relative, u))
    for i in range(6):
        for j in range(n):
            T[JACOBIAN_ROWS + i, j] = 0.0
    for i in range(3):
        T[JACOBIAN_ROWS + i, i] = 1.0
        T[JACOBIAN_ROWS + 3 + i, 3 + i] = 1.0
    _skew_into(T, JACOBIAN_ROWS, ATTITUDE, u, -1.0)
    # Velocity rows: −[u ×] C δω + v + ([ω_ie ×][u ×] − [(ω × u) ×]) φ + [ω_eb ×] C δl.
    for s in range(9, n):
        w = cross(u, (T[SENSOR_ROWS, s], T[SENSOR_ROWS + 1, s], T[SENSOR_ROWS + 2, s]))
        for i in range(3):
            T[JACOBIAN_ROWS + 3 + i, s] = -w[i]
    _skew_into(T, JACOBIAN_ROWS + VELOCITY, ATTITUDE, cross(omega, u), -1.0)
    # [a ×][b ×] = b aᵀ − (a · b) I
    inner = of_earth[0] * u[0] + of_earth[1] * u[1] + of_earth[2] * u[2]
    for i in range(3):
        for j in range(3):
            T[JACOBIAN_ROWS + 3 + i, 6 + j] += u[i] * of_earth[j]
        T[JACOBIAN_ROWS + 3 + i, 6 + i] -= inner
    if m.lever >= 0:
        for j in range(3):
            column = (mat[0][j], mat[1][j], mat[2][j])
            turned = cross(relative, column)
            for i in range(3):
                T[JACOBIAN_ROWS + i, m.lever + j] = column[i]
                T[JACOBIAN_ROWS + 3 + i, m.lever + j] = turned[i]
    shift = (0.0, 0.0, 0.0)
    delay = 0.0
    acc = (0.0, 0.0, 0.0)
    if full is not None and m.delay >= 0:
        delay = T[ESTIMATES, m.delay]
        _, acc, _ = rates(pos, vel, mat, omega_b, force_b)
        acc = (acc[0], acc[1], acc[2] + down_estimate(m))
        shift = add(scale(-delay, antenna), scale(0.5 * delay * delay, acc))
        _delay_rows(m, pos, vel, transform(mat, force_b), delay)
        for i in range(3):
            T[JACOBIAN_ROWS + i, m.delay] = delay * acc[i] - antenna[i]
            T[JACOBIAN_ROWS + 3 + i, m.delay] = -acc[i]
    for k in range(m.processes):
        j = m.gnss + 3 * k
        shift = add(shift, (T[ESTIMATES, j], T[ESTIMATES, j + 1], T[ESTIMATES, j + 2]))
        for i in range(3):
            T[JACOBIAN_ROWS + i, j + i] = 1.0
    metres = _metres(pos)
    for i in range(3):
        T[INNOVATION, i] = (m.fix[i] - pos[i]) * metres[i] - u[i] - shift[i]
        T[INNOVATION, 3 + i] = m.fix[3 + i] - (antenna[i] - delay * acc[i])
    if full is not None and m.further_count > 0:
        add_receiver_errors(m)


@inlined
def correct(pos: Any, vel: Any, quat: Any, T: FloatArray) -> Any:
    """Return the state with the nine errors in the scratch added: `models.error_state.corrected`."""
    metres = _metres(pos)
    new = (
        pos[0] + T[CORRECTION, 0] / metres[0],
        pos[1] + T[CORRECTION, 1] / metres[1],
        pos[2] + T[CORRECTION, 2] / metres[2],
    )
    turned = product(exponential((T[CORRECTION, 6], T[CORRECTION, 7], T[CORRECTION, 8])), quat)
    return new, (vel[0] + T[CORRECTION, 3], vel[1] + T[CORRECTION, 4], vel[2] + T[CORRECTION, 5]), turned
