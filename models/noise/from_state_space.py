"""Spectrum, variances, autocovariance and samples of a noise term, computed from its state space.

The answers hold for any `models.statespace.StateSpace` with one output, repeated poles and integrators included, as
long as the quantity exists. Closed forms of a term are faster; `models.noise.base.Term` falls back on these.

For a cluster of length τ the integrals of the states are states themselves, M = ∫_0^τ exp(F s) ds, Ψ = H M,
Φ − 1 = F M. The second difference of the integral of the output, with noise (w, e) of states and integral::

    z = I_2 − I_1 = Ψ (Φ − 1) x_0 + (Ψ w_1 − e_1) + e_2,      AVAR = var z / (2 τ²)

is a sum of independent parts, so that nothing cancels however short the cluster is; the third difference gives the
Hadamard variance. Samples dt apart have sums in place of integrals. Their spectrum is::

    S_d(f) = dt · g Qd g*,   g = H ((e^{2πi f dt} − 1) − (Φ − 1))⁻¹

References
----------
.. [1] P. S. Maybeck, Stochastic Models, Estimation, and Control, vol. 1, 1979, ch. 4 (equivalent discrete models).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm, schur

from models.arrays import ComplexArray, FloatArray
from models.statespace import StateSpace, discretize, spectrum

Step = tuple[FloatArray, FloatArray]

CLUSTER_WEIGHTS = {2: (-1.0, 1.0), 3: (1.0, -2.0, 1.0)}
"""Weights of successive cluster integrals in the second (Allan) and third (Hadamard) difference of the phase."""


_POLE_SPLITTING = 1e-12
"""Relative change of F that splits a double pole by 1e-6: both errors are then small."""


def is_stationary(system: StateSpace) -> bool:
    """Return whether all poles lie in the left half plane."""
    return bool(np.max(np.linalg.eigvals(system.F).real, initial=-np.inf) < 0.0)


def power_spectrum(system: StateSpace, f: FloatArray, interval: float | None) -> FloatArray:
    """Return the two-sided spectral density at frequencies f, Hz, of the process or of its samples; shape of f."""
    flat = np.ravel(f)
    if interval is None:
        return spectrum(system, flat).reshape(np.shape(f))
    n = system.size
    integral = _integrals(system, interval)[0][n:, :n]
    _, covariance = discretize(system, interval)
    shift = np.expm1(2j * np.pi * flat * interval)[:, None, None] * np.eye(n)
    transposed = np.swapaxes(shift - system.F @ integral, 1, 2)
    gain = np.linalg.solve(transposed, system.H.T.astype(complex))[:, :, 0]
    power = np.einsum("fi,ij,fj->f", gain, covariance, gain.conj()).real
    return np.asarray(interval * power).reshape(np.shape(f))


def difference_variance(
    system: StateSpace, tau: FloatArray, interval: float | None, order: int
) -> FloatArray:
    """Return the variance of a difference of cluster means, times 1/2 (order 2, Allan) or 1/6 (order 3, Hadamard).

    Parameters
    ----------
    system : StateSpace
        One output.
    tau : ndarray
        Cluster times, s; with `interval` the nearest whole multiples of it.
    interval : float or None
        Sampling interval, s.
    order : int
        2 or 3.
    """
    divisor = {2: 2.0, 3: 6.0}[order]
    flat = np.ravel(tau)
    if interval is None:
        return np.array(
            [_contrast(system, _integrals(system, t), order) / (divisor * t**2) for t in flat]
        ).reshape(np.shape(tau))
    one = _one_sample(system, interval)
    clusters = np.rint(flat / interval).astype(int).tolist()
    values = [_contrast(system, _repeated(one, m), order, step=interval) / (divisor * m**2) for m in clusters]
    return np.array(values).reshape(np.shape(tau))


def autocovariance(system: StateSpace, lag: FloatArray) -> FloatArray:
    """Return the stationary autocovariance at lags, s; shape of lag."""
    lags, where = np.unique(np.abs(lag), return_inverse=True)
    reach = expm(system.F * lags[:, None, None])
    return np.asarray((system.H @ reach @ system.P0 @ system.H.T)[:, 0, 0][where]).reshape(np.shape(lag))


def sample(system: StateSpace, n: int, interval: float, rng: np.random.Generator) -> FloatArray:
    """Return n samples of the output, shape (n,), exactly distributed from the initial covariance on.

    In the Schur basis the transition is triangular: each state is a first-order recursion
    whose inputs are those after it.
    """
    from scipy.signal import lfilter  # loaded when used: scipy.signal is slow to import

    triangular, basis = schur(system.F, output="complex")
    transition = expm(triangular * interval)
    _, covariance = discretize(system, interval)
    drive = np.empty((n, system.size))
    drive[:1] = rng.standard_normal((min(n, 1), system.size)) @ _root(system.P0).T
    drive[1:] = rng.standard_normal((max(n - 1, 0), system.size)) @ _root(covariance).T
    own = drive @ basis.conj()
    states: ComplexArray = np.empty((n, system.size), dtype=complex)
    for i in range(system.size - 1, -1, -1):
        total = own[:, i].copy()
        total[1:] += states[:-1, i + 1 :] @ transition[i, i + 1 :]
        states[:, i] = lfilter([1.0], [1.0, -transition[i, i]], total)
    return np.asarray((states @ (system.H @ basis)[0]).real)


def exponentials(system: StateSpace) -> tuple[ComplexArray, ComplexArray]:
    """Return c and p, shape (n,), of the autocovariance Σ c exp(−p |t|) of a stationary system.

    A repeated pole is split by a change of F of relative size 1e-12: with a double pole the sum keeps 9 digits.
    """
    poles, vectors = np.linalg.eig(system.F)
    gaps = np.abs(poles[:, None] - poles) + np.diag(np.full(system.size, np.inf))
    if gaps.min() < _POLE_SPLITTING**0.5 * np.abs(poles).max():
        change = np.diag(np.linspace(-1.0, 1.0, system.size)) * _POLE_SPLITTING * np.abs(poles).max()
        poles, vectors = np.linalg.eig(system.F + change)
    right = np.linalg.solve(vectors, (system.P0 @ system.H.T)[:, 0].astype(complex))
    return np.asarray((system.H @ vectors)[0] * right, dtype=complex), np.asarray(-poles, dtype=complex)


def _integrals(system: StateSpace, step: float) -> Step:
    """Return transition and noise of states and their integrals over a step, shapes (2n, 2n)."""
    n = system.size
    zero = np.zeros((n, n))
    with_integrals = StateSpace(
        np.block([[system.F, zero], [np.eye(n), zero]]),
        np.vstack([system.G, np.zeros_like(system.G)]),
        np.hstack([system.H, np.zeros_like(system.H)]),
        system.Q,
        np.block([[system.P0, zero], [zero, zero]]),
    )
    return discretize(with_integrals, step)


def _one_sample(system: StateSpace, interval: float) -> Step:
    """Return transition and noise of states and their sum over one sample."""
    n = system.size
    transition, covariance = discretize(system, interval)
    zero = np.zeros((n, n))
    return (
        np.block([[transition, zero], [np.eye(n), np.eye(n)]]),
        np.block([[covariance, zero], [zero, zero]]),
    )


def _repeated(one: Step, m: int) -> Step:
    """Return the step m times in a row, by squaring."""
    size = len(one[0])
    total: Step = np.eye(size), np.zeros((size, size))
    power = one
    while m:
        if m & 1:
            total = _after(total, power)
        power = _after(power, power)
        m >>= 1
    return total


def _after(first: Step, second: Step) -> Step:
    (a, p), (b, q) = first, second
    return b @ a, b @ p @ b.T + q


def _contrast(system: StateSpace, cluster: Step, order: int, *, step: float | None = None) -> float:
    """Return the variance of the second or third difference of successive cluster integrals (or sums)."""
    n, weights = system.size, CLUSTER_WEIGHTS[order]
    transition, covariance = cluster
    phi, integral = transition[:n, :n], transition[n:, :n]
    rate = system.F if step is None else system.F @ _integrals(system, step)[0][n:, :n]
    change = rate @ integral  # phi − 1
    psi = system.H @ integral
    start = psi @ np.linalg.matrix_power(change, order - 1)
    value = float((start @ system.P0 @ start.T)[0, 0])
    for j, weight in enumerate(weights):
        later = np.zeros_like(psi)
        for later_weight in weights[:j:-1]:
            later = later_weight * psi + later @ phi
        row = np.hstack([later, weight * system.H])
        value += float((row @ covariance @ row.T)[0, 0])
    return value


def _root(covariance: FloatArray) -> FloatArray:
    """Return R with R R' the covariance, which may be singular; scaled first, as sds differ by many decades."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(sd > 0.0, sd, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
