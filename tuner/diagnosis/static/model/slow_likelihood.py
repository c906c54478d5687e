"""Noise and slow templates fitted together, by the objective of the identification (`tuner.identification.objective`).

Its expected power is E = g_w S_white + S_quantization + S_slow + S_fixed. The slow noise is flicker or one
Gauss–Markov process, each with a random walk: a comparison of two sets of templates takes the better of both kinds
under either hypothesis. A ramp is always among the templates. As sets of templates are compared, the likelihood is not
the restricted one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from models.arrays import FloatArray
from models.noise import BiasInstability, GaussMarkov, Quantization, RandomWalk, Term, White
from tuner.identification.expected_periodogram import expected_power
from tuner.identification.objective import Objective
from tuner.identification.periodogram import CosinePeriodogram

Kinds = tuple[type[Term], ...]

FLICKER: Kinds = (Quantization, White, RandomWalk, BiasInstability)
"""Slow noise with flicker."""
MARKOV: Kinds = (Quantization, White, RandomWalk, GaussMarkov)
"""Slow noise with a Gauss–Markov process."""
BASES = (FLICKER, MARKOV)
"""The two kinds of slow noise."""
MIN_TIME_CONSTANT = 10.0
"""Least time constant of a Gauss–Markov term, sampling intervals: what is faster is a matter of the fast spectrum.

The corner of such a process, 1/63 of the rate, lies above the lowest bin of that, 1/100; slower ones have it below.
"""

TRIAL_CONSTANTS = 8
"""Trial values of a time constant: two a decade in a record of 1e5 samples."""
SCORE_CONSTANTS = 16
"""Time constants whose score is taken, two a factor of 2.2 apart in a record of 1e6 samples: neighbours look alike."""
FIT_TOLERANCE = 1e-4
"""Gain of -2 ln L in one step below which a fit ends: far below a likelihood ratio that decides anything."""


@dataclass(frozen=True)
class Fit:
    """Noise and templates of greatest likelihood.

    Attributes
    ----------
    kinds : tuple of type
        Classes of the noise terms.
    theta, covariance : ndarray, shapes (q,), (q, q)
        Logs of their parameters, and the covariance of these.
    log_likelihood : float
        Up to a constant that all fits to the same coefficients share.
    expected : ndarray, shape (m,)
        Expected power of each cell.
    beta, beta_covariance : ndarray, shapes (p,), (p, p)
        Sizes of the templates and their covariance at the fitted noise.
    """

    kinds: Kinds
    theta: FloatArray
    covariance: FloatArray
    log_likelihood: float
    expected: FloatArray
    beta: FloatArray
    beta_covariance: FloatArray

    def terms(self) -> tuple[Term, ...]:
        """Return the noise terms."""
        found, at = [], 0
        for kind in self.kinds:
            size = len(kind.PARAMETERS)
            found.append(kind(*np.exp(self.theta[at : at + size]).tolist()))
            at += size
        return tuple(found)


@dataclass(frozen=True)
class Track:
    """Data of a fit: cells of cosine coefficients, and templates.

    Attributes
    ----------
    grid : CosinePeriodogram
        Coefficients in cells; the first K are single.
    columns : ndarray, shape (K, p)
        Coefficients of the templates.
    gain : ndarray, shape (m,)
        Shape of the white noise, 1 where it is white.
    fixed : ndarray, shape (m,)
        Power that is there besides.
    """

    grid: CosinePeriodogram
    columns: FloatArray
    gain: FloatArray
    fixed: FloatArray

    @property
    def singles(self) -> int:
        """K, the number of coefficients the templates have."""
        return len(self.columns)

    def with_columns(self, more: FloatArray) -> Track:
        """Return the track with further templates, shape (K,) or (K, q)."""
        added = more[:, None] if more.ndim == 1 else more
        return Track(self.grid, np.concatenate((self.columns, added), axis=1), self.gain, self.fixed)

    def objective(self, kinds: Kinds, times: Sequence[float] = ()) -> Objective:
        """Return the likelihood of these kinds of noise, with trial values of a time constant for `starts`, s."""
        trials = []
        for kind in kinds:
            scales = [(time,) for time in times] if kind is GaussMarkov else [()]
            gain = self.gain if kind is White else 1.0
            trials.append(tuple((s, gain * expected_power(unit(kind, *s), self.grid)[0]) for s in scales))
        lower, upper = _bounds(kinds, self.grid)
        return Objective(
            self.grid, kinds, self.columns, lower, upper, tuple(trials), self.fixed, restricted=False
        )

    def fit(self, kinds: Kinds, start: FloatArray | None = None) -> Fit:
        """Return the fit of these kinds of noise, from `start` or from the best of a grid."""
        if start is not None:
            return _fit(self.objective(kinds), start)
        ends = 2.0 * MIN_TIME_CONSTANT * self.grid.interval, 0.3 * self.grid.longest
        objective = self.objective(kinds, np.geomspace(*ends, TRIAL_CONSTANTS).tolist())
        return max((_fit(objective, s) for s in objective.starts()), key=lambda fit: fit.log_likelihood)

    def square_score_of_markov(self, fit: Fit) -> float:
        """Return the largest square of the score, in sds, of a further Gauss–Markov process at a fit of the others.

        It is about twice the log likelihood that the process gains, for no more than a gradient; 0 where a little of
        it, of any time constant, would lose.
        """
        objective = self.objective(fit.kinds)
        expected, gradient = objective.expected(fit.theta)
        squares, freedom = objective.excess(expected)
        times = np.geomspace(
            2.0 * MIN_TIME_CONSTANT * self.grid.interval, 0.3 * self.grid.longest, SCORE_CONSTANTS
        )
        tried = np.stack([expected_power(unit(GaussMarkov, time), self.grid)[0] for time in times.tolist()])
        tried, known = tried / expected, gradient / expected
        cross = (tried * freedom) @ known.T
        information = (known * freedom) @ known.T
        explained = cross @ np.linalg.pinv(information, hermitian=True)
        score = (tried - explained @ known) @ (squares - freedom)
        variance = np.sum(tried**2 * freedom, axis=1) - np.sum(explained * cross, axis=1)
        usable = variance > 1e-6 * np.sum(tried**2 * freedom, axis=1)
        z = np.where(usable, score / np.sqrt(2.0 * np.where(usable, variance, 1.0)), 0.0)
        return float(np.maximum(z, 0.0).max() ** 2)

    def averaged_variance(self, fit: Fit, column: int, kinds: Kinds) -> float:
        """Return the variance of the size of a template, averaged over amplitudes of slow noise that the data allow.

        Slow noise that is too weak to be seen is often estimated as none; the template then looks too well known.
        The amplitudes of `kinds` run over an even grid from zero, weighted by their likelihood.
        """
        problem = self.objective(fit.kinds)
        place = [sum(len(k.PARAMETERS) for k in fit.kinds[: fit.kinds.index(kind)]) for kind in kinds]
        grids = []
        for at in place:
            top = fit.theta.copy()
            top[at] = max(top[at], problem.lower[at] + 1.0)
            while problem(top)[0] + 2.0 * fit.log_likelihood < 9.0 and top[at] < problem.upper[at]:
                top[at] += 0.25
            grids.append(np.log((np.arange(12) + 0.5) / 12.0) + top[at])
        rows = []
        for values in product(*grids):
            theta = fit.theta.copy()
            theta[place] = values
            beta, covariance = problem.sizes(problem.expected(theta)[0])
            rows.append((-2.0 * problem.log_likelihood(theta), beta[column], covariance[column, column]))
        cost, size, variance = np.array(rows).T
        weight = np.exp(-0.5 * (cost - cost.min()))
        weight /= weight.sum()
        return float(weight @ (variance + (size - fit.beta[column]) ** 2))

    def without_column(self, column: int, size: float) -> Track:
        """Return the track with the size of one template fixed instead of fitted."""
        fixed = self.objective(()).with_size(column, size)
        return replace(self, grid=fixed.data, columns=fixed.columns)


def unit(kind: type[Term], *scale: float) -> Term:
    """Return a term of amplitude 1."""
    make: Callable[..., Term] = kind
    return make(1.0, *scale)


def _bounds(kinds: Kinds, grid: CosinePeriodogram) -> tuple[FloatArray, FloatArray]:
    """Return bounds of the logs of the parameters; amplitudes are in units of the white noise of a sample."""
    root, span = np.sqrt(grid.interval), grid.longest
    limits = {
        Quantization: [(1e-4 * grid.interval, 10.0 * grid.interval)],
        White: [(0.02 * root, 50.0 * root)],
        RandomWalk: [(1e-3 * root / span, 10.0 / root)],
        BiasInstability: [(1e-3 * np.sqrt(grid.interval / span), 30.0)],
        GaussMarkov: [
            (1e-2 * np.sqrt(grid.interval / span), 300.0),
            (MIN_TIME_CONSTANT * grid.interval, 3.0 * span),
        ],
    }
    pairs = np.array([pair for kind in kinds for pair in limits[kind]]).reshape(-1, 2)
    return np.log(pairs[:, 0]), np.log(pairs[:, 1])


def _fit(objective: Objective, start: FloatArray) -> Fit:
    """Return the fit next to a start."""
    start = np.clip(start, objective.lower, objective.upper)
    theta, value = objective.minimise(start, tolerance=FIT_TOLERANCE)
    expected = objective.expected(theta)[0]
    beta, beta_covariance = objective.sizes(expected)
    spread = np.asarray(2.0 * np.linalg.inv(objective(theta)[2] + 1e-6 * np.eye(len(theta))), dtype=float)
    return Fit(objective.kinds, theta, spread, -0.5 * value, expected, beta, beta_covariance)
