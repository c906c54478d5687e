"""Filter for a bias that switches between two levels while other slow noise runs on.

Model of block means y_t, states s_i,t (first-order Gauss–Markov or random walk) and level m_t ∈ {0, 1}::

    y_t = D m_t + Σ_i s_i,t + v_t,      s_i,t+1 = φ_i s_i,t + w_i,t

m is a Markov chain with the chances p01, p10 a block. One Kalman filter runs for each level; before each block
their posteriors are mixed by the chances of a switch (interacting multiple models). Both filters share one gain history
but for that mixing; with D = 0 they are one Kalman filter and the likelihood is exact.

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


@numba.njit(cache=True)  # type: ignore[misc, unused-ignore]
def switching(
    y: FloatArray,
    size: float,
    p01: float,
    p10: float,
    phi: FloatArray,
    q: FloatArray,
    initial: FloatArray,
    r: float,
    path: FloatArray,
) -> float:
    """Return the log likelihood of y, shape (M,); fill `path` (M or 0) with the chance of the upper level.

    `phi`, `q`, `initial` have shape (n,): decay, driving and first variance of each state; `r` is that of v.
    """
    n = phi.size
    modes = 2 if size != 0.0 else 1
    p = np.zeros((2, n, n))
    s = np.zeros((2, n))
    mixed_p = np.zeros((2, n, n))
    mixed_s = np.zeros((2, n))
    gain = np.zeros(n)
    log_weight = np.zeros(2)
    chance = np.array([1.0, 0.0])
    if modes == 2:
        chance[1] = p01 / (p01 + p10)
        chance[0] = 1.0 - chance[1]
    for m in range(2):
        for i in range(n):
            p[m, i, i] = initial[i]
    total = 0.0
    for t in range(y.size):
        if modes == 2:
            to_one = chance[0] * p01 + chance[1] * (1.0 - p10)
            to_zero = 1.0 - to_one
            for m in range(2):
                stays = 1.0 - p01 if m == 0 else p01
                share = chance[0] * stays / ((to_zero if m == 0 else to_one) + 1e-300)
                for i in range(n):
                    mixed_s[m, i] = share * s[0, i] + (1.0 - share) * s[1, i]
                for i in range(n):
                    for j in range(n):
                        spread = share * (1.0 - share) * (s[0, i] - s[1, i]) * (s[0, j] - s[1, j])
                        mixed_p[m, i, j] = share * p[0, i, j] + (1.0 - share) * p[1, i, j] + spread
            chance[0], chance[1] = to_zero, to_one
            if t > 0:
                for m in range(2):
                    for i in range(n):
                        s[m, i] = phi[i] * mixed_s[m, i]
                        for j in range(n):
                            p[m, i, j] = mixed_p[m, i, j] * phi[i] * phi[j]
                        p[m, i, i] += q[i]
        elif t > 0:
            for i in range(n):
                s[0, i] *= phi[i]
                for j in range(n):
                    p[0, i, j] *= phi[i] * phi[j]
                p[0, i, i] += q[i]
        for m in range(modes):
            variance = r
            innovation = y[t] - size * m
            for i in range(n):
                row = 0.0
                for j in range(n):
                    row += p[m, i, j]
                gain[i] = row
                variance += row
                innovation -= s[m, i]
            for i in range(n):
                gain[i] /= variance
            for i in range(n):
                s[m, i] += gain[i] * innovation
                for j in range(n):
                    p[m, i, j] -= gain[i] * gain[j] * variance
            log_weight[m] = (
                np.log(chance[m] + 1e-300) - 0.5 * innovation * innovation / variance - 0.5 * np.log(variance)
            )
        if modes == 2:
            top = max(log_weight[0], log_weight[1])
            weight = np.exp(log_weight[0] - top) + np.exp(log_weight[1] - top)
            total += top + np.log(weight)
            chance[1] = np.exp(log_weight[1] - top) / weight
            chance[0] = 1.0 - chance[1]
        else:
            total += log_weight[0]
        if path.size:
            path[t] = chance[1]
    return total
