"""Maximum likelihood of a sum of noise terms on the cosine periodogram.

The coefficients a_k of `tuner.identification.periodogram` are nearly independent and Gaussian, so with the
expected power E(θ) = Σ_terms E_term(θ), edges and aliasing included::

    -2 ln L = Σ_cells c [ln E + (a - R l)²/E]

c coefficients in a cell, l the coefficients of a unit ramp, whose rate R is profiled out by generalised
least squares. θ are the logs of the parameters of the terms; the gradient is analytic, the step is Fisher
scoring with damping, and the time constants of a grid are the starts.

References
----------
.. [1] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953).
.. [2] K. Levenberg, A method for the solution of certain non-linear problems in least squares (1944).
.. [3] C. Févotte, N. Bertin, J.-L. Durrieu, Nonnegative matrix factorization with the Itakura-Saito
   divergence, Neural Computation 21 (2009): the multiplicative step that finds the starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, groupby, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.noise import (
    BiasInstability,
    GaussMarkov,
    LowPassWhite,
    NoiseModel,
    Quantization,
    RandomWalk,
    Ramp,
    White,
)
from tuner.identification.expectation import expected_power
from tuner.identification.periodogram import CosinePeriodogram, cosine_periodogram

FloatArray = NDArray[np.float64]

TERMS: dict[str, type] = {
    kind.name: kind for kind in (Quantization, White, BiasInstability, GaussMarkov, RandomWalk, LowPassWhite)
}
"""Random terms that can be fitted; ``ramp`` may join them."""

NEGLIGIBLE = 1e-7
"""Share of the power everywhere at which the search for an amplitude ends: the term is zero there."""

_GRID_POINTS = 8
_REFINED = 3


@dataclass(frozen=True)
class LikelihoodFit:
    """Terms fitted to a cosine periodogram.

    Attributes
    ----------
    terms : tuple of str
        Names of the terms, ramp last.
    names : tuple of str
        Parameters, such as ``white.density``; those of a second Gauss–Markov term are ``gauss_markov_2.sd`` and so on.
    estimate : ndarray, shape (p,)
        Natural logs of the parameters.
    covariance : ndarray, shape (p, p)
        Covariance of the logs by the Fisher information; huge where the data do not hold the parameter.
    log_likelihood : float
        Up to a constant that all fits to the same periodogram share.
    slope, slope_sd : float
        Rate of the ramp with its sign, and its standard error given the noise; 0 and inf without a ramp.
    model : NoiseModel
        The same as a noise model.
    """

    terms: tuple[str, ...]
    names: tuple[str, ...]
    estimate: FloatArray
    covariance: FloatArray
    log_likelihood: float
    slope: float
    slope_sd: float
    model: NoiseModel


def fit(pieces: Sequence[FloatArray], interval: float, terms: Sequence[str]) -> LikelihoodFit:
    """Fit a given sum of terms to gap-free segments of one channel.

    Parameters
    ----------
    pieces : sequence of ndarray
        Samples of each segment, unit.
    interval : float
        Sampling interval, s.
    terms : sequence of str
        Names of terms; a Gauss–Markov term may come more than once.

    Returns
    -------
    LikelihoodFit

    Raises
    ------
    ValueError
        If a term is unknown, or all pieces are too short or constant.
    """
    return fit_periodogram(cosine_periodogram(pieces, interval), terms)


def fit_periodogram(data: CosinePeriodogram, terms: Sequence[str]) -> LikelihoodFit:
    """Fit a given sum of terms to a cosine periodogram; see `fit`."""
    problem = Problem.of(data, terms)
    return problem.result(
        min((problem.minimise(start) for start in problem.starts()), key=lambda found: found[1])[0]
    )


@dataclass(frozen=True)
class Problem:
    """Minus twice the log likelihood of one sum of terms, as a function of the logs of its parameters.

    Attributes
    ----------
    data : CosinePeriodogram
        What was measured.
    kinds : tuple of type
        Classes of the random terms, in the order of `TERMS`.
    ramp : bool
        Whether a ramp is profiled out.
    lower, upper : ndarray, shape (p,)
        Bounds of the logs.
    shapes : tuple of (ndarray or None)
        Expected power of the unit amplitude where it is the only parameter.
    """

    data: CosinePeriodogram
    kinds: tuple[type, ...]
    ramp: bool
    lower: FloatArray
    upper: FloatArray
    shapes: tuple[FloatArray | None, ...]

    @classmethod
    def of(cls, data: CosinePeriodogram, terms: Sequence[str]) -> Problem:
        """Prepare the terms of these names."""
        unknown = [name for name in terms if name not in TERMS and name != Ramp.name]
        names = [name for name in TERMS for given in terms if given == name]
        if unknown or not names:
            msg = f"'terms' must hold {', '.join(TERMS)} (and ramp), got {', '.join(terms)}"
            raise ValueError(msg)
        kinds = tuple(TERMS[name] for name in names)
        power = np.maximum(data.power, 1e-3 * data.power[data.count > 1].min(initial=data.power.max()))
        lower, upper, shapes = [], [], []
        for kind in kinds:
            scales = _scales(kind, data)
            ratios = np.stack([power / _shape(kind, scale, data) for scale in scales])
            lower += [0.5 * np.log(NEGLIGIBLE * ratios.min()), *np.log([s / 10.0 for s in scales[0]])]
            upper += [0.5 * np.log(1e3 * ratios.max()), *np.log([s * 100.0 for s in scales[-1]])]
            shapes.append(None if scales[0] else _shape(kind, (), data))
        return cls(data, kinds, Ramp.name in terms, np.array(lower), np.array(upper), tuple(shapes))

    def starts(self) -> list[FloatArray]:
        """Return promising logs of parameters: the best of a grid of time constants, amplitudes by multiplicative steps."""
        groups = [(kind, len(list(same))) for kind, same in groupby(self.kinds)]
        grids = [combinations_with_replacement(_scales(kind, self.data), number) for kind, number in groups]
        found = []
        for choice in product(*grids):
            scales = [scale for group in choice for scale in group]
            shapes = np.stack(
                [_shape(kind, scale, self.data) for kind, scale in zip(self.kinds, scales, strict=True)]
            )
            variances = self._shares(shapes)
            start = np.concatenate(
                [(0.5 * np.log(v), *np.log(s)) for v, s in zip(variances, scales, strict=True)]
            )
            start = np.clip(start, self.lower, self.upper)
            found.append((self(start)[0], start))
        found.sort(key=lambda pair: pair[0])
        return [start for _, start in found[:_REFINED]]

    def _shares(self, shapes: FloatArray) -> FloatArray:
        """Return variances that make Σ v·shapes resemble the power, by 30 multiplicative steps from equal shares."""
        count = self.data.count
        power = self.residual(np.full_like(count, np.median(self.data.power)))[0] ** 2
        variances = np.mean(power / shapes, axis=1) / len(shapes)
        for _ in range(30):
            expected = variances @ shapes
            variances = variances * np.sqrt(
                shapes @ (count * power / expected**2) / (shapes @ (count / expected))
            )
        return np.maximum(variances, 1e-300)

    def residual(self, expected: FloatArray) -> tuple[FloatArray, float, float]:
        """Return amplitudes without the ramp, its rate by generalised least squares, and the standard error of that."""
        if not self.ramp:
            return self.data.amplitude, 0.0, np.inf
        weight = self.data.line / expected
        information = weight @ self.data.line
        slope = float(weight @ self.data.amplitude / information)
        return self.data.amplitude - slope * self.data.line, slope, float(information**-0.5)

    def expected(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the expected power, shape (m,), and its derivatives by θ, shape (p, m)."""
        rows, total, at = [], np.zeros_like(self.data.frequency), 0
        for kind, shape in zip(self.kinds, self.shapes, strict=True):
            gain = np.exp(2.0 * theta[at])
            if shape is not None:
                power, gradient = gain * shape, 2.0 * gain * shape[None]
            else:
                scale = np.exp(theta[at + 1 : at + len(kind.PARAMETERS)])
                power, gradient = expected_power(kind(1.0, *scale), self.data)
                power, gradient = gain * power, gain * gradient
            total += power
            rows.append(gradient)
            at += len(gradient)
        return total, np.concatenate(rows)

    def __call__(self, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return -2 ln L, its gradient (p,) and its expected second derivatives (p, p)."""
        expected, gradient = self.expected(theta)
        ratio = self.residual(expected)[0] ** 2 / expected
        relative = gradient / expected
        weighted = relative * self.data.count
        value = float(self.data.count @ (np.log(expected) + ratio))
        return value, weighted @ (1.0 - ratio), weighted @ relative.T

    def minimise(self, start: FloatArray, *, fixed: int | None = None) -> tuple[FloatArray, float]:
        """Return the logs of the parameters at the minimum next to `start`, and the value there.

        Damped Fisher scoring inside the bounds; the parameter number `fixed` keeps its value.
        """
        free = np.arange(len(start)) != fixed
        theta, damping = start.copy(), 1e-3
        value, gradient, information = self(theta)
        for _ in range(100):
            at_edge = ((theta <= self.lower) & (gradient > 0)) | ((theta >= self.upper) & (gradient < 0))
            move = np.flatnonzero(free & ~at_edge)
            if not len(move):
                break
            matrix = information[np.ix_(move, move)]
            scale = np.diag(matrix) + 1e-3
            step = np.linalg.solve(matrix + damping * np.diag(scale), -gradient[move])
            trial = theta.copy()
            trial[move] = np.clip(theta[move] + np.clip(step, -2.0, 2.0), self.lower[move], self.upper[move])
            attempt = self(trial)
            if attempt[0] <= value:
                gain, theta = value - attempt[0], trial
                value, gradient, information = attempt
                damping = max(0.1 * damping, 1e-9)
                if gain < 1e-6:
                    break
            else:
                damping = 10.0 * damping
                if damping > 1e6:
                    break
        return theta, value

    def result(self, theta: FloatArray) -> LikelihoodFit:
        """Return the fit at these logs of the parameters."""
        expected, _ = self.expected(theta)
        value, _, information = self(theta)
        terms, names, at = [], [], 0
        for number, kind in enumerate(self.kinds):
            repeat = self.kinds[:number].count(kind)
            label = kind.name if not repeat else f"{kind.name}_{repeat + 1}"
            size = len(kind.PARAMETERS)
            terms.append(kind(*np.exp(theta[at : at + size]).tolist()))
            names += [f"{label}.{parameter}" for parameter in kind.PARAMETERS]
            at += size
        covariance = 2.0 * np.linalg.inv(information + 1e-9 * np.eye(len(theta)))
        _, slope, slope_sd = self.residual(expected)
        if self.ramp:
            terms.append(Ramp(max(abs(slope), 1e-300)))
            names.append("ramp.rate")
            theta = np.append(theta, np.log(terms[-1].rate))
            covariance = np.pad(covariance, (0, 1))
            covariance[-1, -1] = (slope_sd / terms[-1].rate) ** 2
        kinds = tuple(term.name for term in terms)
        return LikelihoodFit(
            kinds, tuple(names), theta, covariance, -0.5 * value, slope, slope_sd, NoiseModel(tuple(terms))
        )


def _scales(kind: type, data: CosinePeriodogram) -> list[tuple[float, ...]]:
    """Return starting values of the parameter after the amplitude, s or Hz; one empty tuple where there is none."""
    if len(kind.PARAMETERS) == 1:
        return [()]
    times = np.geomspace(3.0 * data.interval, 0.5 * data.longest, _GRID_POINTS)
    return [(float(t),) for t in (times if kind is GaussMarkov else 0.5 / times[::-1])]


def _shape(kind: type, scale: tuple[float, ...], data: CosinePeriodogram) -> FloatArray:
    """Return the expected power of the unit amplitude."""
    return expected_power(kind(1.0, *scale), data)[0]
