"""Fixes and constraints in compiled code: each filter is updated by itself, or all with the gain of the first."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from models.arrays import FloatArray, IntArray
from models.filter_states.declaration import NAVIGATION_STATES
from tuner.navigation.engine.compilation import (
    block,
    merged,
    prefer_small_code,
    put,
    put_quaternion,
    quaternion,
    vector,
)
from tuner.navigation.engine.layout import (
    GATE_INDEX,
    KIND_COLUMN,
    PATIENCE_INDEX,
    TOTAL,
    Layout,
)
from tuner.navigation.engine.measurement_models import constraint_model, correct, fix_model
from tuner.navigation.engine.mechanisation import invert_calibration
from tuner.navigation.engine.propagation import gather, scatter
from tuner.navigation.engine.state import (
    ATTITUDE_ROW,
    CALIBRATED,
    CALIBRATED_ROW,
    CORRECTION,
    COVARIANCE_ROWS,
    ESTIMATE,
    ESTIMATES,
    INNOVATION,
    INNOVATION_ROWS,
    INVERSE_ROW,
    JACOBIAN_ROWS,
    LIMITS,
    POSITION_ROW,
    REFUSED_ROW,
    SENSOR_INVERSE_ROWS,
    UNREACHED_LIMIT,
    VELOCITY_ROW,
)
from tuner.navigation.engine.update import apply_gain, gain, predict_innovation, update

AFTER, AVAILABLE, WITHHELD, TRUSTED, SLOT = range(5)
"""Columns of `FixBatch.flags`."""


class FixBatch(NamedTuple):
    """Fixes and constraints of w filters."""

    t: FloatArray  # (k,), s
    values: FloatArray  # (w, k, 6), latitude, longitude, height, velocity; longer with constraints
    sd: FloatArray  # (w, k, 6)
    flags: IntArray  # (k, 5): steps done; 1 position only, 2 with velocity, 3 a constraint; whether withheld, and
    # trusted; row of the output, −1 for none


class Output(NamedTuple):
    """Results at e fixes of w filters; where gains are shared P and S alone."""

    values: FloatArray  # (w, e, 16 + n), position, velocity, quaternion; innovation; other states
    P: FloatArray  # (w, e, d, d), of the errors of `Layout.total`
    S: FloatArray  # (w, e, 6, 6)
    use: IntArray  # (w, e, 2)
    aided: FloatArray  # (n, n), of the first filter after the last fix used, where gains are shared


def new_output(w: int, e: int, lay: Layout) -> Output:
    """Return empty results at e fixes of w filters."""
    n, d = lay.size, int(lay.total.max()) + 1
    return Output(
        np.zeros((w, e, 16 + n)),
        np.zeros((w, e, d, d)),
        np.zeros((w, e, 6, 6)),
        np.zeros((w, e, 2), dtype=np.int64),
        np.zeros((n, n)),
    )


@merged
def model_fix(m: Any, w: int, alone: bool | None, full: bool | None) -> None:
    """Set z and H of the measurement of filter w in the scratch; only a filter that is alone has constraints.

    A component that is NaN says nothing: a row of zeros, of any sd.
    """
    N, T = m.rows, m.scratch
    for j in range(m.size):
        T[ESTIMATES, j] = m.states[ESTIMATE, j, w]
    for r in range(6):
        T[CALIBRATED, r] = N[CALIBRATED_ROW + r, w]
        for c in range(6):
            T[SENSOR_INVERSE_ROWS + r, c] = N[INVERSE_ROW + 6 * r + c, w]
    pos, vel, quat = vector(N, POSITION_ROW, w), vector(N, VELOCITY_ROW, w), quaternion(N, ATTITUDE_ROW, w)
    if alone is None:
        fix_model(m, pos, vel, quat, full)
    elif m.fix[KIND_COLUMN] > 0.0:
        constraint_model(m, pos, vel, quat)
    else:
        fix_model(m, pos, vel, quat, full)
    for c in range(6):
        if np.isnan(m.fix[c]):
            T[INNOVATION, c] = 0.0
            for j in range(m.size):
                T[JACOBIAN_ROWS + c, j] = 0.0


@block
def summarise(m: Any, e: Any, w: int, out: FloatArray, row: int) -> None:
    """Set the covariance of the errors of filter w: navigation, total biases, further states."""
    prefer_small_code()
    P, total, d = e.P_each, m.table, out.shape[2]
    for i in range(d):
        for j in range(d):
            out[w, row, i, j] = 0.0
    for s in range(m.size):
        i = total[TOTAL, s]
        if i >= 0:
            for c in range(NAVIGATION_STATES):
                out[w, row, i, c] += P[w, s, c]
            for c in range(NAVIGATION_STATES, m.size):
                if total[TOTAL, c] >= 0:
                    out[w, row, i, total[TOTAL, c]] += P[w, s, c]


@merged
def share_gain(
    m: Any, e: Any, available: int, withheld: bool, row: int, P: FloatArray, S: FloatArray, aided: FloatArray
) -> None:
    """Use a fix, of which z and H are set, with the gain of the first filter, for the covariances of all of them.

    Parameters
    ----------
    m : record
        See `state`.
    available, withheld, row : int, bool, int
        Of `FixBatch.flags`; the row is the slot.
    P, S, aided : ndarray
        Of `Output`.
    """
    size, n = 3 * available, m.size
    gain(m, e, size)
    for w in range(m.filters):
        predict_innovation(m, e, w, size, INNOVATION_ROWS)
        if row >= 0:
            for a in range(size):
                for b in range(size):
                    S[w, row, a, b] = m.scratch[COVARIANCE_ROWS + a, b]
        if not withheld:
            apply_gain(m, e, w, size)
            if w == 0:
                for a in range(n):
                    for b in range(n):
                        aided[a, b] = e.P_each[0, a, b]
        if row >= 0:
            summarise(m, e, w, P, row)


@merged
def use_fix(m: Any, e: Any, w: int, t: float, available: int, withheld: bool, trusted: bool) -> None:
    """Compare a fix, of which z and H are set, with filter w, and use it.

    Parameters
    ----------
    m : record
        See `state`.
    w : int
        The filter.
    t, available, withheld, trusted
        Of the fix.
    """
    N, T, use = m.rows, m.scratch, m.use
    for g in range(2):
        gated = not trusted and t - N[REFUSED_ROW + g, w] < m.constants[PATIENCE_INDEX]
        T[LIMITS, g] = m.constants[GATE_INDEX] if gated else UNREACHED_LIMIT
    if update(m, e, w, available, withheld):
        pos, vel, quat = correct(
            vector(N, POSITION_ROW, w), vector(N, VELOCITY_ROW, w), quaternion(N, ATTITUDE_ROW, w), T
        )
        for j in range(NAVIGATION_STATES, m.size):
            m.states[ESTIMATE, j, w] += T[CORRECTION, j]
        put(N, POSITION_ROW, w, pos)
        put(N, VELOCITY_ROW, w, vel)
        put_quaternion(N, ATTITUDE_ROW, w, quat)
    for g in range(2):
        if use[g] == 2:
            if N[REFUSED_ROW + g, w] > t:
                N[REFUSED_ROW + g, w] = t
        elif use[g] != 0:
            N[REFUSED_ROW + g, w] = UNREACHED_LIMIT


@block
def store(m: Any, w: int, row: int, available: int, values: FloatArray, S: FloatArray, use: IntArray) -> None:
    """Store the state after a fix, its innovation and its use: `Output.values`, `S` and `use`."""
    prefer_small_code()
    T = m.scratch
    for c in range(10):
        values[w, row, c] = m.rows[c, w]
    for c in range(6):
        values[w, row, 10 + c] = T[INNOVATION, c] if c < 3 * available else 0.0
        for b in range(6):
            S[w, row, c, b] = T[COVARIANCE_ROWS + c, b]
    for j in range(m.size):
        values[w, row, 16 + j] = m.states[ESTIMATE, j, w]
    use[w, row, 0], use[w, row, 1] = m.use[0], m.use[1]


@block
def use_fixes(
    m: Any,
    p: Any,
    e: Any,
    fixes: FixBatch,
    i: int,
    shared: bool,
    output: Output,
    alone: bool | None,
    full: bool | None,
) -> int:
    """Use the fixes and constraints of one instant from the i-th on; return the index of the first of a later one.

    Parameters
    ----------
    m, p, e : record
        Of `State`: memory, covariance, each.
    fixes : FixBatch
        All fixes, in the order of time.
    i : int
        The first of this instant.
    shared : bool
        Whether all filters use the gain of the first.
    output : Output
        Results, stored in the rows of the fixes.
    alone, full : bool, optional
        As of `propagation.advance`.
    """
    prefer_small_code()
    flags, sd, given, t = fixes.flags, fixes.sd, fixes.values, fixes.t
    values, P, S, use, aided = output.values, output.P, output.S, output.use, output.aided
    gather(m, p, e)
    instant = flags[i, AFTER]
    while i < len(flags) and flags[i, AFTER] == instant:
        row, available, withheld = flags[i, SLOT], flags[i, AVAILABLE], flags[i, WITHHELD] != 0
        for w in range(m.filters):
            for c in range(6):
                m.sd[w, c] = sd[w, i, c]
        for w in range(1 if shared else m.filters):
            for c in range(given.shape[2]):
                m.fix[c] = given[w, i, c]
            model_fix(m, w, alone, full)
            if shared:
                share_gain(m, e, available, withheld, row, P, S, aided)
            else:
                use_fix(m, e, w, t[i], available, withheld, flags[i, TRUSTED] != 0)
                store(m, w, row, available, values, S, use)
                summarise(m, e, w, P, row)
        if (
            full is not None and m.ideal == 0
        ):  # the next measurement of this instant needs the new calibration
            invert_calibration(m)
        i += 1
    scatter(m, p, e)
    return i
