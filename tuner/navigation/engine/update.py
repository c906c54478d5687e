"""What fixes do to a covariance, in compiled code: gates, the update of a filter, the same gain for others."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.navigation.engine.measurement_models import CONSTRAINT
from tuner.navigation.engine.numba_pipeline import called, compiled
from tuner.navigation.engine.simd import as_rows
from tuner.navigation.engine.types import Own

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@compiled
def whiten(L: FloatArray, m: int, B: Any) -> None:
    """Replace the first m rows of B, of numbers or lanes, by L⁻¹ B."""
    for a in range(m):
        inverse = 1.0 / L[a, a]
        for j in range(B.shape[1]):
            y = B[a, j]
            for b in range(a):
                y -= L[a, b] * B[b, j]
            B[a, j] = y * inverse


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
    P_l, HP_l = as_rows(P), as_rows(HP)
    for a in range(m):
        for c in range(HP_l.shape[1]):
            HP_l[a, c] = 0.0
        for k in range(len(P)):
            h = H[a, k]
            if h != 0.0:
                for c in range(HP_l.shape[1]):
                    HP_l[a, c] += h * P_l[k, c]
    for b in range(m):
        for a in range(m):
            out[a, b] = sd[a] * sd[a] if a == b else 0.0
        for k in range(len(P)):
            h = H[b, k]
            if h != 0.0:
                for a in range(m):
                    out[a, b] += HP[a, k] * h


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
            distance = part[0, 0] * part[0, 0] + part[1, 0] * part[1, 0] + part[2, 0] * part[2, 0]
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
    rows_l, P_l = as_rows(rows), as_rows(P)
    whiten(L, count, rows_l)
    for i in range(n):
        y = 0.0
        for a in range(count):
            y += rows[a, i] * rows[a, n]
        dx[i] = y
        for c in range(P_l.shape[1]):
            left = P_l[i, c]
            for a in range(count):
                left -= rows[a, i] * rows_l[a, c]
            P_l[i, c] = left
    return True


@called
def gain(own: Own, sd: FloatArray, m: int, K: FloatArray) -> None:
    """Set Kᵀ = S⁻¹ H P of the first m rows of a fix, shape (m, n)."""
    spread(own.P, own.H, sd, m, K, own.block)
    factor(own.block, m, own.root)
    K_l = as_rows(K)
    whiten(own.root, m, K_l)
    for a in range(m - 1, -1, -1):
        inverse = 1.0 / own.root[a, a]
        for j in range(K_l.shape[1]):
            y = K_l[a, j]
            for b in range(a + 1, m):
                y -= own.root[b, a] * K_l[b, j]
            K_l[a, j] = y * inverse


@called
def joseph(P: FloatArray, H: FloatArray, K: FloatArray, sd: FloatArray, m: int, HP: FloatArray) -> None:
    """Replace P by (I − KH) P (I − KH)ᵀ + K R Kᵀ of m rows; K is given as Kᵀ (m, n), H P as `spread` sets it."""
    P_l, K_l, HP_l = as_rows(P), as_rows(K), as_rows(HP)
    n = len(P)
    for i in range(n):
        for c in range(P_l.shape[1]):
            left = P_l[i, c]
            for a in range(m):
                left -= K[a, i] * HP_l[a, c]
            P_l[i, c] = left
    for i in range(n):
        for a in range(m):
            y = sd[a] * sd[a] * K[a, i]
            for k in range(n):
                if H[a, k] != 0.0:
                    y -= P[i, k] * H[a, k]
            HP[a, i] = y
    for i in range(n):
        for c in range(P_l.shape[1]):
            grown = P_l[i, c]
            for a in range(m):
                grown += HP[a, i] * K_l[a, c]
            P_l[i, c] = grown
