"""Fixes in compiled code: innovation, Jacobian, gates and update, as in `tuner.navigation.filter`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.earth import earth_rate, radii
from models.errorstate import coupling
from models.strapdown import rates
from models.triples import add, cross, exponential, matrix, product, scale, transform
from tuner.navigation.compiled import Layout, Workspace, compiled, unmix

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compiled
def _skew_into(H: FloatArray, row: int, column: int, a: Any, sign: float) -> None:
    """Add sign [a ×] to a block of H."""
    H[row, column + 1] -= sign * a[2]
    H[row, column + 2] += sign * a[1]
    H[row + 1, column] += sign * a[2]
    H[row + 1, column + 2] -= sign * a[0]
    H[row + 2, column] -= sign * a[1]
    H[row + 2, column + 1] += sign * a[0]


@compiled
def _sensor_rows(lay: Layout, true: FloatArray, mat: Any, inverse: FloatArray, out: FloatArray) -> None:
    """Set rows 0–2 to C δω and rows 3–5 to C δf of the states: −C A⁻¹ S; shape (6, n)."""
    out[:] = 0.0
    for s in range(9, lay.size):
        r = lay.row[s]
        if r >= 0:
            out[r, s] = -1.0 if lay.source[s] < 0 else -true[lay.source[s]]
    for s in range(9, lay.size):
        if lay.row[s] >= 0:
            if not lay.ideal:
                unmix(inverse, out, s)
            turn = transform(mat, (out[0, s], out[1, s], out[2, s]))
            push = transform(mat, (out[3, s], out[4, s], out[5, s]))
            for i in range(3):
                out[i, s] = turn[i]
                out[3 + i, s] = push[i]


@compiled
def _metres(pos: Any) -> Any:
    """Return d(north, east, down)/d(latitude, longitude, height)."""
    meridian, normal = radii(np.sin(pos[0]))
    return (meridian + pos[2], (normal + pos[2]) * np.cos(pos[0]), -1.0)


@compiled
def _delay_rows(
    lay: Layout, pos: Any, vel: Any, force: Any, sensors: FloatArray, delay: float, H: FloatArray
) -> None:
    """Add what a delayed receiver sees of velocity and acceleration errors."""
    _, f_vr, f_vv, _, _, _ = coupling(pos, vel)
    F = np.zeros((3, lay.size))
    for i in range(3):
        for j in range(3):
            F[i, j] = f_vr[i][j]
            F[i, 3 + j] = f_vv[i][j]
        for s in range(9, lay.size):
            F[i, s] = sensors[3 + i, s]
    _skew_into(F, 0, 6, force, -1.0)
    if lay.gravity >= 0:
        F[2, lay.gravity] = 1.0
    for i in range(3):
        for j in range(lay.size):
            H[i, j] += -delay * H[3 + i, j] + 0.5 * delay * delay * F[i, j]
            H[3 + i, j] -= delay * F[i, j]


@compiled
def fix_model(
    lay: Layout,
    pos: Any,
    vel: Any,
    quat: Any,
    x: FloatArray,
    true: FloatArray,
    fix: FloatArray,
    work: Workspace,
    z: FloatArray,
    H: FloatArray,
) -> None:
    """Set z (6,) and H (6, n) of a fix (llh, velocity): `models.gnss.position_fix` and `velocity_fix`."""
    n = lay.size
    mat = matrix(quat)
    sensors = np.empty((6, n))
    _sensor_rows(lay, true, mat, work.inverse, sensors)
    arm = (lay.arm[0], lay.arm[1], lay.arm[2])
    if lay.lever >= 0:
        arm = add(arm, (x[lay.lever], x[lay.lever + 1], x[lay.lever + 2]))
    u = transform(mat, arm)
    omega_b, force_b = (true[0], true[1], true[2]), (true[3], true[4], true[5])
    of_earth = earth_rate(np.sin(pos[0]), np.cos(pos[0]))
    omega = transform(mat, omega_b)
    relative = add(omega, scale(-1.0, of_earth))
    antenna = add(vel, cross(relative, u))
    H[:] = 0.0
    for i in range(3):
        H[i, i] = 1.0
        H[3 + i, 3 + i] = 1.0
    _skew_into(H, 0, 6, u, -1.0)
    # Velocity rows: −[u ×] C δω + v + ([ω_ie ×][u ×] − [(ω × u) ×]) φ + [ω_eb ×] C δl.
    for s in range(9, n):
        w = cross(u, (sensors[0, s], sensors[1, s], sensors[2, s]))
        for i in range(3):
            H[3 + i, s] = -w[i]
    _skew_into(H, 3, 6, cross(omega, u), -1.0)
    # [a ×][b ×] = b aᵀ − (a · b) I
    inner = of_earth[0] * u[0] + of_earth[1] * u[1] + of_earth[2] * u[2]
    for i in range(3):
        for j in range(3):
            H[3 + i, 6 + j] += u[i] * of_earth[j]
        H[3 + i, 6 + i] -= inner
    if lay.lever >= 0:
        for j in range(3):
            column = (mat[0][j], mat[1][j], mat[2][j])
            turned = cross(relative, column)
            for i in range(3):
                H[i, lay.lever + j] = column[i]
                H[3 + i, lay.lever + j] = turned[i]
    shift = (0.0, 0.0, 0.0)
    delay = 0.0
    acc = (0.0, 0.0, 0.0)
    if lay.delay >= 0:
        delay = x[lay.delay]
        _, acc, _ = rates(pos, vel, mat, omega_b, force_b)
        if lay.gravity >= 0:
            acc = (acc[0], acc[1], acc[2] + x[lay.gravity])
        shift = add(scale(-delay, antenna), scale(0.5 * delay * delay, acc))
        _delay_rows(lay, pos, vel, transform(mat, force_b), sensors, delay, H)
        for i in range(3):
            H[i, lay.delay] = delay * acc[i] - antenna[i]
            H[3 + i, lay.delay] = -acc[i]
    for k in range(lay.processes):
        j = lay.gnss + 3 * k
        shift = add(shift, (x[j], x[j + 1], x[j + 2]))
        for i in range(3):
            H[i, j + i] = 1.0
    metres = _metres(pos)
    for i in range(3):
        z[i] = (fix[i] - pos[i]) * metres[i] - u[i] - shift[i]
        z[3 + i] = fix[3 + i] - (antenna[i] - delay * acc[i])


@compiled
def correct(pos: Any, vel: Any, quat: Any, dx: FloatArray) -> Any:
    """Return the state with nine errors added: `models.errorstate.corrected`."""
    metres = _metres(pos)
    new = (pos[0] + dx[0] / metres[0], pos[1] + dx[1] / metres[1], pos[2] + dx[2] / metres[2])
    turned = product(exponential((dx[6], dx[7], dx[8])), quat)
    return new, (vel[0] + dx[3], vel[1] + dx[4], vel[2] + dx[5]), turned


@compiled
def whiten(L: FloatArray, m: int, B: FloatArray) -> None:
    """Replace the first m rows of B by L⁻¹ B."""
    for a in range(m):
        for j in range(B.shape[1]):
            y = B[a, j]
            for b in range(a):
                y -= L[a, b] * B[b, j]
            B[a, j] = y / L[a, a]


@compiled
def factor(S: FloatArray, m: int) -> FloatArray:
    """Return L with S = L Lᵀ, the upper left (m, m)."""
    L = np.zeros((m, m))
    for a in range(m):
        for b in range(a + 1):
            y = S[a, b]
            for c in range(b):
                y -= L[a, c] * L[b, c]
            L[a, b] = np.sqrt(y) if a == b else y / L[b, b]
    return L


@compiled
def update(
    P: FloatArray,
    z: FloatArray,
    H: FloatArray,
    sd: FloatArray,
    available: int,
    withheld: bool,
    limits: FloatArray,
    dx: FloatArray,
    S: FloatArray,
    use: IntArray,
) -> bool:
    """Gate a fix and use it: sets dx, S (6, 6) and `use` (2,), changes P; returns whether dx is to be added.

    With the whitened rows W = L⁻¹ H P of S = L Lᵀ:  P ← P − Wᵀ W,  dx = Wᵀ L⁻¹ z.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Covariance.
    z, H, sd : ndarray, shapes (6,), (6, n), (6,)
        The fix made linear.
    available : int
        1 position only, 2 with velocity.
    withheld : bool
        Whether it is only compared.
    limits : ndarray, shape (2,)
        χ² limits of position and velocity.
    dx : ndarray, shape (n,)
        The estimated errors.
    """
    m, n = 3 * available, P.shape[0]
    rows = np.zeros((m, n + 1))  # H P, and z beside it
    S[:] = 0.0
    for a in range(m):
        rows[a, n] = z[a]
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    rows[a, j] += H[a, k] * P[k, j]
        for b in range(m):
            y = sd[a] * sd[a] if a == b else 0.0
            for k in range(n):
                y += rows[a, k] * H[b, k]
            S[a, b] = y
    count = 0
    taken = np.empty(m, dtype=np.int64)
    own, part = np.empty((3, 3)), np.empty((3, 1))
    for g in range(2):
        use[g] = 0
        if g < available:
            for a in range(3):
                part[a, 0] = z[3 * g + a]
                for b in range(3):
                    own[a, b] = S[3 * g + a, 3 * g + b]
            whiten(factor(own, 3), 3, part)
            distance = part[0, 0] ** 2 + part[1, 0] ** 2 + part[2, 0] ** 2
            use[g] = 3 if withheld else 1 if distance <= limits[g] else 2
            if use[g] == 1:
                for a in range(3):
                    taken[count] = 3 * g + a
                    count += 1
    if count == 0:
        return False
    chosen = np.empty((count, count))
    for a in range(count):
        for b in range(count):
            chosen[a, b] = S[taken[a], taken[b]]
        for j in range(n + 1):
            rows[a, j] = rows[taken[a], j]
    whiten(factor(chosen, count), count, rows)
    for i in range(n):
        dx[i] = 0.0
        for a in range(count):
            dx[i] += rows[a, i] * rows[a, n]
    for a in range(count):
        for i in range(n):
            w = rows[a, i]
            for j in range(n):
                P[i, j] -= w * rows[a, j]
    return True
