"""Compiled recursions over the epochs of a filter: its covariance, and the likelihood of its errors.

Fixes measure the first six states. Measurements with diagonal noise are processed one by one.
"""

from __future__ import annotations

from math import log

import numba
import numpy as np

from models.array_copies import copy_matrix


@numba.njit(cache=True, nogil=True)
def covariance_recursion(phi, noise, fixed, q, r, start):  # type: ignore[no-untyped-def]
    """Return P after every epoch and the gains of its fix: (k, n, n), (k, n, 6).

    `phi` (k, n, n) and `noise` (k, s, n, n), by source, lead to each epoch from the one before; `fixed` (k,) tells
    which have a fix; `q` (s,) multiplies the noise, `r` (6,) are the variances of fixes, `start` (n, n) is P before.
    """
    count, n, _ = phi.shape
    sources = len(q)
    covariance, gain = np.empty((count, n, n)), np.zeros((count, n, 6))
    p = start.copy()
    for k in range(count):
        p = phi[k] @ p @ phi[k].T
        for s in range(sources):
            p += q[s] * noise[k, s]
        if fixed[k]:
            for j in range(6):
                column = p[:, j].copy()
                scale = 1.0 / (column[j] + r[j])
                for a in range(n):
                    for b in range(n):
                        p[a, b] -= scale * column[a] * column[b]
            for j in range(6):
                for a in range(n):
                    gain[k, a, j] = p[a, j] / r[j]
        copy_matrix(covariance[k], p)
    return covariance, gain


@numba.njit(cache=True, nogil=True)
def error_likelihood(dynamics, noise, shift, start, seen, variance, known, inputs, outputs):  # type: ignore[no-untyped-def]
    """Return Σ ln s and the products of whitened residuals of data and regressors, (1 + m, 1 + m).

    The errors obey e_k = dynamics_k e_{k−1} + shift_k + inputs_k b + noise, and are seen as
    seen_k = e_k[:c] + outputs_k b + white noise of `variance` (k, c), where `known` (k, c); b are m unknown constants.
    Twice the negative log likelihood is Σ ln s + the first product, less what regression on the others takes away.
    """
    count, n, _ = dynamics.shape
    c = seen.shape[1]
    m = inputs.shape[2]
    p = start.copy()
    mean = np.zeros((n, 1 + m))
    products = np.zeros((1 + m, 1 + m))
    logs = 0.0
    row = np.empty(1 + m)
    for k in range(count):
        mean = dynamics[k] @ mean
        p = dynamics[k] @ p @ dynamics[k].T + noise[k]
        for a in range(n):
            mean[a, 0] += shift[k, a]
            for i in range(m):
                mean[a, 1 + i] += inputs[k, a, i]
        for j in range(c):
            if not known[k, j]:
                continue
            s = p[j, j] + variance[k, j]
            row[0] = seen[k, j] - mean[j, 0]
            for i in range(m):
                row[1 + i] = outputs[k, j, i] + mean[j, 1 + i]
            column = p[:, j].copy()
            logs += log(s)
            for a in range(1 + m):
                for b in range(1 + m):
                    products[a, b] += row[a] * row[b] / s
            for a in range(n):
                share = column[a] / s
                mean[a, 0] += share * row[0]
                for i in range(m):
                    mean[a, 1 + i] -= share * row[1 + i]
                for b in range(n):
                    p[a, b] -= share * column[b]
    return logs, products
