"""Inertial increments rotated into the axes of their start and integrated, with derivatives by sensor errors.

With C(t) = C_b0b(t) from the gyros, the specific force f and a = C f::

    S(t) = ∫ a dt        P(t) = ∫ S dt
    gyro error e_g       δS = ∫ [a ×] (∫ C e_g dt) dt       e_g = b_g: bias;  e_g = diag(ω) s_g: scale factors
    accel error e_a      δS = −∫ C e_a dt                   e_a = b_a: bias;  e_a = diag(f) s_a: scale factors
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment_in_motion import attitudes


@dataclass(frozen=True)
class IntegratedIncrements:
    """Integrals of the specific force in the axes b₀ of the first step.

    Attributes
    ----------
    t : ndarray, shape (n + 1,)
        Ends of the steps, the beginning of the first before them, s.
    mat : ndarray, shape (n + 1, 9)
        C_b0b, row by row.
    velocity, position : ndarray, shape (n + 1, 3)
        S and P.
    by_velocity, by_position : ndarray, shape (n + 1, 36)
        Derivatives of S and P by the biases of gyros and accelerometers, then by their scale factors; four matrices
        (3, 3), row by row.
    angles : ndarray, shape (n + 1, 18)
        ∫ C dt and ∫ C diag(ω) dt: attitude errors by gyro biases and scale factors.
    rate : ndarray, shape (n + 1, 3)
        Angular rate in b, rad/s, mean of the steps before and after.
    """

    t: FloatArray
    mat: FloatArray
    velocity: FloatArray
    position: FloatArray
    by_velocity: FloatArray
    by_position: FloatArray
    angles: FloatArray
    rate: FloatArray


def integrate_increments(steps: Steps, gyro_bias: FloatArray) -> IntegratedIncrements:
    """Rotate the increments into the axes of the start and integrate them.

    Parameters
    ----------
    steps : Steps
        Increments.
    gyro_bias : ndarray, shape (3,)
        Subtracted first, rad/s.
    """
    dt = steps.dt[:, None]
    turns = steps.increments[:, :3] - gyro_bias * dt
    mats = rotation.mat_from_quat(attitudes(turns))
    mean = 0.5 * (mats[1:] + mats[:-1])
    pieces = (mean @ steps.increments[:, 3:, None])[..., 0]
    by_bias = _cumulative((mean * dt[..., None]).reshape(-1, 9))
    by_scale = _cumulative((mean * turns[:, None, :]).reshape(-1, 9))
    cross = rotation.skew(pieces)

    def tilted(angle: FloatArray) -> FloatArray:
        middle = 0.5 * (angle[1:] + angle[:-1]).reshape(-1, 3, 3)
        return _cumulative((cross @ middle).reshape(-1, 9))

    force_scale = _cumulative((mean * steps.increments[:, None, 3:]).reshape(-1, 9))
    by_velocity = np.hstack([tilted(by_bias), -by_bias, tilted(by_scale), -force_scale])
    velocity = _cumulative(pieces)
    rate = turns / dt
    return IntegratedIncrements(
        steps.ends(),
        mats.reshape(-1, 9),
        velocity,
        _integral(velocity, dt),
        by_velocity,
        _integral(by_velocity, dt),
        np.hstack([by_bias, by_scale]),
        0.5 * (np.vstack([rate[:1], rate]) + np.vstack([rate, rate[-1:]])),
    )


def _cumulative(pieces: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros((1, pieces.shape[1])), np.cumsum(pieces, axis=0)])


def _integral(y: FloatArray, dt: FloatArray) -> FloatArray:
    return _cumulative(0.5 * (y[1:] + y[:-1]) * dt)
