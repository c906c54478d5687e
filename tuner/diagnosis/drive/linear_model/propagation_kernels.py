"""Propagation of errors over a covariance step, in compiled code: Φ, process noise and effects of unknown constants.

Nine navigation states x and six sensors s, with the matrices of `models.error_state`::

    x⁺ = A x + Γ (S b + w)        b⁺ = D b + noise        Γ: answer to a constant sensor error, with −C A⁻¹ in it

S says which sensor measures which state b, D is diagonal but for slopes. So of Φ, and of every noise Q, only nine rows
are full: they are the rows of one matrix W, with the columns

    Φ (n)  |  Q between navigation and other states (n − 9)  |  Q of navigation, four groups (4 × 9)  |  B (p)

and one product A W does most of a step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from models.error_state import coupling
from tuner.navigation.engine.layout import Layout

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile a kernel when it is first called; nothing is inlined by force, which keeps that short."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    return cast(Function, numba.njit(**options)(function))


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


class PropagationState(NamedTuple):
    """Errors propagated since the fix before, n states: Φ, noise and effects of constants, with scratch arrays.

    Attributes
    ----------
    wide, other : ndarray, shape (9, w)
        W, and room for a product with it.
    own, tie : ndarray, shape (n,)
        Φ of a state by itself, and by its slope.
    variance : ndarray, shape (n,)
        Noise of a state beyond the first nine.
    half, done : ndarray, shape (9, 36)
        Room for half a product with the noise of navigation, and all of it.
    A : ndarray, shape (9, 9)
        A of the last step.
    G : ndarray, shape (9, 6)
        Γ of the last step.
    sensor_cross : ndarray, shape (9, 6)
        Covariance of navigation and the states that disturb each sensor.
    step : ndarray, shape (1,)
        Length of a step, s, that `decay` and `added` are for.
    decay, added : ndarray, shape (n,)
        Factor of a state over it, and the variance that it adds.
    acts : ndarray of int, shape (m, 3)
        Constant, sensor that it disturbs and what it multiplies, of every place of `Columns.mix` that is not 0.
    size : ndarray, shape (m,)
        What stands there.
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
    decay: FloatArray
    added: FloatArray
    acts: IntArray
    size: FloatArray


@compiled
def new_state(n: int, columns: Columns) -> PropagationState:
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
    return PropagationState(
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
        np.ones(n),
        np.zeros(n),
        acts[:count].copy(),
        size[:count].copy(),
    )


@compiled
def begin(state: PropagationState) -> None:
    """Reset the propagation at a fix."""
    state.wide[:] = 0.0
    state.own[:] = 1.0
    state.tie[:] = 0.0
    state.variance[:] = 0.0
    for i in range(9):
        state.wide[i, i] = 1.0


@compiled
def set_matrices(
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
    for i in range(9):
        for j in range(6):
            y = 0.0
            for m in range(6):
                y -= E[i, m] * inverse[m, j]
            G[i, j] = y


@compiled
def _product(A: FloatArray, W: FloatArray, out: FloatArray) -> None:
    """Set out to A W, both (9, w); in two parts, since loops over more arrays are not made of vectors."""
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


@compiled
def _added_variance(drive: float, rate: float, dt: float) -> float:
    """Return the variance that a step adds to a state."""
    u = 2.0 * rate * dt
    return float(drive * dt * (1.0 if u == 0.0 else -np.expm1(-u) / u))


@compiled
def advance(
    lay: Layout, columns: Columns, state: PropagationState, true: FloatArray, dt: float, x: FloatArray
) -> None:
    """Advance Φ, the noise, B and the other estimates by a covariance step."""
    n, A, G, W = lay.size, state.A, state.G, state.wide
    cross, noise, pull = n - 9, 2 * n - 9, 2 * n + 27
    _product(A, W, state.other)
    W[:] = state.other
    for i in range(9):
        for g in range(4):
            for j in range(9):
                state.half[j, 9 * g + i] = W[i, noise + 9 * g + j]
    _product(A, state.half, state.done)
    for i in range(9):
        for j in range(36):
            W[i, noise + j] = state.done[i, j]
    for s in range(6):
        _disturb(W, noise + 9 * (s // 3), G, s, lay.white[s] / dt)
    state.sensor_cross[:] = 0.0
    for j in range(9, n):
        r = lay.row[j]
        if r < 0:
            continue
        c = 1.0 if lay.source[j] < 0 else true[lay.source[j]]
        own, tied, share = c * state.own[j], c * state.tie[j], c * state.variance[j]
        slope = lay.slope[j]
        for i in range(9):
            state.sensor_cross[i, r] += c * W[i, cross + j] + 0.5 * c * share * G[i, r]
            W[i, j] += own * G[i, r]
            W[i, cross + j] += share * G[i, r]
            if slope >= 0:
                W[i, slope] += tied * G[i, r]
    for r in range(6):
        at = noise + 18 + 9 * (r // 3)
        for i in range(9):
            for j in range(9):
                W[i, at + j] += state.sensor_cross[i, r] * G[j, r] + state.sensor_cross[j, r] * G[i, r]
    for e in range(len(state.size)):
        q, s = state.acts[e, 0], state.acts[e, 1]
        error = state.size[e] * true[state.acts[e, 2]]
        for i in range(9):
            W[i, pull + q] += error * G[i, s]
    for q in range(len(columns.down)):
        W[5, pull + q] += dt * columns.down[q]
        W[2, pull + q] += 0.5 * dt * dt * columns.down[q]
    if lay.gravity >= 0:
        W[5, lay.gravity] += dt
        W[2, lay.gravity] += 0.5 * dt * dt
    if dt != state.step[0]:
        state.step[0] = dt
        for j in range(9, n):
            state.decay[j] = np.exp(-lay.rate[j] * dt)
            state.added[j] = _added_variance(lay.process_noise[j], lay.rate[j], dt)
    for j in range(9, n):
        decay = state.decay[j]
        if lay.process_noise[j] > 0.0:
            for i in range(9):
                W[i, cross + j] *= decay
            state.variance[j] = decay * decay * state.variance[j] + state.added[j]
        slope = lay.slope[j]
        if slope >= 0:
            state.tie[j] = decay * state.tie[j] + dt * state.own[slope]
            x[j] = decay * x[j] + dt * x[slope]
        else:
            x[j] *= decay
        state.own[j] *= decay


@compiled
def _disturb(W: FloatArray, at: int, G: FloatArray, s: int, density: float) -> None:
    """Add the white noise of sensor s to a block of W."""
    for i in range(9):
        for j in range(9):
            W[i, at + j] += density * G[i, s] * G[j, s]
