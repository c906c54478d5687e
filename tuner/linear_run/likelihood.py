"""Likelihood of a linearised run under other noise, and its gradient: the basis of every test of a drive.

A `NoiseHypothesis` states sds of the fixes, factors on the process noise, a Gauss–Markov error of the position fixes,
rows that are taken, and columns of constants θ that are free. With the innovations z of the filter it describes, their
variances f and their sensitivities s (`kalman_kernels`)::

    ln L = −½ Σ [(z − s θ)²/f + ln 2πf],    θ = I⁻¹ Σ s z/f,    I = Σ s sᵀ/f

over the rows that are taken and count: θ is profiled out. The gradient by all noise parameters at once costs one
backward recursion. For the filter as configured (`as_configured`), z and f are exactly its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from models.arrays import BoolArray, FloatArray
from tuner.linear_run.kalman_kernels import Groups, Places, backward, forward, unaided
from tuner.linear_run.linearized_run import NOISE_GROUPS, LinearizedRun

N_IMPULSE_STATES = 6
"""States after the first nine whose impulses are scored: the biases of gyroscopes and accelerometers."""


@dataclass(frozen=True)
class NoiseHypothesis:
    """Noise supposed of a linearised run of k fixes.

    Attributes
    ----------
    linearized : LinearizedRun
        The run.
    sd : ndarray, shape (k, 6)
        Of the fixes.
    process_noise_scale : ndarray, shape (4,)
        Factor on the density of each of `NOISE_GROUPS`, as configured 1.
    rows : ndarray of bool, shape (k, 6)
        Rows that are taken.
    columns : tuple of int
        Columns of B and D whose parameters are free.
    markov_sd : ndarray, shape (3,)
        Stationary sd of a Gauss–Markov error of the position fixes, north, east, down, m.
    markov_time : float
        Its time constant, s.
    """

    linearized: LinearizedRun
    sd: FloatArray
    process_noise_scale: FloatArray
    rows: BoolArray
    columns: tuple[int, ...] = ()
    markov_sd: FloatArray = field(default_factory=lambda: np.zeros(3))
    markov_time: float = 60.0

    @property
    def counted(self) -> BoolArray:
        """Rows that enter ln L: taken, after the filter has settled; shape (k, 6)."""
        return self.rows & self.linearized.available & self.linearized.scored[:, None]

    def part(self, which: slice, settling: int) -> NoiseHypothesis:
        """Return the hypothesis for a part of the run, see `LinearizedRun.rows`."""
        return replace(
            self, linearized=self.linearized.rows(which, settling), sd=self.sd[which], rows=self.rows[which]
        )

    @property
    def count(self) -> int:
        """Number of rows that enter ln L."""
        return int(np.count_nonzero(self.counted))

    @property
    def factors(self) -> FloatArray:
        """Squared factors on all groups of process noise, 1 on those that are not stated; shape (g,)."""
        found = np.ones(len(self.linearized.noise))
        found[: len(self.process_noise_scale)] = self.process_noise_scale**2
        return found

    @property
    def process_noise(self) -> FloatArray:
        """Process noise of all groups together; shape (k, n, n)."""
        pairs = zip(self.factors.tolist(), self.linearized.noise.values(), strict=True)
        return np.asarray(sum(factor * noise for factor, noise in pairs))


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of a noise hypothesis, its constants and innovations.

    Attributes
    ----------
    value : float
        ln L.
    theta : ndarray, shape (p,)
        Free constants.
    innovation, variance : ndarray, shape (k, 6)
        z − s θ and f, of one row after the other of a fix; NaN where it has none.
    sensitivity : ndarray, shape (k, 6, p)
        s.
    """

    value: float
    theta: FloatArray
    innovation: FloatArray
    variance: FloatArray
    sensitivity: FloatArray

    @property
    def white(self) -> FloatArray:
        """Innovations by their sds: independent and of unit variance; shape (k, 6), NaN where there is none."""
        return np.asarray(self.innovation / np.sqrt(self.variance))


@dataclass(frozen=True)
class Gradient:
    """Derivatives of ln L by logs of the noise, deleted residuals, and scores of impulses.

    The last four suppose that all rows taken count.

    Attributes
    ----------
    value : float
        ln L.
    by_sd : ndarray, shape (k, 6)
        By ln sd of every row.
    by_process_noise_scale : ndarray, shape (g,)
        By ln process_noise_scale.
    by_markov_sd : ndarray, shape (3,)
        By ln markov_sd.
    deleted : ndarray, shape (k, 6)
        What each row is off given all other rows taken, by its sd; NaN where there is none.
    precision : ndarray, shape (k, 6)
        Inverse variance of a row given all other rows, 0 where it is not taken.
    score, information : ndarray, shapes (k, 6), (k, 6, 6)
        Of an impulse in the biases of gyroscopes and accelerometers just after each fix: I⁻¹ score is its size.
    """

    value: float
    by_sd: FloatArray
    by_process_noise_scale: FloatArray
    by_markov_sd: FloatArray
    deleted: FloatArray
    precision: FloatArray
    score: FloatArray
    information: FloatArray


def as_configured(linearized: LinearizedRun) -> NoiseHypothesis:
    """Return the noise for which the filter was configured."""
    return NoiseHypothesis(
        linearized, linearized.sd, np.ones(len(NOISE_GROUPS)), linearized.used & linearized.available
    )


def evaluate(noise: NoiseHypothesis) -> Likelihood:
    """Return the likelihood of a run under a noise hypothesis, the free constants profiled out."""
    return _forward(noise)[0]


def evaluate_with_gradient(noise: NoiseHypothesis) -> tuple[Likelihood, Gradient]:
    """Return the likelihood and its gradient by the noise."""
    likelihood, gains = _forward(noise)
    linearized = noise.linearized
    k, b = len(linearized.t), min(N_IMPULSE_STATES, linearized.transition.shape[1] - 9)
    gradient = Gradient(
        likelihood.value,
        np.zeros(linearized.sd.shape),
        np.zeros(len(linearized.noise)),
        np.zeros(3),
        np.full(linearized.sd.shape, np.nan),
        np.zeros(linearized.sd.shape),
        np.zeros((k, max(b, 0))),
        np.zeros((k, max(b, 0), max(b, 0))),
    )
    backward(
        *_packed(linearized),
        noise.factors,
        linearized.H,
        noise.sd,
        linearized.available,
        noise.rows & linearized.available,
        noise.counted,
        linearized.starts,
        _decay(noise),
        noise.markov_sd,
        likelihood.innovation,
        likelihood.variance,
        gains,
        gradient.by_sd,
        gradient.by_process_noise_scale,
        gradient.by_markov_sd,
        gradient.deleted,
        gradient.precision,
        gradient.score,
        gradient.information,
    )
    gradient.by_process_noise_scale[:] *= 2.0
    return likelihood, gradient


def with_constants_fixed(noise: NoiseHypothesis) -> NoiseHypothesis:
    """Return a noise hypothesis with its free constants fixed at their present estimates.

    Their effect is taken out of the innovations, so that no column is left to carry along. Estimates of mean and
    noise of normal distributions are independent to first order: noise may be fitted with the constants fixed.
    """
    if not noise.columns:
        return noise
    linearized = noise.linearized
    shift = unaided_shift(linearized, noise.columns, evaluate(noise).theta)
    return replace(
        noise, linearized=replace(linearized, innovation=linearized.innovation - shift), columns=()
    )


def unaided_shift(linearized: LinearizedRun, columns: Sequence[int], theta: FloatArray) -> FloatArray:
    """Return what constants of some columns shift all rows by where no filter corrects any of it; shape (k, c)."""
    push, offset = (of[:, :, list(columns)] @ theta for of in (linearized.B, linearized.D))
    error = np.empty_like(push)
    unaided(_packed(linearized)[0], push, linearized.starts, error)
    return np.asarray((linearized.H @ error[:, :, None])[:, :, 0] + offset)


def _packed(linearized: LinearizedRun) -> tuple[Places, Groups]:
    """Return transition and noise as the kernels take them."""
    phi, noise = (linearized.sparse(noise=which) for which in (False, True))
    return (phi.start, phi.column, phi.values), (noise.start, noise.row, noise.column, noise.values)


def _chosen(of: FloatArray, columns: list[int]) -> FloatArray:
    """Return columns of the last axis, without a copy where they are all."""
    every = columns == list(range(of.shape[2]))
    return np.ascontiguousarray(of if every else of[:, :, columns])


def _decay(noise: NoiseHypothesis) -> FloatArray:
    t = noise.linearized.t
    return np.asarray(np.exp(-np.diff(t, prepend=t[:1]) / noise.markov_time))


def covariances(noise: NoiseHypothesis) -> FloatArray:
    """Return P after every fix of the filter that a noise hypothesis describes; shape (k, n, n)."""
    found = np.empty_like(noise.linearized.transition)
    _forward(noise, found)
    return found


def _forward(noise: NoiseHypothesis, covariance: FloatArray | None = None) -> tuple[Likelihood, FloatArray]:
    linearized, columns = noise.linearized, list(noise.columns)
    k, n, p = len(linearized.t), linearized.transition.shape[1], len(columns)
    size = n + 3 if np.any(noise.markov_sd > 0.0) else n
    c = linearized.H.shape[1]
    z, f = np.full((k, c), np.nan), np.full((k, c), np.nan)
    s, gains = np.zeros((k, c, p)), np.zeros((k, c, size))
    forward(
        *_packed(linearized),
        noise.factors,
        linearized.H,
        linearized.innovation,
        noise.sd,
        linearized.available,
        noise.rows & linearized.available,
        linearized.correction,
        linearized.initial,
        linearized.starts,
        _chosen(linearized.B, columns),
        _chosen(linearized.D, columns),
        _decay(noise),
        noise.markov_sd,
        z,
        f,
        s,
        gains,
        np.zeros((0, size, size)) if covariance is None else covariance,
    )
    rows = noise.counted
    theta = np.zeros(p)
    if p:
        root = np.sqrt(f[rows])
        design = s[rows] / root[:, None]
        scale = np.sqrt(np.sum(design**2, axis=0))
        scale[scale == 0.0] = 1.0
        design = design / scale
        inverse = np.linalg.pinv(design.T @ design, rcond=1e-12, hermitian=True)
        theta = inverse @ (design.T @ (z[rows] / root)) / scale
        z = z - s @ theta
    value = -0.5 * float(np.sum(z[rows] ** 2 / f[rows] + np.log(2.0 * np.pi * f[rows])))
    return Likelihood(value, theta, z, f, s), gains
