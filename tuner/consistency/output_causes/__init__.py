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
from functools import partial

import numpy as np

from models.arrays import FloatArray
from tuner.consistency.output_causes.course import course_of
from tuner.consistency.output_causes.error_model import (
    MODEL_ERROR,
    REGRESSORS,
    ErrorModel,
    error_model,
)
from tuner.consistency.output_causes.filter_model import FilterModel, fit_filter
from tuner.consistency.output_causes.hypotheses import LOG_MAX_SCALE, ScaleHypothesis, scale_hypotheses
from tuner.consistency.output_causes.true_noise import TrueNoise
from tuner.consistency.output_errors import OutputErrors
from tuner.consistency.scores import EQUIVALENCE_MARGIN
from tuner.linear_run.likelihood import unaided_shift
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
SMALL_STEP = 0.15
"""Change of a size, as a logarithm, over which a deviance is about a parabola; and distance to a bound of the search
that counts as beyond it."""
SENSOR_NOISE_SD = 0.1
"""Sd of the logarithm of a white density from a log: units, temperatures and mounts differ by as much."""
REFINED_COUNT = 6
"""Hypotheses of one size whose best size is sought: those that promise most; only the likeliest are named."""
INTERVAL_SDS = 1.96
"""Half width of an interval of 95 %, sds."""


@dataclass(frozen=True)
class Explanations:
    """What explains the errors of a filter.

    Attributes
    ----------
    causes : tuple of OutputCause
        One after another as they were found.
    misfit : float or None
        Rms difference of the logarithms of its sds and those of the nearest filter, where that is too large.
    """

    causes: tuple[OutputCause, ...] = ()
    misfit: float | None = None


@dataclass(frozen=True)
class _Fit:
    """A hypothesis at its best."""

    cause: OutputCause
    base: TrueNoise
    constants: FloatArray
    names: tuple[str, ...]


def explain(runs: Sequence[OutputErrors], *, sensor_noise: tuple[float, float] | None = None) -> Explanations:
    """Return what explains the errors of runs of one filter; nothing where its sds are not those of such a filter.

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
        return Explanations()
    model = fit_filter(*pairs[0])
    if not model.fits:
        return Explanations(misfit=model.misfit)
    models = [error_model(run, course, model) for run, course in pairs]
    known = sum(int(one.seen.used.any(axis=1).sum()) for one in models)
    if known < 20:
        return Explanations()
    base = TrueNoise()
    fixed: tuple[str, ...] = ()
    causes: list[OutputCause] = []
    while len(causes) < MAX_CAUSES:
        fits = _candidates(models, base, fixed, known, scale_hypotheses(models[0], base))
        fits = _with_sensor_noise(fits, base, model, None if models[0].course.of_body else sensor_noise)
        fits = [fit for fit in fits if fit.cause.cause not in {c.cause for c in causes}]
        least = max(MIN_GAIN, FURTHER_SHARE * causes[0].gain if causes else 0.0)
        if not fits or fits[0].cause.gain < least:
            break
        best = fits[0]
        rivals = [f.cause for f in fits[1:] if f.cause.gain > best.cause.gain - SHORTLIST_NATS]
        causes.append(replace(best.cause, alternatives=tuple(rivals)))
        base, fixed = best.base, (*fixed, *best.names)
    return Explanations(tuple(causes))


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
    models: Sequence[ErrorModel],
    base: TrueNoise,
    fixed: tuple[str, ...],
    known: int,
    scales: Sequence[ScaleHypothesis],
) -> list[_Fit]:
    """Return the best fit of every cause, the likeliest first, with the names of constants already in the model."""
    deviance, products = _regression(models, base)
    deviance -= _reduction(products, fixed)[0]
    price = 0.5 * math.log(known)
    found = [
        fit
        for name in REGRESSORS
        if name not in fixed and (fit := _constant(products, name, fixed, base, price)) is not None
    ]
    losses = [(scale, partial(_loss, models, scale, base, fixed)) for scale in scales]
    promising = sorted(losses, key=lambda one: _promise(one[0], one[1], deviance), reverse=True)
    for scale, loss in counted(promising[:REFINED_COUNT]):
        if fit := _fitted(scale, loss, base, deviance, price, models[0].error_of(scale.cause)):
            found.append(fit)
    best: dict[str, _Fit] = {}
    for fit in sorted(found, key=lambda f: -f.cause.gain):
        if fit.cause.cause not in best and (
            _shifts(models[0], fit) if fit.names else _matters(models[0], base, fit.base)
        ):
            best[fit.cause.cause] = fit
    return list(best.values())


def _regression(models: Sequence[ErrorModel], true: TrueNoise) -> tuple[float, FloatArray]:
    """Return the deviance of all runs, and the products of whitened data and regressors."""
    each = [whiten(one.under(true)) for one in models]
    both = [np.column_stack([one.residual, one.slope]) for one in each]
    products = np.sum([one.T @ one for one in both], axis=0)
    return sum(one.logs for one in each) + float(products[0, 0]), np.asarray(products)


def _reduction(products: FloatArray, names: Sequence[str]) -> tuple[float, FloatArray, FloatArray]:
    """Return how far regression on constants lowers the deviance, their values and covariance."""
    if not names:
        return 0.0, np.zeros(0), np.zeros((0, 0))
    at = np.concatenate([np.arange(REGRESSORS[n].start, REGRESSORS[n].stop) for n in names]) + 1
    a, b = products[np.ix_(at, at)], products[at, 0]
    covariance = np.linalg.pinv(a, hermitian=True)
    x = covariance @ b
    return float(b @ x), x, covariance


_CONSTANTS = {
    "delay of fixes": ("time_offset", "s", ("delay",), "fixes"),
    "delay of output": ("time_offset", "s", ("delay",), "stamps of the output"),
    "lever arm of fixes": ("lever_arm", "m", ("x", "y", "z"), "fixes"),
    "lever arm of output": ("lever_arm", "m", ("x", "y", "z"), "output"),
    "offset of positions": ("gnss_frame", "m", ("north", "east", "down"), "offset"),
    "rotation of positions": ("gnss_frame", "rad", ("roll", "pitch", "yaw"), "rotation"),
    "rotation of body": ("mounting", "rad", ("roll", "pitch", "yaw"), ""),
}
"""Cause, unit, names of parameters and subject of the constants."""


def _constant(
    products: FloatArray, name: str, fixed: tuple[str, ...], base: TrueNoise, price: float
) -> _Fit | None:
    before = _reduction(products, fixed)[0]
    after, x, covariance = _reduction(products, (*fixed, name))
    code, unit, parameters, subject = _CONSTANTS[name]
    own = slice(len(x) - len(parameters), None)
    value = x[own]
    # The fixes' own errors scatter the estimate; what the model leaves out is relative to its size.
    sd = np.sqrt(np.diag(covariance)[own] + (MODEL_ERROR * np.linalg.norm(value)) ** 2)
    length = float(np.linalg.norm(value))
    if not length > 0.0:
        return None
    spread = math.sqrt(float(value @ covariance[own, own] @ value) / length**2 + (MODEL_ERROR * length) ** 2)
    size = float(value[0]) if len(value) == 1 else length
    gain = 0.5 * (after - before) - price * (REGRESSORS[name].stop - REGRESSORS[name].start)
    cause = OutputCause(
        code,
        size,
        (size - INTERVAL_SDS * spread, size + INTERVAL_SDS * spread),
        unit,
        gain,
        {
            key: (float(v), float(v - INTERVAL_SDS * s), float(v + INTERVAL_SDS * s))
            for key, v, s in zip(parameters, value, sd, strict=True)
        },
        subject,
    )
    return _Fit(cause, base, x, (name,))


def _loss(
    models: Sequence[ErrorModel], scale: ScaleHypothesis, base: TrueNoise, fixed: tuple[str, ...], x: float
) -> float:
    """Return the deviance of a hypothesis of size `x`."""
    true = scale.true(base, x)
    if not fixed:
        return sum(one.deviance(true) for one in models)
    deviance, products = _regression(models, true)
    return deviance - _reduction(products, fixed)[0]


def _promise(scale: ScaleHypothesis, loss: Callable[[float], float], deviance: float) -> float:
    """Return about what a hypothesis lowers the deviance by: on a coarse grid, and by a parabola about no change."""
    low, high = scale.bounds
    if scale.unit != "1":
        return deviance - min(loss(float(x)) for x in np.linspace(low, high, 6))
    best = deviance - min(loss(x) for x in (-2.2, -0.8, 0.8, 2.2))
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
    from scipy.optimize import minimize_scalar  # loaded when used: slow to import

    low, high = scale.bounds
    best = minimize_scalar(loss, bounds=(low, high), method="bounded", options={"xatol": 5e-3})
    x, least = float(best.x), float(best.fun)
    gain = 0.5 * (deviance - least) - price * (2 if scale.time_constant is not None else 1)
    if gain <= 0.0 or min(x - low, high - x) < SMALL_STEP:
        return None
    curvature = (loss(x + 0.05) + loss(x - 0.05) - 2.0 * least) / 0.05**2
    sd = math.sqrt(2.0 / curvature) if curvature > 0.0 else LOG_MAX_SCALE
    wide = INTERVAL_SDS * math.hypot(sd, size_error)
    size, interval = math.exp(x), (math.exp(x - wide), math.exp(x + wide))
    parameters = {"ratio": (size, *interval)}
    if scale.time_constant is not None:
        parameters = {"sd": (size, *interval), "time_constant": (scale.time_constant,) * 3}
    cause = OutputCause(scale.cause, size, interval, scale.unit, gain, parameters, scale.subject)
    return _Fit(cause, scale.true(base, x), np.zeros(0), ())


def _matters(model: ErrorModel, base: TrueNoise, true: TrueNoise) -> bool:
    """Tell whether other noise changes the rms errors of a block by more than the margin of the scores."""
    before = model.variances(base).reshape(5, 3)
    blocks = before.min(axis=1) > 0.0  # filters in axes of the body have no biases
    ratio = np.sqrt((model.variances(true).reshape(5, 3)[blocks] / before[blocks]).mean(axis=1))
    return bool(np.abs(np.log(ratio)).max() > math.log(1.0 + EQUIVALENCE_MARGIN))


def _shifts(model: ErrorModel, fit: _Fit) -> bool:
    """Tell whether errors without the mean that a constant gives them are smaller.

    Where the noise is far larger than assumed, changes of the errors are given too much weight, and a constant may
    fit them at the cost of the errors themselves.
    """
    if model.by_innovations:
        return True
    own, run = REGRESSORS[fit.names[0]], model.errors
    constants = fit.constants[len(fit.constants) - (own.stop - own.start) :]
    shift = unaided_shift(run, range(own.start, own.stop), constants)
    left = (run.innovation - shift)[run.used] / run.sd[run.used]
    return float(np.sum(left**2)) < float(np.sum((run.innovation / run.sd)[run.used] ** 2))
