"""Which fault explains the errors of any filter, from its output alone.

What the filter assumes is read off its sds (`filter_model`); then every fault has a likelihood (`error_model`): wrong
R, wrong Q, wrong time constants, a process that the filter lacks, and constants of the installation, a delay, a lever
arm, another frame. Gains are log likelihoods above that of the filter as it is, less ½ ln(epochs) for each parameter.
The best is named, with those within a few nats as alternatives; with it in the model the search goes on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from scipy.special import chdtrc

from models.arrays import FloatArray
from models.probability import REACH_95
from tuner.consistency.constants import OF_FILTER
from tuner.consistency.output_causes.course import course_of
from tuner.consistency.output_causes.error_model import (
    MODEL_ERROR,
    ErrorModel,
    error_model,
)
from tuner.consistency.output_causes.filter_model import FilterModel, fit_filter
from tuner.consistency.output_causes.hypotheses import SMALL_STEP, ScaleHypothesis, scale_hypotheses
from tuner.consistency.output_causes.true_noise import TrueNoise
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.scores import EQUIVALENCE_MARGIN
from tuner.limits import TOLERATED_RATIO
from tuner.linear_run.best_size import best_size
from tuner.linear_run.whitened_innovations import whiten
from tuner.stages import counted
from tuner.types.output_score import OutputCause

MIN_GAIN = 15.0
"""Nats from which a fault is named. By chance three constants gain 8 nats in one of a thousand runs; what the linear
model of a filter leaves out gained up to 6 for constants in simulated runs of consistent filters."""
SHORTLIST_NATS = 4.0
"""Nats below the best within which a fault is not distinguished from it: odds of 50."""
FURTHER_SHARE = 0.2
"""Share of the gain of the first fault that a further one must have: what the first leaves, the linear model being off
by some per cent, is not another fault."""
MAX_CAUSES = 3
"""Faults that are looked for one after another."""
MAX_RUNS = 2
"""Runs of a Monte Carlo whose likelihoods are added: one tells a fault that scores show, and its size to some per cent,
which is what the linear model of a filter is good for."""
MAX_P_VALUE = 1e-3
"""P-value of the difference between both halves of a run below which an error is not constant."""
SENSOR_NOISE_SD = 0.1
"""Sd of the logarithm of a white density from a log: units, temperatures and mounts differ by as much."""
REFINED_COUNT = 6
"""Hypotheses of one size whose best size is sought: those that promise most; only the likeliest are named."""


@dataclass(frozen=True)
class _Fit:
    """A hypothesis at its best."""

    cause: OutputCause
    base: TrueNoise
    numbers: tuple[int, ...]


def explain(
    runs: Sequence[OutputErrors], *, sensor_noise: tuple[float, float] | None = None
) -> tuple[tuple[OutputCause, ...], float | None]:
    """Return what explains the errors of runs of one filter, one after another as found, and None.

    Where its sds are not those of such a filter nothing does: returned is then the rms difference of the logarithms of
    its sds and those of the nearest one.

    Parameters
    ----------
    runs : sequence of OutputErrors
        The runs.
    sensor_noise : (float, float), optional
        White densities of gyros and accelerometers at rest, from a log of the unit. In motion they are no smaller: a
        hypothesis with less is less likely by as much.
    """
    pairs = [(run, course) for run in runs[:MAX_RUNS] if (course := course_of(run)) is not None]
    stated = [run for run, _ in pairs if np.isfinite(np.einsum("kii->ki", run.covariance)[:, :6]).any()]
    if not pairs or len(stated) < len(pairs):
        return (), None
    model = fit_filter(*pairs[0])
    if not model.fits:
        return (), model.misfit
    models = [error_model(run, course, model) for run, course in pairs]
    known = sum(int(one.seen.used.any(axis=1).sum()) for one in models)
    if known < 20:
        return (), None
    base = TrueNoise()
    fixed: tuple[int, ...] = ()
    causes: list[OutputCause] = []
    while len(causes) < MAX_CAUSES:
        fits = _candidates(pairs[0][0], models, base, fixed, known, scale_hypotheses(models[0], base))
        fits = _with_sensor_noise(
            fits, base, model, None if models[0].course.motion.of_body else sensor_noise
        )
        fits = [fit for fit in fits if fit.cause.cause not in {c.cause for c in causes}]
        least = max(MIN_GAIN, FURTHER_SHARE * causes[0].gain if causes else 0.0)
        if not fits or fits[0].cause.gain < least:
            break
        best = fits[0]
        rivals = [f.cause for f in fits[1:] if f.cause.gain > best.cause.gain - SHORTLIST_NATS]
        causes.append(replace(best.cause, alternatives=tuple(rivals)))
        base, fixed = best.base, (*fixed, *best.numbers)
    return tuple(causes), None


def _with_sensor_noise(
    fits: Sequence[_Fit], base: TrueNoise, model: FilterModel, sensor_noise: tuple[float, float] | None
) -> list[_Fit]:
    """Return the fits, the likeliest first, with what the noise of the sensors at rest says for or against them."""
    if sensor_noise is None:
        return list(fits)
    lacking = np.log(np.array(sensor_noise) / model.density[:2])
    sd = np.hypot(model.log_density_sd[:2], SENSOR_NOISE_SD)

    def evidence(true: TrueNoise) -> float:
        return float(-0.5 * np.sum((lacking - np.log(true.density[:2])).clip(0.0) ** 2 / sd**2))

    found = [
        replace(fit, cause=replace(fit.cause, gain=fit.cause.gain + evidence(fit.base) - evidence(base)))
        for fit in fits
    ]
    return sorted(found, key=lambda fit: -fit.cause.gain)


def _candidates(
    run: OutputErrors,
    models: Sequence[ErrorModel],
    base: TrueNoise,
    fixed: tuple[int, ...],
    known: int,
    scales: Sequence[ScaleHypothesis],
) -> list[_Fit]:
    """Return the best fit of every cause, the likeliest first, with the numbers of constants already in the model."""
    deviance, products = _regression(models, base)
    deviance -= _reduction(products.sum(axis=0), models[0].places, fixed)[0]
    price = 0.5 * math.log(known)
    found = [
        fit
        for number in range(len(OF_FILTER))
        if number not in fixed
        and (fit := _constant(models, products, number, fixed, base, price)) is not None
    ]
    losses = [(scale, cache(partial(_loss, models, scale, base, fixed))) for scale in scales]
    promising = sorted(losses, key=lambda one: _promise(one[1], one[0].grid, deviance), reverse=True)
    for scale, loss in counted(promising[:REFINED_COUNT]):
        if fit := _fitted(scale, loss, base, deviance, price, models[0].error_of(scale.cause)):
            found.append(fit)
    best: dict[str, _Fit] = {}
    for fit in sorted(found, key=lambda f: -f.cause.gain):
        if fit.cause.cause not in best and (fit.numbers or _matters(run, models[0], base, fit.base)):
            best[fit.cause.cause] = fit
    return list(best.values())


def _regression(models: Sequence[ErrorModel], true: TrueNoise) -> tuple[float, FloatArray]:
    """Return the deviance of all runs, and the products of whitened data and regressors in both halves of each."""
    each = [whiten(one.under(true)) for one in models]
    both = [np.column_stack([one.residual, one.slope]) for one in each]
    halves = [[half.T @ half for half in np.array_split(one, 2)] for one in both]
    products = np.sum(halves, axis=0)
    return sum(one.logs for one in each) + float(products[:, 0, 0].sum()), np.asarray(products)


def _reduction(
    products: FloatArray, places: Sequence[slice], numbers: Sequence[int]
) -> tuple[float, FloatArray, FloatArray]:
    """Return how far regression on constants lowers the deviance, their values and covariance."""
    if not numbers:
        return 0.0, np.zeros(0), np.zeros((0, 0))
    at = np.concatenate([np.arange(places[i].start, places[i].stop) for i in numbers]) + 1
    a, b = products[np.ix_(at, at)], products[at, 0]
    covariance = np.linalg.pinv(a, hermitian=True)
    x = covariance @ b
    return float(b @ x), x, covariance


def _constant(
    models: Sequence[ErrorModel],
    products: FloatArray,
    number: int,
    fixed: tuple[int, ...],
    base: TrueNoise,
    price: float,
) -> _Fit | None:
    places, constant = models[0].places, OF_FILTER[number]
    whole = products.sum(axis=0)
    before = _reduction(whole, places, fixed)[0]
    after, x, covariance = _reduction(whole, places, (*fixed, number))
    own = slice(len(x) - (places[number].stop - places[number].start), None)
    value = x[own]
    size = float(np.linalg.norm(value[: constant.size]))
    if not size > 0.0:
        return None
    # The fixes' own errors scatter the estimate; what the model leaves out is relative to its size.
    missed = (MODEL_ERROR * size) ** 2 * np.eye(len(value))
    covariance = covariance[own, own] + missed
    (_, one, of_one), (_, other, of_other) = (_reduction(half, places, (*fixed, number)) for half in products)
    apart, spread = (one - other)[own], (of_one + of_other)[own, own] + 2.0 * missed
    if chdtrc(len(value), apart @ np.linalg.pinv(spread, hermitian=True) @ apart) < MAX_P_VALUE:
        return None  # what changes is no constant
    gain = 0.5 * (after - before) - price * len(value)
    return _Fit(constant.found(value, covariance, REACH_95, gain), base, (number,))


def _loss(
    models: Sequence[ErrorModel], scale: ScaleHypothesis, base: TrueNoise, fixed: tuple[int, ...], x: float
) -> float:
    """Return the deviance of a hypothesis of size `x`."""
    true = scale.true(base, x)
    if not fixed:
        return sum(one.deviance(true) for one in models)
    deviance, products = _regression(models, true)
    return deviance - _reduction(products.sum(axis=0), models[0].places, fixed)[0]


def _promise(loss: Callable[[float], float], grid: Sequence[float], deviance: float) -> float:
    """Return about what a hypothesis lowers the deviance by: on its grid, and by a parabola about no change."""
    best = deviance - min(map(loss, grid[1:-1]))
    if SMALL_STEP not in grid:
        return best
    below, above = loss(-SMALL_STEP), loss(SMALL_STEP)
    slope, curvature = (above - below) / (2.0 * SMALL_STEP), (above + below - 2.0 * deviance) / SMALL_STEP**2
    return max(best, 0.5 * slope**2 / curvature if curvature > 0.0 else 0.0)


def _fitted(
    scale: ScaleHypothesis,
    loss: Callable[[float], float],
    base: TrueNoise,
    deviance: float,
    price: float,
    size_error: float,
) -> _Fit | None:
    """Return a hypothesis at its best size, with the interval of the likelihood.

    None where it gains nothing or its size lies beyond the bounds: then the pattern is another fault's.
    """
    best = best_size(loss, scale.grid)
    gain = 0.5 * (deviance - best.deviance) - price * (2 if scale.time_constant is not None else 1)
    if gain <= 0.0 or best.beyond:
        return None
    more = REACH_95 * size_error
    low, high = (math.hypot(best.size - end, more) for end in best.interval())
    size = math.exp(best.size)
    interval = (size * math.exp(-low), size * math.exp(high))
    parameters = {"ratio": (size, *interval)}
    if scale.time_constant is not None:
        parameters = {"sd": (size, *interval), "time_constant": (scale.time_constant,) * 3}
    cause = OutputCause(scale.cause, size, interval, scale.unit, gain, parameters, scale.subject)
    return _Fit(cause, scale.true(base, best.size), ())


def _matters(run: OutputErrors, model: ErrorModel, base: TrueNoise, true: TrueNoise) -> bool:
    """Tell whether other noise changes the rms errors of a block by more than the margin of the scores.

    Noise that would make errors of a block larger than measured, by more than `TOLERATED_RATIO`, is refuted.
    """
    stated, before, after = (model.variances(one).reshape(5, 3) for one in (TrueNoise(), base, true))
    blocks = before.min(axis=1) > 0.0  # filters in axes of the body have no biases
    second = slice(len(run) // 2, None)
    squares = run.error[second] ** 2 / np.einsum("kii->ki", run.covariance[second])
    seen = [block[np.isfinite(block)] for block in np.split(squares, 5, axis=1)]
    measured = np.array([np.sqrt(block.mean()) if len(block) else np.inf for block in seen])
    of_stated, ratio = (np.sqrt((after[blocks] / one[blocks]).mean(axis=1)) for one in (stated, before))
    possible = of_stated <= TOLERATED_RATIO * measured[blocks]
    return bool(possible[:3].all() and np.abs(np.log(ratio)).max() > math.log(1.0 + EQUIVALENCE_MARGIN))
