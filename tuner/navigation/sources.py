"""Linear covariance by source, in compiled code: which noise an error of the filter comes from.

The gains K are those of the filter's own P. Each source, alone, then goes through the same Φ and the same
gains::

    P_g ← Φ P_g Φᵀ + Q_g              P_g ← (I − KH) P_g (I − KH)ᵀ + K R_g Kᵀ              Σ P_g = P

A source that the filter does not know, as a bias of another time constant, has states of its own at the end
of x: with neither prior nor drive in P, they get no gain, and what they do to the filter's errors is exact.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import earth, errorstate, strapdown, triples
from models.strapdown import correct_increments, mean_attitude, step
from models.triples import add, scale, transform
from tuner.navigation import arrays, compiler, covariance, lanes, updates
from tuner.navigation import compiled as compiled_module
from tuner.navigation import straight as straight_module
from tuner.navigation.arrays import Memory, copy_in, copy_out, memory, work_of
from tuner.navigation.compiled import (
    Layout,
    Workspace,
    borrowed_layout,
    checksum,
    sensed_states,
    set_true,
    transposed,
)
from tuner.navigation.compiler import compiled, kernel
from tuner.navigation.covariance import PUT_OFF, advance, set_decay, settle, summarise
from tuner.navigation.lanes import WIDTH
from tuner.navigation.updates import factor, fix_model, whiten

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compiled
def spread(P: FloatArray, H: FloatArray, sd: FloatArray, m: int, HP: FloatArray, out: FloatArray) -> None:
    """Set the covariance of the first m innovations: H P Hᵀ + R; `HP` (6, n) is scratch."""
    n = P.shape[0]
    for a in range(m):
        HP[a] = 0.0
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    HP[a, j] += H[a, k] * P[k, j]
        for b in range(m):
            y = sd[a] * sd[a] if a == b else 0.0
            for k in range(n):
                y += HP[a, k] * H[b, k]
            out[a, b] = y


@compiled
def gain(P: FloatArray, H: FloatArray, sd: FloatArray, m: int) -> FloatArray:
    """Return Kᵀ = S⁻¹ H P of the first m rows, shape (m, n)."""
    n = P.shape[0]
    rows, S = np.zeros((m, n)), np.zeros((m, m))
    spread(P, H, sd, m, rows, S)
    L = factor(S, m)
    whiten(L, m, rows)
    for a in range(m - 1, -1, -1):
        for j in range(n):
            y = rows[a, j]
            for b in range(a + 1, m):
                y -= L[b, a] * rows[b, j]
            rows[a, j] = y / L[a, a]
    return rows


@compiled
def joseph(P: FloatArray, H: FloatArray, K: FloatArray, sd: FloatArray) -> None:
    """Replace P by (I − KH) P (I − KH)ᵀ + K R Kᵀ; K is given as Kᵀ (m, n)."""
    m, n = K.shape
    HP = np.zeros((m, n))
    for a in range(m):
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    HP[a, j] += H[a, k] * P[k, j]
    for i in range(n):
        for a in range(m):
            for j in range(n):
                P[i, j] -= K[a, i] * HP[a, j]
    for i in range(n):
        for a in range(m):
            y = 0.0
            for k in range(n):
                y += P[i, k] * H[a, k]
            HP[a, i] = y
    for i in range(n):
        for a in range(m):
            y = sd[a] * sd[a] * K[a, i] - HP[a, i]
            for j in range(n):
                P[i, j] += y * K[a, j]


class Nominal(NamedTuple):
    """A noise-free flight and its fixes; k of them, e kept."""

    state: FloatArray  # (10,), true start
    dt: FloatArray  # (m,), s
    increments: FloatArray  # (m, 6), perfect
    after: IntArray  # (k,), steps done
    fixes: FloatArray  # (k, 6), perfect
    available: IntArray  # (k,), 1 position only, 2 with velocity
    withheld: NDArray[np.bool_]  # (k,)
    slot: IntArray  # (k,), row that keeps a fix, −1 for none


def trace_sources(
    lay: Layout,
    initial: FloatArray,
    rate: FloatArray,
    white: FloatArray,
    drive: FloatArray,
    fix_sd: FloatArray,
    nominal: Nominal,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Carry the covariance of every source along a noise-free flight.

    Source 0 is all of them: the filter's own P, from which the gains come.

    Parameters
    ----------
    lay : Layout
        The filter; sensors ideal along the nominal flight.
    initial, rate, white, drive, fix_sd : ndarray, shapes (g, n), (g, n), (g, 6), (g, n), (g, 6)
        Variances at the start, inverse time constants, 1/s, squared densities and sds of fixes of every source.
    nominal : Nominal
        The flight.

    Returns
    -------
    covariance : ndarray, shape (e, g, 15, 15)
        Of navigation errors and total biases after the fixes that are kept.
    innovation : ndarray, shape (e, g, 6, 6)
        Covariances of their innovations.
    aided : ndarray, shape (n, n)
        The filter's own P after the last fix that was used.
    """
    feed, first = sensed_states(lay.row)
    lay = lay._replace(feed=feed, first=first)
    n, e, g = lay.size, int(nominal.slot.max()) + 1, len(initial)
    out, out_s, aided = np.zeros((e, g, 15, 15)), np.zeros((e, g, 6, 6)), np.zeros((n, n))
    # Eight at a time, the filter itself among each.
    for begin in range(1, max(g, 2), WIDTH - 1):
        among = [0, *range(begin, min(begin + WIDTH - 1, g))]
        w = len(among)
        m = memory(lay, WIDTH)
        m.P[range(n), range(n), :w] = initial[among].T
        m.rate[:, :w], m.white[:, :w], m.drive[:, :w] = rate[among].T, white[among].T, drive[among].T
        part, part_s = np.zeros((e, w, 15, 15)), np.zeros((e, w, 6, 6))
        _trace(lay, m, nominal, (0,) * WIDTH, np.ascontiguousarray(fix_sd[among]), part, part_s, aided)
        out[:, among], out_s[:, among] = part, part_s
    return out, out_s, aided


def _kept(number: int) -> Callable[..., None]:
    """Return the kernel of `trace_sources`, kept on disk for as long as no source of it changes (see `flight`)."""

    def trace(
        lay: Layout,
        memory: Memory,
        nominal: Nominal,
        filters: tuple[int, ...],
        fix_sd: FloatArray,
        out: FloatArray,
        out_S: FloatArray,
        aided: FloatArray,
    ) -> None:
        """Carry the first w of eight sources, w being the length of `fix_sd`."""
        if number == 0:
            return
        lay, work, n = borrowed_layout(lay), work_of(memory, filters), lay.size
        dt, increments, after, state = nominal.dt, nominal.increments, nominal.after, nominal.state
        pos, vel = (state[0], state[1], state[2]), (state[3], state[4], state[5])
        quat = (state[6], state[7], state[8], state[9])
        start_pos, start_vel, start_quat = pos, vel, quat
        elapsed, decay_dt, i = 0.0, -1.0, 0
        aged, fastest = 0.0, memory.rate.max()
        sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        angle, velocity = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        before_angle, before_velocity = angle, velocity
        true, x, z, H, HP = np.zeros(6), np.zeros(n), np.zeros(6), np.zeros((6, n)), np.zeros((6, n))
        P, unit = np.zeros((n, n)), Workspace(np.eye(6))
        for k in range(len(dt) + 1):
            if k > 0:
                d = dt[k - 1]
                angle = (increments[k - 1, 0], increments[k - 1, 1], increments[k - 1, 2])
                velocity = (increments[k - 1, 3], increments[k - 1, 4], increments[k - 1, 5])
                if k == 1:
                    before_angle, before_velocity = angle, velocity
                rotvec, dvel = correct_increments(angle, velocity, before_angle, before_velocity)
                pos, vel, quat, force = step(pos, vel, quat, rotvec, dvel, d)
                before_angle, before_velocity = angle, velocity
                elapsed += d
                sum_angle = add(sum_angle, angle)
                sum_force = add(sum_force, scale(d, force))
            due = k == len(dt) or (i < len(after) and after[i] == k)
            if elapsed > 0.0 and (due or elapsed + 0.5 * dt[k] > lay.covariance_step):
                if elapsed != decay_dt:
                    set_decay(memory, elapsed)
                    decay_dt = elapsed
                mat = mean_attitude(start_quat, quat)
                rate, force = scale(1.0 / elapsed, sum_angle), scale(1.0 / elapsed, sum_force)
                set_true(work.true, rate, transform(transposed(mat), force))
                middle_pos = scale(0.5, add(start_pos, pos))
                middle_vel = scale(0.5, add(start_vel, vel))
                advance(lay, work, middle_pos, middle_vel, mat, force, elapsed)
                aged += elapsed * fastest
                if due or aged > PUT_OFF:
                    settle(lay, work)
                    aged = 0.0
                start_pos, start_vel, start_quat = pos, vel, quat
                elapsed = 0.0
                sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            while i < len(after) and after[i] == k:
                inverse = 1.0 / dt[max(k - 1, 0)]
                set_true(true, scale(inverse, angle), scale(inverse, velocity))
                fix_model(lay, pos, vel, quat, x, true, nominal.fixes[i], unit, z, H)
                m, row, used = 3 * nominal.available[i], nominal.slot[i], not nominal.withheld[i]
                copy_out(memory.P, 0, P)
                K = gain(P, H, fix_sd[0], m)
                for w in range(len(fix_sd)):
                    copy_out(memory.P, w, P)
                    if row >= 0:
                        spread(P, H, fix_sd[w], m, HP, out_S[row, w])
                    if used:
                        joseph(P, H, K, fix_sd[w])
                        copy_in(memory.P, w, P)
                        if w == 0:
                            aided[:] = P
                    if row >= 0:
                        summarise(lay, P, out[row, w])
                i += 1

    return kernel(trace)


_trace = _kept(
    checksum(
        triples,
        earth,
        strapdown,
        errorstate,
        lanes,
        straight_module,
        compiler,
        compiled_module,
        arrays,
        covariance,
        updates,
        sys.modules[__name__],
    )
)
