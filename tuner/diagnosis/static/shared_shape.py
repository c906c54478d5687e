"""One slow shape in all axes of a sensor: one temperature, one lag, one warm-up, rather than another name in each.

Errors of a thermometer and the noise of an axis decide between near twins by a few nats, differently in each axis. So
axes in which something smooth was found are judged together: each shape is fitted to all of them, what time constant
it has in common. It is taken by those that lose no more than `NEAR_TWIN_NATS` by it; what was measured comes first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.hysteresis import Hysteresis
from tuner.diagnosis.static.causes.temperature import COVARIATE, Temperature
from tuner.diagnosis.static.causes.temperature_rate import TemperatureRate
from tuner.diagnosis.static.causes.temperature_squared import TemperatureSquared
from tuner.diagnosis.static.causes.temperature_times_time import UNNAMED, Ageing
from tuner.diagnosis.static.causes.template import TimeConstantTemplate
from tuner.diagnosis.static.causes.thermal_lag import ThermalLag
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.residual import Residual, residual
from tuner.diagnosis.static.model.score_scan import scan
from tuner.diagnosis.static.near_twins import NEAR_TWIN_NATS
from tuner.diagnosis.static.outcome import Accepted, TestResult
from tuner.diagnosis.static.search import SearchResult, with_joint_estimates
from tuner.types import Alternative

SMOOTH = (Temperature, TemperatureRate, TemperatureSquared, ThermalLag, Hysteresis, Warmup, Ageing)
"""Smooth shapes that errors of a thermometer turn into each other."""
Shapes = tuple[Extension, ...]


def with_shared_shape(outcomes: Mapping[str, SearchResult]) -> dict[str, SearchResult]:
    """Return the outcomes of axes of one clock that a smooth shape they share explains as well as their own.

    Parameters
    ----------
    outcomes : mapping of str to SearchResult
        What was found in each axis; axes that already agree on something measured, or of which one alone shows a
        smooth shape, stay.

    Returns
    -------
    dict of str to SearchResult
        Those that change.
    """
    concerned = {axis: one for axis, one in outcomes.items() if smooth(one)}
    kinds = {tuple(sorted(x.cause for x in smooth(one))) for one in concerned.values()}
    agreed = len(kinds) == 1 and Warmup.cause not in next(iter(kinds))
    measured = all(COVARIATE in one.final.channel.covariates for one in concerned.values())
    if len(concerned) < 2 or agreed or not measured:
        return {}
    bare = {axis: _without_smooth(one) for axis, one in concerned.items()}
    own = {axis: _value(one.final, smooth(one)) for axis, one in concerned.items()}
    best: tuple[int, Shapes, dict[str, Residual]] = (1, (), {})
    for shapes in _tried(list(bare.values())):
        fits = {
            axis: residual(b.channel, (*b.extensions, *shapes), starts=b.starts, near=b)
            for axis, b in bare.items()
        }
        agree = {axis: fit for axis, fit in fits.items() if _value(fit, shapes) > own[axis] - NEAR_TWIN_NATS}
        if len(agree) > best[0]:
            best = (len(agree), shapes, agree)
    _, shapes, fits = best
    return {
        axis: _changed(outcomes[axis], bare[axis], fit, shapes, own[axis])
        for axis, fit in fits.items()
        if {x.cause for x in smooth(outcomes[axis])} != {x.cause for x in shapes}
    }


def smooth(outcome: SearchResult) -> Shapes:
    """Return the smooth shapes among what was found."""
    return tuple(a.extension for a in outcome.accepted if isinstance(a.extension, SMOOTH))


def _without_smooth(outcome: SearchResult) -> Residual:
    final = outcome.final
    kept = tuple(x for x in final.extensions if not isinstance(x, SMOOTH))
    return residual(final.channel, kept, starts=final.starts, near=final)


def _tried(bare: Sequence[Residual]) -> list[Shapes]:
    """Return the shapes to try, what was measured first; time constants as all axes together show them."""
    lag, warmup = (_together(cause.candidates(bare[0].channel), bare) for cause in (ThermalLag, Warmup))
    rate, square = (Temperature(), TemperatureRate()), (Temperature(), TemperatureSquared())
    return [(Temperature(),), rate, (lag,), square, (warmup,)]


def _together(tried: Sequence[TimeConstantTemplate], bare: Sequence[Residual]) -> TimeConstantTemplate:
    """Return the candidate that scores most in all axes together."""
    total = np.zeros(len(tried))
    for one in bare:
        total += scan(one, np.stack([x.template(one.channel) for x in tried], axis=1))[0].score ** 2
    return tried[int(np.argmax(total))]


def _numbers(shapes: Shapes, channel_blocks: int) -> float:
    """Return the price of the sizes and time constants of shapes, nats."""
    free = len(shapes) + sum(isinstance(x, TimeConstantTemplate) + getattr(x, "prompt", 0) for x in shapes)
    return 0.5 * free * float(np.log(channel_blocks))


def _value(fitted: Residual, shapes: Shapes) -> float:
    """Return the log likelihood of a fit less the price of its smooth shapes."""
    return fitted.fit.log_likelihood - _numbers(shapes, fitted.channel.blocks)


def _changed(
    outcome: SearchResult, bare: Residual, fit: Residual, shapes: Shapes, own: float
) -> SearchResult:
    """Return an outcome with the shared shapes in place of its own, which stay among the alternatives."""
    given = len(outcome.final.extensions) - len(outcome.accepted)
    kept = [a for a in outcome.accepted if not isinstance(a.extension, SMOOTH)]
    ratio = 2.0 * max(fit.fit.log_likelihood - bare.fit.log_likelihood, 0.0)
    p_value = chi2_beyond(SLOW_RATIO_FACTOR * ratio, len(shapes))
    gain = 0.5 * ratio - _numbers(shapes, fit.channel.blocks)
    weight = float(np.exp(min(own - _value(fit, shapes), 0.0)))
    causes = {x.cause for x in shapes}
    others = tuple(Alternative(x.cause, weight) for x in smooth(outcome) if x.named and x.cause not in causes)
    refits = fit
    if len(shapes) == 1:
        refits = residual(
            fit.channel,
            (*bare.extensions, shapes[0].refit(fit, len(bare.extensions))),
            starts=fit.starts,
            near=fit,
        )
    final = with_joint_estimates(refits)
    name = f"likelihood ratio of {' and '.join(x.cause for x in shapes)}, as other axes have it"
    new = [
        Accepted(x, TestResult(x.cause, p_value, gain, ratio, name), others)
        for x in final.extensions[len(bare.extensions) :]
    ]
    kept = [replace(a, extension=x) for a, x in zip(kept, final.extensions[given:], strict=False)]
    left = tuple(result for result in outcome.unexplained if result.cause != UNNAMED)
    return SearchResult(outcome.base, final, (*kept, *new), left)
