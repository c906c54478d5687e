"""A whole flight in compiled code: mechanisation, sensor errors drawn on the way, covariance, fixes.

One filter, or eight that see the same steps and have their fixes at the same times. Between fixes the eight go
through every instruction together; at a fix each goes its own way, or all share the gain of the first.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import earth, strapdown
from models import error_state as errorstate
from models import vector3 as triples
from models.strapdown import correct_increments, mean_attitude, step
from models.vector3 import add, scale, transform
from tuner.navigation.engine import measurement_models as updates
from tuner.navigation.engine import numba_pipeline as compiler
from tuner.navigation.engine import predict as covariance
from tuner.navigation.engine import predict_column as columns
from tuner.navigation.engine import random_normal as white
from tuner.navigation.engine import simd as lanes
from tuner.navigation.engine import tracing as straight_module
from tuner.navigation.engine import types as compiled_module
from tuner.navigation.engine import update as gains
from tuner.navigation.engine import workspace as arrays
from tuner.navigation.engine.measurement_models import correct, fix_model
from tuner.navigation.engine.numba_pipeline import called, compiled, kernel
from tuner.navigation.engine.predict import PUT_OFF, advance, decay_parameters, set_decay, settle, summarise
from tuner.navigation.engine.predict_column import unmixed
from tuner.navigation.engine.random_normal import normal_numbers
from tuner.navigation.engine.tracing import straight
from tuner.navigation.engine.types import NEVER, Layout, Own, checksum, set_true, transposed
from tuner.navigation.engine.update import gain, joseph, spread, update
from tuner.navigation.engine.workspace import Memory, Work, copy_in, copy_out, work_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Flight(NamedTuple):
    """What the inertial units of w filters sense.

    Where it is `noisy`, increments are those of perfect sensors, and errors are added on the way: those of
    `Memory.slow`, and white noise of `Memory.density` from `Memory.stream`.
    """

    dt: FloatArray  # (m,), s
    increments: FloatArray  # (m, 6)
    noisy: bool
    every: int  # steps for which each row of slow errors is held
    fastest: float  # 1/T of the fastest state of any filter, 1/s


class Given(NamedTuple):
    """Fixes of w filters."""

    after: IntArray  # (k,), steps done
    t: FloatArray  # (k,), s
    values: FloatArray  # (w, k, 6), latitude, longitude, height, velocity
    sd: FloatArray  # (w, k, 6)
    available: IntArray  # (k,), 1 position only, 2 with velocity
    withheld: NDArray[np.bool_]  # (k,)
    trusted: NDArray[np.bool_]  # (k,)
    slot: IntArray  # (k,), where a fix is kept, −1 for nowhere
    shared: bool  # whether all use the gain of the first, for their covariances alone


class Kept(NamedTuple):
    """What is kept of e fixes, of w filters; where gains are shared P and S alone."""

    state: FloatArray  # (w, e, 10)
    x: FloatArray  # (w, e, n)
    P: FloatArray  # (w, e, 15, 15)
    z: FloatArray  # (w, e, 6)
    S: FloatArray  # (w, e, 6, 6)
    use: IntArray  # (w, e, 2)
    aided: FloatArray  # (n, n, 1), of the first filter after the last fix used, where gains are shared


def kept(w: int, e: int, n: int) -> Kept:
    """Return room for e fixes of w filters of n states."""
    return Kept(
        np.empty((w, e, 10)),
        np.empty((w, e, n)),
        np.empty((w, e, 15, 15)),
        np.empty((w, e, 6)),
        np.empty((w, e, 6, 6)),
        np.empty((w, e, 2), dtype=np.int64),
        np.zeros((n, n, 1)),
    )


@compiled
def calibrate(lay: Layout, work: Work) -> None:
    """Set bias, A and its inverse from the states."""
    A, x = work.matrix, work.x
    for r in range(6):
        work.bias[r] = x[9 + r]
        for k in range(lay.first[r], lay.first[r + 1]):
            if lay.source[lay.feed[k]] < 0:
                work.bias[r] += x[lay.feed[k]]
    if lay.ideal:
        return
    for i in range(6):
        for j in range(6):
            A[i, j] = 1.0 if i == j else 0.0
    for s in range(9, lay.size):
        if lay.source[s] >= 0:
            A[lay.row[s], lay.source[s]] += x[s]
    invert(A, work.inverse)


@compiled
def invert(A: Any, out: Any) -> None:
    """Set the inverse of A (6, 6), which is lost, by Gauss–Jordan elimination; A is near the identity."""
    for i in range(6):
        for j in range(6):
            out[i, j] = 1.0 if i == j else 0.0
    for i in range(6):
        pivot = 1.0 / A[i, i]
        for j in range(6):
            A[i, j] *= pivot
            out[i, j] *= pivot
        for r in range(6):
            if r != i:
                c = A[r, i]
                for j in range(6):
                    A[r, j] -= c * A[i, j]
                    out[r, j] -= c * out[i, j]


@called
def model_fix(lay: Layout, memory: Memory, own: Own, w: int, fix: FloatArray) -> None:
    """Take filter w out of those of all, and set its z and H of a fix."""
    state = memory.state
    copy_out(memory.P, w, own.P)
    for j in range(lay.size):
        own.x[j] = memory.x[j, w]
    for r in range(6):
        own.true[r] = memory.true[r, w]
        for c in range(6):
            own.inverse[r, c] = memory.inverse[r, c, w]
    pos, vel = (state[0, w], state[1, w], state[2, w]), (state[3, w], state[4, w], state[5, w])
    quat = (state[6, w], state[7, w], state[8, w], state[9, w])
    fix_model(lay, pos, vel, quat, fix, own)


@called
def use_gain(lay: Layout, memory: Memory, own: Own, fixes: Given, i: int, kept: Kept) -> None:
    """Use fix i with the gain of the first filter, for the covariances of all of them."""
    m, row = 3 * fixes.available[i], fixes.slot[i]
    model_fix(lay, memory, own, 0, fixes.values[0, i])
    gain(own, fixes.sd[0, i], m, own.sensors)
    for w in range(len(fixes.sd)):
        copy_out(memory.P, w, own.P)
        spread(own.P, own.H, fixes.sd[w, i], m, own.rows, own.block)
        if row >= 0:
            for a in range(m):
                for b in range(m):
                    kept.S[w, row, a, b] = own.block[a, b]
        if not fixes.withheld[i]:
            joseph(own.P, own.H, own.sensors, fixes.sd[w, i], m, own.rows)
            copy_in(memory.P, w, own.P)
            if w == 0:
                copy_in(kept.aided, 0, own.P)
        if row >= 0:
            summarise(lay, own.P, kept.P[w, row])


@called
def use_fix(lay: Layout, memory: Memory, own: Own, w: int, fixes: Given, i: int, kept: Kept) -> None:
    """Compare fix i with filter w, use it, and keep what came of it."""
    state, refused, row = memory.state, memory.refused, fixes.slot[i]
    use, S = kept.use[w, row], kept.S[w, row]
    model_fix(lay, memory, own, w, fixes.values[w, i])
    t, available = fixes.t[i], fixes.available[i]
    for g in range(2):
        gated = not fixes.trusted[i] and t - refused[g, w] < lay.patience
        own.limits[g] = lay.gate if gated else NEVER
    if update(own, fixes.sd[w, i], available, fixes.withheld[i], S, use):
        pos, vel = (state[0, w], state[1, w], state[2, w]), (state[3, w], state[4, w], state[5, w])
        quat = (state[6, w], state[7, w], state[8, w], state[9, w])
        pos, vel, quat = correct(pos, vel, quat, own.dx)
        copy_in(memory.P, w, own.P)
        for j in range(9, lay.size):
            own.x[j] += own.dx[j]
            memory.x[j, w] = own.x[j]
        for c in range(3):
            state[c, w], state[3 + c, w] = pos[c], vel[c]
        for c in range(4):
            state[6 + c, w] = quat[c]
    for g in range(2):
        if use[g] == 2:
            refused[g, w] = min(refused[g, w], t)
        elif use[g] != 0:
            refused[g, w] = NEVER
    for c in range(10):
        kept.state[w, row, c] = state[c, w]
    for j in range(lay.size):
        kept.x[w, row, j] = own.x[j]
    for c in range(6):
        kept.z[w, row, c] = own.z[c] if c < 3 * available else 0.0
    summarise(lay, own.P, kept.P[w, row])


@straight
def _disturb(work: Work, dt: Any, row: Any) -> None:
    """Add the sensor errors of a step: slow ones, and white noise."""
    white, root = normal_numbers(work.stream), np.sqrt(dt)
    for c in range(6):
        work.true[c] = work.true[c] + (dt * work.slow[row, c] + root * work.density[c] * white[c])


def _kept(number: int) -> Callable[[Layout, Memory, Own, Flight, Given, Kept], None]:
    """Return the flight, kept on disk for as long as no source of it changes.

    Numba looks at the file of one function only, and at the closure of that function: so the checksum of all
    files goes there.
    """

    def fly(lay: Layout, memory: Memory, own: Own, flight: Flight, fixes: Given, kept: Kept) -> None:
        """Filter a stretch of data with as many filters as `memory` holds; changes `memory`."""
        if number == 0:
            return
        work, dt, increments = work_of(memory, memory.each), flight.dt, flight.increments
        state, true, n_steps = work.state, work.true, len(dt)
        calibrate(lay, work)
        pos, vel = (state[0], state[1], state[2]), (state[3], state[4], state[5])
        quat = (state[6], state[7], state[8], state[9])
        start_pos, start_vel, start_quat = pos, vel, quat
        elapsed, decay_dt, last_dt, i = 0.0, -1.0, 0.0, 0
        aged = 0.0
        angle = velocity = before_angle = before_velocity = sum_angle = sum_force = scale(0.0, vel)
        for k in range(n_steps + 1):
            if k > 0:
                d = dt[k - 1]
                for c in range(6):
                    true[c] = increments[k - 1, c] - d * work.bias[c]
                if flight.noisy:
                    _disturb(work, d, (k - 1) // flight.every)
                sample = (true[0], true[1], true[2], true[3], true[4], true[5])
                angle, velocity = unmixed(lay, work.inverse, sample)
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
            due = k == n_steps or (i < len(fixes.after) and fixes.after[i] == k)
            if elapsed > 0.0 and (due or elapsed + 0.5 * dt[k] > lay.covariance_step):
                if elapsed != decay_dt:
                    set_decay(memory, elapsed)
                    decay_dt = elapsed
                mat = mean_attitude(start_quat, quat)
                force = scale(1.0 / elapsed, sum_force)
                set_true(true, scale(1.0 / elapsed, sum_angle), transform(transposed(mat), force))
                middle_pos = scale(0.5, add(start_pos, pos))
                middle_vel = scale(0.5, add(start_vel, vel))
                advance(lay, work, middle_pos, middle_vel, mat, force, elapsed)
                aged += elapsed * flight.fastest
                if due or aged > PUT_OFF:
                    settle(lay, work)
                    aged = 0.0
                decay_parameters(lay, work, elapsed)
                calibrate(lay, work)
                start_pos, start_vel, start_quat = pos, vel, quat
                elapsed = 0.0
                sum_angle = sum_force = scale(0.0, vel)
            if i < len(fixes.after) and fixes.after[i] == k:
                inverse = 1.0 / last_dt if last_dt > 0.0 else 1.0
                set_true(true, scale(inverse, angle), scale(inverse, velocity))
                for c in range(3):
                    state[c], state[3 + c] = pos[c], vel[c]
                for c in range(4):
                    state[6 + c] = quat[c]
                while i < len(fixes.after) and fixes.after[i] == k:
                    if fixes.shared:
                        use_gain(lay, memory, own, fixes, i, kept)
                    else:
                        for w in range(memory.x.shape[1]):
                            use_fix(lay, memory, own, w, fixes, i, kept)
                    i += 1
                    calibrate(lay, work)
                pos, vel = (state[0], state[1], state[2]), (state[3], state[4], state[5])
                quat = (state[6], state[7], state[8], state[9])
                start_pos, start_vel, start_quat = pos, vel, quat
        for c in range(3):
            state[c], state[3 + c] = pos[c], vel[c]
        for c in range(4):
            state[6 + c] = quat[c]

    return kernel(fly)


_SOURCES = (
    triples, earth, strapdown, errorstate, lanes, straight_module, compiler, compiled_module, arrays, columns,
    covariance, updates, gains, white, sys.modules[__name__],
)  # fmt: skip
fly = _kept(checksum(*_SOURCES))
