"""The covariance in compiled code, advanced block by block: P ← Φ P Φᵀ + Q.

With Φ = (A  ΓS; 0  D) for the nine navigation states and the rest, D diagonal (slopes of ramps apart) and S,
the answer of the six sensors to the states, with one element a column, a step costs about n² + 250 n
multiplications instead of 2 n³. Six columns more, the response to unit sensor noise, carry Γ along, so that
Γ W Γᵀ comes with the second product. Φ and Q are those of `models.errorstate`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.errorstate import coupling
from models.triples import add, cross, scale, transform
from tuner.navigation.compiled import Layout, Workspace, compiled, unmix

FloatArray = NDArray[np.float64]


@compiled
def set_decay(lay: Layout, dt: float, work: Workspace) -> None:
    """Set decay and driven variance of every state for a step dt."""
    for j in range(lay.size):
        u = lay.rate[j] * dt
        work.decay[j] = np.exp(-u)
        work.driven[j] = lay.drive[j] * dt * (1.0 if u == 0.0 else -np.expm1(-2.0 * u) / (2.0 * u))


@compiled
def advance_column(
    xr: Any, xv: Any, xa: Any, gyro: Any, accel: Any, down: float, blocks: Any, force: Any, dt: float
) -> Any:
    """Advance errors of position, velocity, attitude by a step; `gyro`, `accel` are C δω, C δf, `down` δγ."""
    f_rr, f_vr, f_vv, f_ar, f_av, omega = blocks
    a = add(add(transform(f_ar, xr), transform(f_av, xv)), add(gyro, scale(-1.0, cross(omega, xa))))
    ya = add(xa, scale(dt, a))
    tilt = scale(0.5, add(xa, ya))
    v = add(add(transform(f_vr, xr), transform(f_vv, xv)), add(accel, scale(-1.0, cross(force, tilt))))
    yv = add(xv, scale(dt, (v[0], v[1], v[2] + down)))
    yr = add(xr, scale(dt, add(transform(f_rr, xr), scale(0.5, add(xv, yv)))))
    return yr, yv, ya


@compiled
def advance(
    lay: Layout,
    P: FloatArray,
    pos: Any,
    vel: Any,
    mat: Any,
    true: FloatArray,
    force: Any,
    dt: float,
    work: Workspace,
) -> None:
    """Advance the covariance by one step about its middle: P ← Φ P Φᵀ + Q.

    Parameters
    ----------
    lay, P, work
        Filter, covariance (n, n), workspace with `decay` and `driven` of the step.
    pos, vel, mat : triples, matrix
        Middle of the step.
    true : ndarray, shape (6,)
        Calibrated mean rates and forces in b.
    force : triple
        Mean specific force in n.
    dt : float
        Length, s.
    """
    n = lay.size
    U, T, small = work.answer, work.wide, work.small
    blocks = coupling(pos, vel)
    # What the sensors feel of every column: −A⁻¹ S P, and unit noise.
    U[:] = 0.0
    for s in range(9, n):
        r = lay.row[s]
        if r >= 0:
            c = -1.0 if lay.source[s] < 0 else -true[lay.source[s]]
            for j in range(n):
                U[r, j] += c * P[s, j]
    for r in range(6):
        U[r, n + r] = -1.0
    if not lay.ideal:
        for j in range(n + 6):
            unmix(work.inverse, U, j)
    for j in range(n):
        down = P[lay.gravity, j] if lay.gravity >= 0 else 0.0
        yr, yv, ya = advance_column(
            (P[0, j], P[1, j], P[2, j]),
            (P[3, j], P[4, j], P[5, j]),
            (P[6, j], P[7, j], P[8, j]),
            transform(mat, (U[0, j], U[1, j], U[2, j])),
            transform(mat, (U[3, j], U[4, j], U[5, j])),
            down,
            blocks,
            force,
            dt,
        )
        T[0, j], T[1, j], T[2, j] = yr
        T[3, j], T[4, j], T[5, j] = yv
        T[6, j], T[7, j], T[8, j] = ya
    for j in range(n, n + 6):
        ya = scale(dt, transform(mat, (U[0, j], U[1, j], U[2, j])))
        push = transform(mat, (U[3, j], U[4, j], U[5, j]))
        yv = scale(dt, add(push, scale(-0.5, cross(force, ya))))
        T[0, j], T[1, j], T[2, j] = scale(0.5 * dt, yv)
        T[3, j], T[4, j], T[5, j] = yv
        T[6, j], T[7, j], T[8, j] = ya
    small[:] = 0.0
    for s in range(9, n):
        r = lay.row[s]
        if r >= 0:
            c = -1.0 if lay.source[s] < 0 else -true[lay.source[s]]
            for i in range(9):
                small[i, r] += c * T[i, s]
    for i in range(9):
        for r in range(6):
            small[i, r] -= lay.white[r] / dt * T[i, n + r]
        g = (small[i, 0], small[i, 1], small[i, 2])
        a = (small[i, 3], small[i, 4], small[i, 5])
        if not lay.ideal:
            g, a = _unmixed(work.inverse, g, a)
        yr, yv, ya = advance_column(
            (T[i, 0], T[i, 1], T[i, 2]),
            (T[i, 3], T[i, 4], T[i, 5]),
            (T[i, 6], T[i, 7], T[i, 8]),
            transform(mat, g),
            transform(mat, a),
            T[i, lay.gravity] if lay.gravity >= 0 else 0.0,
            blocks,
            force,
            dt,
        )
        P[i, 0], P[i, 1], P[i, 2] = yr
        P[i, 3], P[i, 4], P[i, 5] = yv
        P[i, 6], P[i, 7], P[i, 8] = ya
    for i in range(9):
        for j in range(i):
            P[i, j] = P[j, i]
        for j in range(9, n):
            y = work.decay[j] * T[i, j]
            if lay.slope[j] >= 0:
                y += dt * T[i, lay.slope[j]]
            P[i, j] = y
            P[j, i] = y
    _advance_rest(lay, P, dt, work)


@compiled
def _unmixed(inverse: FloatArray, g: Any, a: Any) -> Any:
    """Return A⁻¹ (g, a)."""
    low = (
        (inverse[0, 0], inverse[0, 1], inverse[0, 2]),
        (inverse[1, 0], inverse[1, 1], inverse[1, 2]),
        (inverse[2, 0], inverse[2, 1], inverse[2, 2]),
    )
    mixed = (
        (inverse[0, 3], inverse[0, 4], inverse[0, 5]),
        (inverse[1, 3], inverse[1, 4], inverse[1, 5]),
        (inverse[2, 3], inverse[2, 4], inverse[2, 5]),
    )
    high = (
        (inverse[3, 3], inverse[3, 4], inverse[3, 5]),
        (inverse[4, 3], inverse[4, 4], inverse[4, 5]),
        (inverse[5, 3], inverse[5, 4], inverse[5, 5]),
    )
    return add(transform(low, g), transform(mixed, a)), transform(high, a)


@compiled
def _advance_rest(lay: Layout, P: FloatArray, dt: float, work: Workspace) -> None:
    """Advance the covariance of the states that only decay, grow by a slope and are driven."""
    n = lay.size
    for i in range(9, n):
        c = work.decay[i]
        if lay.slope[i] >= 0:
            for j in range(9, n):
                P[i, j] = c * P[i, j] + dt * P[lay.slope[i], j]
        else:
            for j in range(9, n):
                P[i, j] *= c
    for i in range(9, n):
        for j in range(9, n):
            y = work.decay[j] * P[i, j]
            if lay.slope[j] >= 0:
                y += dt * P[i, lay.slope[j]]
            P[i, j] = y
        P[i, i] += work.driven[i]


@compiled
def decay_parameters(lay: Layout, x: FloatArray, dt: float, work: Workspace) -> None:
    """Advance the estimates of the other states by a step."""
    for j in range(9, lay.size):
        x[j] *= work.decay[j]
        if lay.slope[j] >= 0:
            x[j] += dt * x[lay.slope[j]]


@compiled
def summarise(lay: Layout, P: FloatArray, out: FloatArray) -> None:
    """Set the covariance (15, 15) of navigation errors and total biases: M P Mᵀ."""
    n = lay.size
    MP = np.zeros((15, n))
    for s in range(n):
        i = s if s < 9 else 9 + lay.row[s] if lay.row[s] >= 0 and lay.source[s] < 0 else -1
        if i >= 0:
            for j in range(n):
                MP[i, j] += P[s, j]
    out[:] = 0.0
    for s in range(n):
        j = s if s < 9 else 9 + lay.row[s] if lay.row[s] >= 0 and lay.source[s] < 0 else -1
        if j >= 0:
            for i in range(15):
                out[i, j] += MP[i, s]
