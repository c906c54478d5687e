"""Linear systems with white-noise inputs: exact discretisation, block sums, spectra.

::

    dx/dt = F x + G w,   y = H x,   E[w(t) w(s)'] = Q δ(t − s),   cov x(0) = P0

`Q` is a two-sided spectral density (unit²/Hz), never a covariance. Over a step D::

    x(t + D) = Phi x(t) + v,   Phi = exp(F D),   cov v = Qd = ∫_0^D exp(F s) G Q G' exp(F' s) ds

Van Loan's single matrix exponential [1]_ holds a block exp(−F D) that destroys Qd once D is twenty
times the shortest time constant. Here it serves a short step only, and the step is then doubled::

    Phi(2D) = Phi(D)²,   Qd(2D) = Phi(D) Qd(D) Phi(D)' + Qd(D)

References
----------
.. [1] C. F. Van Loan, Computing integrals involving the matrix exponential,
       IEEE Trans. Automatic Control 23 (1978).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, expm, matrix_balance, solve_continuous_lyapunov

from models.arrays import FloatArray

_MAX_PLAIN_STEP = 0.25
"""Largest ‖F‖·step for which the single matrix exponential is used."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A linear system with n states, s white inputs and m outputs.

    Attributes
    ----------
    F : ndarray, shape (n, n)
        Dynamics, 1/s.
    G : ndarray, shape (n, s)
        Input matrix.
    H : ndarray, shape (m, n)
        Output matrix.
    Q : ndarray, shape (s, s)
        Two-sided spectral density of the inputs.
    P0 : ndarray, shape (n, n)
        Covariance of the initial state; the stationary one where it exists.
    """

    F: FloatArray
    G: FloatArray
    H: FloatArray
    Q: FloatArray
    P0: FloatArray

    def __post_init__(self) -> None:
        for name in ("F", "G", "H", "Q", "P0"):
            object.__setattr__(self, name, np.atleast_2d(np.asarray(getattr(self, name), dtype=float)))
        n, s = self.F.shape[0], self.Q.shape[0]
        shapes = {"F": (n, n), "G": (n, s), "H": (self.H.shape[0], n), "Q": (s, s), "P0": (n, n)}
        for name, expected in shapes.items():
            got = getattr(self, name).shape
            if got != expected:
                raise ValueError(f"'{name}' must have shape {expected}, got {got}")

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.F.shape[0])


def stationary_system(F: ArrayLike, G: ArrayLike, H: ArrayLike, Q: ArrayLike) -> StateSpace:
    """Return a system of these dynamics in balanced coordinates, with its stationary covariance as P0.

    Balancing divides each state by a power of 2, so that time constants of 1 ms and of 10 h lose no digits; the output
    is unchanged. Arrays as of `StateSpace`.

    Raises
    ------
    ValueError
        Where a pole does not lie in the left half plane: nothing stationary exists.
    """
    f, g, h, q = (np.atleast_2d(np.asarray(a, dtype=float)) for a in (F, G, H, Q))
    if not np.max(np.linalg.eigvals(f).real) < 0.0:
        raise ValueError("a stationary system has all its poles in the left half plane")
    balanced, (scale, _) = matrix_balance(f, permute=False, separate=True)
    g, h = g / scale[:, None], h * scale
    covariance = solve_continuous_lyapunov(balanced, -(g @ q @ g.T))
    return StateSpace(balanced, g, h, q, 0.5 * (covariance + covariance.T))


def discretize(system: StateSpace, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the exact transition matrix and process-noise covariance of a step.

    Parameters
    ----------
    system : StateSpace
        Continuous system with n states.
    step : float
        Length of the step, s; zero gives the identity and no noise.

    Returns
    -------
    Phi, Qd : ndarray, shape (n, n)
        Transition matrix and covariance, exact for any ratio of step and time constants.

    Raises
    ------
    ValueError
        Where the step is negative or not finite.
    """
    if not 0.0 <= step < np.inf:
        raise ValueError(f"'step' must be zero or positive, got {step}")
    n = system.size
    drive = system.G @ system.Q @ system.G.T
    norm = float(np.abs(system.F).sum(axis=0).max(initial=0.0)) * step
    doublings = max(0, int(np.ceil(np.log2(norm / _MAX_PLAIN_STEP)))) if norm > 0.0 else 0
    block = np.block([[-system.F, drive], [np.zeros((n, n)), system.F.T]])
    exponential = expm(block * (step / 2**doublings))
    transition = exponential[n:, n:].T
    covariance = transition @ exponential[:n, n:]
    for _ in range(doublings):
        covariance = transition @ covariance @ transition.T + covariance
        transition = transition @ transition
    return transition, 0.5 * (covariance + covariance.T)


def block_sum(*systems: StateSpace) -> StateSpace:
    """Return the system whose output is the sum of the outputs of independent systems.

    Parameters
    ----------
    *systems : StateSpace
        One or more systems with equally many outputs.

    Returns
    -------
    StateSpace
        Block-diagonal F, G, Q, P0; concatenated H.
    """
    if not systems:
        raise ValueError("'systems' must hold at least one system")
    F, G, Q, P0 = (block_diag(*(getattr(s, name) for s in systems)) for name in ("F", "G", "Q", "P0"))
    return StateSpace(F, G, np.hstack([s.H for s in systems]), Q, P0)


def spectrum(system: StateSpace, f: ArrayLike) -> FloatArray:
    """Return the two-sided spectral density of a one-output system.

    Parameters
    ----------
    system : StateSpace
        System with one output.
    f : array_like, shape (k,)
        Frequency, Hz; not a pole of the system.

    Returns
    -------
    ndarray, shape (k,)
        unit²/Hz.
    """
    shift = 2j * np.pi * np.atleast_1d(np.asarray(f, dtype=float))[:, None, None] * np.eye(system.size)
    gain = system.H @ np.linalg.solve(shift - system.F, system.G.astype(complex))
    return np.real(gain @ system.Q @ gain.conj().swapaxes(1, 2))[:, 0, 0]
