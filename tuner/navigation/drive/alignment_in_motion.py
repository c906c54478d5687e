"""Biases of gyros and accelerometers from motion, beside the attitude, where a vehicle is hardly ever stationary.

In the axes b₀ of the first step, with C = C_b0b, a = C f and errors δb_g, δb_a of the assumed biases, to first
order::

    α = ∫ a dt        δα = M δb_g − Θ δb_a,    M = ∫ [a ×] Θ dt,    Θ = ∫ C dt

β = C_nb0 α (`alignment`) is solved for attitude and biases by Gauss–Newton: first over so short a time that the bias
rotates the unit by less than a radian, then over twice that, until all is used. What is known of the biases is a
prior.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models import rotation
from models.arrays import FloatArray
from tuner.navigation.data import Steps

MAX_GAUSS_NEWTON_STEPS = 10
"""Steps of Gauss–Newton over one time, at most."""
MIN_STEP = 0.1
"""Step, in sds of the bias, below which the iteration ends."""
MIN_WINDOWS = 6
"""Windows to begin with, at least."""
VERTICAL_START_BIASES = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
"""Biases about the vertical to begin with, in sds: gravity does not determine them, and minima may be several."""
MAX_MISFIT = 9.0
"""Misfit, in reported variances, above which a solution over more than the first time is repeated from other starts."""
MIN_BIAS_SD = 1e-6
"""Least sd of a bias, rad/s and m/s²."""
STEP_FRACTIONS = (1.0, 0.5, 0.25, 0.125)
"""Fractions of a step that are tried."""
MAX_SQUARE_RATIO = 25.0
"""Squares of misfits are limited to so many times their median."""


@dataclass(frozen=True)
class RotatedSteps:
    """Increments in the axes b₀, integrated, and their derivatives by the biases.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Ends of the steps, the beginning of the first before them, s.
    quat : ndarray, shape (n, 4)
        Attitude of b in b₀.
    velocity, position : ndarray, shape (n, 3)
        First and second integral of the force.
    velocity_derivative, position_derivative : ndarray, shape (n, 18)
        Their derivatives by the biases, M and −Θ, each row by row.
    """

    t: FloatArray
    quat: FloatArray
    velocity: FloatArray
    position: FloatArray
    velocity_derivative: FloatArray
    position_derivative: FloatArray

    def at(self, t: FloatArray, *, position: bool, derivative: bool) -> FloatArray:
        """Return an integral, or its derivative by the biases, at times (k,); shape (k, 3) or (k, 18)."""
        integrals = (
            (self.velocity_derivative, self.position_derivative)
            if derivative
            else (self.velocity, self.position)
        )
        y = integrals[position]
        return np.stack([np.interp(t, self.t, column) for column in y.T], axis=-1)


@dataclass(frozen=True)
class BiasEstimate:
    """Biases of gyros and accelerometers, (6,), and the covariance of the attitude of b₀ in n and of them, (9, 9)."""

    bias: FloatArray
    covariance: FloatArray


def rotate_steps(steps: Steps, window: slice, bias: FloatArray) -> RotatedSteps:
    """Rotate the steps of a window into b₀, biases (6,) subtracted."""
    dt = steps.dt[window, None]
    integrated = steps.increments[window] - bias * dt
    quat = attitudes(integrated[:, :3])
    mats = rotation.mat_from_quat(quat)
    mean = 0.5 * (mats[1:] + mats[:-1])
    pieces = (mean @ integrated[:, 3:, None])[..., 0]
    theta = _cumulative(mean.reshape(-1, 9) * dt)
    middle = 0.5 * (theta[1:] + theta[:-1]).reshape(-1, 3, 3)
    velocity = _cumulative(pieces)
    derivative = np.hstack([_cumulative((rotation.skew(pieces) @ middle).reshape(-1, 9)), -theta])
    t = steps.ends()[window.start : window.start + len(quat)]
    return RotatedSteps(t, quat, velocity, _integral(velocity, dt), derivative, _integral(derivative, dt))


def wahba(alpha: FloatArray, beta: FloatArray) -> FloatArray:
    """Return the rotation that takes vectors α (n, 3) to β (n, 3) with the least squared misfit."""
    u, _, vt = np.linalg.svd(beta.T @ alpha)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(vt)]) @ vt)


def outlier_limit(square: FloatArray) -> float:
    """Return the limit of squares of misfits (n,): outliers do not dominate the sum."""
    return MAX_SQUARE_RATIO * float(np.median(square)) + 1e-12


def biases_from_motion(
    integrated: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    beta: FloatArray,
    times: FloatArray,
    prior: FloatArray,
    sd: FloatArray,
    share: float,
    noise: float,
) -> BiasEstimate:
    """Estimate the biases with which the specific force explains the changes of velocity.

    Parameters
    ----------
    integrated : callable
        α (w, 3) and its derivatives (w, 18) of all windows, biases (6,) subtracted.
    beta : ndarray, shape (w, 3)
        Changes of velocity.
    times : ndarray, shape (w,)
        From the first fix to the ends of the windows, rising, s.
    prior, sd : ndarray, shape (6,)
        Prior mean and sds of the biases.
    share : float
        Independent windows per window.
    noise : float
        Least variance of a change.
    """
    sd = np.maximum(sd, MIN_BIAS_SD)

    def fitted(bias: FloatArray, used: int) -> _Fit:
        alpha, derivative = integrated(bias)
        return _fit(alpha[:used], derivative[:used], beta[:used], (prior - bias) / sd)

    def solved(bias: FloatArray, used: int) -> _Answer:
        here = fitted(bias, used)
        for _ in range(MAX_GAUSS_NEWTON_STEPS):
            weight = share / max(float(here.square.mean()) / 3.0, noise)
            information = weight * here.information
            information[range(3, 9), range(3, 9)] += sd**-2
            covariance = np.asarray(np.linalg.inv(information), dtype=float)
            score = weight * here.score
            score[3:] += here.prior / sd
            step = (covariance @ score)[3:]
            if np.all(np.abs(step) < MIN_STEP * np.sqrt(np.diag(covariance)[3:])):
                break
            for part in STEP_FRACTIONS:
                there = fitted(bias + part * step, used)
                if there.cost(weight) < here.cost(weight):
                    break
            else:
                break
            bias, here = bias + part * step, there
        return bias, covariance, here

    def from_other_starts(answers: list[_Answer], used: int) -> list[_Answer]:
        # Gravity tells turns about level axes; about the vertical there may be several answers.
        bias, _, fit = min(answers, key=lambda one: one[2].cost(share / max(noise, 1e-300)))
        if used > first and fit.square.mean() < MAX_MISFIT * 3.0 * noise:
            return answers
        level = bias - np.concatenate([fit.down @ bias[:3] * fit.down, np.zeros(3)])
        about = np.concatenate([fit.down @ sd[:3] * fit.down, np.zeros(3)])
        return [*answers, *(solved(level + k * about, used) for k in VERTICAL_START_BIASES)]

    length = 1.0 / max(float(sd[:3].max()), 1e-300)
    used = first = max(min(MIN_WINDOWS, len(times)), int(np.searchsorted(times, length)))
    answers = [solved(prior, used)]
    if used < len(times):
        answers = from_other_starts(answers, used)
    while used < len(times):
        length *= 2.0
        used = max(used, int(np.searchsorted(times, length)))
        answers = [solved(bias, used) for bias, _, _ in _distinct(answers)]
        answers = from_other_starts(answers, used)
    weight = share / max(min(float(fit.square.mean()) for _, _, fit in answers) / 3.0, noise)
    bias, covariance, _ = min(answers, key=lambda one: one[2].cost(weight))
    return BiasEstimate(bias, covariance)


def _distinct(answers: list[_Answer]) -> list[_Answer]:
    """Return answers that are more than a sd of theirs from those before them."""
    kept: list[_Answer] = []
    for one in answers:
        sd = np.sqrt(np.diag(one[1])[3:])
        if all(np.any(np.abs(one[0] - other[0]) > sd) for other in kept):
            kept.append(one)
    return kept


@dataclass(frozen=True)
class _Fit:
    """Squares of the misfits (w,) up to their limit, the prior's misfit (6,), score (9,), information (9, 9), down."""

    square: FloatArray
    prior: FloatArray
    score: FloatArray
    information: FloatArray
    down: FloatArray

    def cost(self, weight: float) -> float:
        """Return minus twice the log likelihood."""
        return float(weight * self.square.sum() + self.prior @ self.prior)


_Answer = tuple[FloatArray, FloatArray, _Fit]
"""Biases, the covariance of attitude and biases, the fit."""


def _fit(alpha: FloatArray, derivative: FloatArray, beta: FloatArray, prior: FloatArray) -> _Fit:
    """Turn α (w, 3) to β (w, 3) and return what is left, and how attitude and biases change it."""
    mat = wahba(alpha, beta)
    off = beta - alpha @ mat.T
    square = np.sum(off**2, axis=1)
    most = outlier_limit(square)
    by_bias = np.concatenate(
        [derivative[:, :9].reshape(-1, 3, 3), derivative[:, 9:].reshape(-1, 3, 3)], axis=2
    )
    design = np.concatenate([-rotation.skew(alpha @ mat.T), mat @ by_bias], axis=2)
    weight = np.minimum(1.0, most / np.maximum(square, most))
    score = np.einsum("wij,wi,w->j", design, off, weight)
    information = np.einsum("wij,wik,w->jk", design, design, weight)
    return _Fit(np.minimum(square, most), prior, score, information, mat[2])


def attitudes(angles: FloatArray) -> FloatArray:
    """Return the attitudes before, between and after turns (n, 3), rad; shape (n + 1, 4)."""
    quat = np.vstack([[1.0, 0.0, 0.0, 0.0], rotation.quat_from_rotvec(angles)])
    reach = 1
    while reach < len(quat):
        quat[reach:] = rotation.quat_multiply(quat[:-reach], quat[reach:])
        reach *= 2
    return np.asarray(quat / np.linalg.norm(quat, axis=1, keepdims=True))


def _cumulative(pieces: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros((1, pieces.shape[1])), np.cumsum(pieces, axis=0)])


def _integral(y: FloatArray, dt: FloatArray) -> FloatArray:
    return _cumulative(0.5 * (y[1:] + y[:-1]) * dt)
