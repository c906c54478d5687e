"""Slow shapes against each other: one evidence for every set of them, and moves from one set to another.

A set of templates is worth its log likelihood, the noise fitted again, less the price of its free numbers, plus the log
odds of what it says. A move leaves out one shape, all smooth ones or all events, and puts one shape or a pair in their
place; the set of most evidence is taken, until no move gains. Errors of a thermometer and of a model turn one shape
into another: what explains the record within `NEAR_TWIN_NATS` of the set that is taken is an alternative. A set with
more sizes than the one that it replaces has to pass the test of a new cause besides.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Extension
from tuner.diagnosis.static.causes.hysteresis import Hysteresis
from tuner.diagnosis.static.causes.recovery import Recovery
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.step import Step
from tuner.diagnosis.static.causes.temperature import COVARIATE, Temperature, warming_alike
from tuner.diagnosis.static.causes.temperature_rate import TemperatureRate
from tuner.diagnosis.static.causes.temperature_squared import TemperatureSquared
from tuner.diagnosis.static.causes.temperature_times_time import Ageing
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.thermal_lag import ThermalLag, likeliest_beside
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.hypothesis_tests import is_open
from tuner.diagnosis.static.masked_pairs import likeliest_pair
from tuner.diagnosis.static.model.fitted_channel import (
    FittedChannel,
    extended,
    refitted,
    relabelled,
    with_extensions,
)
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.score_scan import scan
from tuner.diagnosis.static.outcome import ALTERNATIVE_NATS, NEAR_TWIN_NATS, UNKNOWN, Accepted, TestResult
from tuner.diagnosis.static.residual_checks import harmless_ratio
from tuner.types import Alternative

THERMAL = (Temperature, TemperatureRate, TemperatureSquared, ThermalLag, Hysteresis)
"""Functions of the temperature."""
PLAIN = (Temperature, ThermalLag)
"""Those that are the temperature itself, late or not."""
OF_TIME = (Warmup, Ageing)
"""Functions of time."""
SMOOTH = (*THERMAL, *OF_TIME)
"""Smooth shapes, which errors of a thermometer turn into each other."""
UNMEASURED_NATS = NEAR_TWIN_NATS
"""Log odds against a smooth shape that is not the temperature itself, where there is a thermometer.

Its errors, and a transient that is no exponential, cost a true dependence on the temperature so much.
"""
MAX_MOVES = 8
"""Largest number of moves; chosen to bound the search above the number of slow shapes that one record has."""
MAX_REFITS = 3
"""Largest number of refits of a set: each moves a time constant by a factor of two at most."""
Shapes = tuple[Extension, ...]
Shape = TypeVar("Shape", bound=Template)


def log_odds(fitted: FittedChannel) -> float:
    """Return the log odds of the slow shapes of a model before the record is seen, up to a constant, nats.

    One shape goes before two, what was measured before what follows time, the temperature itself before other functions
    of it, and a bias that stays before one that decays, most of all by a time constant beyond those that are sought.
    """
    channel, own = fitted.channel, [x for x in fitted.extensions if isinstance(x, Template)]
    odds = -ALTERNATIVE_NATS * max(len(own) - 1, 0)
    measured = COVARIATE in channel.covariates
    plain = any(isinstance(x, PLAIN) for x in own)
    for x in own:
        if isinstance(x, OF_TIME):
            odds -= UNMEASURED_NATS * measured
        elif isinstance(x, ThermalLag):
            odds -= ALTERNATIVE_NATS * (1 + x.prompt + x.settling)
        elif isinstance(x, THERMAL):
            unusual = not isinstance(x, Temperature) or x.time_constant > 0.0
            alike = plain or isinstance(x, TemperatureRate)  # under a sinusoid a lag of hours is a rate
            odds -= ALTERNATIVE_NATS * unusual if alike else UNMEASURED_NATS
        elif isinstance(x, Recovery):
            long = x.time_constant > Recovery.time_constants(channel)[-1]
            odds -= UNMEASURED_NATS if long else ALTERNATIVE_NATS
    return odds


def worth(fitted: FittedChannel) -> float:
    """Return the log likelihood of a fit less the price of the free numbers of its templates, nats."""
    channel = fitted.channel
    return fitted.fit.log_likelihood - sum(
        x.cost(channel) for x in fitted.extensions if isinstance(x, Template)
    )


def evidence(fitted: FittedChannel) -> float:
    """Return what a fit is worth with the log odds of what it says, nats."""
    return worth(fitted) + log_odds(fitted)


def settled(
    fitted: FittedChannel, accepted: list[Accepted], threshold: float, *, pairs: bool = False
) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with the set of slow shapes that the moves lead to, with their alternatives.

    Parameters
    ----------
    fitted, accepted
        The model, and its last extensions as they were accepted.
    threshold : float
        Chance below which more sizes are taken.
    pairs : bool
        Whether pairs that hide each other are looked for in place of a shape, which takes longer.
    """
    visited = [fitted]
    for _ in range(MAX_MOVES):
        given = len(fitted.extensions) - len(accepted)
        removals = [*_removals(accepted), *([frozenset[int]()] if pairs else [])]
        tried = [one for removed in removals for one in _moves(fitted, given, accepted, removed, pairs=pairs)]
        visited += [fit for fit, _ in tried]
        before = fitted
        for fit, known in sorted(tried, key=lambda one: _free_numbers(one[0])):
            if _gains(fit, fitted, threshold):
                fitted, accepted = fit, known
        if fitted is before:
            break
    return fitted, [_with_rivals(one, fitted, visited) for one in accepted]


def _removals(accepted: Sequence[Accepted]) -> list[frozenset[int]]:
    """Return the sets of places that a move leaves out: each slow shape, all smooth ones, all that decay."""
    slow = [
        i
        for i, one in enumerate(accepted)
        if isinstance(one.extension, Template)
        and not (isinstance(one.extension, Step) and one.extension.taken)
    ]
    kinds = [
        frozenset(i for i in slow if isinstance(accepted[i].extension, kind)) for kind in (SMOOTH, Recovery)
    ]
    return list(dict.fromkeys([*(frozenset((i,)) for i in slow), *(kind for kind in kinds if len(kind) > 1)]))


def _moves(
    fitted: FittedChannel, given: int, accepted: Sequence[Accepted], removed: frozenset[int], *, pairs: bool
) -> Iterator[tuple[FittedChannel, list[Accepted]]]:
    """Give the models with other shapes in place of some of those accepted, all fitted again, and what is accepted."""
    kept = [one for i, one in enumerate(accepted) if i not in removed]
    bare = with_extensions(fitted, (*fitted.extensions[:given], *(one.extension for one in kept)))
    names = {accepted[i].extension.cause for i in removed}
    least = max(worth(fitted) - worth(bare) - 2.0 * NEAR_TWIN_NATS, 0.0)
    hidden = likeliest_pair(bare) if pairs else ()
    for shapes in (*(_candidates(bare, least) if removed else ()), *((hidden,) if hidden else ())):
        same = {x.cause for x in shapes} == names and len(shapes) == len(removed)
        if same or not all(
            is_open(relabelled(bare, (*bare.extensions, *shapes[:i])), x.cause) for i, x in enumerate(shapes)
        ):
            continue
        fit = refitted(extended(bare, *shapes), MAX_REFITS)
        result = judged(bare, fit, shapes, f"likelihood ratio of {' and '.join(x.cause for x in shapes)}")
        own = [replace(one, extension=x) for one, x in zip(kept, fit.extensions[given:], strict=False)]
        new = [Accepted(x, replace(result, cause=x.cause)) for x in fit.extensions[given + len(kept) :]]
        yield fit, [*own, *new]


def _candidates(bare: FittedChannel, least: float) -> Iterator[Shapes]:
    """Give what may stand in place of others: shapes that gain at least so many nats, and pairs of the temperature."""
    for code, cause in CAUSES.extensions().items():
        if issubclass(cause, Template) and is_open(bare, code):
            result = cause.test(bare)
            if result is not None and result.propose is not None and result.gain > least:
                yield result.propose()
    if COVARIATE in bare.channel.covariates and not bare.count(*(cause.cause for cause in THERMAL)):
        yield Temperature(), TemperatureRate()
        yield Temperature(), TemperatureSquared()
        other = extended(bare, Temperature())
        yield (likeliest_beside(other),)
        yield Temperature(), together(Warmup.candidates(bare.channel), [other])
        if alike := warming_alike(bare.channel):
            yield (together(alike, [bare]),)


def _gains(fit: FittedChannel, than: FittedChannel, threshold: float) -> bool:
    """Return whether a model has more evidence than another, and passes the test of the sizes that it has more.

    The test is paid for the choice among candidates; a size in place of a time constant is none more.
    """
    if evidence(fit) <= evidence(than):
        return False
    more = min(_sizes(fit) - _sizes(than), _free_numbers(fit) - _free_numbers(than))
    ratio = 2.0 * SLOW_RATIO_FACTOR * (fit.fit.log_likelihood - than.fit.log_likelihood) - harmless_ratio(
        than
    )
    choices = float(np.exp(_choice(fit) - _choice(than)))
    return more <= 0 or max(choices, 1.0) * chi2_beyond(max(ratio, 0.0), more) < threshold


def _sizes(fitted: FittedChannel) -> int:
    """Return how many sizes a model has."""
    return int(fitted.track.columns.shape[1])


def _free_numbers(fitted: FittedChannel) -> int:
    """Return how many sizes and time constants a model has."""
    return _sizes(fitted) + sum(bool(getattr(x, "time_constant", 0.0)) for x in fitted.extensions)


def _choice(fitted: FittedChannel) -> float:
    """Return what the choice among candidates of its templates costs a model, nats."""
    return sum(x.choice(fitted.channel) for x in fitted.extensions if isinstance(x, Template))


def _with_rivals(one: Accepted, final: FittedChannel, visited: Sequence[FittedChannel]) -> Accepted:
    """Return what was accepted with the causes in its place in models worth as much, of one number more at most."""
    causes = {x.cause for x in final.extensions}
    rivals: dict[str, float] = {}
    if not isinstance(one.extension, Template):
        return one
    for other in visited:
        lead = worth(other) - worth(final)
        more = _free_numbers(other) > _free_numbers(final) + 1
        if more or lead <= -NEAR_TWIN_NATS or other.count(one.extension.cause):
            continue
        for x in other.extensions:
            if isinstance(x, Template) and x.cause not in causes:
                name = x.cause if x.named else UNKNOWN
                rivals[name] = max(rivals.get(name, 0.0), float(np.exp(min(lead, 0.0))))
    known = [a for a in one.alternatives if a.cause not in rivals and a.cause not in causes]
    return replace(one, alternatives=(*known, *(Alternative(name, score) for name, score in rivals.items())))


def smooth(accepted: Iterable[Accepted]) -> Shapes:
    """Return the smooth shapes among what was accepted."""
    return tuple(a.extension for a in accepted if isinstance(a.extension, SMOOTH))


def without_smooth(fitted: FittedChannel) -> FittedChannel:
    """Return a model without its smooth shapes."""
    return with_extensions(fitted, tuple(x for x in fitted.extensions if not isinstance(x, SMOOTH)))


def sets(bare: Sequence[FittedChannel]) -> list[Shapes]:
    """Return the sets that axes may have in common, with the time constants that all of them show."""
    lag, warmup = (together(cause.candidates(bare[0].channel), bare) for cause in (ThermalLag, Warmup))
    rate, square = (Temperature(), TemperatureRate()), (Temperature(), TemperatureSquared())
    alike = warming_alike(bare[0].channel)
    box = [(together(alike, bare),)] if alike else []
    return [(Temperature(),), rate, (lag,), square, (warmup,), *box]


def together(tried: Sequence[Shape], bare: Sequence[FittedChannel]) -> Shape:
    """Return the candidate that scores most in all axes together."""
    total = np.zeros(len(tried))
    for one in bare:
        total += scan(one, np.stack([x.template(one.channel) for x in tried], axis=1))[0].score ** 2
    return tried[int(np.argmax(total))]


def judged(bare: FittedChannel, fit: FittedChannel, shapes: Shapes, name: str) -> TestResult:
    """Return the result of a test of shapes, all of them against none, for the first of them."""
    ratio = 2.0 * max(fit.fit.log_likelihood - bare.fit.log_likelihood, 0.0)
    sizes = _sizes(fit) - _sizes(bare)
    choices = float(np.exp(_choice(fit) - _choice(bare)))
    p_value = min(1.0, choices * chi2_beyond(SLOW_RATIO_FACTOR * ratio, sizes))
    return TestResult(shapes[0].cause, p_value, max(worth(fit) - worth(bare), 0.0), ratio, name)
