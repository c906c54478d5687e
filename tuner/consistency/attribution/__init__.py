"""What explains the scores of a filter: rival explanations, each with the pattern of scores it would cause.

Explanations (`tuner.consistency.attribution.hypotheses`) that take half of the misfit of the scores away
compete by their likelihood: that
of the whole whitened matrices behind the scores (`tuner.consistency.attribution.likelihood`), of which every
explanation predicts all elements
as it predicts the scores. Two are told apart where the difference of their log-likelihoods has a mean beyond twice
its scatter, over the runs [1]_ and with a common level of all expectations; else both are named, last those whose
size ends where the search does. The interval of θ is where −2 ln p is within 4 of its least, times the ratio by which
its slope scatters more, of the same two causes, than a likelihood's would.

A likelihood asks for much where too small a variance is expected, so that it compares only explanations that fit.
Where none does, because several beliefs are far off, that of least misfit in the logarithms of the scores is named.

Two words for one fault: a ladder whose time constants are a rung too long lacks its fastest state and has one too
slow to be told from a constant. Where the runs do not tell the two apart, they are one cause.

References
----------
.. [1] Q. H. Vuong, Likelihood ratio tests for model selection and non-nested hypotheses, Econometrica 57 (1989).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tuner.consistency.attribution.hypotheses import Explanation, explanations
from tuner.consistency.attribution.likelihood import Scatter, deviance, scatters, spread
from tuner.consistency.attribution.sensitivity import Responses, patterns
from tuner.consistency.scores import Consistency, Score
from tuner.simulation.monte_carlo import Runs

FloatArray = NDArray[np.float64]

Loss = Callable[[FloatArray], FloatArray]
"""What expectations, shape (t, k), lose; (t, m)."""

LEVEL_SCATTER = 0.05
"""Scatter of a score that linear covariance cannot explain (ladder for flicker, curvature)."""
LIKELY = 4.0
"""−2 ln of the likelihood by which a size, or an explanation, may be worse than the best and still be likely."""
APART = 2.0
"""Mean difference of −2 ln of two likelihoods over its scatter, from which on explanations are told apart."""
FITTING = 3.0
"""Misfit a score from which an explanation does not fit."""
GRID = 41
"""Sizes at which a likelihood is looked at before its minimum is sought."""


@dataclass(frozen=True)
class Cause:
    """An explanation of the scores.

    Attributes
    ----------
    source : str
        What is wrong.
    ratio : float
        True ÷ believed sd, or time constant; of a missing process, its sd ÷ that of the nearest state.
    interval : (float, float)
        Values of it that are as likely (95 %); ends at the bounds of the search.
    misfit : float
        Sum of squares that it leaves over in the logarithms of the scores.
    text : str
        In words.
    """

    source: str
    ratio: float
    interval: tuple[float, float]
    misfit: float
    text: str


@dataclass(frozen=True)
class Fit:
    """An explanation at its best size: ln θ, its interval, the misfit of scores, and −2 ln p by run, (m,).

    `lift` is what −2 ln p gains, in the mean, where all that is expected is larger by `LEVEL_SCATTER`.
    """

    rival: Explanation
    size: float
    interval: tuple[float, float]
    misfit: float
    loss: FloatArray
    lift: float


def attribute(found: Consistency, flown: Runs, response: Responses) -> tuple[Cause, ...]:
    """Return the explanations of the scores of simulated runs, the likeliest first; none where none explains them.

    Returned are those that take half of the misfit away and are not told from the likeliest.

    Parameters
    ----------
    found : Consistency
        Scores.
    flown : Runs
        What was scored.
    response : Responses
        Of the same filter along the same scenario.
    """
    own, unknown = (
        np.concatenate([patterns(found, budget), spread(budget)]).T
        for budget in (response.known, response.strange)
    )
    rivals = explanations(
        dict(zip(response.known.sources, own, strict=True)),
        dict(zip(response.names, unknown, strict=True)),
        response.constants,
    )
    return best(found.scores, scatters(flown, response.known), rivals)


def best(
    scores: Sequence[Score], measured: Sequence[Scatter], rivals: Sequence[Explanation]
) -> tuple[Cause, ...]:
    """Return the rivals that explain scores and the scatter behind them, the likeliest first."""
    count = len(scores)
    logs = np.log([score.mean / score.dof for score in scores])
    scatter = np.sqrt(2.0 / np.array([score.effective for score in scores]) + LEVEL_SCATTER**2)

    def misfits(expected: FloatArray) -> FloatArray:
        off = (logs - np.log(np.maximum(expected[:, :count], 1e-6))) / scatter
        return np.asarray(np.sum(off**2, axis=1, keepdims=True))

    def likelihoods(of: Sequence[Scatter]) -> Loss:
        return lambda expected: deviance(of, expected[:, count:], model_scatter=LEVEL_SCATTER)

    whole = likelihoods([replace(one, products=one.products.mean(axis=0, keepdims=True)) for one in measured])
    half = 0.5 * float(misfits(np.ones((1, count)))[0, 0])
    fits = [_fitted(rival, likelihoods(measured), whole, misfits) for rival in rivals]
    fits = [fit for fit in fits if fit.misfit <= min(half, FITTING * count)]
    if not fits:
        fits = [_fitted(rival, misfits, misfits, misfits) for rival in rivals]
        fits = [fit for fit in fits if fit.misfit <= half]
        least = min((fit.misfit for fit in fits), default=0.0)
        scale = count / max(least, count)
        fits = [replace(fit, loss=scale * fit.loss, lift=scale * fit.lift) for fit in fits]
    fits.sort(key=lambda fit: float(fit.loss.mean()))
    likely = [fit for fit in fits if not _apart(fit, fits[0])]
    return _named(sorted(likely, key=_at_an_end))


def _fitted(rival: Explanation, loss: Loss, whole: Loss, misfits: Loss) -> Fit:
    """Return an explanation at the size of least loss: by run, (t, m), and of all runs together, (t, 1)."""
    from scipy.optimize import minimize_scalar  # loaded when used: slow to import

    def at(x: float | FloatArray) -> FloatArray:
        return np.array([rival.expected(float(value)) for value in np.atleast_1d(x)])

    grid = np.linspace(*rival.bounds, GRID)
    values, step = whole(at(grid))[:, 0], float(grid[1] - grid[0])
    start = float(grid[int(np.argmin(values))])
    near = (max(start - step, rival.bounds[0]), min(start + step, rival.bounds[1]))
    size = float(minimize_scalar(lambda x: whole(at(x))[0, 0], bounds=near, method="bounded").x)
    # The slope scatters more than its curvature says: epochs depend on each other, and all levels may be off at once.
    near_by = at(size + 0.05 * np.array([-1.0, 0.0, 1.0]))
    below, here, above = loss(near_by)
    slope, curvature = (above - below) / 0.1, float((above + below - 2.0 * here).mean()) / 0.05**2
    lifted = whole((1.0 + LEVEL_SCATTER) * near_by)[:, 0]
    lift = lifted - np.array([below.mean(), here.mean(), above.mean()])
    tilt = (lift[2] - lift[0]) / 0.1
    excess = (_error(slope) ** 2 + float(tilt) ** 2) / (2.0 * curvature) if curvature > 0.0 else 1.0
    limit = float(here.mean()) + LIKELY * max(excess, 1.0)
    low, high = (_edge(lambda x: whole(at(x))[0, 0] - limit, size, end) for end in rival.bounds)
    return Fit(rival, size, (low, high), float(misfits(at(size))[0, 0]), here, float(lift[1]))


def _edge(excess: Callable[[float], float], inside: float, end: float) -> float:
    """Return where a function rises through zero between a point where it is negative and an end, or the end."""
    from scipy.optimize import brentq  # loaded when used: slow to import

    return float(brentq(excess, inside, end, xtol=1e-3)) if excess(end) > 0.0 else end


def _error(by_run: FloatArray) -> float:
    """Return the standard error of a mean over runs; of one value it is unknown, and nothing."""
    return float(by_run.std(ddof=1)) / math.sqrt(len(by_run)) if len(by_run) > 1 else 0.0


def _apart(one: Fit, best: Fit) -> bool:
    """Tell whether runs are less likely by an explanation than by the best, whatever the common level."""
    difference = one.loss - best.loss
    scatter = math.hypot(_error(difference), one.lift - best.lift)
    return float(difference.mean()) > max(LIKELY, APART * scatter)


def _at_an_end(fit: Fit) -> bool:
    """Tell whether the size that explains best lies beyond what is looked at: the shape is wrong, and another's."""
    return min(abs(fit.size - end) for end in fit.rival.bounds) < 0.02


def _named(fits: Sequence[Fit]) -> tuple[Cause, ...]:
    """Return causes with their words; two that say the same become one, where the likelier one stood."""
    by_source = {fit.rival.source: fit for fit in fits}
    twins = {fit.rival.same: fit for fit in fits if fit.rival.same in by_source and fit.size < 0.0}
    causes: dict[str, Cause] = {}
    for fit in fits:
        one = twins.get(fit.rival.source, fit)
        words = [_told(one)]
        if twins.get(one.rival.same) is one:
            words.append(_told(by_source[one.rival.same]))
        size = (math.exp(one.interval[0]), math.exp(one.interval[1]))
        cause = Cause(
            one.rival.source, math.exp(one.size), size, one.misfit, ", or in other words: ".join(words)
        )
        causes.setdefault(cause.source, cause)
    return tuple(causes.values())


def _told(fit: Fit) -> str:
    return fit.rival.words(math.exp(fit.size), (math.exp(fit.interval[0]), math.exp(fit.interval[1])))
