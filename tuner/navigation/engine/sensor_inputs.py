"""Inputs of the navigation errors in compiled code: sensor errors by the states, S P, and white noise, W/dt Γᵀ."""

from __future__ import annotations

from typing import Any

import numpy as np

from models.filter_states.declaration import NAVIGATION_STATES
from models.vector3 import add, cross, dot, scale, transform
from tuner.navigation.engine.compilation import block, count, inlined, prefer_wide_vectors, vector
from tuner.navigation.engine.layout import ACCELEROMETERS, DOWN_INPUT, GROUP_SIZE, GYROS
from tuner.navigation.engine.state import (
    INVERSE_ROW,
    PHI_ROW,
    SENSITIVITY,
    WHITE_ROW,
)
from tuner.navigation.engine.transition import triple

UINT_1, UINT_2, UINT_3 = np.uint64(1), np.uint64(2), np.uint64(3)
"""Unsigned, so that numba does not look for indices from the end, which hides from LLVM how far rows are apart."""


@block
def set_coupling(m: Any) -> None:
    """Set the elements of S c of every group of states, 0 for states that are missing in it."""
    S, C, groups, filters, group_count = m.states, m.coupling, m.groups, count(m), m.group_count
    for g in range(group_count):
        first, members = groups[g, 1], groups[g, 2]
        for k in range(GROUP_SIZE):
            for w in range(filters):
                C[GROUP_SIZE * g + k, w] = S[SENSITIVITY, first + k, w] if k < members else 0.0


@block
def inputs_by_columns(m: Any, p: Any, a: Any, first: int, end: int, alone: bool | None) -> None:
    """Set the inputs of the columns first … end − 1 of P to S times their states.

    Parameters
    ----------
    m, p, a : record
        Of `State`: memory, covariance, inputs.
    first, end : int
        Columns.
    alone : bool, optional
        As of `propagation.advance`.
    """
    prefer_wide_vectors()
    P, A, S, C, groups, filters = p.P, a.inputs, m.states, m.coupling, m.groups, count(m)
    group_count = m.group_count
    if alone is not None:
        s0, s1, s2 = (
            S[SENSITIVITY, NAVIGATION_STATES, 0],
            S[SENSITIVITY, NAVIGATION_STATES + 1, 0],
            S[SENSITIVITY, NAVIGATION_STATES + 2, 0],
        )
        s3, s4, s5 = (
            S[SENSITIVITY, NAVIGATION_STATES + 3, 0],
            S[SENSITIVITY, NAVIGATION_STATES + 4, 0],
            S[SENSITIVITY, NAVIGATION_STATES + 5, 0],
        )
        for column in range(first, end):
            j = np.uint64(column)
            A[0, j, 0] = s0 * P[NAVIGATION_STATES, j, 0]
            A[1, j, 0] = s1 * P[NAVIGATION_STATES + 1, j, 0]
            A[2, j, 0] = s2 * P[NAVIGATION_STATES + 2, j, 0]
            A[3, j, 0] = s3 * P[NAVIGATION_STATES + 3, j, 0]
            A[4, j, 0] = s4 * P[NAVIGATION_STATES + 4, j, 0]
            A[5, j, 0] = s5 * P[NAVIGATION_STATES + 5, j, 0]
            A[DOWN_INPUT, j, 0] = 0.0
    else:
        for column in range(first, end):
            j = np.uint64(column)
            for w in range(filters):
                A[0, j, w] = S[SENSITIVITY, NAVIGATION_STATES, w] * P[NAVIGATION_STATES, j, w]
                A[1, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 1, w] * P[NAVIGATION_STATES + 1, j, w]
                A[2, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 2, w] * P[NAVIGATION_STATES + 2, j, w]
                A[3, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 3, w] * P[NAVIGATION_STATES + 3, j, w]
                A[4, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 4, w] * P[NAVIGATION_STATES + 4, j, w]
                A[5, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 5, w] * P[NAVIGATION_STATES + 5, j, w]
                A[DOWN_INPUT, j, w] = 0.0
    for g in range(group_count):
        sensor, s, k = np.uint64(groups[g, 0]), np.uint64(groups[g, 1]), np.uint64(GROUP_SIZE * g)
        if alone is not None:
            c0, c1, c2, c3 = C[k, 0], C[k + UINT_1, 0], C[k + UINT_2, 0], C[k + UINT_3, 0]
            for column in range(first, end):
                j = np.uint64(column)
                A[sensor, j, 0] += (c0 * P[s, j, 0] + c1 * P[s + UINT_1, j, 0]) + (
                    c2 * P[s + UINT_2, j, 0] + c3 * P[s + UINT_3, j, 0]
                )
        else:
            for column in range(first, end, 2):  # what is behind the states is 0
                j = np.uint64(column)
                i = j + UINT_1
                for w in range(filters):
                    c0, c1, c2, c3 = C[k, w], C[k + UINT_1, w], C[k + UINT_2, w], C[k + UINT_3, w]
                    A[sensor, j, w] += (c0 * P[s, j, w] + c1 * P[s + UINT_1, j, w]) + (
                        c2 * P[s + UINT_2, j, w] + c3 * P[s + UINT_3, j, w]
                    )
                    A[sensor, i, w] += (c0 * P[s, i, w] + c1 * P[s + UINT_1, i, w]) + (
                        c2 * P[s + UINT_2, i, w] + c3 * P[s + UINT_3, i, w]
                    )


@block
def inputs_by_rows(m: Any, p: Any, a: Any) -> None:
    """Set the inputs of the nine first columns of P to S P_nbᵀ, read along the rows of P_nb.

    Parameters
    ----------
    m, p, a : record
        Of `State`: memory, covariance, inputs.
    """
    prefer_wide_vectors()
    P, A, S, C, groups, filters = p.P, a.inputs, m.states, m.coupling, m.groups, count(m)
    group_count = m.group_count
    for j in range(NAVIGATION_STATES):
        for w in range(filters):
            A[0, j, w] = S[SENSITIVITY, NAVIGATION_STATES, w] * P[j, NAVIGATION_STATES, w]
            A[1, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 1, w] * P[j, NAVIGATION_STATES + 1, w]
            A[2, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 2, w] * P[j, NAVIGATION_STATES + 2, w]
            A[3, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 3, w] * P[j, NAVIGATION_STATES + 3, w]
            A[4, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 4, w] * P[j, NAVIGATION_STATES + 4, w]
            A[5, j, w] = S[SENSITIVITY, NAVIGATION_STATES + 5, w] * P[j, NAVIGATION_STATES + 5, w]
            A[DOWN_INPUT, j, w] = 0.0
    for g in range(group_count):
        sensor, s, k = np.uint64(groups[g, 0]), np.uint64(groups[g, 1]), np.uint64(GROUP_SIZE * g)
        for j in range(NAVIGATION_STATES):
            for w in range(filters):
                A[sensor, j, w] += (C[k, w] * P[j, s, w] + C[k + UINT_1, w] * P[j, s + UINT_1, w]) + (
                    C[k + UINT_2, w] * P[j, s + UINT_2, w] + C[k + UINT_3, w] * P[j, s + UINT_3, w]
                )


@inlined
def calibrate_inputs(m: Any, a: Any, first: int, end: int) -> None:
    """Replace the six sensor errors of the inputs of the columns first … end − 1 by A⁻¹ times them."""
    prefer_wide_vectors()
    N, A = m.rows, a.inputs
    for column in range(first, end):
        j = np.uint64(column)
        for w in range(m.rows.shape[1]):
            s, t = triple(A, GYROS, j, w), triple(A, ACCELEROMETERS, j, w)
            for r in range(6):
                a, b = vector(N, INVERSE_ROW + 6 * r, w), vector(N, INVERSE_ROW + 6 * r + 3, w)
                A[r, j, w] = dot(a, s) + dot(b, t)


@inlined
def add_column(A: Any, r: int, w: int, half: float, velocity: Any, attitude: Any) -> None:
    """Add the effects on position, `half` times that on velocity, on velocity and on attitude to row r of inputs."""
    A[r, 0, w] += half * velocity[0]
    A[r, 1, w] += half * velocity[1]
    A[r, 2, w] += half * velocity[2]
    A[r, 3, w] += velocity[0]
    A[r, 4, w] += velocity[1]
    A[r, 5, w] += velocity[2]
    A[r, 6, w] += attitude[0]
    A[r, 7, w] += attitude[1]
    A[r, 8, w] += attitude[2]


@inlined
def add_white(m: Any, a: Any, dt: float) -> None:
    """Add W/dt Γᵀ to the inputs of the nine first columns.

    Γ is the effect of constant sensor errors over the step, for A = I.
    """
    prefer_wide_vectors()
    N, A, half, inverse = m.rows, a.inputs, 0.5 * dt, 1.0 / dt
    for r in range(3):
        for w in range(m.rows.shape[1]):
            turn = (N[PHI_ROW + 34 + r, w], N[PHI_ROW + 37 + r, w], N[PHI_ROW + 40 + r, w])
            attitude = scale(inverse * N[WHITE_ROW + r, w], turn)
            velocity = scale(inverse * N[WHITE_ROW + 3 + r, w], turn)
            add_column(A, r, w, half, cross(attitude, vector(N, PHI_ROW + 31, w)), attitude)
            add_column(A, 3 + r, w, half, velocity, (0.0, 0.0, 0.0))


@inlined
def add_mixed_white(m: Any, a: Any, dt: float) -> None:
    """Add W/dt Γᵀ for any A."""
    prefer_wide_vectors()
    N, A, half, inverse = m.rows, a.inputs, 0.5 * dt, 1.0 / dt
    for r in range(6):
        for w in range(m.rows.shape[1]):
            density = inverse * N[WHITE_ROW + r, w]
            turn = (vector(N, PHI_ROW + 34, w), vector(N, PHI_ROW + 37, w), vector(N, PHI_ROW + 40, w))
            attitude = transform(
                turn, (N[INVERSE_ROW + r, w], N[INVERSE_ROW + 6 + r, w], N[INVERSE_ROW + 12 + r, w])
            )
            velocity = transform(
                turn, (N[INVERSE_ROW + 18 + r, w], N[INVERSE_ROW + 24 + r, w], N[INVERSE_ROW + 30 + r, w])
            )
            velocity = add(velocity, cross(attitude, vector(N, PHI_ROW + 31, w)))
            add_column(A, r, w, half, scale(density, velocity), scale(density, attitude))
