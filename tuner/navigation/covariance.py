"""The covariance in compiled code, advanced block by block: P ← Φ P Φᵀ + Q.

With Φ = (A  ΓS; 0  D) for the nine navigation states and the rest, D diagonal (slopes of ramps apart) and S,
the answer of the six sensors to the states, with one element a column::

    T = (A  ΓS) P                       column by column; S P comes first
    P_nn ← T (A  ΓS)ᵀ + Γ W Γᵀ          the same again with the rows of T, those of T Sᵀ + Γ W for S P
    P_nb ← T_b Dᵀ,   P_bb ← D P_bb Dᵀ + Q_bb

Decay is put off: between fixes P is that of states b/c, c ← D c, in which it changes nothing but S ← S D, and
Q_bb ← Q_bb/c². `settle` turns back to b.

Φ and Q are those of `models.errorstate`. The same lines advance one filter, eight columns at a time, or eight
filters, one column at a time (`tuner.navigation.compiled.Work`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.errorstate import coupling
from models.triples import add, cross, scale, transform
from tuner.navigation.compiled import Layout, Memory, Work, compiled

FloatArray = NDArray[np.float64]

PUT_OFF = 100.0
"""Time constants after which decay is put off no longer: numbers stay in range."""


@compiled
def set_decay(memory: Memory, dt: float) -> None:
    """Set decay and driven variance of every state for a step dt."""
    n, filters = memory.rate.shape
    for j in range(n):
        for w in range(filters):
            u = memory.rate[j, w] * dt
            grown = 1.0 if u == 0.0 else -np.expm1(-2.0 * u) / (2.0 * u)
            memory.decay[j, w] = np.exp(-u)
            memory.driven[j, w] = memory.drive[j, w] * dt * grown


@compiled
def _scaled(c: Any, m: Any) -> Any:
    """Return c times a matrix."""
    return scale(c, m[0]), scale(c, m[1]), scale(c, m[2])


@compiled
def _row(m: Any, r: int, s: Any) -> Any:
    """Return row r of a matrix times six numbers."""
    return m[r, 0] * s[0] + m[r, 1] * s[1] + m[r, 2] * s[2] + m[r, 3] * s[3] + m[r, 4] * s[4] + m[r, 5] * s[5]


@compiled
def unmixed(lay: Layout, inverse: Any, s: Any) -> Any:
    """Return A⁻¹ s as rates and forces."""
    if lay.ideal:
        return (s[0], s[1], s[2]), (s[3], s[4], s[5])
    return (
        (_row(inverse, 0, s), _row(inverse, 1, s), _row(inverse, 2, s)),
        (_row(inverse, 3, s), _row(inverse, 4, s), _row(inverse, 5, s)),
    )


@compiled
def _sensed(lay: Layout, r: int, slant: Any, M: Any, c: int) -> Any:
    """Return row r of S times column c of M."""
    s = lay.feed[lay.first[r]]
    y = slant[s] * M[s, c]
    for k in range(lay.first[r] + 1, lay.first[r + 1]):
        s = lay.feed[k]
        y += slant[s] * M[s, c]
    return y


@compiled
def _set_column(M: Any, c: int, r: Any, v: Any, a: Any) -> None:
    """Set the first nine rows of a column to three triples."""
    for k in range(3):
        M[k, c], M[3 + k, c], M[6 + k, c] = r[k], v[k], a[k]


@compiled
def _advance_column(
    lay: Layout, work: Work, M: Any, c: int, six: Any, fall: Any, blocks: Any, turn: Any, half: float
) -> None:
    """Replace a column of nine by A times it, plus Γ times six sensor errors and `fall` downwards."""
    f_rr, f_vr, f_vv, f_ar, f_av, omega, force = blocks
    rate, push = unmixed(lay, work.inverse, six)
    r, v, a = (M[0, c], M[1, c], M[2, c]), (M[3, c], M[4, c], M[5, c]), (M[6, c], M[7, c], M[8, c])
    ya = add(a, add(add(transform(f_ar, r), transform(f_av, v)), add(transform(turn, rate), cross(a, omega))))
    dv = add(transform(f_vr, r), transform(f_vv, v))
    dv = add(dv, add(transform(turn, push), cross(add(a, ya), force)))
    yv = add(v, (dv[0], dv[1], dv[2] + fall))
    yr = add(r, add(transform(f_rr, r), scale(half, add(v, yv))))
    _set_column(M, c, yr, yv, ya)


@compiled
def advance(lay: Layout, work: Work, pos: Any, vel: Any, mat: Any, force: Any, dt: float) -> None:
    """Advance the covariance by one step about its middle: P ← Φ P Φᵀ + Q.

    Parameters
    ----------
    lay, work
        Filter, its arrays; `decay`, `driven` and, where there are scale factors, `true` are those of the step.
    pos, vel, mat : triples, matrix
        Middle of the step.
    force : triple
        Mean specific force in n.
    dt : float
        Length, s.
    """
    f_rr, f_vr, f_vv, f_ar, f_av, omega = coupling(pos, vel)
    blocks = (
        _scaled(dt, f_rr),
        _scaled(dt, f_vr),
        _scaled(dt, f_vv),
        _scaled(dt, f_ar),
        _scaled(dt, f_av),
        scale(dt, omega),
        scale(0.5 * dt, force),
    )
    turn, half, slant, P = _scaled(-dt, mat), 0.5 * dt, work.slant, work.P_c
    if not lay.ideal:
        for s in range(9, lay.size):
            if lay.source[s] >= 0:
                slant[s] = work.shrunk[s] * work.true[lay.source[s]]
    for c in range(P.shape[1]):
        six = (
            _sensed(lay, 0, slant, P, c),
            _sensed(lay, 1, slant, P, c),
            _sensed(lay, 2, slant, P, c),
            _sensed(lay, 3, slant, P, c),
            _sensed(lay, 4, slant, P, c),
            _sensed(lay, 5, slant, P, c),
        )
        fall = dt * P[lay.gravity, c] if lay.gravity >= 0 else 0.0
        _advance_column(lay, work, P, c, six, fall, blocks, turn, half)
    _set_rows(lay, work, turn, blocks[6], dt)
    rows = work.rows_c
    for c in range(rows.shape[1]):
        q = work.sensed_c
        six = (q[0, c], q[1, c], q[2, c], q[3, c], q[4, c], q[5, c])
        _advance_column(lay, work, rows, c, six, q[6, c], blocks, turn, half)
    _advance_rest(lay, work, dt)


@compiled
def _set_rows(lay: Layout, work: Work, turn: Any, force: Any, dt: float) -> None:
    """Set T as columns, and T Sᵀ + Γ W with dt times its column of gravity below."""
    unit, gamma, sensed, T = work.inverse_c, work.gamma_c, work.sensed, work.P
    for c in range(unit.shape[1]):
        tilt = transform(turn, (unit[0, c], unit[1, c], unit[2, c]))
        push = add(transform(turn, (unit[3, c], unit[4, c], unit[5, c])), cross(tilt, force))
        _set_column(gamma, c, scale(0.5 * dt, push), push, tilt)
    if work.apart:
        for i in range(9):
            for j in range(9):
                work.rows[j, i] = T[i, j]
    for r in range(6):
        density = work.white[r] * (1.0 / dt)
        for i in range(9):
            sensed[r, i] = density * work.gamma[i, r]
        for k in range(lay.first[r], lay.first[r + 1]):
            s = lay.feed[k]
            for i in range(9):
                sensed[r, i] += work.slant[s] * T[i, s]
    if lay.gravity >= 0:
        for i in range(9):
            sensed[6, i] = dt * T[i, lay.gravity]


@compiled
def _advance_rest(lay: Layout, work: Work, dt: float) -> None:
    """Let the other states decay, grow by a slope and be driven; make both sides of P the same."""
    n, P, shrunk = lay.size, work.P, work.shrunk
    for j in range(9, n):
        shrunk[j] *= work.decay[j]
        work.slant[j] *= work.decay[j]
        P[j, j] += work.driven[j] / (shrunk[j] * shrunk[j])
        if lay.slope[j] >= 0:
            c = dt / shrunk[j]
            for i in range(n):
                P[i, j] += c * P[i, lay.slope[j]]
            for i in range(9, n):
                P[j, i] += c * P[lay.slope[j], i]
    for i in range(9):
        for j in range(i, 9):
            if work.apart:
                P[i, j] = work.rows[i, j]
            P[j, i] = P[i, j]  # rounding must not part the two sides
        for j in range(9, n):
            P[j, i] = P[i, j]


@compiled
def settle(lay: Layout, work: Work) -> None:
    """Let P be that of the states themselves."""
    for i in range(lay.size):
        for c in range(work.P_c.shape[1]):
            work.P_c[i, c] *= work.shrunk[i] * work.shrunk_c[c]
    for j in range(9, lay.size):
        work.shrunk[j] = work.slant[j] = 1.0


@compiled
def decay_parameters(lay: Layout, work: Work, dt: float) -> None:
    """Advance the estimates of the other states by a step."""
    x = work.x
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
