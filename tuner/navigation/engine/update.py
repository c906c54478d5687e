"""Update of one filter by a fix, in compiled code: gates, gain and covariance, also with the gain of another filter."""

from __future__ import annotations

from typing import Any

import numpy as np

from models.arrays import FloatArray
from tuner.navigation.engine.compilation import block, inlined, merged
from tuner.navigation.engine.layout import CONSTRAINT_CODE, indices
from tuner.navigation.engine.state import (
    BLOCK_ROWS,
    CORRECTION,
    COVARIANCE_ROWS,
    INNOVATION,
    INNOVATION_ROWS,
    JACOBIAN_ROWS,
    LIMITS,
    ROOT_ROWS,
    SENSOR_ROWS,
    WHITENED,
)

AXES, FIRST_FILTER = indices(3, 0)


@block
def factor(m: Any, S: int, size: int) -> None:
    """Set `ROOT_ROWS` to L of S = L Lᵀ; S is the upper left of the scratch from row S on, its lower triangle used."""
    T = m.scratch
    for a in range(size):
        for b in range(a + 1):
            y = T[S + a, b]
            for c in range(b):
                y -= T[ROOT_ROWS + a, c] * T[ROOT_ROWS + b, c]
            T[ROOT_ROWS + a, b] = np.sqrt(y) if a == b else y / T[ROOT_ROWS + b, b]


@block
def whiten(m: Any, size: int, B: int) -> None:
    """Replace the rows of the scratch from B by L⁻¹ times them."""
    T, n = m.scratch, m.size
    for a in range(size):
        for b in range(a):
            factor_ab = T[ROOT_ROWS + a, b]
            for j in range(n):
                T[B + a, j] -= factor_ab * T[B + b, j]
        inverse = 1.0 / T[ROOT_ROWS + a, a]
        for j in range(n):
            T[B + a, j] *= inverse


@inlined
def whiten_vector(T: FloatArray, size: int) -> None:
    """Replace the first elements of `WHITENED` by L⁻¹ times them."""
    for a in range(size):
        for b in range(a):
            T[WHITENED, a] -= T[ROOT_ROWS + a, b] * T[WHITENED, b]
        T[WHITENED, a] /= T[ROOT_ROWS + a, a]


@block
def predict_innovation(m: Any, e: Any, w: int, size: int, HP: int) -> None:
    """Set `COVARIANCE_ROWS`, S = H P Hᵀ + R of filter w, and on the way the rows of the scratch from HP to H P."""
    P, T, n = e.P_each, m.scratch, m.size
    for a in range(size):
        for j in range(n):
            T[HP + a, j] = 0.0
        for k in range(n):
            h = T[JACOBIAN_ROWS + a, k]
            if h != 0.0:
                for j in range(n):
                    T[HP + a, j] += h * P[w, k, j]
    for b in range(size):
        for a in range(size):
            y = m.sd[w, a] * m.sd[w, a] if a == b else 0.0
            for k in range(n):
                y += T[HP + a, k] * T[JACOBIAN_ROWS + b, k]
            T[COVARIANCE_ROWS + a, b] = y


@block
def subtract_products(m: Any, e: Any, w: int, left: int, right: int, size: int) -> None:
    """Replace P of filter w by P − leftᵀ right, of rows of the scratch; three or six."""
    P, T, n = e.P_each, m.scratch, m.size
    for i in range(n):
        for first in range(0, size, 3):
            p, q = left + first, right + first
            a, b, c = T[p, i], T[p + 1, i], T[p + 2, i]
            for j in range(n):
                P[w, i, j] -= a * T[q, j] + b * T[q + 1, j] + c * T[q + 2, j]


@merged
def update(m: Any, e: Any, w: int, available: int, withheld: bool) -> bool:
    """Gate a fix and use it: sets dx, `COVARIANCE_ROWS` (6, 6), `use`, changes P; returns whether dx is to be added.

    With the whitened rows V = L⁻¹ H P of S = L Lᵀ:  P ← P − Vᵀ V,  dx = Vᵀ L⁻¹ z.

    Parameters
    ----------
    m : record
        See `state`; the scratch contains the limits, and z and H of the fix.
    w : int
        The filter.
    available : int
        1 position only, 2 with velocity; `CONSTRAINT_CODE`.
    withheld : bool
        Whether it is only compared.
    """
    T, use, n = m.scratch, m.use, m.size
    constrained = available == CONSTRAINT_CODE
    groups = 1 if constrained else available
    for a in range(6):
        for b in range(6):
            T[COVARIANCE_ROWS + a, b] = 0.0
    predict_innovation(m, e, w, 3 * groups, INNOVATION_ROWS)
    for g in range(2):
        use[g] = 0
        if g < groups:
            for a in range(3):
                T[WHITENED, a] = T[INNOVATION, 3 * g + a]
                for b in range(3):
                    T[BLOCK_ROWS + a, b] = T[COVARIANCE_ROWS + 3 * g + a, 3 * g + b]
            factor(m, BLOCK_ROWS, AXES)
            whiten_vector(T, AXES)
            distance = T[WHITENED, 0] * T[WHITENED, 0] + T[WHITENED, 1] * T[WHITENED, 1]
            distance += T[WHITENED, 2] * T[WHITENED, 2]
            limit = T[INNOVATION, 5] if constrained else T[LIMITS, g]
            use[g] = 3 if withheld else 1 if distance <= limit else 2
            if constrained:
                T[INNOVATION, 3], T[INNOVATION, 4] = use[g], distance
    count, first = 3 * ((use[0] == 1) + (use[1] == 1)), 3 * (use[0] != 1)
    if constrained:
        use[0] = 0
    if count == 0:
        return False
    rows = INNOVATION_ROWS + first
    for a in range(count):
        T[WHITENED, a] = T[INNOVATION, first + a]
        for b in range(count):
            T[BLOCK_ROWS + a, b] = T[COVARIANCE_ROWS + first + a, first + b]
    factor(m, BLOCK_ROWS, count)
    whiten_vector(T, count)
    whiten(m, count, rows)
    for j in range(n):
        T[CORRECTION, j] = 0.0
    for a in range(count):
        share = T[WHITENED, a]
        for j in range(n):
            T[CORRECTION, j] += T[rows + a, j] * share
    subtract_products(m, e, w, rows, rows, count)
    return True


@merged
def gain(m: Any, e: Any, size: int) -> None:
    """Set `SENSOR_ROWS` of the scratch to Kᵀ = S⁻¹ H P of the first rows of a fix of the first filter."""
    T, n = m.scratch, m.size
    predict_innovation(m, e, FIRST_FILTER, size, SENSOR_ROWS)
    factor(m, COVARIANCE_ROWS, size)
    whiten(m, size, SENSOR_ROWS)
    for a in range(size - 1, -1, -1):
        for b in range(a + 1, size):
            for j in range(n):
                T[SENSOR_ROWS + a, j] -= T[ROOT_ROWS + b, a] * T[SENSOR_ROWS + b, j]
        inverse = 1.0 / T[ROOT_ROWS + a, a]
        for j in range(n):
            T[SENSOR_ROWS + a, j] *= inverse


@merged
def apply_gain(m: Any, e: Any, w: int, size: int) -> None:
    """Replace P by (I − KH) P (I − KH)ᵀ + K R Kᵀ; `SENSOR_ROWS` is Kᵀ, `INNOVATION_ROWS` H P."""
    P, T, n = e.P_each, m.scratch, m.size
    subtract_products(m, e, w, SENSOR_ROWS, INNOVATION_ROWS, size)
    for a in range(size):
        for i in range(n):
            y = -m.sd[w, a] * m.sd[w, a] * T[SENSOR_ROWS + a, i]
            for k in range(n):
                if T[JACOBIAN_ROWS + a, k] != 0.0:
                    y += P[w, i, k] * T[JACOBIAN_ROWS + a, k]
            T[INNOVATION_ROWS + a, i] = y
    subtract_products(m, e, w, INNOVATION_ROWS, SENSOR_ROWS, size)
