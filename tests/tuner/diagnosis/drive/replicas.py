"""Replicas of a linear model: the same filter and trajectory, errors drawn from a noise hypothesis.

::

    e ← Φ e + B θ + w,    ν = H e + D θ + v,    c = K ν,    e ← e − c

with w and v as the hypothesis has them, K as the recorded filter had it. They say how a statistic is spread where
the hypothesis is true, and hide causes in runs whose filter does not model them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
from numpy.typing import NDArray

from models.filter_states.declaration import NAVIGATION_STATES
from tuner.linear_run.likelihood import NoiseHypothesis, _forward, as_configured
from tuner.linear_run.linearized_run import NOISE_GROUPS, LinearizedRun

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Source:
    """What replicas of one hypothesis are drawn from.

    Attributes
    ----------
    noise : NoiseHypothesis
        What is true.
    roots : ndarray, shape (k, n, n)
        Square roots of the process noise.
    start : ndarray, shape (n, n)
        Square root of P at the start.
    gains : ndarray, shape (k, 6, n)
        Of the recorded filter, row by row.
    """

    noise: NoiseHypothesis
    roots: FloatArray
    start: FloatArray
    gains: FloatArray

    @classmethod
    def of(cls, noise: NoiseHypothesis) -> Source:
        """Prepare the replicas of a noise hypothesis."""
        linearized = noise.linearized
        factors = (noise.process_noise_scale**2).tolist()
        total = linearized.noise.get("gnss_position", np.zeros_like(linearized.transition))
        for factor, group in zip(factors, NOISE_GROUPS, strict=True):
            total = total + factor * linearized.noise[group]
        return cls(
            noise, _root(total), _root(linearized.initial[None])[0], _forward(as_configured(linearized))[1]
        )

    def draw(self, rng: np.random.Generator, theta: FloatArray | None = None) -> LinearizedRun:
        """Return a replica.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of all noise.
        theta : ndarray, shape (p,), optional
            Constants, one for each column of B.
        """
        h, linearized = self.noise, self.noise.linearized
        k, n = linearized.transition.shape[:2]
        drive = np.einsum("kij,kj->ki", self.roots, rng.standard_normal((k, n)))
        noise = h.sd * rng.standard_normal((k, 6)) * linearized.available
        if np.any(h.markov_sd > 0.0):
            noise[:, :3] += _markov(linearized.t, h.markov_sd, h.markov_time, rng)
        if theta is not None:
            drive += linearized.B @ theta
            noise += linearized.D @ theta
        starts = (self.start @ rng.standard_normal((n, int(linearized.starts.sum()) + 1))).T
        innovation, correction = np.zeros((k, 6)), np.zeros((k, n))
        _run(
            linearized.transition, linearized.H, drive, noise, linearized.available,
            linearized.used & linearized.available, linearized.starts,
            np.ascontiguousarray(starts), self.gains, innovation, correction,
        )  # fmt: skip
        return replace(linearized, innovation=innovation, correction=correction)


def _root(matrices: FloatArray) -> FloatArray:
    """Return square roots of covariances (k, n, n), which may be singular and of mixed units."""
    scale = np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrices / (scale[:, :, None] * scale[:, None, :]))
    return np.asarray(scale[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])


def _markov(t: FloatArray, sd: FloatArray, time: float, rng: np.random.Generator) -> FloatArray:
    """Return a Gauss–Markov process at times t, one column for each sd; shape (k, 3)."""
    decay = np.exp(-np.diff(t, prepend=t[:1]) / time)
    drawn = rng.standard_normal((len(t), len(sd)))
    for i in range(1, len(t)):
        drawn[i] = decay[i] * drawn[i - 1] + np.sqrt(1.0 - decay[i] ** 2) * drawn[i]
    return np.asarray(drawn * sd)


@numba.njit(cache=True, error_model="numpy", fastmath=True)
def _run(
    phi: FloatArray,
    H: FloatArray,
    drive: FloatArray,
    noise: FloatArray,
    available: BoolArray,
    rows: BoolArray,
    starts: BoolArray,
    begin: FloatArray,
    gains: FloatArray,
    innovation: FloatArray,
    correction: FloatArray,
) -> None:
    """Set innovations (k, 6) and corrections (k, n) of the recorded filter on drawn errors."""
    k = len(drive)
    e = begin[0].copy()
    stretch = 1
    for i in range(k):
        if i > 0 and starts[i]:
            e[:NAVIGATION_STATES] = begin[stretch, :NAVIGATION_STATES]
            stretch += 1
        e = phi[i] @ e + drive[i]
        a = correction[i]
        for row in range(6):
            if available[i, row]:
                innovation[i, row] = H[i, row] @ e + noise[i, row]
                if rows[i, row]:
                    z = innovation[i, row] - H[i, row] @ a
                    a += gains[i, row] * z
        e -= a
