"""A block fitted to the measured Allan variance alone: robust where the likelihood of a noise model does not fit.

The Allan variance of a block is linear in N², K² and in σ² of states with given time constants, so it is a
non-negative least-squares problem on ln V, solved by Gauss–Newton with the weights of its degrees of freedom::

    w_i = 1 / (2/ν_i + δ²),   rows A/μ against 1 + ln(V/μ) + 1/ν

1/ν removes the bias of the logarithm of χ². δ is the misfit that a real sensor is granted; without it points of 10⁵
degrees of freedom rule the fit. Components that the curve does not need are dropped; the random walk is then raised
to half of what the record cannot exclude, since a block that only just fits its own record is too confident later.

References
----------
.. [1] IEEE Std 952-1997, Annex C (Allan variance of each term).
.. [2] C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974 (non-negative least squares).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from models.arrays import LEAST_DIVISOR, FloatArray
from models.noise import GaussMarkov, Quantization, RandomWalk, Term, White
from models.probability import REACH_95
from tuner.identification.nonnegative import nonnegative
from tuner.identification.predictive.criteria import follows_curve
from tuner.types.prediction import INNER_LIMIT, MeasuredAllan, NoiseBlock, SpectralExcess

MODEL_ERROR = 2.0 * np.log(INNER_LIMIT) / REACH_95
"""Granted sd of the misfit of ln V: puts 95 % of the deviations within the inner limit of the comparison."""
TIME_CONSTANTS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
"""Time constants of the states that may take part, s: two a decade follow any slope between −1/2 and +1/2."""
MIN_IMPROVEMENT = 6.63
"""Reduction of the weighted misfit that keeps a component: χ² with one degree of freedom at 1 %."""
WALK_LIMIT = 2.71
"""Rise of the misfit at the upper limit of the random walk: one-sided 95 %."""
WALK_SHARE = 0.5
"""Share of that limit that is written at least."""
MAX_ROUNDS = 30
"""Gauss–Newton steps; the best is kept, as a step with new weights need not improve."""
STEP_LENGTH = 0.7
"""Length of a step, found to damp the exchange between weights and solution."""
NEGLIGIBLE_SHARE = 1e-3
"""Largest share of the variance at any cluster time below which a component is zero."""


@dataclass(frozen=True)
class _Component:
    """A column of the fit: what it is, its kind of noise for the degrees of freedom, and its curve."""

    unit: Term | SpectralExcess
    noise_kind: str
    curve: FloatArray


@dataclass(frozen=True)
class _Solution:
    """Shares of components (variances), the weights they were found with, and the misfit."""

    components: tuple[_Component, ...]
    shares: FloatArray
    weights: FloatArray

    def predicted(self) -> FloatArray:
        return np.asarray(sum(c.curve * s for c, s in zip(self.components, self.shares, strict=True)))


def fit_curve(
    measured: MeasuredAllan, excess: Sequence[SpectralExcess] = (), *, slower_than: float = 0.0
) -> NoiseBlock:
    """Fit a block with as few components as the curve needs.

    Parameters
    ----------
    measured : MeasuredAllan
        Curve of one axis.
    excess : sequence of SpectralExcess
        Lines, resonances or bands whose power is fitted beside the block.
    slower_than : float
        Gauss–Markov states have longer time constants than this, s.
    """
    solution = _eliminated(measured, _components(measured, excess, slower_than))
    return _block(solution)


def with_bounded_parts(
    block: NoiseBlock,
    measured: MeasuredAllan,
    excess: Sequence[SpectralExcess] = (),
    *,
    largest_increment_sd: float,
) -> NoiseBlock:
    """Return a given block, with quantization noise and excess power fitted to what it leaves of the curve.

    Parameters
    ----------
    block : NoiseBlock
        Stays as it is, its own quantization noise included.
    measured : MeasuredAllan
        Curve of one axis.
    excess : sequence of SpectralExcess
        Lines and resonances read from the spectrum.
    largest_increment_sd : float
        Quantization noise that a free fit of the same curve finds, unit·s: more must not stand in for white noise
        that the block lacks.
    """
    columns = [Quantization(1.0).allan_variance(measured.tau, interval=measured.interval)]
    columns += [part.allan_variance(measured.tau) for part in excess]
    own = block.allan_variance(measured.tau, measured.interval)
    matrix = np.stack(columns, axis=1) / measured.variance[:, None]
    largest = np.full(len(columns), np.inf)
    largest[0] = max(
        largest_increment_sd**2 - block.increment_sd**2, 1e-12 * largest_increment_sd**2, LEAST_DIVISOR
    )
    scale = np.linalg.norm(matrix, axis=0)
    solved = lsq_linear(matrix / scale, 1.0 - own / measured.variance, bounds=(0.0, largest * scale))
    shares = np.maximum(solved.x, 0.0) / scale
    shares[np.max(matrix * shares, axis=0) < NEGLIGIBLE_SHARE] = 0.0
    return replace(
        block,
        increment_sd=float(np.hypot(block.increment_sd, np.sqrt(shares[0]))),
        excess=(
            *block.excess,
            *(p.scaled(float(s)) for p, s in zip(excess, shares[1:], strict=True) if s > 0.0),
        ),
    )


def raise_random_walk(block: NoiseBlock, measured: MeasuredAllan) -> NoiseBlock:
    """Return the block with at least half the random walk that its record cannot exclude.

    As much of it is taken as keeps the prediction within the limits of the comparison with the curve.
    """
    tau, variance = measured.tau, measured.variance
    unit = RandomWalk(1.0).allan_variance(tau, interval=measured.interval)
    own = block.random_walk_density**2
    rest = block.allan_variance(tau, measured.interval) - own * unit
    weight = 1.0 / (2.0 / measured.dof["random_walk"] + MODEL_ERROR**2)

    def misfit(share: float) -> float:
        return float(np.sum(weight * np.log((rest + share * unit) / variance) ** 2))

    low = high = max(own, 1e-4 * variance[-1] / unit[-1])
    limit = misfit(own) + WALK_LIMIT
    while misfit(high) < limit and high < 1e12 * low:
        high *= 2.0
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if misfit(middle) < limit else (low, middle)
    wanted = WALK_SHARE**2 * low
    if follows_curve(measured, rest + own * unit).passes:
        while wanted > own and not follows_curve(measured, rest + wanted * unit).passes:
            wanted = 0.8 * wanted if wanted > 1e-6 * low else 0.0
    return replace(block, random_walk_density=float(np.sqrt(max(own, wanted))))


def _components(
    measured: MeasuredAllan, excess: Sequence[SpectralExcess], slower_than: float
) -> tuple[_Component, ...]:
    tau, interval = measured.tau, measured.interval
    shortest, longest = 0.5 * tau[0], tau[-1]
    times = [time for time in TIME_CONSTANTS if shortest <= time <= longest and time > slower_than]
    states = [GaussMarkov(1.0, time) for time in times]
    kinds: list[tuple[Term, str]] = [
        (Quantization(1.0), "quantization"),
        (White(1.0), "white"),
        (RandomWalk(1.0), "random_walk"),
    ]
    terms = [*kinds, *((state, "bias_instability") for state in states)]
    return (
        *(_Component(term, kind, term.allan_variance(tau, interval=interval)) for term, kind in terms),
        *(_Component(part, "quantization", part.allan_variance(tau)) for part in excess),
    )


def _solve(measured: MeasuredAllan, components: tuple[_Component, ...]) -> _Solution:
    """Return the best of some Gauss–Newton steps."""
    variance = measured.variance
    matrix = np.stack([component.curve for component in components], axis=1)
    inverse_dof = np.stack([1.0 / measured.dof[component.noise_kind] for component in components], axis=1)
    predicted, goal = variance.copy(), np.ones(len(variance))
    weights = 1.0 / (2.0 / measured.dof["bias_instability"] + MODEL_ERROR**2)
    shares: FloatArray | None = None
    best = (np.inf, np.zeros(len(components)), weights)
    for _ in range(MAX_ROUNDS):
        new = nonnegative(matrix * (np.sqrt(weights) / predicted)[:, None], np.sqrt(weights) * goal)
        step = (
            np.inf if shares is None else float(np.max(np.abs(new - shares) / (new + shares + LEAST_DIVISOR)))
        )
        shares = new if shares is None else shares + STEP_LENGTH * (new - shares)
        predicted = np.maximum(matrix @ shares, 1e-6 * variance)
        mean_inverse = (matrix * inverse_dof) @ shares / predicted
        weights = 1.0 / (2.0 * mean_inverse + MODEL_ERROR**2)
        goal = 1.0 + np.log(variance / predicted) + mean_inverse
        cost = float(np.sum(weights * (goal - 1.0) ** 2) - np.sum(np.log(weights)))
        if cost < best[0] - 1e-6:
            best = (cost, shares.copy(), weights.copy())
        if step < 1e-4:
            break
    _, shares, weights = best
    total = np.maximum(matrix @ shares, LEAST_DIVISOR)
    negligible = np.max(matrix * shares / total[:, None], axis=0) < NEGLIGIBLE_SHARE
    return _Solution(components, np.where(negligible, 0.0, shares), weights)


def _eliminated(measured: MeasuredAllan, components: tuple[_Component, ...]) -> _Solution:
    """Drop the component that is missed least while its loss costs less than `MIN_IMPROVEMENT`."""
    variance = measured.variance

    def misfit(solution: _Solution, weights: FloatArray) -> float:
        return float(np.sum(weights * np.log(solution.predicted() / variance) ** 2))

    first = _solve(measured, components)
    kept = tuple(c for c, share in zip(components, first.shares, strict=True) if share > 0.0)
    current = _solve(measured, kept)
    while len(kept) > 1:
        least, without = np.inf, current
        for j, component in enumerate(kept):
            if isinstance(component.unit, White):
                continue
            trial = _solve(measured, kept[:j] + kept[j + 1 :])
            loss = misfit(trial, current.weights) - misfit(current, current.weights)
            if loss < least:
                least, without = loss, trial
        if least > MIN_IMPROVEMENT:
            break
        kept, current = without.components, without
    return current


def _block(solution: _Solution) -> NoiseBlock:
    block = NoiseBlock(0.0)
    for component, share in zip(solution.components, solution.shares, strict=True):
        if share <= 0.0:
            continue
        root, unit = float(np.sqrt(share)), component.unit
        match unit:
            case White():
                block = replace(block, white_density=root)
            case RandomWalk():
                block = replace(block, random_walk_density=root)
            case Quantization():
                block = replace(block, increment_sd=root)
            case GaussMarkov():
                block = replace(block, states=(*block.states, unit.scaled(root)))
            case SpectralExcess():
                block = replace(block, excess=(*block.excess, unit.scaled(float(share))))
    return block
