"""Compiled recursion over the epochs of a filter: its covariance and gains.

Fixes measure the first six states. Measurements with diagonal noise are processed one by one.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def covariance_recursion(phi, noise, fixed, r, start):  # type: ignore[no-untyped-def]
    """Return P after every epoch and the gains of its fix: (k, n, n), (k, n, 6).

    `phi` (k, n, n) and `noise` (k, s, n, n), by source, lead to each epoch from the one before; `fixed` (k,) tells
    which have a fix; `r` (6,) are the variances of fixes, `start` (n, n) is P before.
    """
    count, n, _ = phi.shape
    covariance, gain = np.empty((count, n, n)), np.zeros((count, n, 6))
    p = start.copy()
    for k in range(count):
        p = phi[k] @ p @ phi[k].T
        for source in noise[k]:
            p += source
        if fixed[k]:
            for j in range(6):
                column = p[:, j].copy()
                share = 1.0 / (column[j] + r[j]) * column
                for a in range(n):
                    for b in range(n):
                        p[a, b] -= share[a] * column[b]
            gain[k] = p[:, :6] / r
        covariance[k] = p
    return covariance, gain
