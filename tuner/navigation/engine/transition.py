"""Φ of the navigation errors over a covariance step, and its products with columns and rows of P, in compiled code.

Φ is that of `models.error_state`; innermost loops go over filters, or over columns where there is one filter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from models.error_state import coupling
from models.filter_states.declaration import NAVIGATION_STATES
from models.strapdown import mean_attitude
from models.vector3 import add, cross, scale, transform
from tuner.navigation.engine.compilation import block, inlined, prefer_wide_vectors, put, quaternion, vector
from tuner.navigation.engine.layout import (
    ACCELEROMETERS,
    ATTITUDE,
    DOWN_INPUT,
    GYROS,
    POSITION,
    SOURCE,
    VELOCITY,
)
from tuner.navigation.engine.state import (
    ANGLE_SUM_ROW,
    ATTITUDE_ROW,
    CALIBRATED_ROW,
    PHI_ROW,
    POSITION_ROW,
    SENSITIVITY,
    START_ROW,
    UNIT,
    VELOCITY_ROW,
    VELOCITY_SUM_ROW,
)


@inlined
def linearise(m: Any, dt: float) -> None:
    """Set Φ of the navigation errors, linearised at the middle of the step: `models.error_state.coupling` times dt.

    Behind its 28 numbers stand ω_in dt (28), half the velocity increment f dt/2 (31) and −C dt (34).
    """
    prefer_wide_vectors()
    N = m.rows
    for w in range(m.rows.shape[1]):
        pos = scale(0.5, add(vector(N, START_ROW, w), vector(N, POSITION_ROW, w)))
        vel = scale(0.5, add(vector(N, START_ROW + VELOCITY_ROW, w), vector(N, VELOCITY_ROW, w)))
        mat = mean_attitude(quaternion(N, START_ROW + ATTITUDE_ROW, w), quaternion(N, ATTITUDE_ROW, w))
        rr, vr, vv, ar, av, omega = coupling(pos, vel)
        N[PHI_ROW + 0, w], N[PHI_ROW + 1, w] = dt * rr[0][0], dt * rr[0][2]
        put(N, PHI_ROW + 2, w, scale(dt, rr[1]))
        put(N, PHI_ROW + 5, w, scale(dt, (vr[0][0], vr[0][2], vr[1][0])))
        put(N, PHI_ROW + 8, w, scale(dt, (vr[1][2], vr[2][0], vr[2][2])))
        put(N, PHI_ROW + 11, w, scale(dt, vv[0]))
        put(N, PHI_ROW + 14, w, scale(dt, vv[1]))
        N[PHI_ROW + 17, w], N[PHI_ROW + 18, w] = dt * vv[2][0], dt * vv[2][1]
        put(N, PHI_ROW + 19, w, scale(dt, (ar[0][0], ar[0][2], ar[1][0])))
        put(N, PHI_ROW + 22, w, scale(dt, (ar[1][2], ar[2][0], ar[2][2])))
        put(N, PHI_ROW + 25, w, scale(dt, (av[0][1], av[1][0], av[2][1])))
        put(N, PHI_ROW + 28, w, scale(dt, omega))
        put(N, PHI_ROW + 31, w, scale(0.5, vector(N, VELOCITY_SUM_ROW, w)))
        put(N, PHI_ROW + 34, w, scale(-dt, mat[0]))
        put(N, PHI_ROW + 37, w, scale(-dt, mat[1]))
        put(N, PHI_ROW + 40, w, scale(-dt, mat[2]))


@block
def set_sensitivity(m: Any, dt: float) -> None:
    """Set mean calibrated rates and forces of the step, and the elements of S c that depend on them."""
    prefer_wide_vectors()
    N, S = m.rows, m.states
    for i in range(3):
        for w in range(m.rows.shape[1]):
            N[CALIBRATED_ROW + i, w] = N[ANGLE_SUM_ROW + i, w] / dt
            force = N[PHI_ROW + 34 + i, w] * N[PHI_ROW + 31, w] + N[PHI_ROW + 37 + i, w] * N[PHI_ROW + 32, w]
            force += N[PHI_ROW + 40 + i, w] * N[PHI_ROW + 33, w]
            N[CALIBRATED_ROW + 3 + i, w] = force * (-2.0 / (dt * dt))
    for s in range(NAVIGATION_STATES, m.size):
        source = m.table[SOURCE, s]
        if source >= 0:
            for w in range(m.rows.shape[1]):
                S[SENSITIVITY, s, w] = S[UNIT, s, w] * N[CALIBRATED_ROW + source, w]


@inlined
def attitude_rows(K: Any, w: int, r: Any, v: Any, a: Any, rate: Any) -> Any:
    """Return the attitude rows of Φ_nn times a column of nine, plus Γ times errors of the gyros."""
    f_ar = (
        (K[PHI_ROW + 19, w], 0.0, K[PHI_ROW + 20, w]),
        (K[PHI_ROW + 21, w], 0.0, K[PHI_ROW + 22, w]),
        (K[PHI_ROW + 23, w], 0.0, K[PHI_ROW + 24, w]),
    )
    f_av = ((0.0, K[PHI_ROW + 25, w], 0.0), (K[PHI_ROW + 26, w], 0.0, 0.0), (0.0, K[PHI_ROW + 27, w], 0.0))
    turn = (vector(K, PHI_ROW + 34, w), vector(K, PHI_ROW + 37, w), vector(K, PHI_ROW + 40, w))
    y = add(transform(f_ar, r), transform(f_av, v))
    return add(a, add(y, add(transform(turn, rate), cross(a, vector(K, PHI_ROW + 28, w)))))


@inlined
def velocity_rows(K: Any, w: int, r: Any, v: Any, a: Any, after: Any, force: Any) -> Any:
    """Return the velocity rows, from the attitude `after` them, with errors of the accelerometers."""
    f_vr = (
        (K[PHI_ROW + 5, w], 0.0, K[PHI_ROW + 6, w]),
        (K[PHI_ROW + 7, w], 0.0, K[PHI_ROW + 8, w]),
        (K[PHI_ROW + 9, w], 0.0, K[PHI_ROW + 10, w]),
    )
    f_vv = (
        (K[PHI_ROW + 11, w], K[PHI_ROW + 12, w], K[PHI_ROW + 13, w]),
        (K[PHI_ROW + 14, w], K[PHI_ROW + 15, w], K[PHI_ROW + 16, w]),
        (K[PHI_ROW + 17, w], K[PHI_ROW + 18, w], 0.0),
    )
    turn = (vector(K, PHI_ROW + 34, w), vector(K, PHI_ROW + 37, w), vector(K, PHI_ROW + 40, w))
    y = add(transform(f_vr, r), transform(f_vv, v))
    return add(v, add(y, add(transform(turn, force), cross(add(a, after), vector(K, PHI_ROW + 31, w)))))


@inlined
def position_rows(K: Any, w: int, r: Any, v: Any, after: Any, half: float) -> Any:
    """Return the position rows, from the velocity `after` them."""
    f_rr = (
        (K[PHI_ROW + 0, w], 0.0, K[PHI_ROW + 1, w]),
        (K[PHI_ROW + 2, w], K[PHI_ROW + 3, w], K[PHI_ROW + 4, w]),
        (0.0, 0.0, 0.0),
    )
    return add(r, add(transform(f_rr, r), scale(half, add(v, after))))


@inlined
def triple(P: Any, row: int, j: Any, w: int) -> Any:
    """Return three rows of column j."""
    return P[row, j, w], P[row + 1, j, w], P[row + 2, j, w]


@inlined
def put_triple(P: Any, row: int, j: Any, w: int, a: Any) -> None:
    """Set three rows of column j."""
    P[row, j, w] = a[0]
    P[row + 1, j, w] = a[1]
    P[row + 2, j, w] = a[2]


@block
def columns_through_step(m: Any, p: Any, a: Any, first: int, end: int, dt: float) -> None:
    """Replace nine rows of the columns first … end − 1 of P by Φ_nn · + Γ times their inputs."""
    prefer_wide_vectors()
    K, P, A, half = m.rows, p.P, a.inputs, 0.5 * dt
    for column in range(first, end):
        j = np.uint64(column)
        for w in range(m.rows.shape[1]):
            r, v, a = triple(P, POSITION, j, w), triple(P, VELOCITY, j, w), triple(P, ATTITUDE, j, w)
            a_after = attitude_rows(K, w, r, v, a, triple(A, GYROS, j, w))
            v_after = velocity_rows(K, w, r, v, a, a_after, triple(A, ACCELEROMETERS, j, w))
            v_after = (v_after[0], v_after[1], v_after[2] + dt * A[DOWN_INPUT, j, w])
            put_triple(P, POSITION, j, w, position_rows(K, w, r, v, v_after, half))
            put_triple(P, VELOCITY, j, w, v_after)
            put_triple(P, ATTITUDE, j, w, a_after)


@inlined
def row_triple(P: Any, i: int, k: int, w: int) -> Any:
    """Return three columns of row i."""
    return P[i, k, w], P[i, k + 1, w], P[i, k + 2, w]


@inlined
def put_both(P: Any, i: int, k: int, w: int, a: Any) -> None:
    """Set three columns of row i, and the mirrored elements of column i."""
    P[i, k, w] = P[k, i, w] = a[0]
    P[i, k + 1, w] = P[k + 1, i, w] = a[1]
    P[i, k + 2, w] = P[k + 2, i, w] = a[2]


@block
def rows_through_step(m: Any, p: Any, a: Any, dt: float) -> None:
    """Set P_nn to T_nn Φ_nnᵀ + inputsᵀ Γᵀ, one triangle of it; the last rows first."""
    prefer_wide_vectors()
    K, P, A, half = m.rows, p.P, a.inputs, 0.5 * dt
    for i in range(6, 9):
        for w in range(m.rows.shape[1]):
            r, v, a = (
                row_triple(P, i, POSITION, w),
                row_triple(P, i, VELOCITY, w),
                row_triple(P, i, ATTITUDE, w),
            )
            a_after = attitude_rows(K, w, r, v, a, triple(A, GYROS, np.uint64(i), w))
            P[i, 6, w], P[i, 7, w], P[i, 8, w] = a_after
    for i in range(3, 6):
        for w in range(m.rows.shape[1]):
            r, v, a = (
                row_triple(P, i, POSITION, w),
                row_triple(P, i, VELOCITY, w),
                row_triple(P, i, ATTITUDE, w),
            )
            a_after = attitude_rows(K, w, r, v, a, triple(A, GYROS, np.uint64(i), w))
            v_after = velocity_rows(K, w, r, v, a, a_after, triple(A, ACCELEROMETERS, np.uint64(i), w))
            put_both(P, i, ATTITUDE, w, a_after)
            P[i, 3, w], P[i, 4, w], P[i, 5, w] = v_after[0], v_after[1], v_after[2] + dt * A[DOWN_INPUT, i, w]
    for i in range(3):
        for w in range(m.rows.shape[1]):
            r, v, a = (
                row_triple(P, i, POSITION, w),
                row_triple(P, i, VELOCITY, w),
                row_triple(P, i, ATTITUDE, w),
            )
            a_after = attitude_rows(K, w, r, v, a, triple(A, GYROS, np.uint64(i), w))
            v_after = velocity_rows(K, w, r, v, a, a_after, triple(A, ACCELEROMETERS, np.uint64(i), w))
            v_after = (v_after[0], v_after[1], v_after[2] + dt * A[DOWN_INPUT, i, w])
            put_both(P, i, ATTITUDE, w, a_after)
            put_both(P, i, VELOCITY, w, v_after)
            P[i, 0, w], P[i, 1, w], P[i, 2, w] = position_rows(K, w, r, v, v_after, half)
