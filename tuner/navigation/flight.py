"""A whole flight in compiled code: mechanisation, sensor errors drawn on the way, covariance, fixes.

One filter, or eight that see the same steps and have their fixes at the same times. Between fixes the eight go
through every instruction together; at a fix each goes its own way.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import earth, errorstate, strapdown, triples
from models.strapdown import correct_increments, mean_attitude, step
from models.triples import add, scale, transform
from tuner.navigation import arrays, compiler, covariance, lanes, updates
from tuner.navigation import compiled as compiled_module
from tuner.navigation import straight as straight_module
from tuner.navigation.arrays import Memory, Work, copy_in, copy_out, work_of
from tuner.navigation.compiled import (
    NEVER,
    Layout,
    Workspace,
    borrowed_layout,
    checksum,
    set_true,
    transposed,
)
from tuner.navigation.compiler import called, compiled, kernel
from tuner.navigation.covariance import (
    PUT_OFF,
    advance,
    decay_parameters,
    set_decay,
    settle,
    summarise,
    unmixed,
)
from tuner.navigation.lanes import borrowed
from tuner.navigation.updates import correct, fix_model, update

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Flight(NamedTuple):
    """What the inertial units of w filters sense.

    Where it is `noisy`, increments are those of perfect sensors, and errors are added on the way: slow ones, and
    white noise of `Memory.density`.
    """

    dt: FloatArray  # (m,), s
    increments: FloatArray  # (m, 6)
    noisy: bool
    slow: FloatArray  # (w, s, 6), rates and forces
    every: int  # steps for which each row of `slow` is held
    rng: tuple[np.random.Generator, ...]  # w of them, sources of the white noise


class Given(NamedTuple):
    """Fixes of w filters."""

    after: IntArray  # (k,), steps done
    t: FloatArray  # (k,), s
    values: FloatArray  # (w, k, 6), latitude, longitude, height, velocity
    sd: FloatArray  # (k, 6)
    available: IntArray  # (k,), 1 position only, 2 with velocity
    withheld: NDArray[np.bool_]  # (k,)
    trusted: NDArray[np.bool_]  # (k,)


class Kept(NamedTuple):
    """What is kept of every fix, of w filters."""

    state: FloatArray  # (w, k, 10)
    x: FloatArray  # (w, k, n)
    P: FloatArray  # (w, k, 15, 15)
    z: FloatArray  # (w, k, 6)
    S: FloatArray  # (w, k, 6, 6)
    use: IntArray  # (w, k, 2)


class Own(NamedTuple):
    """One filter among eight, as the updates see it, and their scratch."""

    P: FloatArray  # (n, n)
    x: FloatArray  # (n,)
    true: FloatArray  # (6,)
    inverse: FloatArray  # (6, 6), of A
    z: FloatArray  # (6,)
    H: FloatArray  # (6, n)
    dx: FloatArray  # (n,)
    limits: FloatArray  # (2,)


@compiled
def calibrate(lay: Layout, work: Work) -> None:
    """Set bias, A and its inverse from the states."""
    A, x = work.matrix, work.x
    for r in range(6):
        work.bias[r] = 0.0
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
def use_fix(lay: Layout, memory: Memory, own: Own, w: int, fixes: Given, i: int, kept: Kept) -> None:
    """Compare fix i with filter w, use it, and keep what came of it."""
    state, refused, use, S = memory.state, memory.refused, kept.use[w, i], kept.S[w, i]
    copy_out(memory.P, w, own.P)
    for j in range(lay.size):
        own.x[j] = memory.x[j, w]
    for r in range(6):
        own.true[r] = memory.true[r, w]
        for c in range(6):
            own.inverse[r, c] = memory.inverse[r, c, w]
    pos, vel = (state[0, w], state[1, w], state[2, w]), (state[3, w], state[4, w], state[5, w])
    quat = (state[6, w], state[7, w], state[8, w], state[9, w])
    fix_model(lay, pos, vel, quat, own.x, own.true, fixes.values[w, i], Workspace(own.inverse), own.z, own.H)
    t, available = fixes.t[i], fixes.available[i]
    for g in range(2):
        gated = not fixes.trusted[i] and t - refused[g, w] < lay.patience
        own.limits[g] = lay.gate if gated else NEVER
    if update(own.P, own.z, own.H, fixes.sd[i], available, fixes.withheld[i], own.limits, own.dx, S, use):
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
        kept.state[w, i, c] = state[c, w]
    for j in range(lay.size):
        kept.x[w, i, j] = own.x[j]
    for c in range(6):
        kept.z[w, i, c] = own.z[c] if c < 3 * available else 0.0
    summarise(lay, own.P, kept.P[w, i])


@compiled
def _draw(memory: Memory, slow: FloatArray, row: int, dt: float, rng: Any) -> None:
    """Draw the sensor errors of a step: slow ones, and white noise."""
    root = np.sqrt(dt)
    for w in range(memory.drawn.shape[1]):
        for c in range(6):
            white = memory.density[c, w] * root * rng[w].standard_normal()
            memory.drawn[c, w] = slow[w, row, c] * dt + white


def _kept(number: int) -> Callable[[Layout, Memory, Flight, Given, Kept], None]:
    """Return the flight, kept on disk for as long as no source of it changes.

    Numba looks at the file of one function only, and at the closure of that function: so the checksum of all
    files goes there.
    """

    def fly(lay: Layout, memory: Memory, flight: Flight, fixes: Given, kept: Kept) -> None:
        """Filter a stretch of data with as many filters as `flight` has generators; changes `memory`."""
        if number == 0:
            return
        lay, work = borrowed_layout(lay), work_of(memory, flight.rng)
        dt, increments = borrowed(flight.dt), borrowed(flight.increments)
        state, true, n, n_steps = work.state, work.true, lay.size, len(dt)
        own = Own(
            np.empty((n, n)), np.empty(n), np.empty(6), np.eye(6),
            np.zeros(6), np.zeros((6, n)), np.zeros(n), np.empty(2),
        )  # fmt: skip
        calibrate(lay, work)
        pos, vel = (state[0], state[1], state[2]), (state[3], state[4], state[5])
        quat = (state[6], state[7], state[8], state[9])
        start_pos, start_vel, start_quat = pos, vel, quat
        elapsed, decay_dt, last_dt, i = 0.0, -1.0, 0.0, 0
        aged, fastest = 0.0, memory.rate.max()
        angle = velocity = before_angle = before_velocity = sum_angle = sum_force = scale(0.0, vel)
        for k in range(n_steps + 1):
            if k > 0:
                d = dt[k - 1]
                for c in range(6):
                    true[c] = increments[k - 1, c] - d * work.bias[c]
                if flight.noisy:
                    _draw(memory, flight.slow, (k - 1) // flight.every, d, flight.rng)
                    for c in range(6):
                        true[c] += work.drawn[c]
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
                aged += elapsed * fastest
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
    triples, earth, strapdown, errorstate, lanes, straight_module, compiler, compiled_module, arrays, covariance,
    updates, sys.modules[__name__],
)  # fmt: skip
fly = _kept(checksum(*_SOURCES))
