"""What declared states add to, in compiled code, beyond one sensor in full: `Layout.further`, term by term.

The loops of `sensor_inputs`, `mechanisation` and `measurement_models` know states that add to one sensor with factor
1, as those of this project do. All others, and what adds to a fix or to the acceleration down, are here: lists of
(state, target of `models.filter_states.declaration.TARGETS`, source) with a factor, which are empty in most filters.
"""

from __future__ import annotations

from typing import Any

from models.filter_states.declaration import DOWN_TARGET, FIX_TARGET
from models.vector3 import transform
from tuner.navigation.engine.compilation import block, inlined
from tuner.navigation.engine.layout import DOWN_INPUT, GRAVITY_INDEX
from tuner.navigation.engine.state import (
    BIAS_ROW,
    CALIBRATED,
    CALIBRATED_ROW,
    CALIBRATION_ROW,
    ESTIMATE,
    ESTIMATES,
    INNOVATION,
    JACOBIAN_ROWS,
    MEASURED,
    SENSOR_INVERSE_ROWS,
    SENSOR_ROWS,
    UNIT,
    VELOCITY_ROW,
)


@block
def add_inputs(m: Any, p: Any, a: Any, first: int, end: int, by_rows: int) -> None:
    """Add S P of these terms to the inputs of the columns first … end − 1, read from columns, or rows (1), of P."""
    N, S, P, A = m.rows, m.states, p.P, a.inputs
    for e in range(m.further_count):
        s, target, source = m.further[e, 0], m.further[e, 1], m.further[e, 2]
        if target > DOWN_INPUT:
            continue
        for j in range(first, end):
            for w in range(m.rows.shape[1]):
                c = m.factor[e] * S[UNIT, s, w]
                if source >= 0:
                    c *= N[CALIBRATED_ROW + source, w]
                A[target, j, w] += c * (P[j, s, w] if by_rows == 1 else P[s, j, w])


@block
def add_to_calibration(m: Any, matrix: bool) -> None:
    """Add the estimates of these terms to the biases of the sensors, or to A."""
    N, S = m.rows, m.states
    for e in range(m.further_count):
        s, target, source = m.further[e, 0], m.further[e, 1], m.further[e, 2]
        if target < DOWN_TARGET and matrix == (source >= 0):
            row = CALIBRATION_ROW + 6 * target + source if matrix else BIAS_ROW + target
            for w in range(m.rows.shape[1]):
                N[row, w] += m.factor[e] * S[ESTIMATE, s, w]


@block
def add_to_sensor_rows(m: Any, mat: Any) -> None:
    """Add C δω and C δf of these terms to `SENSOR_ROWS`."""
    T, mixed = m.scratch, m.ideal == 0
    for e in range(m.further_count):
        s, target, source = m.further[e, 0], m.further[e, 1], m.further[e, 2]
        if target >= DOWN_TARGET:
            continue
        y = -m.factor[e] if source < 0 else -m.factor[e] * T[CALIBRATED, source]
        rate, force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        if mixed:
            k = SENSOR_INVERSE_ROWS
            rate = (y * T[k, target], y * T[k + 1, target], y * T[k + 2, target])
            force = (y * T[k + 3, target], y * T[k + 4, target], y * T[k + 5, target])
        elif target < 3:
            rate = (y * (target == 0), y * (target == 1), y * (target == 2))
        else:
            force = (y * (target == 3), y * (target == 4), y * (target == 5))
        turn, push = transform(mat, rate), transform(mat, force)
        for i in range(3):
            T[SENSOR_ROWS + i, s] += turn[i]
            T[SENSOR_ROWS + 3 + i, s] += push[i]


@block
def subtract_biases(m: Any) -> None:
    """Subtract the biases of these terms from `MEASURED`."""
    T = m.scratch
    for e in range(m.further_count):
        if m.further[e, 1] < DOWN_TARGET and m.further[e, 2] < 0:
            T[MEASURED, m.further[e, 1]] -= m.factor[e] * T[ESTIMATES, m.further[e, 0]]


@block
def add_receiver_errors(m: Any) -> None:
    """Add what states add to a fix to H, and take their estimates out of z."""
    T = m.scratch
    for e in range(m.further_count):
        row = m.further[e, 1] - FIX_TARGET
        if row >= 0:
            T[JACOBIAN_ROWS + row, m.further[e, 0]] += m.factor[e]
            T[INNOVATION, row] -= m.factor[e] * T[ESTIMATES, m.further[e, 0]]


@inlined
def down_estimate(m: Any) -> Any:
    """Return the acceleration down of the estimates in the scratch, m/s²."""
    T, down = m.scratch, 0.0
    if m.gravity >= 0:
        down += T[ESTIMATES, m.gravity]
    for e in range(m.further_count):
        if m.further[e, 1] == DOWN_TARGET:
            down += m.factor[e] * T[ESTIMATES, m.further[e, 0]]
    return down


@block
def add_down_derivative(m: Any, row: int) -> None:
    """Set a row of the scratch to the derivative of the acceleration down by the states, where that is not 0."""
    T = m.scratch
    if m.gravity >= 0:
        T[row, m.gravity] += 1.0
    for e in range(m.further_count):
        if m.further[e, 1] == DOWN_TARGET:
            T[row, m.further[e, 0]] += m.factor[e]


@block
def accelerate_down(m: Any, dt: float) -> None:
    """Add what the known and the estimated gravity accelerates each filter in a sample of length dt."""
    N, S = m.rows, m.states
    for w in range(m.rows.shape[1]):
        down = m.constants[GRAVITY_INDEX]
        if m.gravity >= 0:
            down += S[ESTIMATE, m.gravity, w]
        for e in range(m.further_count):
            if m.further[e, 1] == DOWN_TARGET:
                down += m.factor[e] * S[ESTIMATE, m.further[e, 0], w]
        N[VELOCITY_ROW + 2, w] += dt * down
        N[2, w] -= 0.5 * dt * dt * down
