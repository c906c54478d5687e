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
from typing import Any, cast

import numba
import numpy as np
from numpy.typing import NDArray

from models import earth, errorstate, strapdown, triples
from models.strapdown import correct_increments, mean_attitude, step
from models.triples import add, scale, transform
from tuner.navigation import compiled as compiled_module
from tuner.navigation import covariance, updates
from tuner.navigation.compiled import Layout, Workspace, checksum, compiled
from tuner.navigation.covariance import advance, set_decay, summarise
from tuner.navigation.updates import factor, fix_model, whiten

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compiled
def gain(P: FloatArray, H: FloatArray, sd: FloatArray, m: int) -> FloatArray:
    """Return Kᵀ = S⁻¹ H P of the first m rows, shape (m, n)."""
    n = P.shape[0]
    rows, S = np.zeros((m, n)), np.zeros((m, m))
    for a in range(m):
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    rows[a, j] += H[a, k] * P[k, j]
        for b in range(m):
            y = sd[a] * sd[a] if a == b else 0.0
            for k in range(n):
                y += rows[a, k] * H[b, k]
            S[a, b] = y
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


@compiled
def trace_sources(
    lay: Layout,
    state: FloatArray,
    P: FloatArray,
    rates: FloatArray,
    white: FloatArray,
    drive: FloatArray,
    fix_sd: FloatArray,
    dt: FloatArray,
    increments: FloatArray,
    after: IntArray,
    fixes: FloatArray,
    available: IntArray,
    withheld: NDArray[np.bool_],
    slot: IntArray,
    out: FloatArray,
    out_S: FloatArray,
    aided: FloatArray,
) -> None:
    """Carry the covariance of every source along a noise-free flight.

    Source 0 is all of them: the filter's own P, from which the gains come.

    Parameters
    ----------
    lay : Layout
        The filter; sensors ideal along the nominal flight.
    state : ndarray, shape (10,)
        True start.
    P : ndarray, shape (g, n, n)
        Covariances at the start; changed.
    rates, white, drive, fix_sd : ndarray, shapes (g, n), (g, 6), (g, n), (g, 6)
        Inverse time constants, 1/s, squared densities and sds of fixes of every source.
    dt, increments, after, fixes, available, withheld
        As of `flight.fly`, perfect.
    slot : ndarray of int, shape (k,)
        Row of `out` that keeps a fix, −1 for none.
    out : ndarray, shape (e, g, 15, 15)
        Covariances of navigation errors and total biases after the fixes that are kept.
    out_S : ndarray, shape (e, g, 6, 6)
        Covariances of their innovations.
    aided : ndarray, shape (n, n)
        The filter's own P after the last fix that was used.
    """
    sources, n = P.shape[0], lay.size
    wide, answer, small = np.empty((9, n + 6)), np.empty((6, n + 6)), np.empty((9, 6))
    decay, driven = np.empty((sources, n)), np.zeros((sources, n))
    unit, bias = np.eye(6), np.zeros(6)
    pos, vel = (state[0], state[1], state[2]), (state[3], state[4], state[5])
    quat = (state[6], state[7], state[8], state[9])
    start_pos, start_vel, start_quat = pos, vel, quat
    elapsed, decay_dt, i = 0.0, -1.0, 0
    sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    angle, velocity = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    before_angle, before_velocity = angle, velocity
    true, x, z, H = np.zeros(6), np.zeros(n), np.zeros(6), np.zeros((6, n))
    HP = np.zeros((6, n))
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
            mat = mean_attitude(start_quat, quat)
            rate, force_n = scale(1.0 / elapsed, sum_angle), scale(1.0 / elapsed, sum_force)
            columns = (
                (mat[0][0], mat[1][0], mat[2][0]),
                (mat[0][1], mat[1][1], mat[2][1]),
                (mat[0][2], mat[1][2], mat[2][2]),
            )
            force_b = transform(columns, force_n)
            for c in range(3):
                true[c], true[3 + c] = rate[c], force_b[c]
            for g in range(sources):
                own = Layout(
                    lay.size, rates[g], drive[g], white[g], lay.row, lay.source, lay.slope, lay.gravity,
                    lay.lever, lay.delay, lay.gnss, lay.processes, lay.ideal, lay.arm, lay.gate,
                    lay.covariance_step, lay.patience,
                )  # fmt: skip
                work = Workspace(wide, answer, small, decay[g], driven[g], unit, unit, bias)
                if elapsed != decay_dt:
                    set_decay(own, elapsed, work)
                advance(
                    own,
                    P[g],
                    scale(0.5, add(start_pos, pos)),
                    scale(0.5, add(start_vel, vel)),
                    mat,
                    true,
                    force_n,
                    elapsed,
                    work,
                )
            decay_dt = elapsed
            start_pos, start_vel, start_quat = pos, vel, quat
            elapsed = 0.0
            sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        while i < len(after) and after[i] == k:
            inverse = 1.0 / dt[max(k - 1, 0)]
            for c in range(3):
                true[c], true[3 + c] = angle[c] * inverse, velocity[c] * inverse
            work = Workspace(wide, answer, small, decay[0], driven[0], unit, unit, bias)
            fix_model(lay, pos, vel, quat, x, true, fixes[i], work, z, H)
            m = 3 * available[i]
            row = slot[i]
            if row >= 0:
                for g in range(sources):
                    spread(P[g], H, fix_sd[g], m, HP, out_S[row, g])
            if not withheld[i]:
                K = gain(P[0], H, fix_sd[0], m)
                for g in range(sources):
                    joseph(P[g], H, K, fix_sd[g])
                aided[:] = P[0]
            if row >= 0:
                for g in range(sources):
                    summarise(lay, P[g], out[row, g])
            i += 1


def _kept(number: int) -> Callable[..., None]:
    """Return `trace_sources`, kept on disk for as long as no source of it changes (see `flight`)."""

    def entry(*arguments: Any) -> None:
        if number > 0:
            trace_sources(*arguments)

    return cast(Callable[..., None], numba.njit(cache=True, nogil=True)(entry))


kept_trace = _kept(
    checksum(
        triples,
        earth,
        strapdown,
        errorstate,
        compiled_module,
        covariance,
        updates,
        sys.modules[__name__],
    )
)
