"""Expected cosine periodogram of each noise term, edges included.

For a process of autocovariance g on a span T the expectation of a squared cosine coefficient is::

    E a_k² = ∫_{-T}^{T} (1-|u|/T) g(u) cos ωu du - 2/(ωT) ∫_0^T g(u) sin ωu du,    ω = 2πf_k = πk/T

that is S(f_k) times an edge factor (s = (-1)^k)::

    white, random walk      1
    flicker                 (2/π) Si(πk) - 2(1-s)/(π²k)             → 1 - 2/(π²k)
    Gauss-Markov            1 - (2T_c/T) (1 - s e^{-T/T_c}) / (1 + (ωT_c)²)
    quantization            S + (4Q²/T) cos²(πfτ0)

    H e^{Ft} P0 H'          1 + [2 Re H A⁻²v - (2/ω) Im H A⁻¹v] / (S T),    A = F + iω,  v = (s e^{FT} - 1) P0 H'

The first three hold exactly, the flicker one through its generalised autocovariance -(B²/π) ln|u|; the last serves
every other stationary term, by its state space. A term that is neither is taken as S(f), right to O(memory/T).
"""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any

import numba
import numpy as np
from scipy.linalg import expm
from scipy.special import sici

from models.arrays import FloatArray
from models.noise import BiasInstability, GaussMarkov, Quantization, Term
from tuner.identification.periodogram import CosinePeriodogram

LOG_STEP = 1e-4
"""Step of the logarithm of a parameter in central differences: relative error 1e-8."""


@singledispatch
def expected_power(term: Term, grid: CosinePeriodogram) -> tuple[FloatArray, FloatArray]:
    """Return E a² of a term on the grid, shape (m,), and its derivatives by the logs of its parameters."""
    spectrum = term.psd(grid.frequency, interval=grid.interval)
    gradient = term.psd_gradient(grid.frequency, interval=grid.interval)
    factor, slope = _edge(term, grid)
    return spectrum * factor, gradient * factor + spectrum * slope


@expected_power.register
def _(term: GaussMarkov, grid: CosinePeriodogram) -> tuple[FloatArray, FloatArray]:
    time, interval = term.time_constant, grid.interval
    ends = grid.parity * np.exp(-grid.span / time)
    both = _of_markov(grid.frequency, grid.sine_square, grid.span, ends, interval, term.sd, time)
    return both[0], both[1:]


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[misc, unused-ignore]
def _of_markov(
    frequency: FloatArray,
    sine_square: FloatArray,
    span: FloatArray,
    ends: FloatArray,
    interval: float,
    sd: float,
    time: float,
) -> FloatArray:
    """Return E a² of a sampled Gauss–Markov process and its derivatives by ln σ and ln T, shape (3, m).

    `sine_square` is sin²(πfτ0) and `ends` s e^{-T/T_c}, shape (m,) each.
    """
    out = np.empty((3, frequency.size))
    a = interval / time
    lost, phi, size = -np.expm1(-a), np.exp(-a), interval * sd * sd
    top, angle = -np.expm1(-2.0 * a) * size, 2.0 * np.pi * time
    for k in range(frequency.size):
        over = 1.0 / (lost * lost + 4.0 * phi * sine_square[k])
        spectrum = top * over
        slope = (4.0 * sine_square[k] * (1.0 + phi * phi) - 2.0 * lost * lost) * (size * a * phi)
        ratio = time / span[k]
        knee = 1.0 / (1.0 + (angle * frequency[k]) ** 2)
        factor = 1.0 - 2.0 * ratio * knee * (1.0 - ends[k])
        by_time = 2.0 * knee * (ends[k] - ratio * (2.0 * knee - 1.0) * (1.0 - ends[k]))
        out[0, k] = spectrum * factor
        out[1, k] = 2.0 * spectrum * factor
        out[2, k] = spectrum * by_time - slope * over * over * factor
    return out


@singledispatch
def _edge(term: Term, grid: CosinePeriodogram) -> tuple[Any, Any]:
    """Return the edge factor and its derivatives by the logs of the parameters."""
    factor = _edge_of_states(term, grid)
    if factor is None:
        return 1.0, 0.0
    slopes = [np.zeros_like(factor)]
    for parameter in term.PARAMETERS[1:]:
        above, below = (
            _edge_of_states(replace(term, **{parameter: getattr(term, parameter) * np.exp(step)}), grid)
            for step in (LOG_STEP, -LOG_STEP)
        )
        assert above is not None
        assert below is not None
        slopes.append((above - below) / (2.0 * LOG_STEP))
    return factor, np.stack(slopes)


def _edge_of_states(term: Term, grid: CosinePeriodogram) -> FloatArray | None:
    """Return the edge factor of a stationary term from its state space; None for another."""
    if term.exponentials() is None:
        return None
    system = term.state_space()
    assert system is not None
    omega = 2.0 * np.pi * grid.frequency
    start = system.P0 @ system.H.T
    spans, where = np.unique(grid.span, return_inverse=True)
    ends = (expm(system.F * spans[:, None, None]) @ start)[where]
    shift = system.F + 1j * omega[:, None, None] * np.eye(system.size)
    once = np.linalg.solve(shift, grid.parity[:, None, None] * ends - start)
    twice = np.linalg.solve(shift, once)
    lost = (system.H @ twice)[:, 0, 0].real - (system.H @ once)[:, 0, 0].imag / omega
    return np.asarray(1.0 + 2.0 * lost / (grid.span * term.psd(grid.frequency)))


@_edge.register
def _(_term: BiasInstability, grid: CosinePeriodogram) -> tuple[Any, Any]:
    k = grid.order
    exact = 2.0 / np.pi * sici(np.pi * k)[0] - 2.0 / (np.pi**2 * k) * (1.0 - grid.parity)
    return np.where(grid.parity != 0.0, exact, 1.0 - 2.0 / (np.pi**2 * k)), 0.0


@_edge.register
def _(_term: Quantization, grid: CosinePeriodogram) -> tuple[Any, Any]:
    half = np.pi * grid.frequency * grid.interval
    return 1.0 + grid.interval / grid.span / np.tan(half) ** 2, 0.0
