"""What fixes do to a covariance, in compiled code: gates, the update of a filter, the same gain for others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tuner.navigation.compiled import Own
from tuner.navigation.compiler import called, compiled
from tuner.navigation.updates import CONSTRAINT

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
def factor(S: FloatArray, m: int, L: FloatArray) -> None:
    """Set L with S = L Lᵀ, the upper left (m, m); what is above the diagonal is nothing."""
    for a in range(m):
        for b in range(a + 1):
            y = S[a, b]
            for c in range(b):
                y -= L[a, c] * L[b, c]
            L[a, b] = np.sqrt(y) if a == b else y / L[b, b]


@called
def spread(P: FloatArray, H: FloatArray, sd: FloatArray, m: int, HP: FloatArray, out: FloatArray) -> None:
    """Set the covariance of the first m innovations, H P Hᵀ + R, and H P (m, n) on the way."""
    n = P.shape[0]
    for a in range(m):
        for j in range(n):
            HP[a, j] = 0.0
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    HP[a, j] += H[a, k] * P[k, j]
        for b in range(m):
            y = sd[a] * sd[a] if a == b else 0.0
            for k in range(n):
                y += HP[a, k] * H[b, k]
            out[a, b] = y


@called
def update(own: Own, sd: FloatArray, available: int, withheld: bool, S: FloatArray, use: IntArray) -> bool:
    """Gate a fix and use it: sets dx, S (6, 6) and `use` (2,), changes P; returns whether dx is to be added.

    With the whitened rows W = L⁻¹ H P of S = L Lᵀ:  P ← P − Wᵀ W,  dx = Wᵀ L⁻¹ z.

    Parameters
    ----------
    own : Own
        P, the limits, and the fix made linear: z, H.
    sd : ndarray, shape (6,)
        Of the fix.
    available : int
        1 position only, 2 with velocity; `CONSTRAINT`.
    withheld : bool
        Whether it is only compared.
    """
    P, z, rows, chosen, L, part, dx = own.P, own.z, own.rows, own.block, own.root, own.part, own.dx
    constrained = available == CONSTRAINT
    groups = 1 if constrained else available
    n = P.shape[0]
    S[:] = 0.0
    spread(P, own.H, sd, 3 * groups, rows, S)
    for a in range(3 * groups):
        rows[a, n] = z[a]
    count = 0
    for g in range(2):
        use[g] = 0
        if g < groups:
            for a in range(3):
                part[a, 0] = z[3 * g + a]
                for b in range(3):
                    chosen[a, b] = S[3 * g + a, 3 * g + b]
            factor(chosen, 3, L)
            whiten(L, 3, part)
            distance = part[0, 0] ** 2 + part[1, 0] ** 2 + part[2, 0] ** 2
            limit = z[5] if constrained else own.limits[g]
            use[g] = 3 if withheld else 1 if distance <= limit else 2
            if constrained:
                z[3], z[4] = use[g], distance
            if use[g] == 1:
                for a in range(3):
                    for j in range(n + 1):
                        rows[count + a, j] = rows[3 * g + a, j]
                count += 3
    first = 0 if use[0] == 1 else 3
    if constrained:
        use[0] = 0
    if count == 0:
        return False
    for a in range(count):
        for b in range(count):
            chosen[a, b] = S[first + a, first + b]
    factor(chosen, count, L)
    whiten(L, count, rows)
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


@called
def gain(own: Own, sd: FloatArray, m: int, K: FloatArray) -> None:
    """Set Kᵀ = S⁻¹ H P of the first m rows of a fix, shape (m, n)."""
    spread(own.P, own.H, sd, m, K, own.block)
    factor(own.block, m, own.root)
    whiten(own.root, m, K)
    for a in range(m - 1, -1, -1):
        for j in range(K.shape[1]):
            y = K[a, j]
            for b in range(a + 1, m):
                y -= own.root[b, a] * K[b, j]
            K[a, j] = y / own.root[a, a]


@called
def joseph(P: FloatArray, H: FloatArray, K: FloatArray, sd: FloatArray, m: int, HP: FloatArray) -> None:
    """Replace P by (I − KH) P (I − KH)ᵀ + K R Kᵀ of m rows; K is given as Kᵀ (m, n), H P as `spread` sets it."""
    n = P.shape[0]
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
