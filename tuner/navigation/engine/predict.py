# mypy: disable-error-code="call-arg"
"""The covariance in compiled code, advanced block by block: P ← Φ P Φᵀ + Q.

With Φ = (A  ΓS; 0  D) for the nine navigation states and the rest, D diagonal (slopes of ramps apart) and S,
the answer of the six sensors to the states, with one element a column::

    T = (A  ΓS) P                       column by column; S P comes first
    P_bn ← T_bᵀ                         turned over
    P_nn ← (A  ΓS) Tᵀ + Γ W Γᵀ          the same again with the columns of Tᵀ; S Tᵀ + W Γᵀ for S P;
                                        of eight filters the blocks on one side
    P_nb ← T_b Dᵀ,   P_bb ← D P_bb Dᵀ + Q_bb

Of eight filters P_bn is left as it was until `settle`: columns of P_bn and P_bb are read as rows.

Decay is put off: between fixes P is that of states b/c, c ← D c, in which it changes nothing but S ← S D, and
Q_bb ← Q_bb/c². `settle` turns back to b.

Φ and Q are those of `models.error_state`. The same lines advance one filter, eight columns at a time, or eight
filters, one column at a time (`tuner.navigation.engine.workspace.Work`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.error_state import coupling
from models.vector3 import add, cross, scale, transform
from tuner.navigation.engine.numba_pipeline import called, compiled
from tuner.navigation.engine.predict_column import (
    Step,
    all_sensed,
    column_of,
    keep,
    kept,
    moved,
    pushed,
    set_triple,
    tilted,
    unmixed,
)
from tuner.navigation.engine.simd import WIDTH
from tuner.navigation.engine.tracing import straight, turned_over
from tuner.navigation.engine.types import Layout
from tuner.navigation.engine.workspace import Memory, Work

FloatArray = NDArray[np.float64]

PUT_OFF = 100.0
"""Time constants after which decay is put off no longer: numbers stay in range."""


@called
def set_decay(memory: Memory, dt: float) -> None:
    """Set decay, growth and driven variance of every state for a step dt."""
    n, filters = memory.rate.shape
    for j in range(n):
        for w in range(filters):
            u = memory.rate[j, w] * dt
            grown = 1.0 if u == 0.0 else -np.expm1(-2.0 * u) / (2.0 * u)
            memory.decay[j, w] = np.exp(-u)
            memory.growth[j, w] = np.exp(2.0 * u)
            memory.driven[j, w] = memory.drive[j, w] * dt * grown


@straight
def _scaled(c: Any, m: Any) -> Any:
    """Return c times a matrix."""
    return scale(c, m[0]), scale(c, m[1]), scale(c, m[2])


@straight
def turned(M: Any, c: int) -> Any:
    """Return the first eight rows of a column of lanes turned over."""
    return turned_over((M[0, c], M[1, c], M[2, c], M[3, c], M[4, c], M[5, c], M[6, c], M[7, c]))


@straight
def set_block(M: Any, i: int, rows: Any) -> None:
    """Set eight rows of the first column of lanes from row i on."""
    M[i, 0], M[i + 1, 0], M[i + 2, 0], M[i + 3, 0] = rows[0], rows[1], rows[2], rows[3]
    M[i + 4, 0], M[i + 5, 0], M[i + 6, 0], M[i + 7, 0] = rows[4], rows[5], rows[6], rows[7]


@straight
def _with_white(work: Work, dt: float, six: Any, noise: Any, c: int) -> Any:
    """Return six sensor errors plus W/dt times column c of Γᵀ."""
    w, f = work.white, 1.0 / dt
    return (
        six[0] + f * w[0] * noise[0, c],
        six[1] + f * w[1] * noise[1, c],
        six[2] + f * w[2] * noise[2, c],
        six[3] + f * w[3] * noise[3, c],
        six[4] + f * w[4] * noise[4, c],
        six[5] + f * w[5] * noise[5, c],
    )


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
    turn, push = _scaled(-dt, mat), scale(0.5 * dt, force)
    step = Step(
        _scaled(dt, f_rr),
        _scaled(dt, f_vr),
        _scaled(dt, f_vv),
        _scaled(dt, f_ar),
        _scaled(dt, f_av),
        scale(dt, omega),
        push,
        turn,
        0.5 * dt,
    )
    keep(step, work.step)
    slant, P, rows, over, noise = work.slant, work.P_c, work.rows_c, work.over_c, work.noise_c
    if not lay.ideal:
        for s in range(9, lay.size):
            if lay.source[s] >= 0:
                slant[s] = work.shrunk[s] * work.true[lay.source[s]]
    _set_noise(work, turn, push, dt)
    for c in range(P.shape[1]):
        fall = dt * over[lay.gravity, c] if lay.gravity >= 0 else 0.0
        now = kept(step, work.step)
        column, (rate, force) = column_of(P, c), unmixed(lay, work.inverse, all_sensed(lay, slant, over, c))
        a = tilted(column, rate, now)
        v = pushed(column, a, force, fall, now)
        set_triple(P, c, 0, moved(column, v, now))
        set_triple(P, c, 3, v)
        set_triple(P, c, 6, a)
    if work.apart:
        _turn_over(lay, work)
    for c in range(rows.shape[1]):
        now = kept(step, work.step)
        six = _with_white(work, dt, all_sensed(lay, slant, over, c), noise, c)
        column, (rate, force) = column_of(rows, c), unmixed(lay, work.inverse, six)
        a = tilted(column, rate, now)
        if work.apart or c < 6:  # elsewhere the other side of P_nn says the same
            fall = dt * over[lay.gravity, c] if lay.gravity >= 0 else 0.0
            v = pushed(column, a, force, fall, now)
            if work.apart or c < 3:
                set_triple(over, c, 0, moved(column, v, now))
            set_triple(over, c, 3, v)
        set_triple(over, c, 6, a)
    if work.apart:
        _set_ninth(lay, work, dt, step)
    else:
        for s in range(3, 9):
            for i in range(s - s % 3):
                work.P[s, i] = work.P[i, s]
    _advance_rest(lay, work, dt)


@compiled
def _set_noise(work: Work, turn: Any, force: Any, dt: float) -> None:
    """Set Γ, and for one filter Γᵀ of all rows but the last, too."""
    unit, gamma = work.inverse_c, work.gamma_c
    for c in range(unit.shape[1]):
        tilt = transform(turn, (unit[0, c], unit[1, c], unit[2, c]))
        push = add(transform(turn, (unit[3, c], unit[4, c], unit[5, c])), cross(tilt, force))
        set_triple(gamma, c, 0, scale(0.5 * dt, push))
        set_triple(gamma, c, 3, push)
        set_triple(gamma, c, 6, tilt)
    if work.apart:
        set_block(work.noise_c, 0, turned(gamma, 0))


@compiled
def _turn_over(lay: Layout, work: Work) -> None:
    """Turn T of one filter over: columns of the nine into `rows`, the others into the rows of P below them."""
    P, lanes, rows = work.P, work.P_c, work.rows_c
    ninth = lanes[8, 0]
    set_block(rows, 0, turned(lanes, 0))
    for c in range(1, lanes.shape[1]):
        set_block(lanes, WIDTH * c, turned(lanes, c))
    rows[8, 0], lanes[8, 0] = lanes[8, 0], ninth
    for s in range(9, lay.size):
        P[s, 8] = P[8, s]
    for i in range(9):
        work.ninth[i, 0] = P[8, i]


@compiled
def _set_ninth(lay: Layout, work: Work, dt: float, step: Any) -> None:
    """Set the ninth column of P_nn of one filter: what is not in its row is one number."""
    P = work.P
    six = _with_white(work, dt, all_sensed(lay, work.slant, P, 8), work.gamma.T, 8)
    rate, _ = unmixed(lay, work.inverse, six)
    a = tilted(column_of(work.ninth, 0), rate, step)
    for i in range(WIDTH):
        P[i, 8] = P[8, i]
    P[8, 8] = a[2]


@straight
def _shrink(work: Work, c: int) -> None:
    """Let a column of other states decay."""
    shrunk, slant, grown = work.shrunk_c, work.slant_c, work.grown_c
    shrunk[c] = shrunk[c] * work.decay_c[c]
    slant[c] = slant[c] * work.decay_c[c]
    grown[c] = grown[c] * work.growth_c[c]


@straight
def _drive(work: Work, j: int) -> None:
    """Drive a state."""
    work.P[j, j] = work.P[j, j] + work.driven[j] * work.grown[j]


@compiled
def _advance_rest(lay: Layout, work: Work, dt: float) -> None:
    """Let the other states decay, grow by a slope and be driven."""
    P = work.P
    for c in range(9 // WIDTH if work.apart else 9, work.decay_c.shape[0]):
        _shrink(work, c)
    for j in range(9, lay.size):
        _drive(work, j)
    for j in lay.ramps:
        c = dt / work.shrunk[j]
        for i in range(lay.size):
            P[i, j] += c * P[i, lay.slope[j]]
        for i in range(9, lay.size):
            P[j, i] += c * P[lay.slope[j], i]
        for i in range(9):
            P[j, i] = P[i, j]


@called
def settle(lay: Layout, work: Work) -> None:
    """Let P be that of the states themselves, and both its sides the same."""
    for s in range(9, lay.size):
        for i in range(9):
            work.P[s, i] = work.P[i, s]
    for i in range(9):
        for j in range(i + 1, 9):
            mean = 0.5 * (work.P[i, j] + work.P[j, i])
            work.P[i, j] = work.P[j, i] = mean
    for i in range(lay.size):
        for c in range(work.P_c.shape[1]):
            work.P_c[i, c] *= work.shrunk[i] * work.shrunk_c[c]
    for j in range(9, lay.size):
        work.shrunk[j] = work.slant[j] = work.grown[j] = 1.0


@straight
def _decay(x: Any, decay: Any, j: int) -> None:
    """Let an estimate decay."""
    x[j] = x[j] * decay[j]


@compiled
def decay_parameters(lay: Layout, work: Work, dt: float) -> None:
    """Advance the estimates of the other states by a step."""
    x, decay = work.x, work.decay
    for j in range(9, lay.size):
        _decay(x, decay, j)
    for j in lay.ramps:
        x[j] += dt * x[lay.slope[j]]


@called
def summarise(lay: Layout, P: FloatArray, out: FloatArray) -> None:
    """Set the covariance (15, 15) of navigation errors and total biases: M P Mᵀ."""
    out[:] = 0.0
    for s in range(lay.size):
        i = lay.total[s]
        if i >= 0:
            for c in range(9):
                out[i, c] += P[s, c]
            for c in range(9, lay.size):
                if lay.total[c] >= 0:
                    out[i, lay.total[c]] += P[s, c]
