"""Likelihood of a bias that switches between levels beside slow noise, by a bank of Kalman filters.

Model of block means y_t, states s_i,t (first-order Gauss–Markov or random walk) and level m_t of a few::

    y_t = D[m_t] + Σ_i s_i,t + v_t,      s_i,t+1 = φ_i s_i,t + w_i,t

m is a Markov chain with a matrix of chances a block. One Kalman filter runs for each level; before each block
their posteriors are mixed by the chances of a switch (interacting multiple models). The filters share one gain history
but for that mixing; with one level there is one Kalman filter and the likelihood is exact: `still`. With two slow
states, as searches have them, `paired` does the same as `switching` with up to seven, in a third of its time.

References
----------
.. [1] H. A. P. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian
   switching coefficients, IEEE Trans. Autom. Control 33 (1988).
"""

from __future__ import annotations

import numba
import numpy as np

from models.arrays import FloatArray

MAX_STATES = 7
"""Most slow states that `switching` holds: a random walk beside one rung a decade of six."""
TRIANGLE_SIZE = 32
"""Numbers kept of a covariance: the 28 of its triangle, row by row, and zeros up to whole vectors."""


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})  # type: ignore[misc, unused-ignore]
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

    `levels`, two or three, have the chances `first` (m,) at the start and `chances` (m, m) from row to column a block.
    `phi`, `q`, `initial` have shape (n,), n at most `MAX_STATES`: decay, process-noise and initial variance of each
    state; `r` (M,) is that of v. Covariances are triangles, written out so that they stay in registers; what levels
    apart add to a mixture is taken from their differences:
    Σ c_k (s_k − s̄)(s_k − s̄)ᵀ = Σ_{k>h} c_k c_h (s_k − s_h)(s_k − s_h)ᵀ.
    """
    n, modes = phi.size, levels.size
    p, ahead_p = np.zeros((modes, TRIANGLE_SIZE)), np.zeros((modes, TRIANGLE_SIZE))
    s, ahead_s = np.zeros((modes, MAX_STATES)), np.zeros((modes, MAX_STATES))
    spread, decay = np.zeros((modes * (modes - 1) // 2, TRIANGLE_SIZE)), np.zeros(TRIANGLE_SIZE)
    damped, noise = np.zeros(MAX_STATES), np.zeros(MAX_STATES)
    shares, away = np.zeros(modes), np.zeros(modes)
    chance, ahead = first.copy(), np.zeros(modes)
    for i in range(n):
        damped[i] = phi[i]
        for j in range(i + 1):
            decay[i * (i + 1) // 2 + j] = phi[i] * phi[j]
        for m in range(modes):
            p[m, i * (i + 3) // 2] = initial[i]
    total, product = 0.0, 1.0
    for t in range(y.size):
        if t > 0:
            if t == 1:
                for i in range(n):
                    noise[i] = q[i]
            pair = 0
            for k in range(1, modes):
                for h in range(k):
                    z = spread[pair]
                    a0, a1, a2 = s[k, 0] - s[h, 0], s[k, 1] - s[h, 1], s[k, 2] - s[h, 2]
                    a3, a4, a5 = s[k, 3] - s[h, 3], s[k, 4] - s[h, 4], s[k, 5] - s[h, 5]
                    a6 = s[k, 6] - s[h, 6]
                    z[0] = a0 * a0
                    z[1], z[2] = a1 * a0, a1 * a1
                    z[3], z[4], z[5] = a2 * a0, a2 * a1, a2 * a2
                    z[6], z[7], z[8], z[9] = a3 * a0, a3 * a1, a3 * a2, a3 * a3
                    z[10], z[11], z[12], z[13], z[14] = a4 * a0, a4 * a1, a4 * a2, a4 * a3, a4 * a4
                    z[15], z[16], z[17], z[18], z[19] = a5 * a0, a5 * a1, a5 * a2, a5 * a3, a5 * a4
                    z[20] = a5 * a5
                    z[21], z[22], z[23], z[24], z[25] = a6 * a0, a6 * a1, a6 * a2, a6 * a3, a6 * a4
                    z[26], z[27] = a6 * a5, a6 * a6
                    pair += 1
            for m in range(modes):
                ahead[m] = 1e-300
                for k in range(modes):
                    ahead[m] += chance[k] * chances[k, m]
                for k in range(modes):
                    shares[k] = chance[k] * chances[k, m] / ahead[m]
                a, b, ab = shares[0], shares[1], shares[0] * shares[1]
                if modes == 2:
                    for e in range(TRIANGLE_SIZE):
                        ahead_p[m, e] = (a * p[0, e] + b * p[1, e] + ab * spread[0, e]) * decay[e]
                    for i in range(MAX_STATES):
                        ahead_s[m, i] = (a * s[0, i] + b * s[1, i]) * damped[i]
                else:
                    c, ac, bc = shares[2], a * shares[2], b * shares[2]
                    for e in range(TRIANGLE_SIZE):
                        apart = ab * spread[0, e] + ac * spread[1, e] + bc * spread[2, e]
                        ahead_p[m, e] = (a * p[0, e] + b * p[1, e] + c * p[2, e] + apart) * decay[e]
                    for i in range(MAX_STATES):
                        ahead_s[m, i] = (a * s[0, i] + b * s[1, i] + c * s[2, i]) * damped[i]
            p, ahead_p = ahead_p, p
            s, ahead_s = ahead_s, s
            chance, ahead = ahead, chance
        least = np.inf
        for m in range(modes):
            x, mean = p[m], s[m]
            x[0] += noise[0]
            x[2] += noise[1]
            x[5] += noise[2]
            x[9] += noise[3]
            x[14] += noise[4]
            x[20] += noise[5]
            x[27] += noise[6]
            g0 = ((x[0] + x[1]) + (x[3] + x[6])) + ((x[10] + x[15]) + x[21])
            g1 = ((x[1] + x[2]) + (x[4] + x[7])) + ((x[11] + x[16]) + x[22])
            g2 = ((x[3] + x[4]) + (x[5] + x[8])) + ((x[12] + x[17]) + x[23])
            g3 = ((x[6] + x[7]) + (x[8] + x[9])) + ((x[13] + x[18]) + x[24])
            g4 = ((x[10] + x[11]) + (x[12] + x[13])) + ((x[14] + x[19]) + x[25])
            g5 = ((x[15] + x[16]) + (x[17] + x[18])) + ((x[19] + x[20]) + x[26])
            g6 = ((x[21] + x[22]) + (x[23] + x[24])) + ((x[25] + x[26]) + x[27])
            over = 1.0 / (r[t] + (((g0 + g1) + (g2 + g3)) + ((g4 + g5) + g6)))
            seen = ((mean[0] + mean[1]) + (mean[2] + mean[3])) + ((mean[4] + mean[5]) + mean[6])
            innovation = y[t] - levels[m] - seen
            moved = innovation * over
            mean[0] += g0 * moved
            mean[1] += g1 * moved
            mean[2] += g2 * moved
            mean[3] += g3 * moved
            mean[4] += g4 * moved
            mean[5] += g5 * moved
            mean[6] += g6 * moved
            weight = g0 * over
            x[0] = x[0] - weight * g0
            weight = g1 * over
            x[1], x[2] = x[1] - weight * g0, x[2] - weight * g1
            weight = g2 * over
            x[3], x[4], x[5] = x[3] - weight * g0, x[4] - weight * g1, x[5] - weight * g2
            weight = g3 * over
            x[6], x[7], x[8] = x[6] - weight * g0, x[7] - weight * g1, x[8] - weight * g2
            x[9] = x[9] - weight * g3
            weight = g4 * over
            x[10], x[11], x[12] = x[10] - weight * g0, x[11] - weight * g1, x[12] - weight * g2
            x[13], x[14] = x[13] - weight * g3, x[14] - weight * g4
            weight = g5 * over
            x[15], x[16], x[17] = x[15] - weight * g0, x[16] - weight * g1, x[17] - weight * g2
            x[18], x[19], x[20] = x[18] - weight * g3, x[19] - weight * g4, x[20] - weight * g5
            weight = g6 * over
            x[21], x[22], x[23] = x[21] - weight * g0, x[22] - weight * g1, x[23] - weight * g2
            x[24], x[25], x[26] = x[24] - weight * g3, x[25] - weight * g4, x[26] - weight * g5
            x[27] = x[27] - weight * g6
            chance[m] *= np.sqrt(over)
            away[m] = 0.5 * innovation * moved
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


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})  # type: ignore[misc, unused-ignore]
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


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})  # type: ignore[misc, unused-ignore]
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
