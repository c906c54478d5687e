"""Errors of a drive as one set of numbers: all zero (or one) for a perfect sensor and receiver."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """Deterministic and random errors.

    Attributes
    ----------
    delay, lag : float
        Of all fixes; of velocities besides, s.
    arm : ndarray, shape (3,)
        Antenna from where it is said to be, forward, right, down, m.
    frame : ndarray, shape (3,)
        Small turn of the velocities, roll, pitch, yaw, rad.
    matrix : ndarray, shape (6, 6)
        Sensed rates and forces are (I + matrix) times the true ones.
    jump_time, jump : float, ndarray (6,)
        Bias from a time on.
    noise : ndarray, shape (2,)
        White noise of gyros and accelerometers over nominal.
    fixes : ndarray, shape (6,)
        White errors of the fixes over reported.
    markov_sd, markov_time : float
        Correlated position error, m, s.
    outliers, outlier_size : int, float
        Number of wrong positions, length in reported sds.
    wrong, wrong_rms : int, float
        Number of wrong velocities, rms length, m/s.
    """

    delay: float = 0.0
    lag: float = 0.0
    arm: FloatArray = field(default_factory=lambda: np.zeros(3))
    frame: FloatArray = field(default_factory=lambda: np.zeros(3))
    matrix: FloatArray = field(default_factory=lambda: np.zeros((6, 6)))
    jump_time: float = 0.0
    jump: FloatArray = field(default_factory=lambda: np.zeros(6))
    noise: FloatArray = field(default_factory=lambda: np.ones(2))
    fixes: FloatArray = field(default_factory=lambda: np.ones(6))
    markov_sd: float = 0.0
    markov_time: float = 1.0
    outliers: int = 0
    outlier_size: float = 0.0
    wrong: int = 0
    wrong_rms: float = 0.0

    def plus(self, other: Errors) -> Errors:
        """Return both together; no two may set the same random error or jump."""
        mine = self if self.markov_sd else other
        far = self if self.outliers else other
        off = self if self.wrong else other
        late = self if np.any(self.jump) else other
        return replace(
            self,
            delay=self.delay + other.delay,
            lag=self.lag + other.lag,
            arm=self.arm + other.arm,
            frame=self.frame + other.frame,
            matrix=self.matrix + other.matrix,
            jump_time=late.jump_time,
            jump=late.jump,
            noise=self.noise * other.noise,
            fixes=self.fixes * other.fixes,
            markov_sd=mine.markov_sd,
            markov_time=mine.markov_time,
            outliers=far.outliers,
            outlier_size=far.outlier_size,
            wrong=off.wrong,
            wrong_rms=off.wrong_rms,
        )
