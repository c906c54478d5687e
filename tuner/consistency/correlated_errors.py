"""Scores of errors that depend on each other in time, in bands for the number of independent ones.

With the autocorrelation ρ of whitened errors (of mean zero, where the filter is right), the mean of n squares of d
components each has the variance of χ² with

    ν = d N       N = n/(1 + 2 Σ ρ²(m))        the sum to the first lag with ρ below a fifth

degrees of freedom [1]_. N is an estimate itself; N²/(N + 3) in its place keeps the false-alarm rate of records of
any length beside the correlation time (simulated first-order Gauss–Markov errors: at most 0.25 % for a band of 0.07 %
and the margin).

Constants that were fitted to the errors and taken out, of derivatives X (whitened like the errors, autocorrelation
matrix R), take Σ tr((XᵀX)⁻¹ Xᵀ R X) of the expected sum of squares with them: a heading error that stays for minutes
goes wholly into a rotation between the bodies. A component of which they take more than an eighth is not scored: its
autocorrelation cannot be distinguished from a record that is so short beside it.

References
----------
.. [1] M. S. Bartlett, On the theoretical specification and sampling properties of autocorrelated time-series, Suppl.
       J. Royal Statistical Society 8 (1946).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.scores import TEST_COUNT, mean_band
from tuner.types.consistency import Score

CORRELATION_CUT = 0.2
"""Autocorrelation at which its sum ends: what follows adds 4 % of the sum, and less than the noise of its estimate."""
UNCERTAIN_COUNT = 3.0
"""N₀ of N/(1 + N₀/N): found by simulation, see the head of the file."""
MAX_ABSORBED_SHARE = 0.125
"""Share of a component's variance that fitted constants may take: sixteen correlation times of one constant."""


def autocorrelation(w: FloatArray) -> FloatArray:
    """Return the autocorrelation of components of mean zero, by lag; shape (n, d) → (n,)."""
    n = len(w)
    size = 1 << (2 * n - 1).bit_length()
    f = np.fft.rfft(w, size, axis=0)
    total = np.fft.irfft((f * f.conj()).real.sum(axis=1), size)[:n]
    return np.asarray(total / np.arange(n, 0, -1) / (total[0] / n)) if total[0] > 0.0 else np.eye(1, n)[0]


def _first_lags(w: FloatArray, cut: float = CORRELATION_CUT) -> FloatArray:
    """Return the autocorrelation to the lag before it is first below `cut`, up to half of the record, (n, d) → (m,)."""
    rho = autocorrelation(w)[: len(w) // 2 + 1]
    below = np.flatnonzero(rho < cut)
    return rho[: below[0]] if len(below) else rho


def independent_count(w: FloatArray) -> float:
    """Return the number of independent epochs in whitened errors, shape (n, d), at least 1."""
    rho = _first_lags(w)
    if len(rho) > len(w) // 2:
        return 1.0
    count = len(w) * (1.0 - CORRELATION_CUT**2) / (1.0 + 2.0 * float(np.sum(rho[1:] ** 2)))
    return max(count / (1.0 + UNCERTAIN_COUNT / count), 1.0)


def independent_means(d: FloatArray) -> float:
    """Return the number n/(1 + 2 Σ ρ) of independent values behind the mean of a course of mean zero, shape (n,)."""
    if not d.any():
        return float(len(d))
    cut = min(CORRELATION_CUT, 2.0 / math.sqrt(len(d)))  # the noise of a correlation of white values
    rho = _first_lags(d[:, None], cut)
    if len(rho) > len(d) // 2:
        return 1.0
    # The sum to the first lag below the cut lacks a share of the cut of the whole: correlations decay.
    count = len(d) / (1.0 + 2.0 * float(np.sum(rho[1:])) / (1.0 - cut))
    return max(count / (1.0 + UNCERTAIN_COUNT / count), 1.0)


def independent_share(w: FloatArray) -> float:
    """Return 1/(1 + 2 Σ ρ²) of errors in order of time, shape (n, d): what share of them counts as independent."""
    rho = autocorrelation(w)[1:]
    near = np.logical_and.accumulate(rho >= CORRELATION_CUT)
    return 1.0 / (1.0 + 2.0 * float(np.sum(rho[near] ** 2)))


def whitened(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return columns of errors, (…, d, r), of unit covariance where P = L Lᵀ, (…, d, d), is right.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where a covariance is not positive definite.
    """
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), error))


def absorbed_shares(w: FloatArray, x: FloatArray) -> FloatArray:
    """Return the share of the variance of each component that fitted constants took; (n, d), (n, d, r) → (d,)."""
    from scipy.signal import fftconvolve  # loaded when used: slow to import

    n, d, r = x.shape
    if not r:
        return np.zeros(d)
    inverse = np.linalg.pinv(np.einsum("ndr,nds->rs", x, x), hermitian=True)
    shares = np.empty(d)
    for j in range(d):
        rho = _first_lags(w[:, j : j + 1])
        kernel = np.concatenate([rho[:0:-1], rho])[:, None]
        near = fftconvolve(x[:, j], kernel, mode="full", axes=0)[len(rho) - 1 : len(rho) - 1 + n]
        # The sum to the first lag below the cut lacks a share of the cut of the whole: correlations decay.
        shares[j] = np.sum(inverse * (x[:, j].T @ near)) / n / (1.0 - CORRELATION_CUT)
    return shares


def time_score(
    name: str,
    groups: Sequence[FloatArray],
    *,
    fitted: Sequence[FloatArray] = (),
    tests: int = TEST_COUNT,
) -> Score | None:
    """Score whitened errors of runs, (n, d) each, that are correlated in time; None where there are none.

    `fitted` are the derivatives of the errors of each by constants that were taken out of them, (n, d, r).
    """
    pairs = [
        (w, x)
        for w, x in zip(groups, fitted or [np.zeros((*w.shape, 0)) for w in groups], strict=True)
        if len(w) > 1
    ]
    if not pairs:
        return None
    shares = [absorbed_shares(w, x) for w, x in pairs]
    kept = np.max(shares, axis=0) <= MAX_ABSORBED_SHARE
    d = int(np.count_nonzero(kept))
    if not d:
        return None
    count = sum(len(w) for w, _ in pairs)
    left = [1.0 - float(np.mean(share[kept])) for share in shares]
    mean = (
        sum(float(np.sum(w[:, kept] ** 2)) / part for (w, _), part in zip(pairs, left, strict=True)) / count
    )
    effective = sum(
        d * independent_count(w[:, kept]) * part for (w, _), part in zip(pairs, left, strict=True)
    )
    return Score(name, mean, d, effective, mean_band(d, effective, tests=tests))
