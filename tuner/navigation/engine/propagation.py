"""The covariance in compiled code, advanced block by block: P ← Φ P Φᵀ + Q.

With x = (navigation errors n, other states b), D diagonal (slopes of ramps apart) and S the errors of the six sensors
(and of the acceleration down) by the states b::

    Φ = ( Φ_nn   Γ S )        T = (Φ_nn  Γ S) P                              columns of P_nn and P_nb
        ( 0      D   )        P_nn ← T_nn Φ_nnᵀ + (T_nb Sᵀ + Γ W/dt) Γᵀ      rows of P_nn
                              P_nb ← T_nb Dᵀ,   P_bb ← D P_bb Dᵀ + Q_bb

Between fixes P is that of states b/c with c ← D c, so P_nb and P_bb keep their values, S ← S D and Q_bb ← Q_bb/c².
P_bn is left as it was; `gather` returns to b and makes both sides of P equal.

Φ and Q are those of `models.error_state`. Innermost loops go over filters, or over columns where there is one filter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from models.filter_states.declaration import NAVIGATION_STATES
from tuner.navigation.engine.compilation import block, count, merged, prefer_small_code
from tuner.navigation.engine.further_couplings import add_inputs
from tuner.navigation.engine.layout import SLOPE
from tuner.navigation.engine.sensor_inputs import (
    add_mixed_white,
    add_white,
    calibrate_inputs,
    inputs_by_columns,
    inputs_by_rows,
    set_coupling,
)
from tuner.navigation.engine.state import (
    COLUMN_MULTIPLE,
    DECAY,
    DRIVING_DENSITY,
    ESTIMATE,
    PROCESS_VARIANCE,
    RATE,
    SCALED_VARIANCE,
    SENSITIVITY,
    UNIT,
)
from tuner.navigation.engine.transition import (
    columns_through_step,
    linearise,
    rows_through_step,
    set_sensitivity,
)

COLUMNS_AT_ONCE = 8
"""Columns of `BATCH_SIZE` filters that are advanced at a time: their inputs stay in the fastest cache."""
LONGEST_DECAY = 100.0
"""Time constants of the fastest state after which P returns to b: c stays within the range of numbers, e^±100."""


@block
def set_decay(m: Any, dt: float) -> None:
    """Set decay and process noise of every state for a step dt."""
    prefer_small_code()
    states = m.states
    for j in range(NAVIGATION_STATES, m.size):
        for w in range(states.shape[2]):
            u = states[RATE, j, w] * dt
            states[DECAY, j, w] = np.exp(-u)
            grown = 1.0 if u == 0.0 else -np.expm1(-2.0 * u) / (2.0 * u)
            states[PROCESS_VARIANCE, j, w] = states[DRIVING_DENSITY, j, w] * dt * grown


@block
def add_process_noise(m: Any, p: Any) -> None:
    """Advance the units of b and the estimates by exp(−dt/T); add the process noise of b."""
    P, S, size, filters = p.P, m.states, m.size, count(m)
    for j in range(NAVIGATION_STATES, size):
        for w in range(filters):
            c = S[UNIT, j, w] * S[DECAY, j, w]
            S[UNIT, j, w] = c
            S[SENSITIVITY, j, w] = c
            S[ESTIMATE, j, w] *= S[DECAY, j, w]
            S[SCALED_VARIANCE, j, w] = S[PROCESS_VARIANCE, j, w] / (c * c)
    for j in range(NAVIGATION_STATES, size):
        for w in range(filters):
            P[j, j, w] += S[SCALED_VARIANCE, j, w]


@block
def add_slopes(m: Any, p: Any, dt: float) -> None:
    """Add dt times its slope to every state that has one."""
    prefer_small_code()
    P, S, size, filters = p.P, m.states, m.size, m.rows.shape[1]
    for j in range(NAVIGATION_STATES, size):
        k = m.table[SLOPE, j]
        if k < 0:
            continue
        for i in range(size):
            for w in range(filters):
                P[i, j, w] += dt / S[UNIT, j, w] * S[UNIT, k, w] * P[i, k, w]
        for i in range(size):
            for w in range(filters):
                P[j, i, w] += dt / S[UNIT, j, w] * S[UNIT, k, w] * P[k, i, w]
        for w in range(filters):
            S[ESTIMATE, j, w] += dt * S[ESTIMATE, k, w]


@block
def gather(m: Any, p: Any, e: Any) -> None:
    """Copy the covariance of every filter, unscaled and symmetric, to a matrix of its own with contiguous rows."""
    prefer_small_code()
    P, S, each, filters, size = p.P, m.states, e.P_each, count(m), m.size
    for i in range(size):
        for j in range(i, size):
            if j < NAVIGATION_STATES:
                for w in range(filters):
                    mean = 0.5 * (P[i, j, w] + P[j, i, w])
                    each[w, i, j] = mean
                    each[w, j, i] = mean
            else:
                for w in range(filters):
                    value = P[i, j, w] * (S[UNIT, i, w] * S[UNIT, j, w])
                    each[w, i, j] = value
                    each[w, j, i] = value


@block
def scatter(m: Any, p: Any, e: Any) -> None:
    """Copy these matrices back; the scale of every state is then 1."""
    prefer_small_code()
    P, S, each, filters, size = p.P, m.states, e.P_each, count(m), m.size
    for i in range(size):
        for j in range(size):
            for w in range(filters):
                P[i, j, w] = each[w, i, j]
        for w in range(filters):
            S[UNIT, i, w] = 1.0
            S[SENSITIVITY, i, w] = 1.0


@merged
def advance(m: Any, p: Any, a: Any, dt: float, alone: bool | None, full: bool | None) -> None:
    """Advance the covariance and the estimates of b by one covariance step, with the sums in `State.rows`.

    Parameters
    ----------
    m, p, a : record
        Of `State`: memory, covariance, inputs.
    dt : float
        Length of the step, s.
    alone : bool, optional
        None for many filters: numba compiles no branch that only one filter takes.
    full : bool, optional
        None where A = I, no state has a slope, fixes no delay and `Layout.further` no entry: numba compiles nothing for
        them.
    """
    size, mixed = m.size, m.ideal == 0
    end = (size + COLUMN_MULTIPLE - 1) // COLUMN_MULTIPLE * COLUMN_MULTIPLE if m.filters == 1 else size
    linearise(m, dt)
    if full is not None and mixed:
        set_sensitivity(m, dt)
    set_coupling(m)
    inputs_by_rows(m, p, a)
    if full is not None and m.further_count > 0:
        add_inputs(m, p, a, 0 * end, 0 * end + NAVIGATION_STATES, 0 * end + 1)
    begin = 0 * end  # no constant, for which numba would compile once more
    first = begin + NAVIGATION_STATES
    while begin < end:
        last = end if m.filters == 1 or first + COLUMNS_AT_ONCE > end else first + COLUMNS_AT_ONCE
        inputs_by_columns(m, p, a, first, last, alone)
        if full is not None and m.further_count > 0:
            add_inputs(m, p, a, first, last if last < size else size, 0 * end)
        if full is not None and mixed:
            calibrate_inputs(m, a, begin, last)
        columns_through_step(m, p, a, begin, last, dt)
        begin, first = last, last
    inputs_by_rows(m, p, a)
    if full is not None and m.further_count > 0:
        add_inputs(m, p, a, 0 * end, 0 * end + NAVIGATION_STATES, 0 * end + 1)
    if full is None:
        add_white(m, a, dt)
    elif mixed:
        add_mixed_white(m, a, dt)
        calibrate_inputs(m, a, 0 * end, 0 * end + NAVIGATION_STATES)
    else:
        add_white(m, a, dt)
    rows_through_step(m, p, a, dt)
    add_process_noise(m, p)
    if full is not None and m.ramps > 0:
        add_slopes(m, p, dt)
