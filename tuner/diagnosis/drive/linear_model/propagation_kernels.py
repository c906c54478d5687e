"""Accumulation of Φ, process noise and the effect of constants over covariance steps, in compiled code.

Nine navigation states x and six sensors s, with Φ_nn and Γ of the engine's step
(`tuner.navigation.engine.transition`)::

    x⁺ = A x + Γ (S b + w)        b⁺ = D b + noise        Γ: effect of a constant sensor error, with −C A⁻¹ in it

S says which sensor measures which state b, D is diagonal but for slopes. So of Φ, and of every noise Q, only nine rows
are full; they are the rows of one matrix W with the columns

    Φ (n)  |  Q between navigation and other states (n − 9)  |  Q of navigation, four groups (4 × 9)  |  B (p)

and one product A W does most of a step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from models.array_copies import copy_matrix
from models.arrays import FloatArray, IntArray
from tuner.navigation.engine.compilation import block
from tuner.navigation.engine.layout import Layout
from tuner.navigation.engine.sensor_inputs import calibrate_inputs
from tuner.navigation.engine.state import CALIBRATED_ROW, DECAY, ESTIMATE, PROCESS_VARIANCE, WHITE_ROW
from tuner.navigation.engine.transition import columns_through_step


class Columns(NamedTuple):
    """Effect of candidate constants on measured rates and forces.

    Attributes
    ----------
    mix : ndarray, shape (p, 6, 6)
        Error of the six sensors by one unit of each constant: mix (ω, f), true rates and forces.
    down : ndarray, shape (p,)
        Acceleration down by one unit, m/s².
    """

    mix: FloatArray
    down: FloatArray


class AccumulatedErrors(NamedTuple):
    """Errors propagated since the fix before, n states: Φ, noise and effects of constants, with scratch arrays.

    Attributes
    ----------
    wide, other : ndarray, shape (9, w)
        W, and room for a product with it.
    own, tie : ndarray, shape (n,)
        Φ of a state by itself, and by its slope.
    variance : ndarray, shape (n,)
        Process noise of a state beyond the first nine.
    half, done : ndarray, shape (9, 36)
        Room for half a product with the noise of navigation, and all of it.
    A : ndarray, shape (9, 9)
        Φ_nn of the last step.
    G : ndarray, shape (9, 6)
        Γ of the last step.
    sensor_cross : ndarray, shape (9, 6)
        Covariance of navigation and the states that disturb each sensor.
    step : ndarray, shape (1,)
        Length of a step, s, for which decay and process noise of the states are set.
    acts : ndarray of int, shape (m, 3)
        Constant, sensor that it disturbs and what it multiplies, of every element of `Columns.mix` that is not 0.
    size : ndarray, shape (m,)
        These elements.
    """

    wide: FloatArray
    other: FloatArray
    own: FloatArray
    tie: FloatArray
    variance: FloatArray
    half: FloatArray
    done: FloatArray
    A: FloatArray
    G: FloatArray
    sensor_cross: FloatArray
    step: FloatArray
    acts: IntArray
    size: FloatArray


@block
def new_errors(n: int, columns: Columns) -> AccumulatedErrors:
    """Return the arrays of a propagation of n states."""
    width, count = 2 * n + 27 + len(columns.down), 0
    acts, size = np.zeros((columns.mix.size, 3), dtype=np.int64), np.zeros(columns.mix.size)
    for q in range(len(columns.down)):
        for r in range(6):
            for c in range(6):
                if columns.mix[q, r, c] != 0.0:
                    acts[count, 0], acts[count, 1], acts[count, 2] = q, r, c
                    size[count] = columns.mix[q, r, c]
                    count += 1
    errors = AccumulatedErrors(
        np.zeros((9, width)),
        np.zeros((9, width)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros((9, 36)),
        np.zeros((9, 36)),
        np.zeros((9, 9)),
        np.zeros((9, 6)),
        np.zeros((9, 6)),
        np.zeros(1),
        acts[:count].copy(),
        size[:count].copy(),
    )
    restart(errors)
    return errors


@block
def restart(errors: AccumulatedErrors) -> None:
    """Reset the propagation at a fix."""
    errors.wide[:] = 0.0
    errors.own[:] = 1.0
    errors.tie[:] = 0.0
    errors.variance[:] = 0.0
    for i in range(9):
        errors.wide[i, i] = 1.0


@block
def set_step(
    m: Any,
    p: Any,
    a: Any,
    dt: float,
    errors: AccumulatedErrors,
) -> None:
    """Set Φ_nn and Γ of a step: what the engine's step makes of a unit matrix, and of unit errors of the sensors.

    `m`, `p` and `a` are the records of `State`; the last two are overwritten.
    """
    matrix, inputs = p.P, a.inputs
    matrix[:9, :16] = 0.0
    inputs[:, :16] = 0.0
    for i in range(9):
        matrix[i, i, 0] = 1.0
    for r in range(6):
        inputs[r, 9 + r, 0] = 1.0
    if m.ideal == 0:
        calibrate_inputs(m, a, 0, 16)
    columns_through_step(m, p, a, 0, 16, dt)
    for i in range(9):
        for j in range(9):
            errors.A[i, j] = matrix[i, j, 0]
        for r in range(6):
            errors.G[i, r] = matrix[i, 9 + r, 0]


@block
def _product(A: FloatArray, W: FloatArray, out: FloatArray) -> None:
    """Set out to A W, both (9, w); in two parts, since loops over more arrays are not vectorised."""
    for i in range(9):
        a, b, c, d, e = A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4]
        to = out[i]
        w0, w1, w2, w3, w4 = W[0], W[1], W[2], W[3], W[4]
        for j in range(W.shape[1]):
            to[j] = a * w0[j] + b * w1[j] + c * w2[j] + d * w3[j] + e * w4[j]
        a, b, c, d = A[i, 5], A[i, 6], A[i, 7], A[i, 8]
        w5, w6, w7, w8 = W[5], W[6], W[7], W[8]
        for j in range(W.shape[1]):
            to[j] += a * w5[j] + b * w6[j] + c * w7[j] + d * w8[j]


@block
def accumulate(lay: Layout, columns: Columns, errors: AccumulatedErrors, m: Any, dt: float) -> None:
    """Add a covariance step to Φ, the process noise and B, and let the estimates of the other states decay.

    `m` is the first record of `State`, with the step linearised and its decay set.
    """
    array, states = m.rows, m.states
    n, A, G, W = lay.size, errors.A, errors.G, errors.wide
    cross, noise, constants = n - 9, 2 * n - 9, 2 * n + 27
    _product(A, W, errors.other)
    copy_matrix(W, errors.other)
    for i in range(9):
        for g in range(4):
            for j in range(9):
                errors.half[j, 9 * g + i] = W[i, noise + 9 * g + j]
    _product(A, errors.half, errors.done)
    for i in range(9):
        for j in range(36):
            W[i, noise + j] = errors.done[i, j]
    for s in range(6):
        _add_white(W, noise + 9 * (s // 3), G, s, array[WHITE_ROW + s, 0] / dt)
    errors.sensor_cross[:] = 0.0
    for j in range(9, n):
        r = lay.row[j]
        if r < 0:
            continue
        c = 1.0 if lay.source[j] < 0 else array[CALIBRATED_ROW + lay.source[j], 0]
        own, tied, share = c * errors.own[j], c * errors.tie[j], c * errors.variance[j]
        slope = lay.slope[j]
        for i in range(9):
            errors.sensor_cross[i, r] += c * W[i, cross + j] + 0.5 * c * share * G[i, r]
            W[i, j] += own * G[i, r]
            W[i, cross + j] += share * G[i, r]
            if slope >= 0:
                W[i, slope] += tied * G[i, r]
    for r in range(6):
        at = noise + 18 + 9 * (r // 3)
        for i in range(9):
            for j in range(9):
                W[i, at + j] += errors.sensor_cross[i, r] * G[j, r] + errors.sensor_cross[j, r] * G[i, r]
    for e in range(len(errors.size)):
        q, s = errors.acts[e, 0], errors.acts[e, 1]
        error = errors.size[e] * array[CALIBRATED_ROW + errors.acts[e, 2], 0]
        for i in range(9):
            W[i, constants + q] += error * G[i, s]
    for q in range(len(columns.down)):
        W[5, constants + q] += dt * columns.down[q]
        W[2, constants + q] += 0.5 * dt * dt * columns.down[q]
    if lay.gravity >= 0:
        W[5, lay.gravity] += dt
        W[2, lay.gravity] += 0.5 * dt * dt
    for j in range(9, n):
        decay = states[DECAY, j, 0]
        if lay.process_noise[j] > 0.0:
            for i in range(9):
                W[i, cross + j] *= decay
            errors.variance[j] = decay * decay * errors.variance[j] + states[PROCESS_VARIANCE, j, 0]
        slope = lay.slope[j]
        if slope >= 0:
            errors.tie[j] = decay * errors.tie[j] + dt * errors.own[slope]
            states[ESTIMATE, j, 0] = decay * states[ESTIMATE, j, 0] + dt * states[ESTIMATE, slope, 0]
        else:
            states[ESTIMATE, j, 0] *= decay
        errors.own[j] *= decay


@block
def _add_white(W: FloatArray, at: int, G: FloatArray, s: int, density: float) -> None:
    """Add the white noise of sensor s to a block of W."""
    for i in range(9):
        for j in range(9):
            W[i, at + j] += density * G[i, s] * G[j, s]
