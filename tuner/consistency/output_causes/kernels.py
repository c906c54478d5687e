"""Compiled recursions over the epochs of a filter: its covariance, and the likelihood of its errors.

Fixes measure the first six states. Measurements with diagonal noise are processed one by one.
"""

from __future__ import annotations

from math import log

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


@numba.njit(cache=True, nogil=True)
def error_likelihood(dynamics, noise, shift, start, seen, variance, known, inputs, outputs):  # type: ignore[no-untyped-def]
    """Return Σ ln s and the products of whitened residuals of data and regressors, (1 + m, 1 + m).

    The errors obey e_k = dynamics_k e_{k−1} + shift_k + inputs_k b + noise, and are seen as
    seen_k = e_k[:c] + outputs_k b + white noise of `variance` (k, c), where `known` (k, c); b are m unknown constants.
    Twice the negative log likelihood is Σ ln s + the first product, less what regression on the others takes away.
    """
    n, m = inputs.shape[1:]
    p = start.copy()
    mean = np.zeros((n, 1 + m))  # of data; less those of regressors
    products = np.zeros((1 + m, 1 + m))
    logs = 0.0
    for k in range(len(dynamics)):
        mean = dynamics[k] @ mean
        p = dynamics[k] @ p @ dynamics[k].T + noise[k]
        mean[:, 0] += shift[k]
        mean[:, 1:] -= inputs[k]
        for j in np.flatnonzero(known[k]):
            s = p[j, j] + variance[k, j]
            row = -mean[j]
            row[0] += seen[k, j]
            row[1:] += outputs[k, j]
            column = p[:, j].copy()
            logs += log(s)
            for a in range(1 + m):
                for b in range(1 + m):
                    products[a, b] += row[a] * row[b] / s
            for a in range(n):
                share = column[a] / s
                for b in range(1 + m):
                    mean[a, b] += share * row[b]
                for b in range(n):
                    p[a, b] -= share * column[b]
    return logs, products
