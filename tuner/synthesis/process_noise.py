"""What drives the filter's states: continuous densities, and their exact covariance for a step.

For one axis, x = (integral, Gauss–Markov states, bias, bias rate)::

    d integral/dt = Σ b_i + bias + w_N      Q entry  N²
    d b_i/dt      = −b_i/T_i + w_i                   2σ_i²/T_i
    d bias/dt     = bias rate + w_K                  K²       (P0: turn-on sd²)
    d rate/dt     = 0                                0        (only where a ramp is modelled)

The integral is the angle of a gyro axis, the velocity of an accelerometer axis. Discrete covariances come
from `models.statespace.discretize`, exact for any ratio of step and time constant.

References
----------
.. [1] P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.
"""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from models.noise.arma import Arma
from models.statespace import StateSpace
from tuner.types import ArmaFit, ChannelNoise


def axis_states(channel: ChannelNoise) -> tuple[str, ...]:
    """Return the names of the states of one axis, in order."""
    markov = tuple(f"markov_{i}" for i in range(1, len(channel.markov) + 1))
    return ("integral", *markov, "bias", *(("bias_rate",) if channel.ramp_sd else ()))


def axis_system(channel: ChannelNoise) -> StateSpace:
    """Return the error model of one axis; its output is the integral.

    Parameters
    ----------
    channel : ChannelNoise
        Noise settings of the axis.

    Returns
    -------
    StateSpace
        States in the order of `axis_states`, one white input a state, Q in unit²/Hz (two-sided).
    """
    m = len(channel.markov)
    n = len(axis_states(channel))
    F = np.zeros((n, n))
    F[0, 1 : m + 2] = 1.0
    F[np.arange(1, m + 1), np.arange(1, m + 1)] = [-1.0 / state.time_constant for state in channel.markov]
    if channel.ramp_sd:
        F[m + 1, m + 2] = 1.0
    ramp = [channel.ramp_sd] if channel.ramp_sd else []
    drives = [
        channel.white_density,
        *(state.driving_density for state in channel.markov),
        channel.random_walk_density,
    ]
    Q = np.diag(np.square(drives + [0.0] * len(ramp)))
    P0 = np.diag(np.square([0.0, *(state.sd for state in channel.markov), channel.constant_sd, *ramp]))
    return StateSpace(F, np.eye(n), np.eye(1, n), Q, P0)


def shaping_states(fit: ArmaFit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return an ARMA fit as discrete shaping states of a filter that steps at `fit.interval`.

    Returns
    -------
    Phi, Qd, P0 : ndarray, shape (r, r)
        Transition, process noise and stationary covariance; the noise is the first state.

    Raises
    ------
    ValueError
        Where the fit is not distinguishable from white noise or misses a coefficient.
    """
    coefficients = [c.value for c in (*fit.ar, *fit.ma)]
    if fit.white or any(value is None for value in coefficients):
        raise ValueError(
            f"'fit' must be an ARMA model other than white noise, got order {fit.order}, white={fit.white}"
        )
    p, _ = fit.order
    values = tuple(float(value) for value in coefficients if value is not None)
    return Arma(values[:p], values[p:], fit.variance, fit.interval).transition()
