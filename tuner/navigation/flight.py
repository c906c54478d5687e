"""A whole flight in compiled code: mechanisation, sensor errors drawn on the way, covariance, fixes."""

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
from tuner.navigation.covariance import advance, decay_parameters, set_decay, summarise
from tuner.navigation.updates import correct, fix_model, update

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compiled
def calibrate(lay: Layout, x: FloatArray, work: Workspace) -> None:
    """Set bias, A and its inverse from the states."""
    work.bias[:] = 0.0
    for i in range(6):
        for j in range(6):
            work.matrix[i, j] = 1.0 if i == j else 0.0
    for j in range(9, lay.size):
        if lay.row[j] >= 0:
            if lay.source[j] < 0:
                work.bias[lay.row[j]] += x[j]
            else:
                work.matrix[lay.row[j], lay.source[j]] += x[j]
    if not lay.ideal:
        invert(work.matrix, work.inverse)


@compiled
def invert(A: FloatArray, out: FloatArray) -> None:
    """Set the inverse of A (6, 6) by Gauss–Jordan elimination; A is near the identity."""
    work = A.copy()
    for i in range(6):
        for j in range(6):
            out[i, j] = 1.0 if i == j else 0.0
    for i in range(6):
        pivot = 1.0 / work[i, i]
        for j in range(6):
            work[i, j] *= pivot
            out[i, j] *= pivot
        for r in range(6):
            c = work[r, i]
            if r != i and c != 0.0:
                for j in range(6):
                    work[r, j] -= c * work[i, j]
                    out[r, j] -= c * out[i, j]


@compiled
def fly(
    lay: Layout,
    state: FloatArray,
    x: FloatArray,
    P: FloatArray,
    dt: FloatArray,
    increments: FloatArray,
    noisy: bool,
    white: FloatArray,
    slow: FloatArray,
    every: int,
    rng: np.random.Generator,
    after: IntArray,
    fixes: FloatArray,
    sd: FloatArray,
    available: IntArray,
    withheld: NDArray[np.bool_],
    trusted: NDArray[np.bool_],
    t: FloatArray,
    out_state: FloatArray,
    out_x: FloatArray,
    out_P: FloatArray,
    out_z: FloatArray,
    out_S: FloatArray,
    out_use: IntArray,
) -> None:
    """Filter a stretch of data; see `tuner.navigation.engine` for the arrays. Changes `state`, `x` and `P`.

    Where `noisy`, the increments are those of perfect sensors, and sensor errors are added here: slow ones,
    `slow` (s, 6), each row held for `every` steps, and white noise of densities `white` (6,).
    """
    work = Workspace(
        np.empty((9, lay.size + 6)),
        np.empty((6, lay.size + 6)),
        np.empty((9, 6)),
        np.empty(lay.size),
        np.empty(lay.size),
        np.eye(6),
        np.eye(6),
        np.zeros(6),
    )
    pos, vel = (state[0], state[1], state[2]), (state[3], state[4], state[5])
    quat = (state[6], state[7], state[8], state[9])
    calibrate(lay, x, work)
    start_pos, start_vel, start_quat = pos, vel, quat
    elapsed, decay_dt, last_dt = 0.0, -1.0, 0.0
    sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    angle, velocity = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    before_angle, before_velocity = angle, velocity
    true, sample = np.zeros(6), np.zeros(6)
    z, S, dx, use = np.zeros(6), np.zeros((6, 6)), np.zeros(lay.size), np.zeros(2, dtype=np.int64)
    H = np.zeros((6, lay.size))
    n_steps, i, refused, limits = len(dt), 0, np.full(2, 1e300), np.empty(2)
    for k in range(n_steps + 1):
        if k > 0:
            d = dt[k - 1]
            root = np.sqrt(d)
            for c in range(6):
                value = increments[k - 1, c] - work.bias[c] * d
                if noisy:
                    value += slow[(k - 1) // every, c] * d + white[c] * root * rng.standard_normal()
                sample[c] = value
            if lay.ideal:
                for c in range(6):
                    true[c] = sample[c]
            else:
                for c in range(6):
                    true[c] = 0.0
                    for s in range(6):
                        true[c] += work.inverse[c, s] * sample[s]
            angle, velocity = (true[0], true[1], true[2]), (true[3], true[4], true[5])
            if last_dt > 0.0:
                stretch = 2.0 * d * d / (last_dt + d) / last_dt
                before_angle = scale(stretch, before_angle)
                before_velocity = scale(stretch, before_velocity)
            else:
                before_angle, before_velocity = angle, velocity
            rotvec, dvel = correct_increments(angle, velocity, before_angle, before_velocity)
            pos, vel, quat, force = step(pos, vel, quat, rotvec, dvel, d)
            before_angle, before_velocity, last_dt = angle, velocity, d
            elapsed += d
            sum_angle = add(sum_angle, angle)
            sum_force = add(sum_force, scale(d, force))
        due = k == n_steps or (i < len(after) and after[i] == k)
        if elapsed > 0.0 and (due or elapsed + 0.5 * dt[k] > lay.covariance_step):
            if elapsed != decay_dt:
                set_decay(lay, elapsed, work)
                decay_dt = elapsed
            mat = mean_attitude(start_quat, quat)
            inverse = 1.0 / elapsed
            force_n = scale(inverse, sum_force)
            rate = scale(inverse, sum_angle)
            columns = (
                (mat[0][0], mat[1][0], mat[2][0]),
                (mat[0][1], mat[1][1], mat[2][1]),
                (mat[0][2], mat[1][2], mat[2][2]),
            )
            force_b = transform(columns, force_n)
            for c in range(3):
                true[c] = rate[c]
                true[3 + c] = force_b[c]
            middle_pos = scale(0.5, add(start_pos, pos))
            middle_vel = scale(0.5, add(start_vel, vel))
            advance(lay, P, middle_pos, middle_vel, mat, true, force_n, elapsed, work)
            decay_parameters(lay, x, elapsed, work)
            calibrate(lay, x, work)
            start_pos, start_vel, start_quat = pos, vel, quat
            elapsed = 0.0
            sum_angle, sum_force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        while i < len(after) and after[i] == k:
            inverse = 1.0 / last_dt if last_dt > 0.0 else 1.0
            for c in range(3):
                true[c] = angle[c] * inverse
                true[3 + c] = velocity[c] * inverse
            fix_model(lay, pos, vel, quat, x, true, fixes[i], work, z, H)
            for g in range(2):
                gated = not trusted[i] and t[i] - refused[g] < lay.patience
                limits[g] = lay.gate if gated else 1e300
            if update(P, z, H, sd[i], available[i], withheld[i], limits, dx, S, use):
                pos, vel, quat = correct(pos, vel, quat, dx)
                for j in range(9, lay.size):
                    x[j] += dx[j]
                calibrate(lay, x, work)
            start_pos, start_vel, start_quat = pos, vel, quat
            for g in range(2):
                if use[g] == 2:
                    refused[g] = min(refused[g], t[i])
                elif use[g] != 0:
                    refused[g] = 1e300
            for c in range(3):
                out_state[i, c], out_state[i, 3 + c] = pos[c], vel[c]
            for c in range(4):
                out_state[i, 6 + c] = quat[c]
            for j in range(lay.size):
                out_x[i, j] = x[j]
            for c in range(6):
                out_z[i, c] = z[c] if c < 3 * available[i] else 0.0
            for a in range(6):
                for b in range(6):
                    out_S[i, a, b] = S[a, b]
            out_use[i, 0], out_use[i, 1] = use[0], use[1]
            summarise(lay, P, out_P[i])
            i += 1
    for c in range(3):
        state[c], state[3 + c] = pos[c], vel[c]
    for c in range(4):
        state[6 + c] = quat[c]


def _kept(number: int) -> Callable[..., None]:
    """Return `fly`, kept on disk for as long as no source of it changes.

    Numba looks at the file of one function only, and at the closure of that function: so the checksum of all
    files goes there.
    """

    def entry(*arguments: Any) -> None:
        if number > 0:
            fly(*arguments)

    return cast(Callable[..., None], numba.njit(cache=True, nogil=True)(entry))


kept_fly = _kept(
    checksum(
        triples, earth, strapdown, errorstate, compiled_module, covariance, updates, sys.modules[__name__]
    )
)
