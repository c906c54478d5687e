"""Sensor errors that are constants or slow processes, and their removal.

An inertial unit measures, with ω and f the true rate and specific force in b::

    (ω, f)_measured = A (ω, f) + b + w        A = ( I + K_g   G     )
                                                  ( 0         I + K_a )

K holds scale factors on its diagonal and misalignments beside it, G is the g-sensitivity of the gyros, b the
sum of all biases (turn-on constant, random walk, Gauss–Markov ladder) and w white noise. Which states A and b are made
of is declared in `models.filter_states`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray
from models.state_layout import ErrorModel


@dataclass(frozen=True)
class Calibration:
    """Sensor errors as estimated: A (ω, f) = measured − bias.

    Attributes
    ----------
    bias : ndarray, shape (6,)
        Sum of all biases, gyros (rad/s) before accelerometers (m/s²).
    matrix : ndarray, shape (6, 6)
        A.
    """

    bias: FloatArray
    matrix: FloatArray

    def true_rates(self, measured: ArrayLike) -> FloatArray:
        """Return angular rate and specific force behind measured ones; shape (..., 6)."""
        return np.asarray(np.linalg.solve(self.matrix, (np.asarray(measured) - self.bias)[..., None])[..., 0])


IDEAL_SENSORS = Calibration(np.zeros(6), np.eye(6))
"""Sensors without errors."""


def calibration(model: ErrorModel, parameters: ArrayLike) -> Calibration:
    """Return the calibration in a vector of states.

    Parameters
    ----------
    model : ErrorModel
        The states.
    parameters : array_like, shape (n,)
        Estimates of all states; those of position, velocity and attitude are not used.
    """
    x, bias, matrix = np.asarray(parameters, dtype=float), np.zeros(6), np.eye(6)
    state, sensor, source, factor = model.sensor_couplings
    value, alone = factor * x[state], source < 0
    np.add.at(bias, sensor[alone], value[alone])
    np.add.at(matrix, (sensor[~alone], source[~alone]), value[~alone])
    return Calibration(bias, matrix)


def sensor_jacobian(model: ErrorModel, omega_b: ArrayLike, force_b: ArrayLike) -> FloatArray:
    """Return S, the derivative of measured (ω, f) by the states; shape (6, n).

    Parameters
    ----------
    model : ErrorModel
        The states.
    omega_b, force_b : array_like, shape (3,)
        Calibrated angular rate, rad/s, and specific force, m/s².
    """
    true = np.concatenate([np.asarray(omega_b, dtype=float), np.asarray(force_b, dtype=float), [1.0]])
    state, sensor, source, factor = model.sensor_couplings
    s = np.zeros((6, model.layout.size))
    np.add.at(s, (sensor, state), factor * true[source])
    return s
