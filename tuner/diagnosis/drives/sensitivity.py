"""Whitened innovations and what unknown constants do to them, by one recursion over a linear record.

The separate-bias form of Friedland [1]_: with the filter's own gains K, the error that constants θ cause is V θ,

    V⁻ = Φ V + B        s = H V⁻ + D        V = V⁻ − K s        e⁻ = Φ e        ν − H e⁻ = s θ + white of covariance S

and e is what is left of the error that the corrections applied did not take away (0 where they are the Kalman
filter's own). With L Lᵀ = S: W = L⁻¹ (ν − H e⁻) is white under the model, and W = (L⁻¹ s) θ + white.

References
----------
.. [1] B. Friedland, Treatment of bias in recursive filtering, IEEE Trans. Automatic Control 14 (1969).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.drives.record import LinearRecord

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Whitened:
    """A record made white.

    Attributes
    ----------
    t : ndarray, shape (k,)
        s.
    residual : ndarray, shape (k, 6)
        W; 0 in rows that do not count.
    slope : ndarray, shape (k, 6, p)
        L⁻¹ s.
    counted : ndarray of bool, shape (k, 6)
        Rows that count.
    log_likelihood : ndarray, shape (k,)
        Of each fix, nats, less a constant.
    """

    t: FloatArray
    residual: FloatArray
    slope: FloatArray
    counted: BoolArray
    log_likelihood: FloatArray


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _follow(
    phi: FloatArray,
    Q: FloatArray,
    H: FloatArray,
    B: FloatArray,
    D: FloatArray,
    nu: FloatArray,
    sd: FloatArray,
    used: BoolArray,
    correction: FloatArray,
    initial: FloatArray,
    starts: BoolArray,
    slopes: IntArray,
    W: FloatArray,
    SW: FloatArray,
    ll: FloatArray,
) -> None:
    """Fill W (k, 6), SW (k, 6, p) and ll (k,)."""
    k, n, p = len(nu), initial.shape[0], B.shape[2]
    P, V, e = initial.copy(), np.zeros((n, p)), np.zeros(n)
    T = np.empty((9, n))
    for i in range(k):
        if starts[i] and i > 0:
            P[:9, :] = 0.0
            P[:, :9] = 0.0
            P[:9, :9] = initial[:9, :9]
            V[:9] = 0.0
            e[:9] = 0.0
        top = phi[i, :9]
        # P ← Φ P Φᵀ + Q, Φ = (top; diagonal and a few slopes)
        T[:] = top @ P
        P[:9, :9] = T @ top.T
        for j in range(9, n):
            for a in range(9):
                y = T[a, j] * phi[i, j, j]
                if slopes[j] >= 0:
                    y += T[a, slopes[j]] * phi[i, j, slopes[j]]
                P[a, j] = P[j, a] = y
        for a in range(9, n):
            for j in range(9, n):
                y = P[a, j] * phi[i, a, a]
                if slopes[a] >= 0:
                    y += P[slopes[a], j] * phi[i, a, slopes[a]]
                P[a, j] = y
        for j in range(9, n):
            for a in range(9, n):
                y = P[a, j] * phi[i, j, j]
                if slopes[j] >= 0:
                    y += P[a, slopes[j]] * phi[i, j, slopes[j]]
                P[a, j] = y
        P += Q[i]
        head = top @ V
        e[:9] = top @ e
        for j in range(9, n):
            for q in range(p):
                V[j, q] *= phi[i, j, j]
                if slopes[j] >= 0:
                    V[j, q] += phi[i, j, slopes[j]] * V[slopes[j], q]
            e[j] = phi[i, j, j] * e[j] + (phi[i, j, slopes[j]] * e[slopes[j]] if slopes[j] >= 0 else 0.0)
        V[:9] = head
        V += B[i]
        rows = np.flatnonzero(used[i])
        m = len(rows)
        if m > 0:
            Hu, r = np.empty((m, n)), np.empty(m)
            s = np.empty((m, p))
            for a in range(m):
                Hu[a] = H[i, rows[a]]
                r[a] = nu[i, rows[a]]
                s[a] = D[i, rows[a]]
            HP = Hu @ P
            S = HP @ Hu.T
            for a in range(m):
                S[a, a] += sd[i, rows[a]] ** 2
            L = np.linalg.cholesky(S)
            s += Hu @ V
            r -= Hu @ e
            for a in range(m):
                for b in range(a):
                    HP[a] -= L[a, b] * HP[b]
                    s[a] -= L[a, b] * s[b]
                    r[a] -= L[a, b] * r[b]
                HP[a] /= L[a, a]
                s[a] /= L[a, a]
                r[a] /= L[a, a]
                W[i, rows[a]], SW[i, rows[a]] = r[a], s[a]
                ll[i] -= 0.5 * r[a] * r[a] + np.log(L[a, a])
            P -= HP.T @ HP
            V -= HP.T @ s
            e += HP.T @ r
        e -= correction[i]


def whitened(record: LinearRecord) -> Whitened:
    """Return the innovations of a record made white, and their sensitivities."""
    k, p = len(record), len(record.parameters)
    n = record.initial.shape[0]
    slopes = np.full(n, -1)
    beside = np.abs(record.transition[:, 9:, 9:]).max(axis=0)
    np.fill_diagonal(beside, 0.0)
    for j, of in zip(*np.nonzero(beside), strict=True):
        slopes[9 + j] = 9 + of
    w, sw, ll = np.zeros((k, 6)), np.zeros((k, 6, p)), np.zeros(k)
    q = np.zeros_like(record.transition)
    for part in record.noise.values():
        q += part
    _follow(
        record.transition,
        q,
        record.H,
        record.drive,
        record.seen,
        record.innovation,
        record.sd,
        record.used,
        record.correction,
        record.initial,
        record.starts,
        slopes,
        w,
        sw,
        ll,
    )
    counted = record.counted
    return Whitened(
        record.t,
        np.where(counted, w, 0.0),
        np.where(counted[..., None], sw, 0.0),
        counted,
        np.where(record.scored, ll, 0.0),
    )
