"""Noise and slow templates fitted together: the likelihood in the cosine domain.

::

    -2 ln L(θ, β) = Σ c [ln E(θ) + (a − C β)²/E(θ)],    E = g_w S_white + S_quantization + S_slow + S_fixed

with c coefficients in a cell, β profiled out by weighted least squares and θ the logs of the parameters. The slow
noise is flicker or one Gauss–Markov process, each with a random walk: a comparison of two sets of templates takes
the better of both kinds under either hypothesis. A ramp is always among the templates.

References
----------
.. [1] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from models.noise import BiasInstability, GaussMarkov, Quantization, RandomWalk, Term, White
from tuner.identification.expected_periodogram import expected_power
from tuner.identification.periodogram import CosinePeriodogram

FloatArray = NDArray[np.float64]
Kinds = tuple[type[Term], ...]

FLICKER: Kinds = (Quantization, White, RandomWalk, BiasInstability)
"""Slow noise with flicker."""
MARKOV: Kinds = (Quantization, White, RandomWalk, GaussMarkov)
"""Slow noise with a Gauss–Markov process."""
BASES = (FLICKER, MARKOV)
"""The two kinds of slow noise."""
MIN_TIME_CONSTANT = 100.0
"""Least time constant of a Gauss–Markov term, sampling intervals: what is faster is a matter of the fast spectrum."""


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

    def fit(self, kinds: Kinds, start: FloatArray | None = None) -> Fit:
        """Return the fit of these kinds of noise, from `start` or from the best of a grid."""
        problem = _Problem(self, kinds)
        if start is None:
            return min((problem.minimise(s) for s in problem.starts()), key=lambda f: -f.log_likelihood)
        return problem.minimise(start)

    def averaged_variance(self, fit: Fit, column: int, kinds: Kinds) -> float:
        """Return the variance of the size of a template, averaged over amplitudes of slow noise that the data allow.

        Slow noise that is too weak to be seen is often estimated as none; the template then looks too well known.
        The amplitudes of `kinds` run over an even grid from zero, weighted by their likelihood.
        """
        problem = _Problem(self, fit.kinds)
        place = [sum(len(k.PARAMETERS) for k in fit.kinds[: fit.kinds.index(kind)]) for kind in kinds]
        lower = problem.bounds[0]
        grids = []
        for at in place:
            top = fit.theta.copy()
            top[at] = max(top[at], lower[at] + 1.0)
            while problem(top)[0] + 2.0 * fit.log_likelihood < 9.0 and top[at] < problem.bounds[1][at]:
                top[at] += 0.25
            grids.append(np.log((np.arange(12) + 0.5) / 12.0) + top[at])
        rows = []
        for values in product(*grids):
            theta = fit.theta.copy()
            theta[place] = values
            expected = problem.expected(theta)[0]
            beta, covariance, squares = problem.profile(expected)
            value = float(self.grid.count @ np.log(expected) + squares.sum())
            rows.append((value, beta[column], covariance[column, column]))
        cost, size, variance = np.array(rows).T
        weight = np.exp(-0.5 * (cost - cost.min()))
        weight /= weight.sum()
        return float(weight @ (variance + (size - fit.beta[column]) ** 2))

    def without_column(self, column: int, size: float) -> Track:
        """Return the track with the size of one template fixed instead of fitted."""
        amplitude = self.grid.amplitude.copy()
        amplitude[: self.singles] -= size * self.columns[:, column]
        return replace(
            self,
            grid=replace(self.grid, amplitude=amplitude),
            columns=np.delete(self.columns, column, axis=1),
        )


def unit(kind: type[Term], *scale: float) -> Term:
    """Return a term of amplitude 1."""
    make: Callable[..., Term] = kind
    return make(1.0, *scale)


@dataclass(frozen=True)
class _Problem:
    track: Track
    kinds: Kinds

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of the logs; amplitudes are in units of the white noise of a sample."""
        grid = self.track.grid
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
        pairs = np.array([pair for kind in self.kinds for pair in limits[kind]])
        return np.log(pairs[:, 0]), np.log(pairs[:, 1])

    @cached_property
    def shapes(self) -> tuple[FloatArray | None, ...]:
        """Power of the unit amplitude where a term has no other parameter."""
        return tuple(
            None
            if len(kind.PARAMETERS) > 1
            else self._weighted(kind, expected_power(unit(kind), self.track.grid)[0])
            for kind in self.kinds
        )

    def _weighted(self, kind: type[Term], power: FloatArray) -> FloatArray:
        return power * self.track.gain if kind is White else power

    def expected(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return E, shape (m,), and its derivatives by θ, shape (q, m)."""
        total, rows, at = self.track.fixed.copy(), [], 0
        for kind, shape in zip(self.kinds, self.shapes, strict=True):
            gain = np.exp(2.0 * theta[at])
            if shape is not None:
                power = gain * shape
                gradient = 2.0 * power[None]
            else:
                power, gradient = expected_power(
                    unit(kind, *np.exp(theta[at + 1 : at + 2]).tolist()), self.track.grid
                )
                power, gradient = gain * power, gain * gradient
            total += power
            rows.append(gradient)
            at += len(gradient)
        return total, np.concatenate(rows)

    def profile(self, expected: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return β (p,), its covariance (p, p) and the squares of the rest over E, times c, shape (m,)."""
        track = self.track
        weighted = track.columns / expected[: track.singles, None]
        information = weighted.T @ track.columns
        ridge = np.diag(1e-10 * np.diag(information) + 1e-300)
        covariance = np.asarray(np.linalg.inv(information + ridge), dtype=float)
        beta = covariance @ (weighted.T @ track.grid.amplitude[: track.singles])
        rest = track.grid.amplitude.copy()
        rest[: track.singles] -= track.columns @ beta
        return beta, covariance, track.grid.count * rest**2 / expected

    def __call__(self, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return -2 ln L, its gradient (q,) and its expected second derivatives (q, q)."""
        expected, gradient = self.expected(theta)
        squares = self.profile(expected)[2]
        relative = gradient / expected
        count = self.track.grid.count
        value = float(count @ np.log(expected) + squares.sum())
        return value, relative @ (count - squares), (relative * count) @ relative.T

    def minimise(self, start: FloatArray) -> Fit:
        """Return the fit next to `start`, by damped Fisher scoring."""
        lower, upper = self.bounds
        theta, damping = np.clip(start, lower, upper), 1e-3
        value, gradient, information = self(theta)
        for _ in range(60):
            at_edge = ((theta <= lower) & (gradient > 0)) | ((theta >= upper) & (gradient < 0))
            move = np.flatnonzero(~at_edge)
            if not len(move):
                break
            matrix = information[np.ix_(move, move)]
            step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix) + 1e-3), -gradient[move])
            trial = theta.copy()
            trial[move] = np.clip(theta[move] + np.clip(step, -2.0, 2.0), lower[move], upper[move])
            attempt = self(trial)
            if attempt[0] > value:
                damping *= 10.0
                if damping > 1e5:
                    break
                continue
            gain, theta = value - attempt[0], trial
            value, gradient, information = attempt
            damping = max(0.1 * damping, 1e-9)
            if gain < 1e-4:
                break
        expected = self.expected(theta)[0]
        beta, covariance, _ = self.profile(expected)
        spread = np.asarray(2.0 * np.linalg.inv(information + 1e-6 * np.eye(len(theta))), dtype=float)
        return Fit(self.kinds, theta, spread, -0.5 * value, expected, beta, covariance)

    def starts(self) -> list[FloatArray]:
        """Return the likeliest starts on a grid of time constants."""
        lower, upper = self.bounds
        grid = self.track.grid
        number = sum(kind is GaussMarkov for kind in self.kinds)
        times = np.geomspace(2.0 * MIN_TIME_CONSTANT * grid.interval, 0.3 * grid.longest, 6)
        choices: list[tuple[float, ...]] = [(t,) for t in times.tolist()] if number == 1 else [()]
        if number == 2:
            choices = [(a, b) for i, a in enumerate(times) for b in times[i + 1 :]]
        found = []
        for choice in choices:
            left = list(choice)
            powers, logs = [], []
            for kind, shape in zip(self.kinds, self.shapes, strict=True):
                scale = [left.pop(0)] if shape is None else []
                logs.append(np.log(scale))
                powers.append(expected_power(unit(kind, *scale), grid)[0] if shape is None else shape)
            variances = self._shares(np.stack(powers))
            start = np.concatenate([(0.5 * np.log(v), *log) for v, log in zip(variances, logs, strict=True)])
            start = np.clip(start, lower, upper)
            found.append((self(start)[0], start))
        found.sort(key=lambda pair: pair[0])
        return [start for _, start in found[:2]]

    def _shares(self, shapes: FloatArray) -> FloatArray:
        """Return variances for which Σ v·shapes resembles the power, by multiplicative steps."""
        count = self.track.grid.count
        rough = self.profile(np.maximum(self.track.grid.power, 1e-12 + np.median(self.track.grid.power)))[2]
        squares = rough * np.maximum(self.track.grid.power, 1e-12 + np.median(self.track.grid.power))
        variances = (squares / shapes) @ np.ones_like(count) / count.sum() / len(shapes)
        for _ in range(30):
            expected = variances @ shapes + self.track.fixed
            variances = variances * np.sqrt(shapes @ (squares / expected**2) / (shapes @ (count / expected)))
        return np.asarray(np.maximum(variances, 1e-300))
