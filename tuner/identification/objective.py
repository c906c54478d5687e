"""Likelihood of a sum of noise terms on the cosine periodogram, and its maximum.

The coefficients a_k of `tuner.identification.periodogram` are nearly independent and Gaussian, so with the
expected power E(θ) = Σ_terms E_term(θ), edges and aliasing included::

    -2 ln L = Σ_cells c [ln E + (a - C β)²/E] + ln det CᵀE⁻¹C

with c coefficients in a cell and C those of templates, such as a unit ramp, whose sizes β are profiled out by
generalised least squares; the last term restores the degrees of freedom that β costs. Sums with different templates
are compared without it (`restricted`). θ are the logs of the parameters of the terms. The gradient is analytic, the
step is damped Fisher scoring, and the values of a grid of time constants are the starts.

References
----------
.. [1] P. Whittle, Estimation and information in stationary time series, Ark. Mat. 2 (1953).
.. [2] H. D. Patterson, R. Thompson, Recovery of inter-block information, Biometrika 58 (1971): the last term.
.. [3] C. Févotte, N. Bertin, J.-L. Durrieu, Nonnegative matrix factorization with the Itakura-Saito
   divergence, Neural Computation 21 (2009): the multiplicative step that finds the starts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations_with_replacement, groupby, product

import numba
import numpy as np
from scipy.optimize import nnls

from models.arrays import FloatArray
from models.noise import TERMS, Ramp, Sinusoid, Term
from tuner.identification.expected_periodogram import expected_power
from tuner.identification.fisher_scoring import minimise
from tuner.identification.periodogram import CosinePeriodogram
from tuner.types.arguments import described
from tuner.types.records import DataError

Trial = tuple[tuple[float, ...], FloatArray]

NEGLIGIBLE_SHARE = 1e-7
"""Share of the power everywhere at which the search for an amplitude ends: the term is zero there."""

_DIAGONAL_RIDGE = 1e-10
"""Part of the information on a template that keeps the sizes of like templates finite."""

_GRID_POINTS = 8
"""Trial values of a time constant: half a decade apart in a record of four decades."""
LEVEL_REACH = 1.3
"""Factor of frequency, up and down, over which a level is averaged; chosen so that the spectrum of a random walk, the
steepest, changes by less than threefold there."""
LEAST_SHARE = 0.01
"""Share of the level that a term starts with at least, where it is largest: a log cannot come back from zero."""
_FITTED_STARTS = 12
"""Points of the grid, the best at rough amplitudes, at which the amplitudes are fitted.

Of 45 grids of 36 points each, half of recordings, one led to a likelihood that was lower by more than 0.5 nats.
"""
_REFINED_STARTS = 3
"""Best points of the grid from which the likelihood is maximised: it may have several maxima."""


@dataclass(frozen=True)
class Objective:
    """Minus twice the log likelihood of one sum of terms, as a function of the logs of its parameters.

    Attributes
    ----------
    data : CosinePeriodogram
        What was measured.
    kinds : tuple of type
        Classes of the random terms, in the order of `models.noise.TERMS`.
    columns : ndarray, shape (K, q)
        Coefficients of the templates in the first K cells, which hold one coefficient each, or 0.
    lower, upper : ndarray, shape (p,)
        Bounds of the logs.
    grids : tuple of tuple of (tuple, ndarray)
        For each term, trial values of the parameters after the amplitude (an empty tuple where there are none)
        with the expected power of the unit amplitude.
    fixed : ndarray, shape (m,), optional
        Power that is there besides.
    restricted : bool
        Whether the degrees of freedom of the templates are restored.
    """

    data: CosinePeriodogram
    kinds: tuple[type[Term], ...]
    columns: FloatArray
    lower: FloatArray
    upper: FloatArray
    grids: tuple[tuple[Trial, ...], ...]
    fixed: FloatArray | float = 0.0
    restricted: bool = True

    @classmethod
    def of(cls, data: CosinePeriodogram, terms: Sequence[str]) -> Objective:
        """Prepare the terms of these names; ValueError if one is unknown or none is random."""
        random = random_terms()
        kinds = tuple(kind for name, kind in random.items() for given in terms if given == name)
        if not kinds or not set(terms) <= {*random, Ramp.name}:
            raise ValueError(
                f"'terms' must hold some of {', '.join(random)} (and ramp), got {', '.join(terms)}"
            )
        least, most = data.power[data.count > 1].min(initial=data.power.max()), data.power.max()
        power = np.maximum(data.power, max(1e-3 * least, 1e-15 * most))
        grids = tuple(_trials(kind, data) for kind in kinds)
        lower, upper = [], []
        for trials in grids:
            ratios = np.stack([power / shape for _, shape in trials])
            scales = list(zip(*(scale for scale, _ in trials), strict=True))
            lower += [0.5 * np.log(NEGLIGIBLE_SHARE * ratios.min()), *np.log([min(s) / 10.0 for s in scales])]
            upper += [0.5 * np.log(1e3 * ratios.max()), *np.log([max(s) * 100.0 for s in scales])]
        columns = data.line[:, None] if Ramp.name in terms else np.zeros((0, 0))
        return cls(data, kinds, columns, np.array(lower), np.array(upper), grids)

    def is_amplitude(self, j: int) -> bool:
        """Return whether parameter j is the amplitude of its term, which may be zero."""
        return j in np.cumsum([0, *(len(kind.PARAMETERS) for kind in self.kinds)])

    def expected(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the expected power, shape (m,), and its derivatives by θ, shape (p, m)."""
        rows, total, at = [], np.zeros_like(self.data.frequency) + self.fixed, 0
        for kind, trials in zip(self.kinds, self.grids, strict=True):
            if len(kind.PARAMETERS) == 1:
                power = np.exp(2.0 * theta[at]) * trials[0][1]
                gradient = 2.0 * power[None]
            else:
                values = np.exp(theta[at : at + len(kind.PARAMETERS)]).tolist()
                power, gradient = expected_power(kind(*values), self.data)
            total += power
            rows.append(gradient)
            at += len(gradient)
        return total, np.concatenate(rows)

    @cached_property
    def rows(self) -> FloatArray:
        """The templates as rows, shape (q, K)."""
        return np.ascontiguousarray(self.columns.T)

    def sizes(self, expected: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the sizes of the templates, shape (q,), and their covariance, (q, q)."""
        single = len(self.columns)
        weighted = self.rows / expected[:single]
        information = weighted @ self.columns
        diagonal = information.reshape(-1)[:: len(information) + 1]
        diagonal += _DIAGONAL_RIDGE * diagonal + np.finfo(float).tiny
        covariance = np.asarray(np.linalg.inv(information), dtype=float)
        return covariance @ (weighted @ self.data.amplitude[:single]), covariance

    def excess(self, expected: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the sum of squares of each cell over its expectation, and its degrees of freedom, (m,)."""
        rest, freedom, _ = self._rest(expected)
        return self.data.count * rest**2 / expected, freedom

    def _rest(self, expected: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return coefficients less templates and their degrees of freedom, (m,); ln det of the information on these.

        That is 0 where it does not count.
        """
        rest, freedom, determinant = self.data.amplitude, self.data.count, 0.0
        if self.columns.size:
            single = len(self.columns)
            size, covariance = self.sizes(expected)
            rest = rest.copy()
            rest[:single] -= size @ self.rows
            if self.restricted:
                leverage = np.einsum("pk,pk->k", covariance @ self.rows, self.rows) / expected[:single]
                freedom = freedom.copy()
                freedom[:single] = np.maximum(freedom[:single] - leverage, 0.0)
                determinant = -float(np.linalg.slogdet(covariance)[1])
        return rest, freedom, determinant

    def with_size(self, column: int, size: float) -> Objective:
        """Return the objective with the size of one template fixed instead of profiled out."""
        amplitude = self.data.amplitude.copy()
        amplitude[: len(self.columns)] -= size * self.columns[:, column]
        return replace(
            self,
            data=replace(self.data, amplitude=amplitude),
            columns=np.delete(self.columns, column, axis=1),
        )

    def __call__(self, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return -2 ln L, its gradient (p,) and its expected second derivatives (p, p)."""
        return self._evaluate(*self.expected(theta))

    def _evaluate(self, expected: FloatArray, gradient: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return what a call returns, for an expected power and its derivatives."""
        rest, freedom, determinant = self._rest(expected)
        squares, slope, information = _scores(self.data.count, rest, freedom, expected, gradient)
        return float(self.data.count @ np.log(expected) + squares) + determinant, slope, information

    def with_power(self, shape: FloatArray) -> Callable[[FloatArray], tuple[float, FloatArray, FloatArray]]:
        """Return what a call does, with a last parameter more: the log of the size of power of this shape, (m,)."""

        def of(theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
            (expected, gradient), power = self.expected(theta[:-1]), np.exp(theta[-1]) * shape
            return self._evaluate(expected + power, np.concatenate((gradient, power[None])))

        return of

    def covariances(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the covariance of θ of normal samples, (p, p), and what the law of the samples adds to it."""
        expected, gradient = self.expected(theta)
        information = self._evaluate(expected, gradient)[2] + 1e-9 * np.eye(len(theta))
        moved = np.linalg.solve(information, gradient / expected @ (self.data.count / expected))
        covariance = np.asarray(2.0 * np.linalg.inv(information), dtype=float)
        return covariance, self.data.law_variance * np.outer(moved, moved)

    def log_likelihood(self, theta: FloatArray) -> float:
        """Return ln L without the last term, to compare sums with different templates."""
        expected, _ = self.expected(theta)
        return -0.5 * float(self.data.count @ np.log(expected) + self.excess(expected)[0].sum())

    def maximum(self) -> FloatArray:
        """Return the logs of the parameters of greatest likelihood, the best of several starts."""
        return min((self.minimise(start) for start in self.starts()), key=lambda found: found[1])[0]

    def minimise(
        self, start: FloatArray, *, kept: int | None = None, tolerance: float = 1e-6
    ) -> tuple[FloatArray, float]:
        """Return the minimum of -2 ln L next to `start` and its value, parameter number `kept` as it is."""
        return minimise(self, start, lower=self.lower, upper=self.upper, fixed=kept, tolerance=tolerance)

    def starts(self) -> list[FloatArray]:
        """Return promising logs: the best of a grid of time constants, each with its best amplitudes.

        Where there is no grid, amplitudes start from equal shares of the power: of a spectrum that no sum fits, such as
        a filtered one, the likelihood has several maxima, and least squares lead to a low one.
        """
        same = [list(group) for _, group in groupby(zip(self.kinds, self.grids, strict=True), lambda p: p[0])]
        choices = [combinations_with_replacement(group[0][1], len(group)) for group in same]
        amplitudes = [j for j in range(len(self.lower)) if self.is_amplitude(j)]
        lower, upper = self.lower[amplitudes], self.upper[amplitudes]
        tried, found = [], []
        every = list(product(*choices))
        rough = self._shares if len(every) == 1 else self._nearest
        for choice in every:
            scales, each = zip(*(trial for group in choice for trial in group), strict=True)
            shapes = np.stack(each)
            function = partial(self._of_amplitudes, shapes)
            start = np.clip(0.5 * np.log(rough(shapes)), lower, upper)
            tried.append((function(start)[0], start, function, scales))
        tried.sort(key=lambda entry: entry[0])
        for _, start, function, scales in tried[:_FITTED_STARTS]:
            logs, value = minimise(function, start, lower=lower, upper=upper, tolerance=1e-4)
            entries = [(log, *np.log(scale)) for log, scale in zip(logs, scales, strict=True)]
            found.append((value, np.concatenate(entries)))
        found.sort(key=lambda pair: pair[0])
        return [start for _, start in found[:_REFINED_STARTS]]

    def _of_amplitudes(self, shapes: FloatArray, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return what a call returns, for logs of amplitudes of given shapes."""
        powers = np.exp(2.0 * theta)[:, None] * shapes
        return self._evaluate(powers.sum(axis=0) + self.fixed, 2.0 * powers)

    @cached_property
    def _levels(self) -> tuple[FloatArray, FloatArray]:
        """Mean square of each cell less templates, (m,), and that of all cells within `LEVEL_REACH` of it."""
        count, squares = self.data.count, self.excess(np.ones_like(self.data.count))[0]
        sums = [np.concatenate(([0.0], np.cumsum(x))) for x in (squares, count)]
        first = np.searchsorted(sums[1], sums[1][1:] / LEVEL_REACH)
        last = np.searchsorted(sums[1], sums[1][1:] * LEVEL_REACH, side="right") - 1
        total, number = (x[np.maximum(last, first + 1)] - x[first] for x in sums)
        power = squares / count
        return power, np.maximum(total / number, 1e-12 * power.max())

    def _nearest(self, shapes: FloatArray) -> FloatArray:
        """Return variances whose Σ v·shapes is nearest to the power, in units of its level, each of some effect."""
        power, level = self._levels
        weight = np.sqrt(self.data.count) / level
        variances = nnls((shapes * weight).T, (power - self.fixed) * weight)[0]
        return np.asarray(np.maximum(variances, LEAST_SHARE * np.min(level / shapes, axis=1)))

    def _shares(self, shapes: FloatArray) -> FloatArray:
        """Return variances that make Σ v·shapes resemble the power, from equal shares."""
        count = self.data.count
        squares = self.excess(np.ones_like(count))[0]
        variances: FloatArray = np.sum(squares / shapes, axis=1) / count.sum() / len(shapes)
        for _ in range(10):
            expected = variances @ shapes + self.fixed
            variances = variances * np.sqrt(shapes @ (squares / expected**2) / (shapes @ (count / expected)))
        return variances + np.finfo(float).tiny


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})  # type: ignore[misc, unused-ignore]
def _scores(
    count: FloatArray, rest: FloatArray, freedom: FloatArray, expected: FloatArray, gradient: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return the sum of squares over their expectations, the gradient of -2 ln L by θ and its second derivatives.

    Arrays have shape (m,), `gradient`, that of the expected power, (p, m). Sums are taken in any order.
    """
    p, m = gradient.shape
    relative, left = np.empty((p, m)), np.empty(m)
    squares = 0.0
    for k in range(m):
        square = count[k] * rest[k] * rest[k] / expected[k]
        squares += square
        left[k] = freedom[k] - square
    slope, information = np.empty(p), np.empty((p, p))
    for i in range(p):
        total = 0.0
        for k in range(m):
            relative[i, k] = gradient[i, k] / expected[k]
            total += relative[i, k] * left[k]
        slope[i] = total
        for j in range(i + 1):
            total = 0.0
            for k in range(m):
                total += relative[i, k] * relative[j, k] * freedom[k]
            information[i, j] = information[j, i] = total
    return squares, slope, information


def random_terms() -> dict[str, type[Term]]:
    """Return the terms that can be fitted to a spectrum, by name; ``ramp`` may join them."""
    return {name: kind for name, kind in TERMS.items() if kind.fitted and not kind.deterministic}


def expect_terms(terms: Sequence[str] | None) -> None:
    """Refuse a sum of terms that no record can be fitted by.

    Parameters
    ----------
    terms : sequence of str or None
        As a user names them; None leaves the choice to the data.

    Raises
    ------
    DataError
        Where a term is unknown, none is random, or one that has nothing but its amplitude comes twice.
    """
    if terms is None:
        return
    random = random_terms()
    names = (*random, Ramp.name)
    if unknown := [name for name in terms if name not in {*names, Sinusoid.name}]:
        raise DataError(f"terms: expected some of {' '.join(names)}, found {described(unknown[0])}")
    if not set(terms) & random.keys():
        raise DataError(
            f"terms: expected one or more of {' '.join(random)}, found {' '.join(terms) or 'none'}"
        )
    for name in dict.fromkeys(terms):
        if list(terms).count(name) > 1 and name in names and len(TERMS[name].PARAMETERS) == 1:
            raise DataError(
                f"terms: expected {name} once, found it {list(terms).count(name)} times: no record tells the two apart"
            )


def _trials(kind: type[Term], data: CosinePeriodogram) -> tuple[Trial, ...]:
    """Return the trial values of a term with the expected power of its unit amplitude."""
    times = np.geomspace(3.0 * data.interval, 0.5 * data.longest, _GRID_POINTS)
    try:
        shapes = kind.trial_shapes(times)
    except ValueError as error:
        raise DataError(str(error)) from None
    return tuple((scale, expected_power(_unit(kind, scale), data)[0]) for scale in shapes)


def _unit(kind: type[Term], scale: Iterable[float]) -> Term:
    """Return a term of unit amplitude with these values of its other parameters."""
    return kind(**dict(zip(kind.PARAMETERS, (1.0, *scale), strict=True)))
