"""Which error of a configuration explains the scores of its filter, with the size of that error.

Hypotheses (`tuner.consistency.attribution.hypotheses`) that remove half of the misfit of the scores compete by their
likelihood: that of the covariance of all whitened errors and innovations behind the scores
(`tuner.consistency.attribution.likelihood`), every element of which a hypothesis predicts as it predicts the scores.
Two are distinguished where the difference of their log-likelihoods has a mean beyond twice its standard error, over
the runs [1]_ and with a common level of all expectations; else both are named, last those whose size ends where the
search does. The interval of θ is where −2 ln p is within 4 of its least, times the ratio by which its slope scatters
more, of the same two origins, than a likelihood's would.

The likelihood punishes a variance that is expected too small far more than one expected too large, so that it compares
only hypotheses that fit. Where none does, because several settings are far off, that of least misfit in the logarithms
of the scores is named.

Noise of the sensors and noise of the fixes may both be wrong (`tuner.consistency.attribution.pairs`): where the best
hypothesis leaves more misfit than chance, pairs are tried, and named where the runs distinguish them from it.

One error may have two descriptions: a ladder of states whose time constants are a rung too long lacks its fastest state
and has one too slow to differ from a constant. Where the runs do not distinguish the two, they are one explanation.

References
----------
.. [1] Q. H. Vuong, Likelihood ratio tests for model selection and non-nested hypotheses, Econometrica 57 (1989).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.attribution.hypotheses import Fit, Hypothesis, hypotheses
from tuner.consistency.attribution.likelihood import (
    WhitenedProducts,
    deviance,
    expected_products,
    measured_products,
)
from tuner.consistency.attribution.pairs import fitted_in_turn, pairs
from tuner.consistency.attribution.sensitivity import ScoreSensitivity, score_contributions
from tuner.consistency.scores import BLOCKS
from tuner.linear_run.best_size import INTERVAL_DEVIANCE, best_size
from tuner.simulation.monte_carlo import Runs
from tuner.types.consistency import Consistency, ErrorBudget, Score
from tuner.types.verdict import Explanation

Loss = Callable[[FloatArray], FloatArray]
"""Of expectations, shape (t, k): what they lose, by run; (t, m)."""

MODEL_ERROR = 0.05
"""Relative error of an expected score: a ladder approximates flicker to some per cent, linear covariance the filter."""
DISTINCT_ERRORS = 2.0
"""Standard errors of the mean difference of −2 ln of two likelihoods from which hypotheses are distinguished: 95 %."""
MAX_MISFIT_PER_SCORE = 3.0
"""Misfit per score up to which a hypothesis fits; by chance it is about 1, and scores depend on each other."""
GRID_SIZES = 41
"""Sizes at which a likelihood is computed before its minimum is sought: with a step of a quarter in ln θ."""


def attribute(found: Consistency, simulated: Runs, sensitivity: ScoreSensitivity) -> tuple[Explanation, ...]:
    """Return what would explain the scores of simulated runs, the likeliest first; empty where nothing would.

    Returned are explanations that remove half of the misfit and are not distinguished from the likeliest.

    Parameters
    ----------
    found : Consistency
        Scores.
    simulated : Runs
        The runs that were scored.
    sensitivity : ScoreSensitivity
        Of the same filter along the same scenario.
    """
    # The error budget is of navigation and total biases: a further state by itself has no source that may be wrong.
    found = replace(found, blocks=tuple(one for one in found.blocks if one.name in BLOCKS))

    def columns(budget: ErrorBudget) -> FloatArray:
        return np.concatenate([score_contributions(found, budget), expected_products(budget)]).T

    own = sensitivity.configured
    rivals = hypotheses(
        dict(zip(own.sources, columns(own), strict=True)),
        {
            noise: column
            for budget, noises in sensitivity.unmodelled
            for noise, column in zip(noises, columns(budget), strict=True)
        },
        sensitivity.time_constants,
    )
    return likeliest(found.scores, measured_products(simulated, own), rivals)


def likeliest(
    scores: Sequence[Score], measured: Sequence[WhitenedProducts], rivals: Sequence[Hypothesis]
) -> tuple[Explanation, ...]:
    """Return the hypotheses that explain scores and the products behind them, the likeliest first.

    Parameters
    ----------
    scores : sequence of Score
        Scores, n of them.
    measured : sequence of WhitenedProducts
        Of the runs that were scored.
    rivals : sequence of Hypothesis
        Each expects the n scores, then all products.
    """
    count = len(scores)
    logs = np.log([score.mean / score.dof for score in scores])
    errors = np.sqrt(2.0 / np.array([score.effective for score in scores]) + MODEL_ERROR**2)

    def misfits(expected: FloatArray) -> FloatArray:
        off = (logs - np.log(np.maximum(expected[:, :count], 1e-6))) / errors
        return np.asarray(np.sum(off**2, axis=1, keepdims=True))

    def by_run(expected: FloatArray, of: Sequence[WhitenedProducts] = measured) -> FloatArray:
        return deviance(of, expected[:, count:], model_error=MODEL_ERROR)

    def likely_size(rival: Hypothesis) -> Fit:
        return _fitted(rival, by_run, partial(by_run, of=together), misfits)

    together = [replace(one, products=one.products.mean(axis=0, keepdims=True)) for one in measured]
    half = 0.5 * float(misfits(np.ones((1, count)))[0, 0])
    most = min(half, MAX_MISFIT_PER_SCORE * count)
    fits = [fit for fit in map(likely_size, rivals) if fit.misfit <= most]
    if not fits:
        fits = [_fitted(rival, misfits, misfits, misfits) for rival in rivals]
        fits = [fit for fit in fits if fit.misfit <= half]
        scale = count / max(min((fit.misfit for fit in fits), default=0.0), count)
        fits = [replace(fit, loss=scale * fit.loss, level_loss=scale * fit.level_loss) for fit in fits]
    fits.sort(key=lambda fit: float(fit.loss.mean()))
    if not fits or fits[0].misfit > count:
        both = [pair for pair in _both(rivals, likely_size) if pair[0].misfit <= most]
        single = by_run(fits[0].hypothesis.expected(fits[0].size)[None, :])[0] if fits else None
        if both and (single is None or _distinct(replace(fits[0], loss=single), both[0][0])):
            return _explained_by_both(both)
    likely = [fit for fit in fits if not _distinct(fit, fits[0])]
    return _explanations(sorted(likely, key=lambda fit: fit.beyond))


def _both(rivals: Sequence[Hypothesis], fit: Callable[[Hypothesis], Fit]) -> list[tuple[Fit, Fit]]:
    """Return noise of sensors and of fixes that are wrong together, the likeliest first; each is surely wrong."""
    found = [fitted_in_turn(one, other, fit) for one, other in pairs(rivals)]
    sure = [pair for pair in found if all(not one.interval[0] < 0.0 < one.interval[1] for one in pair)]
    return sorted(sure, key=lambda pair: float(pair[1].loss.mean()))


def _explained_by_both(both: Sequence[tuple[Fit, Fit]]) -> tuple[Explanation, ...]:
    """Return the pairs that are not distinguished from the likeliest, that with the clearer change first in each."""
    likely = [pair for pair in both if not _distinct(pair[1], both[0][1])]
    ordered = [sorted(pair, key=lambda one: -abs(one.size)) for pair in likely]
    return tuple(replace(_explanation(one), beside=_explanation(other)) for one, other in ordered)


def _fitted(rival: Hypothesis, loss: Loss, whole: Loss, misfits: Loss) -> Fit:
    """Return a hypothesis at the size of least loss: by run, (t, m), and of all runs together, (t, 1)."""

    def at(x: float | FloatArray) -> FloatArray:
        return np.array([rival.expected(float(value)) for value in np.atleast_1d(x)])

    best = best_size(lambda x: float(whole(at(x))[0, 0]), np.linspace(*rival.bounds, GRID_SIZES).tolist())
    # The slope scatters more than its curvature says: epochs depend on each other, and all levels may be off at once.
    near_by = at(best.size + 0.05 * np.array([-1.0, 0.0, 1.0]))
    below, here, above = loss(near_by)
    slope, curvature = (above - below) / 0.1, float((above + below - 2.0 * here).mean()) / 0.05**2
    raised = whole((1.0 + MODEL_ERROR) * near_by)[:, 0]
    level_loss = raised - np.array([below.mean(), here.mean(), above.mean()])
    level_slope = (level_loss[2] - level_loss[0]) / 0.1
    excess = 1.0
    if curvature > 0.0:
        excess = (_standard_error(slope) ** 2 + float(level_slope) ** 2) / (2.0 * curvature)
    misfit = float(misfits(at(best.size))[0, 0])
    interval = best.interval(INTERVAL_DEVIANCE * max(excess, 1.0))
    return Fit(rival, best.size, interval, misfit, here, float(level_loss[1]), best.beyond)


def _standard_error(by_run: FloatArray) -> float:
    """Return the standard error of a mean over runs; 0 for a single run, where it is unknown."""
    return float(by_run.std(ddof=1)) / math.sqrt(len(by_run)) if len(by_run) > 1 else 0.0


def _distinct(one: Fit, best: Fit) -> bool:
    """Tell whether runs are less likely by a hypothesis than by the best, whatever the common level."""
    difference = one.loss - best.loss
    error = math.hypot(_standard_error(difference), one.level_loss - best.level_loss)
    return float(difference.mean()) > max(INTERVAL_DEVIANCE, DISTINCT_ERRORS * error)


def _explanations(fits: Sequence[Fit]) -> tuple[Explanation, ...]:
    """Return explanations; two descriptions of one error become one, where the likelier one stood."""
    by_source = {fit.hypothesis.source: fit for fit in fits}
    twins = {
        fit.hypothesis.equivalent: fit
        for fit in fits
        if fit.hypothesis.equivalent in by_source and fit.size < 0.0
    }
    answer: dict[str, Explanation] = {}
    for fit in fits:
        one = twins.get(fit.hypothesis.source, fit)
        other = one.hypothesis.equivalent
        twin = _explanation(by_source[other]) if twins.get(other) is one else None
        answer.setdefault(one.hypothesis.source, replace(_explanation(one), equivalent=twin))
    return tuple(answer.values())


def _explanation(fit: Fit) -> Explanation:
    of = fit.hypothesis
    interval = (math.exp(fit.interval[0]), math.exp(fit.interval[1]))
    return Explanation(of.kind, of.process, math.exp(fit.size), interval, fit.misfit, of.time_constant)
