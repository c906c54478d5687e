"""Compiled Kalman recursions of a linearised run: the filter forwards, the gradient of its likelihood backwards.

Forwards, one fix after the other and one row h after the other, since the errors of rows are independent::

    a ← Φ a,  P ← Φ P Φᵀ + Σ_g s_g Q_g,  V ← Φ V + B          to the fix
    z = ν − h a,  f = h P hᵀ + r,  K = P hᵀ/f,  s = D + h V    innovation, its variance, gain, d z/dθ
    a ← a + K z,  P ← P − K f Kᵀ,  V ← V − K s                 a row that is taken
    a ← a − c                                                  the correction of the original filter

Three further states may model a Gauss–Markov error of the position fixes. Backwards [1]_, with L = I − K h::

    u = z/f − K·r,   d = 1/f + K·N K            ∂ ln L/∂r = (u² − d)/2
    r ← hᵀ z/f + Lᵀ r,   N ← hᵀ h/f + Lᵀ N L    before the row; if ln L does not count it,
    r ← Lᵀ r,            N ← Lᵀ N L − (Lᵀ r h + hᵀ rᵀ L) z/f    and    ∂ ln L/∂r = ((K·r)² − K·N K)/2 − K·r z/f
    ∂ ln L/∂s_g = ½ Σ tr (r rᵀ − N) Q_g,        then r ← Φᵀ r, N ← Φᵀ N Φ

P and N are made symmetric at every fix: updates do not reduce an antisymmetric part, so that Φ would let rounding
errors grow as errors grow without fixes, with t² and more.

r is the score of an impulse in the states and N its information; u/√d is the deleted residual of a row [2]_,
(z/f − K·r)/√(1/f − K·N K) for a row that is not taken.

References
----------
.. [1] S. J. Koopman, N. Shephard, Exact score for time series models in state space form, Biometrika 79 (1992).
.. [2] P. de Jong, J. Penzer, Diagnosing shocks in time series, J. Amer. Statist. Assoc. 93 (1998).
"""

from __future__ import annotations

import numba
import numpy as np

from models.array_copies import copy_matrix, copy_row
from models.arrays import BoolArray, FloatArray, IntArray
from models.filter_states.declaration import NAVIGATION_STATES

Places = tuple[IntArray, IntArray, FloatArray]
"""First places of the rows of a stack of matrices (n + 1,), columns (m,) and values (k, m)."""
Groups = tuple[IntArray, IntArray, IntArray, FloatArray]
"""First places of the groups of noise (g + 1,), rows, columns (m,) and values (k, m) of their lower halves."""


@numba.njit(cache=True, error_model="numpy")
def _gathered(
    first: int, last: int, column: IntArray, values: FloatArray, right: FloatArray, to: FloatArray
) -> None:
    """Set a row to the sum of values times rows of `right`, four at a time, which the compiler vectorises."""
    to[:] = 0.0
    fours = first + (last - first) // 4 * 4
    for e in range(first, fours, 4):
        a, b, c, d = values[e], values[e + 1], values[e + 2], values[e + 3]
        w, x, y, z = right[column[e]], right[column[e + 1]], right[column[e + 2]], right[column[e + 3]]
        for j in range(len(to)):
            to[j] += a * w[j] + b * x[j] + c * y[j] + d * z[j]
    for e in range(fours, last):
        a, w = values[e], right[column[e]]
        for j in range(len(to)):
            to[j] += a * w[j]


@numba.njit(cache=True, error_model="numpy")
def _product(
    start: IntArray, column: IntArray, values: FloatArray, right: FloatArray, out: FloatArray, half: bool
) -> None:
    """Set the first n rows of out to Φ @ right, or the lower half of them only."""
    for i in range(len(start) - 1):
        width = i + 1 if half else out.shape[1]
        _gathered(start[i], start[i + 1], column, values, right, out[i, :width])


@numba.njit(cache=True, error_model="numpy")
def _turned_product(
    start: IntArray, column: IntArray, values: FloatArray, right: FloatArray, out: FloatArray, half: bool
) -> None:
    """Set the first n rows of out to Φᵀ @ right, or the lower half of them only."""
    for i in range(len(start) - 1):
        out[i, : i + 1 if half else out.shape[1]] = 0.0
    for m in range(len(start) - 1):
        of = right[m]
        for e in range(start[m], start[m + 1]):
            c, to = values[e], out[column[e]]
            for j in range(column[e] + 1 if half else len(of)):
                to[j] += c * of[j]


@numba.njit(cache=True, error_model="numpy")
def _add(row: IntArray, column: IntArray, values: FloatArray, factor: float, out: FloatArray) -> None:
    """Add a factor times the lower half of a matrix to that of out."""
    for e in range(len(row)):
        out[row[e], column[e]] += factor * values[e]


@numba.njit(cache=True, error_model="numpy")
def _pull(row: IntArray, column: IntArray, values: FloatArray, r: FloatArray, N: FloatArray) -> float:
    """Return ½ tr (r rᵀ − N) Q of the lower half of Q."""
    total = 0.0
    for e in range(len(row)):
        m, j = row[e], column[e]
        c = (r[m] * r[j] - N[m, j]) * values[e]
        total += 0.5 * c if m == j else c
    return total


@numba.njit(cache=True, error_model="numpy")
def _mirror(matrix: FloatArray) -> None:
    """Make a matrix symmetric: its upper half that of its lower one."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            matrix[j, i] = matrix[i, j]


@numba.njit(cache=True, error_model="numpy")
def _flip(matrix: FloatArray, out: FloatArray) -> None:
    """Set out to the transpose."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[j, i] = matrix[i, j]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def forward(
    phi: Places,
    noise: Groups,
    factor: FloatArray,
    H: FloatArray,
    innovation: FloatArray,
    sd: FloatArray,
    available: BoolArray,
    rows: BoolArray,
    correction: FloatArray,
    initial: FloatArray,
    starts: BoolArray,
    B: FloatArray,
    D: FloatArray,
    decay: FloatArray,
    markov_sd: FloatArray,
    z: FloatArray,
    f: FloatArray,
    s: FloatArray,
    gains: FloatArray,
    covariance: FloatArray,
) -> None:
    """Run the filter; sets z, f (k, c), s (k, c, p) and gains K (k, c, N), N the states with those of the fixes.

    `phi` is Φ, `noise` by groups with the squared factors on them; c rows are measured. `decay` (k,) is e^{−Δt/T} of
    the Gauss–Markov error to each fix; N = n without it. Rows that are available and not taken get z, f, s and K as
    predicted. `covariance` is set to P after each fix, (k, N, N), where it is not empty.
    """
    k, n, p = H.shape[0], H.shape[2], B.shape[2]
    start, column, transition = phi
    group, places, across, spread = noise
    size = gains.shape[2]
    P, T, U = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
    a, b = np.zeros(size), np.zeros(size)
    V, W = np.zeros((size, p)), np.zeros((size, p))
    Ph, at = np.zeros(size), np.zeros(size, dtype=np.int64)
    copy_matrix(P, initial)
    for j in range(n, size):
        P[j, j] = markov_sd[j - n] ** 2
    for i in range(k):
        if i > 0 and starts[i]:
            a[:NAVIGATION_STATES] = 0.0
            V[:NAVIGATION_STATES] = 0.0
            P[:NAVIGATION_STATES] = 0.0
            P[:, :NAVIGATION_STATES] = 0.0
            copy_matrix(P, initial[:NAVIGATION_STATES, :NAVIGATION_STATES])
        F = transition[i]
        for m in range(n):
            b[m] = 0.0
            for e in range(start[m], start[m + 1]):
                b[m] += F[e] * a[column[e]]
        for m in range(n, size):
            b[m] = decay[i] * a[m]
        a, b = b, a
        if p:
            _product(start, column, F, V, W, False)
            for m in range(n):
                for q in range(p):
                    W[m, q] += B[i, m, q]
            for m in range(n, size):
                for q in range(p):
                    W[m, q] = decay[i] * V[m, q]
            V, W = W, V
        _product(start, column, F, P, T, False)
        for m in range(n, size):
            for j in range(size):
                T[m, j] = decay[i] * P[m, j]
        _flip(T, U)
        _product(start, column, F, U, P, True)
        for m in range(n, size):
            for j in range(size):
                P[m, j] = decay[i] * U[m, j]
            P[m, m] += markov_sd[m - n] ** 2 * (1.0 - decay[i] ** 2)
        for g in range(len(factor)):
            which = slice(group[g], group[g + 1])
            _add(places[which], across[which], spread[i, which], factor[g], P)
        _mirror(P)
        for row in range(H.shape[1]):
            if not available[i, row]:
                continue
            count = 0
            for j in range(n):
                if H[i, row, j] != 0.0:
                    at[count] = j
                    count += 1
            of_fix = n + row if row < 3 and size > n else -1
            residual = innovation[i, row]
            Ph[:] = 0.0
            for m in range(count):
                c = H[i, row, at[m]]
                residual -= c * a[at[m]]
                of = P[at[m]]
                for j in range(size):
                    Ph[j] += c * of[j]
            if of_fix >= 0:
                residual -= a[of_fix]
                for j in range(size):
                    Ph[j] += P[of_fix, j]
            variance = 0.0
            for m in range(count):
                variance += H[i, row, at[m]] * Ph[at[m]]
            if of_fix >= 0:
                variance += Ph[of_fix]
            variance = max(variance, 0.0) + sd[i, row] ** 2
            z[i, row], f[i, row] = residual, variance
            slope = s[i, row]
            copy_row(slope, D[i, row])
            for m in range(count):
                c, of = H[i, row, at[m]], V[at[m]]
                for q in range(p):
                    slope[q] += c * of[q]
            if of_fix >= 0:
                for q in range(p):
                    slope[q] += V[of_fix, q]
            for m in range(size):
                gains[i, row, m] = Ph[m] / variance
            if not rows[i, row]:
                continue
            root = np.sqrt(variance)
            for m in range(size):
                Ph[m] /= root
            for m in range(size):
                c = gains[i, row, m]
                a[m] += c * residual
                g, of, by = Ph[m], P[m], V[m]
                for j in range(size):
                    of[j] -= g * Ph[j]
                for q in range(p):
                    by[q] -= c * slope[q]
        for m in range(n):
            a[m] -= correction[i, m]
        if len(covariance):
            copy_matrix(covariance[i], P)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def backward(
    phi: Places,
    noise: Groups,
    factor: FloatArray,
    H: FloatArray,
    sd: FloatArray,
    available: BoolArray,
    rows: BoolArray,
    counted: BoolArray,
    starts: BoolArray,
    decay: FloatArray,
    markov_sd: FloatArray,
    z: FloatArray,
    f: FloatArray,
    gains: FloatArray,
    by_sd: FloatArray,
    by_process_noise: FloatArray,
    by_markov: FloatArray,
    deleted: FloatArray,
    precision: FloatArray,
    score: FloatArray,
    information: FloatArray,
) -> None:
    """Set the derivatives of ln L by the logs of the sds (k, c), of the factors (g,) and of markov_sd (3,).

    Also sets the deleted residual of each row by its sd, deleted (k, c), its inverse variance d, precision (k, c), and
    score (k, b) and information (k, b, b) of an impulse in states 9 … 9 + b − 1 just after each fix; all three hold
    where all rows taken count.
    """
    k, n, size, b = H.shape[0], H.shape[2], gains.shape[2], score.shape[1]
    start, column, transition = phi
    group, places, across, spread = noise
    N, T, U = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
    r, w, NK, h = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    by_process_noise[:] = 0.0
    by_markov[:] = 0.0
    for i in range(k - 1, -1, -1):
        for m in range(b):
            score[i, m] = r[NAVIGATION_STATES + m]
            for j in range(b):
                information[i, m, j] = N[NAVIGATION_STATES + m, NAVIGATION_STATES + j]
        for row in range(H.shape[1] - 1, -1, -1):
            by_sd[i, row] = 0.0
            if not available[i, row]:
                continue
            K, variance = gains[i, row], f[i, row]
            Kr = 0.0
            KNK = 0.0
            NK[:] = 0.0
            for m in range(size):
                c, of = K[m], N[m]
                Kr += c * r[m]
                for j in range(size):
                    NK[j] += c * of[j]
            for m in range(size):
                KNK += K[m] * NK[m]
            pull = z[i, row] / variance
            if not rows[i, row]:
                deleted[i, row] = (pull - Kr) / np.sqrt(max(1.0 / variance - KNK, 1e-6 / variance))
                continue
            own = 1.0 if counted[i, row] else 0.0
            u = own * pull - Kr
            weight = own / variance + KNK
            deleted[i, row] = u / np.sqrt(weight)
            precision[i, row] = weight
            by_sd[i, row] = sd[i, row] ** 2 * (u * u - weight - 2.0 * (1.0 - own) * Kr * pull)
            copy_row(h, H[i, row])
            if size > n:
                h[n:] = 0.0
                if row < 3:
                    h[n + row] = 1.0
            for m in range(size):
                if h[m] != 0.0:
                    r[m] += h[m] * u
                    of = N[m]
                    for j in range(size):
                        N[j, m] -= h[m] * NK[j]
                    for j in range(size):
                        of[j] += h[m] * (h[j] * weight - NK[j])
            if own == 0.0:
                for m in range(size):
                    if h[m] != 0.0:
                        for j in range(size):
                            N[m, j] -= pull * h[m] * r[j]
                            N[j, m] -= pull * h[m] * r[j]
        for g in range(len(factor)):
            which = slice(group[g], group[g + 1])
            by_process_noise[g] += _pull(places[which], across[which], spread[i, which], r, N)
        for m in range(n, size):
            gain = markov_sd[m - n] ** 2 * (1.0 - decay[i] ** 2)
            by_markov[m - n] += gain * (r[m] * r[m] - N[m, m])
        for m in range(size):
            w[m] = decay[i] * r[m] if m >= n else 0.0
        F = transition[i]
        for m in range(n):
            for e in range(start[m], start[m + 1]):
                w[column[e]] += F[e] * r[m]
        r, w = w, r
        _turned_product(start, column, F, N, T, False)
        for m in range(n, size):
            for j in range(size):
                T[m, j] = decay[i] * N[m, j]
        _flip(T, U)
        _turned_product(start, column, F, U, N, True)
        for m in range(n, size):
            for j in range(size):
                N[m, j] = decay[i] * U[m, j]
        _mirror(N)
        if i > 0 and starts[i]:
            r[:NAVIGATION_STATES] = 0.0
            N[:NAVIGATION_STATES] = 0.0
            N[:, :NAVIGATION_STATES] = 0.0
    for m in range(n, size):
        by_markov[m - n] += markov_sd[m - n] ** 2 * (r[m] * r[m] - N[m, m])
    for g in range(len(factor)):
        by_process_noise[g] *= factor[g]


@numba.njit(cache=True, error_model="numpy")
def unaided(phi: Places, push: FloatArray, starts: BoolArray, error: FloatArray) -> None:
    """Set the error (k, n) at every fix that inputs (k, n) cause where no filter corrects any of it."""
    start, column, transition = phi
    now = np.zeros(push.shape[1])
    for i in range(len(push)):
        if starts[i]:
            now[:NAVIGATION_STATES] = 0.0
        for m in range(len(start) - 1):
            total = push[i, m]
            for e in range(start[m], start[m + 1]):
                total += transition[i, e] * now[column[e]]
            error[i, m] = total
        copy_row(now, error[i])
