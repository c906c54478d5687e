"""Exact errors of a filter that is configured for one linear system while the truth is another; nothing is sampled.

Truth x and estimate x̂ are one linear system, so that the covariance of both follows from matrices alone::

    truth       x ← Φ x + w,   z = h x + v         estimate    x̂ ← Φ' x̂,   x̂ ← x̂ + G (z − h' x̂)

with Φ' and the gains G of the filter's own model. What both know, by x̂ ≙ L x with h' L = h, is carried as the
difference d = x̂ − L x, which stays small where x does not::

    d ← Φ' d + (Φ' L − L Φ) x − L w                d ← (I − G h') d + G v

After an hour of measurements, one a second, the filter predicts: the true rms of its error stands beside the sd that
it predicts.

References
----------
.. [1] P. S. Maybeck, Stochastic Models, Estimation, and Control, vol. 1, 1979, ch. 6.8 (covariance analysis of
       filters of another system than the truth).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from models.arrays import FloatArray
from models.noise.arma import Arma
from models.statespace import StateSpace, discretize
from tuner.synthesis.process_noise import axis_states, axis_system
from tuner.types import ChannelNoise

AIDED_MEASUREMENTS = 3600
"""Measurements before the outage, one a second."""


@dataclass(frozen=True)
class Linear:
    """A linear system with n states.

    Attributes
    ----------
    advance : callable
        A step, s → Φ and covariance of the noise, (n, n) each.
    start : ndarray, shape (n, n)
        Covariance at the start.
    common : tuple of int
        States that every such system has, in the same order: the integrals, measured and judged first, and
        the constant.
    """

    advance: Callable[[float], tuple[FloatArray, FloatArray]]
    start: FloatArray
    common: tuple[int, ...]


def axis(channel: ChannelNoise, *, integrals: int = 1) -> Linear:
    """Return the system of one axis whose output is the integral of the rate, or with 2 the integral of that."""
    inner = axis_system(channel)
    n, more = inner.size, integrals - 1
    F = np.zeros((n + more, n + more))
    F[more:, more:] = inner.F
    F[range(more), range(1, more + 1)] = 1.0
    Q, P0 = block_diag(np.zeros((more, more)), inner.Q), block_diag(np.zeros((more, more)), inner.P0)
    system = StateSpace(F, np.eye(n + more), np.eye(1, n + more), Q, P0)
    constant = more + axis_states(channel).index("bias")
    return Linear(lambda step: discretize(system, step), system.P0, (*range(integrals), constant))


def shaped(noise: Arma, *, constant_sd: float) -> Linear:
    """Return the system of one axis whose rate is an ARMA sequence and a constant; steps are whole intervals."""
    phi, q, p0 = noise.transition()
    n = len(phi) + 2
    one, drive = np.eye(n), np.zeros((n, n))
    one[0, [1, n - 1]] = noise.interval
    one[1 : n - 1, 1 : n - 1] = phi
    drive[1 : n - 1, 1 : n - 1] = q

    def advance(step: float) -> tuple[FloatArray, FloatArray]:
        transition, covariance = np.eye(n), np.zeros((n, n))
        for _ in range(round(step / noise.interval)):
            covariance = one @ covariance @ one.T + drive
            transition = one @ transition
        return transition, covariance

    return Linear(advance, block_diag(0.0, p0, constant_sd**2), (0, n - 1))


def outage_errors(
    truth: Linear, configured: Linear, sd: float, outages: Sequence[float], *, aided: int = AIDED_MEASUREMENTS
) -> tuple[FloatArray, FloatArray]:
    """Return true rms and predicted sd of the output after each outage, shape (q,).

    Parameters
    ----------
    truth, configured : Linear
        The system as it is, and as the filter takes it.
    sd : float
        Of a measurement.
    outages : sequence of float
        Lengths, s.
    aided : int
        Measurements before, one a second.
    """
    (phi_true, noise_true), (phi, noise) = truth.advance(1.0), configured.advance(1.0)
    n, m = len(truth.start), len(configured.start)
    alike = np.zeros((m, n))
    alike[configured.common, truth.common] = 1.0
    first = np.vstack([np.eye(n), -alike])
    joint, drive = first @ truth.start @ first.T, first @ noise_true @ first.T  # of x and d
    advance, update, h = _both(phi_true, phi, alike), np.eye(n + m), np.eye(1, m)[0]
    p = configured.start
    for _ in range(aided):
        p = phi @ p @ phi.T + noise
        gain = p @ h / (h @ p @ h + sd**2)
        keep = np.eye(m) - np.outer(gain, h)
        p = keep @ p @ keep.T + sd**2 * np.outer(gain, gain)
        update[n:, n:] = keep
        joint = update @ (advance @ joint @ advance.T + drive) @ update.T
        joint[n:, n:] += sd**2 * np.outer(gain, gain)
    true, predicted = [], []
    for seconds in outages:
        (ahead_true, added_true), (ahead, added) = truth.advance(seconds), configured.advance(seconds)
        error = _both(ahead_true, ahead, alike)[n]
        lost = (first @ added_true @ first.T)[n, n]
        true.append(np.sqrt(error @ joint @ error + lost))
        predicted.append(np.sqrt((ahead @ p @ ahead.T + added)[0, 0]))
    return np.array(true), np.array(predicted)


def _both(phi_true: FloatArray, phi: FloatArray, alike: FloatArray) -> FloatArray:
    """Return the transition of truth and difference together."""
    n, m = len(phi_true), len(phi)
    return np.block([[phi_true, np.zeros((n, m))], [phi @ alike - alike @ phi_true, phi]])
