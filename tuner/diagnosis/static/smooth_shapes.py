"""Smooth shapes of one axis against each other: sets of them are fitted in place of what a search accepted.

A search accepts one shape after another, and compares each with what it finds beside those that it has. What two
shapes explain together may be what two others do: slope and square of the temperature of a unit that warms, slope and
an exponential of time. Errors of a thermometer cost a bias that follows the true temperature some nats against any
other shape. So sets are compared as a whole, by log likelihood less the price of their free numbers: those within
`NEAR_TWIN_NATS` of each other are alternatives, and what was measured goes before a shape of time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from models.probability import chi2_beyond
from tuner.diagnosis.static.ambiguous_causes import NEAR_TWIN_NATS, warming_alike
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.hysteresis import Hysteresis
from tuner.diagnosis.static.causes.temperature import COVARIATE, Temperature
from tuner.diagnosis.static.causes.temperature_rate import TemperatureRate
from tuner.diagnosis.static.causes.temperature_squared import TemperatureSquared
from tuner.diagnosis.static.causes.temperature_times_time import Ageing
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.thermal_lag import ThermalLag
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.score_scan import scan
from tuner.diagnosis.static.outcome import UNKNOWN, Accepted, TestResult
from tuner.types import Alternative

SMOOTH = (Temperature, TemperatureRate, TemperatureSquared, ThermalLag, Hysteresis, Warmup, Ageing)
"""Smooth shapes that errors of a thermometer turn into each other."""
PLAIN = (Temperature, ThermalLag)
"""Those that are the temperature itself, late or not."""
OF_TIME = (Warmup, Ageing)
"""Those that are functions of time."""
FEWER_NATS = 3.0
"""Lead of shapes up to which one of them alone is named: odds of 20."""
Shapes = tuple[Extension, ...]
Shape = TypeVar("Shape", bound=Template)


def smooth(accepted: Iterable[Accepted]) -> Shapes:
    """Return the smooth shapes among what was accepted."""
    return tuple(a.extension for a in accepted if isinstance(a.extension, SMOOTH))


def without_smooth(fitted: FittedChannel) -> FittedChannel:
    """Return a model without its smooth shapes."""
    kept = tuple(x for x in fitted.extensions if not isinstance(x, SMOOTH))
    return fit_channel(fitted.channel, kept, starts=fitted.starts, near=fitted)


def beside(bare: FittedChannel, shapes: Shapes) -> FittedChannel:
    """Return a model with further shapes."""
    return fit_channel(bare.channel, (*bare.extensions, *shapes), starts=bare.starts, near=bare)


def sets(bare: Sequence[FittedChannel]) -> list[Shapes]:
    """Return the sets to try, what was measured first; time constants as all axes together show them."""
    lag, warmup = (together(cause.candidates(bare[0].channel), bare) for cause in (ThermalLag, Warmup))
    rate, square = (Temperature(), TemperatureRate()), (Temperature(), TemperatureSquared())
    return [(Temperature(),), rate, (lag,), square, (warmup,)]


def together(tried: Sequence[Shape], bare: Sequence[FittedChannel]) -> Shape:
    """Return the candidate that scores most in all axes together."""
    total = np.zeros(len(tried))
    for one in bare:
        total += scan(one, np.stack([x.template(one.channel) for x in tried], axis=1))[0].score ** 2
    return tried[int(np.argmax(total))]


def price(shapes: Shapes, blocks: int) -> float:
    """Return the price of the sizes and time constants of shapes, nats."""
    constants = sum(bool(getattr(x, "time_constant", 0.0)) for x in shapes)
    free = len(shapes) + constants + sum(bool(getattr(x, "prompt", False)) for x in shapes)
    return 0.5 * free * float(np.log(blocks))


def value(fitted: FittedChannel, shapes: Shapes) -> float:
    """Return the log likelihood of a fit less the price of its smooth shapes."""
    return fitted.fit.log_likelihood - price(shapes, fitted.channel.blocks)


def judged(bare: FittedChannel, fit: FittedChannel, shapes: Shapes, name: str) -> TestResult:
    """Return the result of a test of shapes, all of them against none, for the first of them."""
    ratio = 2.0 * max(fit.fit.log_likelihood - bare.fit.log_likelihood, 0.0)
    p_value = chi2_beyond(SLOW_RATIO_FACTOR * ratio, len(shapes))
    return TestResult(shapes[0].cause, p_value, 0.5 * ratio - price(shapes, fit.channel.blocks), ratio, name)


def measured_first(
    fitted: FittedChannel, accepted: list[Accepted], threshold: float
) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with functions of the temperature in place of shapes of time that explain as much as they do.

    A square alone gives way to the temperature itself, which goes before other functions of it; the likeliest of these
    is taken. Sets that explain as much as what is left are its alternatives.
    """
    own = smooth(accepted)
    if not own or COVARIATE not in fitted.channel.covariates:
        return fitted, accepted
    bare = without_smooth(fitted)
    plain, rate, lag, square, warmup = sets([bare])
    alike = warming_alike(fitted.channel)
    box = [(together(alike, [bare]),)] if alike else []
    tried = [plain, rate, lag, square, (TemperatureSquared(),), *box, warmup]
    fits = [(shapes, beside(bare, shapes)) for shapes in tried]
    if len(own) > 1 and any(isinstance(x, Warmup) for x in own):
        warmup = (warmup[0].refit(fits[-1][1], len(bare.extensions)),)
        fits[-1] = (warmup, beside(bare, warmup))
    worth = value(fitted, own)
    near = [(s, fit) for s, fit in fits if value(fit, s) > worth - NEAR_TWIN_NATS]
    wanted = [
        (shapes, fit)
        for shapes, fit in near
        if (_goes_before(shapes, own) or (_fewer(shapes, own) and value(fit, shapes) > worth - FEWER_NATS))
        and judged(bare, fit, shapes, "").p_value < threshold
    ]
    if wanted:
        itself = [one for one in wanted if one[0] == plain]
        shapes, fit = max(itself or wanted, key=lambda one: value(one[1], one[0]))
        names = " and ".join(x.cause for x in shapes)
        result = judged(bare, fit, shapes, f"likelihood ratio of {names}")
        lost = tuple(
            Alternative(x.cause if x.named else UNKNOWN, float(np.exp(min(worth - value(fit, shapes), 0.0))))
            for x in own
            if x.cause not in {y.cause for y in shapes}
        )
        kept = [a for a in accepted if not isinstance(a.extension, SMOOTH)]
        accepted = [*kept, *(Accepted(x, replace(result, cause=x.cause), lost) for x in shapes)]
        refits = tuple(x.refit(fit, i) for i, x in enumerate(fit.extensions))
        fitted = fit_channel(fit.channel, refits, starts=fit.starts, near=fit)
        own, worth = shapes, value(fit, shapes)
        accepted = [
            replace(a, extension=x)
            for a, x in zip(accepted, refits[len(refits) - len(accepted) :], strict=True)
        ]
    causes = {x.cause for x in own}
    found = {
        x.cause: Alternative(x.cause, float(np.exp(min(value(fit, shapes) - worth, 0.0))))
        for shapes, fit in near
        if not causes < {x.cause for x in shapes} and value(fit, shapes) > worth - NEAR_TWIN_NATS
        for x in shapes
        if x.cause not in causes
    }
    return fitted, [_with(a, found) if isinstance(a.extension, SMOOTH) else a for a in accepted]


def _goes_before(shapes: Shapes, own: Shapes) -> bool:
    """Return whether a set that was measured is named in place of another one that explains as much."""
    if any(isinstance(x, OF_TIME) for x in own):
        return len(shapes) <= len(own) and any(isinstance(x, PLAIN) for x in shapes)
    return [x.cause for x in shapes] == [Temperature.cause] and not any(isinstance(x, PLAIN) for x in own)


def _fewer(shapes: Shapes, own: Shapes) -> bool:
    """Return whether a set has some of the causes of another one, and no other."""
    return {x.cause for x in shapes} < {x.cause for x in own}


def _with(accepted: Accepted, more: dict[str, Alternative]) -> Accepted:
    """Return what was accepted with further alternatives, those it has already apart."""
    known = {a.cause for a in accepted.alternatives}
    return replace(
        accepted, alternatives=(*accepted.alternatives, *(a for a in more.values() if a.cause not in known))
    )
