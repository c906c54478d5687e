"""Telegraph ("popcorn") noise: a bias that switches between two levels.

Its spectrum is that of a Gauss–Markov process; only its path differs. Statistic: log likelihood of the block
means under two levels, one Gauss–Markov process (or flicker) and a random walk, less that of the best Gaussian model
(flicker or one Gauss–Markov process, with one more and a random walk), by one and the same filter, the white noise
of each block with its known variance; χ²₅, and
a price of 1.5 ln M nats because the problem is not regular. A path with fewer than four switches is a
matter of steps. The level with the longer mean time is called low: which of two levels is the true bias is
not observable.
Where three levels with equal switching rates, which have as many parameters, are likelier, the path is no telegraph
noise: it is reported as unexplained. Each level must be visited twice: one that is not is a matter of steps, too.
Extension: the path is taken out; in the noise model it is the Gauss–Markov process of the same variance.

References
----------
.. [1] S. Machlup, Noise in semiconductors: spectrum of a two-parameter random signal, J. Appl. Phys. 25 (1954).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import minimize

from models.arrays import FloatArray
from models.effects.static.events import Telegraph as Effect
from models.noise import BiasInstability, GaussMarkov, RandomWalk, Term
from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension, Value
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.null_distributions import COST_OUTSIDE, curvature
from tuner.diagnosis.static.model.slow_likelihood import Fit
from tuner.diagnosis.static.outcome import ALTERNATIVE_NATS, NO_GAIN, TestResult
from tuner.diagnosis.static.switching.climb import climb
from tuner.diagnosis.static.switching.models import (
    NO_VALUES,
    STILL,
    Chain,
    Slow,
    block_noise,
    expanded,
    ladder,
    likelihood,
    likelihood_by_start,
)
from tuner.diagnosis.static.variance.local_variance import course
from tuner.diagnosis.static.variance.normal_blocks import law_in_blocks

MIN_MARKOV_GAIN = 5.0
"""Nats that a further Gauss–Markov process must gain on flicker before two levels beside flicker are fitted.

Two levels have the spectrum of such a process: without that gain the fit is not worth its time.
"""
MIN_SWITCHES = 4
"""Least number of switches of telegraph noise: with fewer, steps explain the path with fewer parameters."""
LEVEL_OFFSETS = 5
"""Places of the lower level, within a size, that are tried on held-out data.

Between them it is free by a normal law.
"""
MIN_VISITS = 2
"""Least number of visits to each of three levels: one that is visited once is a matter of steps."""
THIRD_LEVEL_TOLERANCE = 0.1
"""Nats, and logs, to which three levels are fitted: a thirtieth of that lead."""


@dataclass(frozen=True)
class Telegraph(Extension):
    """Telegraph noise as a path on the blocks, shape (M,), in scales.

    Attributes
    ----------
    path : tuple of float
        Mean level so far.
    sd, time_constant : float
        Of the Gauss–Markov process of the same autocovariance, scales and s.
    size : float
        Upper level less the lower one, scales; 0 where there are more.
    dwells : tuple of float
        Mean times at the lower and the upper level, s.
    besides : tuple of Term
        Slow noise beside the path.
    third_level_lead : float
        Log likelihood of three levels less that of two, nats.
    """

    cause = "telegraph"
    effect = Effect
    group = "slow part"
    supersedes = ("gauss_markov",)
    meaning = "the bias switches between two levels (popcorn noise)"
    consequence = "a Gauss–Markov bias state of the same variance; a switching filter would do better"
    path: tuple[float, ...]
    sd: float
    time_constant: float
    size: float = 0.0
    dwells: tuple[float, float] = (1.0, 1.0)
    besides: tuple[Term, ...] = ()
    third_level_lead: float = -np.inf

    def lead(self, y: FloatArray, step: float, r: FloatArray | float) -> float:
        """Return how much likelier two levels make block means, shape (M,), than the Gauss–Markov process does, nats.

        `step` is the length of a block, s, and `r` the variance of the white part of its mean. Where the lower level
        lies is not known: within a size about the middle, as one of `LEVEL_OFFSETS` places or by a normal law.
        """
        if self.size == 0.0:
            return 0.0
        up, down = (float(-np.expm1(-step / dwell)) for dwell in self.dwells)
        width, chain = self.size / LEVEL_OFFSETS, Chain.two(self.size, up, down)
        middle = y - y.mean() + 0.5 * self.size
        places = width * (np.arange(LEVEL_OFFSETS) - 0.5 * (LEVEL_OFFSETS - 1))
        near = Slow.of(self.besides, step, width**2 / 4.0)
        two = [likelihood(middle - place, chain, near, r) for place in places]
        gaussian = (*self.besides, GaussMarkov(self.sd, self.time_constant))
        alone = likelihood(y - y.mean(), STILL, Slow.of(gaussian, step, self.size**2 / 4.0), r)
        return float(np.logaddexp.reduce(two)) - float(np.log(LEVEL_OFFSETS)) - alone

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the path out."""
        path = np.repeat(np.array(self.path), channel.block)
        return replace(channel, y=channel.y - path)

    def terms(self, interval: float) -> tuple[Term, ...]:  # noqa: ARG002
        """Return the Gauss–Markov process of the same autocovariance."""
        return (GaussMarkov(self.sd, self.time_constant),)

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Compare two levels with Gaussian noise on the block means."""
        channel = fitted.channel
        step = channel.block * channel.interval
        y = fitted.cleaned.block_mean(fitted.cleaned.y) - fitted.path - law_in_blocks(fitted)
        y = y - y.mean()
        relative_variance = channel.block_mean(course(fitted))
        name = "log likelihood of two levels less that of Gaussian noise"
        known = fitted.count("gauss_markov") > 0
        more = fitted.with_markov if fitted.may_have_markov and not known else ()

        def still(fit: Fit) -> float:
            terms = fit.terms()
            slow = Slow.of(expanded(terms, step, channel.span), step)
            return likelihood(y, STILL, slow, block_noise(terms, step) * relative_variance)

        null = max(still(fit) for fit in (*fitted.fits, *more))
        r = block_noise(fitted.fit.terms(), step) * relative_variance
        besides: type[Term] = GaussMarkov
        best = _search(y, step, channel.span, r, fitted, null)
        flicker = BiasInstability in fitted.fit.kinds
        if flicker and any(fit.log_likelihood > fitted.fit.log_likelihood + MIN_MARKOV_GAIN for fit in more):
            again = _search(y, step, channel.span, r, fitted, null, BiasInstability)
            best, besides = (again, BiasInstability) if again[0] > best[0] else (best, besides)
        price = 1.5 * float(np.log(channel.blocks))
        if best[0] - null > price:
            more = () if more or known else fitted.with_markov
            null = max([null, *(still(fit) for fit in more)])
        if best[0] - null > price:
            null = max(null, _refit_gaussian(y, step, channel.span, r, best[1]))
        lead = best[0] - null
        p_value = chi2_beyond(2.0 * max(lead, 0.0), 5)
        gain = lead - price
        if gain <= 0.0:
            return TestResult("telegraph", p_value, gain, lead, name)
        found = best[1]
        unsure = TestResult("telegraph", p_value, gain, lead, name)

        @cache
        def confirm() -> TestResult:
            return _judged(unsure, y, step, channel.span, r, found, besides, null)

        return replace(unsure, propose=lambda: _proposed(confirm()), confirm=confirm)


@dataclass(frozen=True)
class ManyLevels(Telegraph):
    """A path between more than two levels."""

    named = False
    meaning = "the bias switches between more than two levels"


def _proposed(result: TestResult) -> tuple[Extension, ...]:
    """Return what a result proposes, nothing where it does not."""
    return () if result.propose is None else result.propose()


def _judged(
    unsure: TestResult,
    y: FloatArray,
    step: float,
    span: float,
    r: FloatArray | float,
    x: FloatArray,
    besides: type[Term],
    null: float,
) -> TestResult:
    """Return the result for two levels next to these free numbers, whose path is compared with steps and more levels.

    Its lead is that of the maximum: the search that made `unsure` ends some tenths of a nat below it, by which rivals
    may differ.
    """
    extension, switches, x, two = _extension(y, step, span, r, x, besides)
    price, lead = unsure.statistic - unsure.gain, max(two - null, unsure.statistic)
    unsure = replace(unsure, p_value=chi2_beyond(2.0 * lead, 5), gain=lead - price, statistic=lead)
    many, three = _three_levels(y, step, span, r, x, besides, two + ALTERNATIVE_NATS)
    if many is not None:
        lead = three - null
        known = replace(unsure, gain=lead - price, statistic=lead, name=ManyLevels.meaning)
        return replace(known, propose=lambda: (many,))
    size = extension.values["size"]
    if (
        switches < MIN_SWITCHES or not size.lower * size.upper > 0.0
    ):  # levels that are not distinct have no name
        return replace(unsure, gain=NO_GAIN)
    extension = replace(extension, third_level_lead=three - two)
    return replace(unsure, propose=lambda: (extension,))


def _parts(x: FloatArray, step: float, span: float, besides: type[Term]) -> tuple[Chain, Slow]:
    """Return the chain and slow states of the free numbers (ln sd, ln T, ln K, size, ln dwells).

    The noise besides is a Gauss–Markov process, or flicker of level sd: a ladder of one rung a decade, T unused.
    """
    p01, p10 = (-np.expm1(-step / np.exp(x[4:]))).tolist()
    return Chain.two(float(x[3]), p01, p10), Slow.of(_besides(x, step, span, besides), step)


def _besides(x: FloatArray, step: float, span: float, besides: type[Term]) -> tuple[Term, ...]:
    amplitude, constant, density = np.exp(x[:3]).tolist()
    markov = (GaussMarkov(amplitude, constant),)
    rungs = markov if besides is GaussMarkov else ladder(amplitude, 0.5 * step, 2.0 * span, 1)
    return (*rungs, RandomWalk(density))


def _bounds(step: float, span: float) -> tuple[FloatArray, FloatArray]:
    """Return the least and largest free numbers; the size has none."""
    low = [*np.log([1e-5, 2.0 * step, 1e-8]), -np.inf, *np.log([1.5 * step, 1.5 * step])]
    high = [*np.log([1e3, 3.0 * span, 1e2]), np.inf, *np.log([0.5 * span, 0.5 * span])]
    return np.array(low), np.array(high)


def _cost(
    y: FloatArray, step: float, span: float, r: FloatArray | float, x: FloatArray, besides: type[Term]
) -> float:
    low, high = _bounds(step, span)
    if np.any(x < low) or np.any(x > high):
        return COST_OUTSIDE
    return -likelihood(y, *_parts(x, step, span, besides), r)


def _refit_gaussian(y: FloatArray, step: float, span: float, r: FloatArray | float, x: FloatArray) -> float:
    """Return the log likelihood of two Gauss–Markov processes and a random walk, fitted by the same filter.

    The fits of the cosine domain are those of instants, the filter sees means of blocks: close to the block
    length that is worth some nats, which two levels must not earn.
    """
    low, high = np.exp(x[4:])
    share = high / (low + high)
    second = [np.log(abs(x[3]) * np.sqrt(share * (1.0 - share)) + 1e-6), -np.log(1.0 / low + 1.0 / high)]

    def cost(free: FloatArray) -> float:
        if np.any(np.abs(free) > 30.0) or max(free[1], free[4]) > np.log(10.0 * span):
            return COST_OUTSIDE
        sds, constants = np.exp(free[[0, 3]]).tolist(), np.exp(free[[1, 4]]).tolist()
        markov = [GaussMarkov(sd, constant) for sd, constant in zip(sds, constants, strict=True)]
        return -likelihood(y, STILL, Slow.of([*markov, RandomWalk(float(np.exp(free[2])))], step), r)

    start = np.concatenate((x[:3], second))
    simplex = np.vstack([start, start + 0.7 * np.eye(5)])
    options = {"maxiter": 700, "fatol": 0.02, "xatol": 0.01, "initial_simplex": simplex}
    return -float(minimize(cost, start, method="Nelder-Mead", options=options).fun)


def _search(
    y: FloatArray,
    step: float,
    span: float,
    r: FloatArray | float,
    fitted: FittedChannel,
    null: float,
    besides: type[Term] = GaussMarkov,
) -> tuple[float, FloatArray]:
    """Return the greatest log likelihood of two levels, with this noise besides, and where it is."""
    fit = next(f for f in fitted.fits if GaussMarkov in f.kinds)
    terms = fit.terms()
    markov = next(t for t in terms if isinstance(t, GaussMarkov))
    walk = next(t for t in terms if isinstance(t, RandomWalk))
    spread = float(np.std(np.diff(y))) / np.sqrt(2.0)
    noise = max(float(np.sqrt(np.mean(r))), 1e-6)
    sizes = np.array([1.5, 3.0]) * max(markov.sd, 0.5 * spread, noise)
    best: tuple[float, FloatArray] = (-np.inf, NO_VALUES)
    starts = []
    for size in sizes:
        for dwell in (4.0 * step, 20.0 * step, 100.0 * step):
            for share in (0.15, 0.6):
                x = np.array([
                    np.log(max(share * markov.sd, 1e-4)), np.log(np.clip(markov.time_constant, 4 * step, span)),
                    np.log(max(walk.density, 1e-7)), size, np.log(dwell), np.log(dwell),
                ])  # fmt: skip
                starts.append((_cost(y, step, span, r, x, besides), x))
    starts.sort(key=lambda pair: pair[0])
    for _, x in starts[:2]:
        simplex = np.vstack([x, x + np.diag([0.7, 0.7, 0.7, 0.3 * x[3], 0.7, 0.7])])
        options = {"maxiter": 200, "fatol": 0.1, "xatol": 0.1, "initial_simplex": simplex}
        result = minimize(
            lambda x: _cost(y, step, span, r, x, besides), x, method="Nelder-Mead", options=options
        )
        if -result.fun > best[0]:
            best = (-float(result.fun), result.x)
        if best[0] < null - 10.0:
            break
    return best


def _extension(
    y: FloatArray, step: float, span: float, r: FloatArray | float, x: FloatArray, besides: type[Term]
) -> tuple[Telegraph, int, FloatArray, float]:
    """Return the extension at the maximum, the switches of its path, the free numbers, their log likelihood.

    A mean dwell is known no better than by the root of the number of dwells.
    """
    low, high = _bounds(step, span)

    def parts(free: FloatArray) -> tuple[Chain, Slow] | None:
        outside = np.any(free < low) or np.any(free > high)
        return None if outside else _parts(free, step, span, besides)

    x, model, cost = climb(y, r, parts, x)
    spread = np.sqrt(np.diag(curvature(lambda free: cost(np.clip(free, low, high)), x)))
    path, size = np.empty(len(y)), float(x[3])
    value = likelihood_by_start(y, *model, r, path)
    dwells = np.exp(x[4:]).tolist()
    share = dwells[1] / sum(dwells)
    switches = (
        int(np.count_nonzero(np.diff(np.abs(path) > 0.5 * abs(size)))) if max(dwells) < span / 6.0 else 0
    )
    spread[4:] = np.maximum(spread[4:], 1.0 / np.sqrt(max(0.5 * switches, 1.0)))
    values = {
        "size": Value.of(size, float(spread[3]), "{u}"),
        "dwell_low": Value.log(dwells[0], float(spread[4]), "s"),
        "dwell_high": Value.log(dwells[1], float(spread[5]), "s"),
    }
    sd = abs(size) * float(np.sqrt(share * (1.0 - share)))
    found = Telegraph(
        tuple(path.tolist()), sd, 1.0 / (1.0 / dwells[0] + 1.0 / dwells[1]), size,
        (dwells[0], dwells[1]), _besides(x, step, span, besides), values=values,
    )  # fmt: skip
    return found, switches, x, value


def _three_levels(
    y: FloatArray,
    step: float,
    span: float,
    r: FloatArray | float,
    two: FloatArray,
    besides: type[Term],
    least: float,
) -> tuple[ManyLevels | None, float]:
    """Return the path between three levels, None where they are not likelier than `least`, and their log likelihood.

    The third level lies between the two, or beyond one of them; from each a switch to either other is as likely.
    Hills are climbed from each of these places next to the free numbers of two, until one is high enough.
    """

    def parts(x: FloatArray) -> tuple[Chain, Slow] | None:
        if not np.log(1.5 * step) <= x[5] <= np.log(0.5 * span) or np.any(np.abs(x[:3]) > 30.0):
            return None
        chain = Chain.even([0.0, float(x[3]), float(x[4])], -float(np.expm1(-step / np.exp(x[5]))))
        return chain, Slow.of(_besides(x, step, span, besides), step)

    dwell, size = 0.5 * (two[4] + two[5]), two[3]
    places = ((0.5 * size, size), (size, 2.0 * size), (-size, size))
    starts = [np.array([*two[:3], *pair, dwell]) for pair in places]
    models = [parts(x) for x in starts]
    values = [-np.inf if model is None else likelihood_by_start(y, *model, r) for model in models]
    simplex, best = np.diag([0.5, 0.5, 0.5, 0.3 * size, 0.3 * size, 0.5]), -np.inf
    for at in np.argsort(values)[::-1]:
        x, model, _ = climb(y, r, parts, starts[at], simplex, THIRD_LEVEL_TOLERANCE)
        path, dwell = np.empty(len(y)), float(np.exp(x[5]))
        value = likelihood_by_start(y, *model, r, path)
        levels = np.array([0.0, x[3], x[4]])
        nearest = np.argmin(np.abs(path[:, None] - levels), axis=1)
        entered = nearest[np.flatnonzero(np.diff(nearest, prepend=-1))]
        visits = int(np.bincount(entered, minlength=len(levels)).min())
        if value > least and visits >= MIN_VISITS:
            return ManyLevels(tuple(path.tolist()), float(np.std(levels)), dwell / 1.5), value
        best = max(best, value if visits >= MIN_VISITS else -np.inf)
    return None, best
