"""Sensor errors that are constants or slow processes, and their removal.

An inertial unit measures, with ω and f the true rate and specific force in b::

    (ω, f)_measured = A (ω, f) + b + w        A = ( I + K_g   G     )
                                                  ( 0         I + K_a )

K holds scale factors on its diagonal and misalignments beside it, G is the g-sensitivity of the gyros, b the
sum of all biases (turn-on constant, random walk, Gauss–Markov ladder) and w white noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.state_layout import ErrorModel

FloatArray = NDArray[np.float64]

OFF_DIAGONAL = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Elements of K that the six misalignments are."""


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

    def measured_rates(self, true: ArrayLike) -> FloatArray:
        """Return what the sensors would measure; shape (..., 6)."""
        return np.asarray((self.matrix @ np.asarray(true)[..., None])[..., 0] + self.bias)


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
    x, at = np.asarray(parameters, dtype=float), model.layout
    bias, matrix = np.zeros(6), np.eye(6)
    for first, sensor, axes in _sensors(model):
        bias[first : first + 3] = x[at[f"{sensor}_bias"]]
        if axes:
            np.add.at(bias, first + np.array(axes), x[at[f"{sensor}_markov"]])
        if f"{sensor}_scale" in at:
            matrix[range(first, first + 3), range(first, first + 3)] += x[at[f"{sensor}_scale"]]
        if f"{sensor}_misalignment" in at:
            for value, (i, j) in zip(x[at[f"{sensor}_misalignment"]], OFF_DIAGONAL, strict=True):
                matrix[first + i, first + j] = value
    if "g_sensitivity" in at:
        matrix[:3, 3:] = x[at["g_sensitivity"]].reshape(3, 3)
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
    at = model.layout
    true = np.concatenate([np.asarray(omega_b, dtype=float), np.asarray(force_b, dtype=float)])
    s = np.zeros((6, at.size))
    for first, sensor, axes in _sensors(model):
        rows = np.arange(first, first + 3)
        s[rows, at[f"{sensor}_bias"]] = np.eye(3)
        for k, axis in enumerate(axes):
            s[first + axis, at[f"{sensor}_markov"].start + k] = 1.0
        if f"{sensor}_scale" in at:
            s[rows, at[f"{sensor}_scale"]] = np.diag(true[rows])
        if f"{sensor}_misalignment" in at:
            for k, (i, j) in enumerate(OFF_DIAGONAL):
                s[first + i, at[f"{sensor}_misalignment"].start + k] = true[first + j]
    if "g_sensitivity" in at:
        s[:3, at["g_sensitivity"]] = np.kron(np.eye(3), true[3:])
    return s


def _sensors(model: ErrorModel) -> tuple[tuple[int, str, tuple[int, ...]], ...]:
    return (0, "gyro", model.gyro_markov_axes), (3, "accel", model.accel_markov_axes)
