"""Likelihood of a bias that switches between levels beside slow noise, by a bank of Kalman filters.

Model of block means y_t, states s_i,t (first-order Gauss–Markov or random walk) and level m_t of a few::

    y_t = D[m_t] + Σ_i s_i,t + v_t,      s_i,t+1 = φ_i s_i,t + w_i,t

m is a Markov chain with a matrix of chances a block. One Kalman filter runs for each level; before each block
their posteriors are mixed by the chances of a switch (interacting multiple models). The filters share one gain history
but for that mixing; with one level there is one Kalman filter and the likelihood is exact: `still`. With two slow
states, as searches have them, `paired` does the same as `switching` with any number, in a quarter of its time.

References
----------
.. [1] H. A. P. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian
   switching coefficients, IEEE Trans. Autom. Control 33 (1988).
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc, unused-ignore]
def switching(
    y: FloatArray,
    levels: FloatArray,
    first: FloatArray,
    chances: FloatArray,
    phi: FloatArray,
    q: FloatArray,
    initial: FloatArray,
    r: FloatArray,
    path: FloatArray,
) -> float:
    """Return the log likelihood of y, shape (M,); fill `path` (M or 0) with the mean of the level so far.

    `levels` (m,) has the chances `first` (m,) at the start and `chances` (m, m) from row to column a block.
    `phi`, `q`, `initial` have shape (n,): decay, process-noise and initial variance of each state; `r` (M,) is that of
    v. Covariances are kept as triangles, row by row; what levels apart add to a mixture is taken from their
    differences: Σ c_k (s_k − s̄)(s_k − s̄)ᵀ = Σ_{k>h} c_k c_h (s_k − s_h)(s_k − s_h)ᵀ.
    """
    n, modes = phi.size, levels.size
    size = n * (n + 1) // 2
    p, ahead_p = np.zeros((modes, size)), np.zeros((modes, size))
    s, ahead_s = np.zeros((modes, n)), np.zeros((modes, n))
    spread, decay = np.zeros((modes * (modes - 1) // 2, size)), np.zeros(size)
    off, gain, away = np.zeros(n), np.zeros(n), np.zeros(modes)
    chance, ahead = first.copy(), np.zeros(modes)
    at = 0
    for i in range(n):
        for j in range(i + 1):
            decay[at] = phi[i] * phi[j]
            at += 1
        p[:, at - 1] = initial[i]
    total, product = 0.0, 1.0
    for t in range(y.size):
        if t > 0:
            pair = 0
            for k in range(1, modes):
                for h in range(k):
                    for i in range(n):
                        off[i] = s[k, i] - s[h, i]
                    at = 0
                    for i in range(n):
                        for j in range(i + 1):
                            spread[pair, at] = off[i] * off[j]
                            at += 1
                    pair += 1
            for m in range(modes):
                ahead[m] = 1e-300
                for k in range(modes):
                    ahead[m] += chance[k] * chances[k, m]
                share = chance[0] * chances[0, m] / ahead[m]
                for i in range(n):
                    ahead_s[m, i] = share * s[0, i]
                for at in range(size):
                    ahead_p[m, at] = share * p[0, at]
                pair = 0
                for k in range(1, modes):
                    share = chance[k] * chances[k, m] / ahead[m]
                    for i in range(n):
                        ahead_s[m, i] += share * s[k, i]
                    for at in range(size):
                        ahead_p[m, at] += share * p[k, at]
                    for h in range(k):
                        both = share * chance[h] * chances[h, m] / ahead[m]
                        for at in range(size):
                            ahead_p[m, at] += both * spread[pair, at]
                        pair += 1
                for at in range(size):
                    ahead_p[m, at] *= decay[at]
                at = -1
                for i in range(n):
                    at += i + 1
                    ahead_p[m, at] += q[i]
                    ahead_s[m, i] *= phi[i]
            p, ahead_p = ahead_p, p
            s, ahead_s = ahead_s, s
            chance, ahead = ahead, chance
        least = np.inf
        for m in range(modes):
            variance, innovation = r[t], y[t] - levels[m]
            at = 0
            for i in range(n):
                gain[i] = 0.0
                for j in range(i):
                    gain[i] += p[m, at]
                    gain[j] += p[m, at]
                    at += 1
                gain[i] += p[m, at]
                at += 1
                innovation -= s[m, i]
            for i in range(n):
                variance += gain[i]
            at = 0
            for i in range(n):
                weight = gain[i] / variance
                s[m, i] += weight * innovation
                for j in range(i + 1):
                    p[m, at] -= weight * gain[j]
                    at += 1
            chance[m] /= np.sqrt(variance)
            away[m] = 0.5 * innovation * innovation / variance
            least = min(least, away[m])
        weight = 0.0
        for m in range(modes):
            chance[m] *= np.exp(least - away[m])
            weight += chance[m]
        for m in range(modes):
            chance[m] /= weight
        total -= least
        product *= weight
        if not 1e-100 < product < 1e100:
            total += np.log(product)
            product = 1.0
        if path.size:
            path[t] = 0.0
            for m in range(modes):
                path[t] += chance[m] * levels[m]
    return float(total + np.log(product))


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def still(y: FloatArray, phi: FloatArray, q: FloatArray, initial: FloatArray, r: FloatArray) -> float:
    """Return the log likelihood of y, shape (M,), with one level of 0: `switching` without switches."""
    n = phi.size
    p, s, gain = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for i in range(n):
        p[i, i] = initial[i]
    total = 0.0
    for t in range(y.size):
        variance, innovation = r[t], y[t]
        for i in range(n):
            gain[i] = 0.0
            for j in range(n):
                gain[i] += p[i, j]
            variance += gain[i]
            innovation -= s[i]
        total -= 0.5 * (innovation * innovation / variance + np.log(variance))
        for i in range(n):
            s[i] = phi[i] * (s[i] + gain[i] * innovation / variance)
            for j in range(i + 1):
                p[i, j] = phi[i] * phi[j] * (p[i, j] - gain[i] * gain[j] / variance)
                p[j, i] = p[i, j]
            p[i, i] += q[i]
    return total


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def paired(
    y: FloatArray,
    levels: FloatArray,
    first: FloatArray,
    chances: FloatArray,
    phi: FloatArray,
    q: FloatArray,
    initial: FloatArray,
    r: FloatArray,
    path: FloatArray,
) -> float:
    """Return the result of `switching` for two slow states: means s and covariances p are written out."""
    modes = levels.size
    s0, s1, p00, p10, p11 = (
        np.zeros(modes),
        np.zeros(modes),
        np.zeros(modes),
        np.zeros(modes),
        np.zeros(modes),
    )
    chance, ahead, away = first.copy(), np.zeros(modes), np.zeros(modes)
    mixed = np.zeros((modes, 5))
    a, b = phi[0], phi[1]
    p00[:], p11[:] = initial[0], initial[1]
    total, product = 0.0, 1.0
    for t in range(y.size):
        if t > 0:
            for m in range(modes):
                ahead[m] = 1e-300
                for k in range(modes):
                    ahead[m] += chance[k] * chances[k, m]
                mean0, mean1, v00, v10, v11 = 0.0, 0.0, 0.0, 0.0, 0.0
                for k in range(modes):
                    share = chance[k] * chances[k, m] / ahead[m]
                    mean0 += share * s0[k]
                    mean1 += share * s1[k]
                for k in range(modes):
                    share = chance[k] * chances[k, m] / ahead[m]
                    off0, off1 = s0[k] - mean0, s1[k] - mean1
                    v00 += share * (p00[k] + off0 * off0)
                    v10 += share * (p10[k] + off0 * off1)
                    v11 += share * (p11[k] + off1 * off1)
                mixed[m, 0], mixed[m, 1] = a * mean0, b * mean1
                mixed[m, 2], mixed[m, 3], mixed[m, 4] = a * a * v00 + q[0], a * b * v10, b * b * v11 + q[1]
            for m in range(modes):
                chance[m], s0[m], s1[m] = ahead[m], mixed[m, 0], mixed[m, 1]
                p00[m], p10[m], p11[m] = mixed[m, 2], mixed[m, 3], mixed[m, 4]
        least = np.inf
        for m in range(modes):
            gain0, gain1 = p00[m] + p10[m], p10[m] + p11[m]
            over = 1.0 / (r[t] + gain0 + gain1)
            innovation = y[t] - levels[m] - s0[m] - s1[m]
            s0[m] += gain0 * innovation * over
            s1[m] += gain1 * innovation * over
            p00[m] -= gain0 * gain0 * over
            p10[m] -= gain0 * gain1 * over
            p11[m] -= gain1 * gain1 * over
            chance[m] *= np.sqrt(over)
            away[m] = 0.5 * innovation * innovation * over
            least = min(least, away[m])
        weight = 0.0
        for m in range(modes):
            chance[m] *= np.exp(least - away[m])
            weight += chance[m]
        for m in range(modes):
            chance[m] /= weight
        total -= least
        product *= weight
        if not 1e-100 < product < 1e100:
            total += np.log(product)
            product = 1.0
        if path.size:
            path[t] = 0.0
            for m in range(modes):
                path[t] += chance[m] * levels[m]
    return float(total + np.log(product))
