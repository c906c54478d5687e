"""Likelihood of a bias that switches between levels beside slow noise, by a bank of Kalman filters.

Model of block means y_t, states s_i,t (first-order Gauss–Markov or random walk) and level m_t of a few::

    y_t = D[m_t] + Σ_i s_i,t + v_t,      s_i,t+1 = φ_i s_i,t + w_i,t

m is a Markov chain with a matrix of chances a block. One Kalman filter runs for each level; before each block
their posteriors are mixed by the chances of a switch (interacting multiple models). The filters share one gain history
but for that mixing; with one level there is one Kalman filter and the likelihood is exact.

References
----------
.. [1] H. A. P. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian
   switching coefficients, IEEE Trans. Autom. Control 33 (1988).
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
import numpy as np

from models.arrays import LEAST_DIVISOR, FloatArray


@cache
def switching(states: int, levels: int) -> Any:
    """Return the filter of so many slow states and levels: a compiler that knows them unrolls its loops.

    Its arguments and its result are those of `run` below.
    """

    @numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})  # type: ignore[misc, unused-ignore]
    def run(
        y: FloatArray,
        level: FloatArray,
        first: FloatArray,
        chances: FloatArray,
        phi: FloatArray,
        q: FloatArray,
        initial: FloatArray,
        r: FloatArray,
        path: FloatArray,
    ) -> float:
        """Return the log likelihood of y, shape (M,); fill `path` (M or 0) with the mean of the level so far.

        Levels have the chances `first` (m,) at the start and `chances` (m, m) from row to column a block. `phi`, `q`,
        `initial` have shape (n,): decay, process-noise and initial variance of each state; `r` (M,) is that of v. Of
        covariances the lower triangle is kept.
        """
        s, mixed_s, off = np.zeros((levels, states)), np.zeros((levels, states)), np.zeros((levels, states))
        p, mixed_p = np.zeros((levels, states, states)), np.zeros((levels, states, states))
        gain, share, ahead, away = np.zeros(states), np.zeros(levels), np.zeros(levels), np.zeros(levels)
        for m in range(levels):
            for i in range(states):
                p[m, i, i] = initial[i]
        chance, total, product = first.copy(), 0.0, 1.0
        for t in range(y.size):
            if t > 0:
                for m in range(levels):
                    ahead[m] = LEAST_DIVISOR
                    for k in range(levels):
                        ahead[m] += chance[k] * chances[k, m]
                    for k in range(levels):
                        share[k] = chance[k] * chances[k, m] / ahead[m]
                    for i in range(states):
                        mean = 0.0
                        for k in range(levels):
                            mean += share[k] * s[k, i]
                        for k in range(levels):
                            off[k, i] = s[k, i] - mean
                        mixed_s[m, i] = phi[i] * mean
                    for i in range(states):
                        for j in range(i + 1):
                            mixed = 0.0
                            for k in range(levels):
                                mixed += share[k] * (p[k, i, j] + off[k, i] * off[k, j])
                            mixed_p[m, i, j] = mixed * (phi[i] * phi[j])
                        mixed_p[m, i, i] += q[i]
                for m in range(levels):
                    chance[m] = ahead[m]
                    for i in range(states):
                        s[m, i] = mixed_s[m, i]
                        for j in range(i + 1):
                            p[m, i, j] = mixed_p[m, i, j]
            least = np.inf
            for m in range(levels):
                variance, innovation = r[t], y[t] - level[m]
                for i in range(states):
                    gain[i] = 0.0
                    for j in range(i):
                        gain[i] += p[m, i, j]
                    for j in range(i, states):
                        gain[i] += p[m, j, i]
                    variance += gain[i]
                    innovation -= s[m, i]
                over = 1.0 / variance
                moved = innovation * over
                for i in range(states):
                    s[m, i] += gain[i] * moved
                    for j in range(i + 1):
                        p[m, i, j] -= gain[i] * over * gain[j]
                chance[m] *= np.sqrt(over)
                away[m] = 0.5 * innovation * moved
                least = min(least, away[m])
            weight = 0.0
            for m in range(levels):
                chance[m] *= np.exp(least - away[m])
                weight += chance[m]
            for m in range(levels):
                chance[m] /= weight
            total -= least
            product *= weight
            if not 1e-100 < product < 1e100:
                total += np.log(product)
                product = 1.0
            if path.size:
                path[t] = 0.0
                for m in range(levels):
                    path[t] += chance[m] * level[m]
        return float(total + np.log(product))

    return run
