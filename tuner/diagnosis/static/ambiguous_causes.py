"""Causes that errors of a thermometer or of a model turn into each other, near twins, and which of them is named.

A shape that follows a measured quantity goes before one of time alone; a lag, a slope with a rate and a slope with a
square are compared with each other once one of them was accepted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.probability import chi2_beyond
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.hysteresis import Hysteresis
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.recovery import Recovery
from tuner.diagnosis.static.causes.registry import CAUSES
from tuner.diagnosis.static.causes.step import Step
from tuner.diagnosis.static.causes.temperature import COVARIATE, Temperature, warming
from tuner.diagnosis.static.causes.temperature_rate import TemperatureRate
from tuner.diagnosis.static.causes.temperature_squared import TemperatureSquared
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.causes.thermal_lag import ThermalLag, beside_temperature
from tuner.diagnosis.static.causes.vibration import Vibration
from tuner.diagnosis.static.causes.warmup import Warmup
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.hypothesis_tests import retest
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, extended, fit_channel, without
from tuner.diagnosis.static.model.null_distributions import SLOW_RATIO_FACTOR
from tuner.diagnosis.static.model.score_scan import judge, scan
from tuner.diagnosis.static.outcome import Accepted, TestResult
from tuner.types import Alternative

ALTERNATIVE_NATS = 3.0
"""Nats within which a rival counts as an alternative: a likelihood ratio of 20, the usual 5 %."""
NEAR_TWIN_NATS = 10.0
"""Nats within which two slow shapes, or two shapes of the fast spectrum, are alternatives.

Errors of what they are functions of (a thermometer's lag and noise, a transient that is no exponential, a filter of
another order) cost a true one that much.
"""
SPECTRUM_TWINS = frozenset({"lowpass", "colour"})
"""Shapes of the fast spectrum that differ in the order of a filter only."""
LAG_LIKELIHOOD_RATIO = 24.0
"""Likelihood ratio from which a lag replaces a temperature: χ²₁ at 1e-6, 1e-5 for the dozen lags of the grid."""

LINE_PRICE = 1.5
"""Price of a line, logs of the number of samples: half of one for amplitude and phase each, one for the frequency."""
STEP_REACH = 2
"""Blocks on either side of the beginning of a recovery between which a step in its place lies."""
TRIED_CONSTANTS = 40
"""Time constants by which the temperature may warm: a seventh apart, a hundredth of the warming's own size."""
MAX_REST_RATIO = 1.1
"""Rms distance of readings from an exponential ÷ the least one up to which it is as likely.

Errors that stay for minutes leave few independent readings, some ten in a record: their rms is known to no tenth.
"""
MIN_WARMING = 2.0
"""Rms of the exponential about a line ÷ that distance from which the temperature warms by it at all.

It then has 80 % of the power of what is no ramp in the readings, as of a box that warms by 7 K, read with errors of
0.4 K for minutes. A chamber that warms and cools is nearer to a parabola, the longest of the exponentials.
"""

THERMAL = (Temperature, TemperatureRate, TemperatureSquared, ThermalLag, Hysteresis)
"""Causes that are functions of the temperature."""


def measured_first(result: TestResult, candidates: list[TestResult]) -> TestResult:
    """Return a result, or in place of a smooth shape its near twin that is the temperature itself, or lags it.

    A shape of time gives way to both; another function of the temperature to the temperature only.
    """
    named = CAUSES.extensions().get(result.cause)
    plain = (Temperature.cause, ThermalLag.cause)
    if named is None or not issubclass(named, Template) or named.abrupt or result.cause in plain:
        return result
    for cause in plain if named.covariate is None else plain[:1]:
        for other in candidates:
            if other.cause == cause and other.gain > result.gain - NEAR_TWIN_NATS:
                return other
    return result


def behind_thermometer(fitted: FittedChannel, result: TestResult, threshold: float) -> TestResult:
    """Return a result, or in place of a smooth shape of time a temperature behind a thermometer that is late.

    A thermometer late by τ reads T − τ dT/dt: what follows T follows its reading, and the rate of that.
    """
    named = CAUSES.extensions().get(result.cause)
    if named is None or not issubclass(named, Template) or named.abrupt or named.covariate is not None:
        return result
    if COVARIATE not in fitted.channel.covariates or fitted.count(*(c.cause for c in THERMAL)):
        return result
    pair = Temperature(), TemperatureRate()
    columns = np.stack([one.template(fitted.channel) for one in pair], axis=1)
    best = fitted.refit(block_transform(columns, fitted.cleaned, fitted.track.singles))
    ratio = max(0.0, 2.0 * (best.log_likelihood - fitted.fit.log_likelihood))
    gain = 0.5 * ratio - 0.5 * float(np.log(fitted.channel.blocks))
    p_value = chi2_beyond(SLOW_RATIO_FACTOR * ratio, 2)
    if gain < result.gain - NEAR_TWIN_NATS or p_value > threshold:
        return result
    name = "likelihood ratio of the temperature and its rate"
    return TestResult(Temperature.cause, p_value, gain, ratio, name, lambda: pair)


def warming_box(fitted: FittedChannel, result: TestResult, threshold: float) -> TestResult:
    """Return a result, or in place of a warm-up the temperature, where that warms alike but for errors of its readings.

    Errors of a thermometer that stay for minutes cost a bias that follows the true temperature more than any shape of
    time: what the readings follow by an exponential takes their place, if it explains the bias as well.
    """
    channel = fitted.channel
    if result.cause != Warmup.cause or COVARIATE not in channel.covariates or result.propose is None:
        return result
    if fitted.count(*(c.cause for c in THERMAL)):
        return result
    alike = warming_alike(channel)
    if not alike:
        return result
    scores, templates = scan(fitted, np.stack([one.template(channel) for one in alike], axis=1))
    found = judge(fitted, templates[:, scores.best], scores.correlation, price=Warmup.price)
    if found.gain < result.gain - NEAR_TWIN_NATS or found.p_value > threshold:
        return result
    name = "likelihood ratio of the temperature, errors of its readings taken out"
    return TestResult(
        Temperature.cause, found.p_value, found.gain, found.ratio, name, lambda: (alike[scores.best],)
    )


def warming_alike(channel: Channel) -> list[Temperature]:
    """Return the temperature as each exponential that its readings follow as closely as the best one; none for none."""
    constants = Warmup.time_constants(channel)
    tried = np.geomspace(constants[0], 3.0 * constants[-1], TRIED_CONSTANTS)
    rests = np.array([warming(channel, constant)[2] for constant in tried.tolist()])
    best = int(np.argmin(rests))
    if best == len(tried) - 1 or warming(channel, float(tried[best]))[1] < MIN_WARMING * rests[best]:
        return []
    likely = tried[rests <= MAX_REST_RATIO * rests.min()]
    return [Temperature(time_constant=constant) for constant in likely.tolist()]


def twins(one: str, other: str) -> bool:
    """Return whether two causes have shapes that errors of the model can turn into each other."""
    causes = CAUSES.extensions()
    slow = all(code in causes and issubclass(causes[code], Template) for code in (one, other))
    return one != other and (slow or {one, other} == SPECTRUM_TWINS)


def without_lag(fitted: FittedChannel, accepted: list[Accepted]) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with the temperature itself where its lag is not worth its price beside what else was found.

    A transient that was not in the model yet can make a lag look needed.
    """
    given = len(fitted.extensions) - len(accepted)
    for at, one in enumerate(accepted):
        lag = one.extension
        if not isinstance(lag, ThermalLag) or lag.prompt or len(accepted) < 2:
            continue
        plain = list(fitted.extensions)
        plain[given + at] = Temperature()
        other = fit_channel(fitted.channel, tuple(plain), starts=fitted.starts, near=fitted)
        other = _refitted(other)
        lead = fitted.fit.log_likelihood - other.fit.log_likelihood
        if lead < ALTERNATIVE_NATS:
            twin = Alternative("thermal_lag", float(np.exp(min(lead - ALTERNATIVE_NATS, 0.0))))
            changed = replace(one, extension=other.extensions[given + at], alternatives=(twin,))
            return other, [*accepted[:at], changed, *accepted[at + 1 :]]
    return fitted, accepted


def with_one_lag(fitted: FittedChannel, accepted: list[Accepted]) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with one lag in place of a temperature and its rate, where that explains as much.

    A short lag τ is L = T − τ dT/dt.
    """
    given = len(fitted.extensions) - len(accepted)
    place = {a.extension.cause: at for at, a in enumerate(accepted)}
    if not {Temperature.cause, TemperatureRate.cause} <= place.keys():
        return fitted, accepted
    first, second = place[Temperature.cause], place[TemperatureRate.cause]
    bare = without(without(fitted, given + max(first, second)), given + min(first, second))
    tried = ThermalLag.candidates(fitted.channel)
    scores, _ = scan(bare, np.stack([one.template(fitted.channel) for one in tried], axis=1))
    other = extended(bare, tried[scores.best].likeliest(bare))
    other = _refitted(other)
    lead = other.fit.log_likelihood - fitted.fit.log_likelihood
    if lead < -ALTERNATIVE_NATS:
        return fitted, accepted
    twin = Alternative(TemperatureRate.cause, float(np.exp(min(-lead, 0.0))))
    lag = replace(
        accepted[first], extension=other.extensions[-1], alternatives=(*accepted[first].alternatives, twin)
    )
    return other, [*(a for at, a in enumerate(accepted) if at not in (first, second)), lag]


def with_curve(fitted: FittedChannel, accepted: list[Accepted]) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with slope and square of the temperature in place of a lag that explains less, or as its twin.

    Neither of the two explains alone what a lag, with two parameters, does.
    """
    given = len(fitted.extensions) - len(accepted)
    for at, one in enumerate(accepted):
        if not isinstance(one.extension, ThermalLag) or fitted.count("temperature_squared"):
            continue
        pair = (Temperature(), TemperatureSquared())
        changed = (*fitted.extensions[: given + at], *pair, *fitted.extensions[given + at + 1 :])
        other = fit_channel(fitted.channel, changed, starts=fitted.starts, near=fitted)
        lead = other.fit.log_likelihood - fitted.fit.log_likelihood
        if abs(lead) > NEAR_TWIN_NATS and lead < 0.0:
            return fitted, accepted
        twin = Alternative(
            TemperatureSquared.cause if lead < 0.0 else ThermalLag.cause, float(np.exp(-abs(lead)))
        )
        if lead < 0.0:
            known = [*one.alternatives, twin]
            return fitted, [*accepted[:at], replace(one, alternatives=tuple(known)), *accepted[at + 1 :]]
        twins = (twin,) if lead < NEAR_TWIN_NATS else ()
        square = retest(without(other, given + at + 1), TemperatureSquared.cause)
        result = one.result if square is None else square.without_proposal
        both = [Accepted(pair[0], one.result, twins), Accepted(pair[1], result, twins)]
        return other, [*accepted[:at], *both, *accepted[at + 1 :]]
    return fitted, accepted


def with_lag(fitted: FittedChannel, accepted: list[Accepted]) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with a lag in place of a temperature that a second, late way is clearly wanted beside."""
    given = len(fitted.extensions) - len(accepted)
    for at, one in enumerate(accepted):
        if one.extension.cause != "temperature":
            continue
        lag, ratio = beside_temperature(fitted)
        if ratio < LAG_LIKELIHOOD_RATIO:
            return fitted, accepted
        wider = [*fitted.extensions[: given + at], lag, *fitted.extensions[given + at + 1 :]]
        other = fit_channel(fitted.channel, tuple(wider), starts=fitted.starts, near=fitted)
        other = _refitted(other)
        changed = replace(one, extension=other.extensions[given + at])
        return other, [*accepted[:at], changed, *accepted[at + 1 :]]
    return fitted, accepted


def with_steps(fitted: FittedChannel, accepted: list[Accepted]) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model with steps in place of recoveries that explain no more: of all of them, or of one.

    A first step beside a second one that is not in the model yet looks as if it decayed, and so does one on slow noise,
    by time constants beyond those that are sought: that is a recovery where it explains `NEAR_TWIN_NATS` more.
    """
    given, channel = len(fitted.extensions) - len(accepted), fitted.channel
    longest = float(Recovery.time_constants(channel)[-1])
    decays = {at: one.extension for at, one in enumerate(accepted) if isinstance(one.extension, Recovery)}
    for chosen in dict.fromkeys((tuple(decays), *((at,) for at in decays))) if decays else ():
        changed = list(fitted.extensions)
        for at in chosen:
            time = channel.start + decays[at].first * channel.interval
            reach = STEP_REACH * channel.block * channel.interval
            placed = {"time": Value(time, time - reach, time + reach, "s")}
            changed[given + at] = Step(decays[at].first, values=placed)
        other = _refitted(fit_channel(channel, tuple(changed), starts=fitted.starts, near=fitted))
        lead = fitted.fit.log_likelihood - other.fit.log_likelihood
        price = sum(
            NEAR_TWIN_NATS if decays[at].time_constant > longest else ALTERNATIVE_NATS for at in chosen
        )
        if lead < price:
            twin = Alternative(Recovery.cause, float(np.exp(min(lead - price, 0.0))))
            found = [
                replace(one, extension=other.extensions[given + at], alternatives=(twin,))
                if at in chosen
                else one
                for at, one in enumerate(accepted)
            ]
            return with_steps(other, found)
    return fitted, accepted


def without_line_of_resonance(
    fitted: FittedChannel, accepted: list[Accepted]
) -> tuple[FittedChannel, list[Accepted]]:
    """Return the model without a line within the width of a resonance that explains as much alone, fitted again.

    The highest ordinate of a sharp resonance is found first, and looks like a line.
    """
    given = len(fitted.extensions) - len(accepted)
    resonances = [x for x in fitted.extensions if isinstance(x, Vibration)]
    for at, one in enumerate(accepted):
        tone = one.extension
        if not isinstance(tone, Line) or not any(
            abs(tone.frequency - x.frequency) < x.frequency / x.quality for x in resonances
        ):
            continue
        other = _refitted(_refitted(without(fitted, given + at)))
        lead = _spectrum_likelihood(fitted) - _spectrum_likelihood(other)
        if lead < LINE_PRICE * float(np.log(len(fitted.channel))):
            return without_line_of_resonance(other, [*accepted[:at], *accepted[at + 1 :]])
    return fitted, accepted


def _refitted(fitted: FittedChannel) -> FittedChannel:
    """Return the model with every extension fitted again beside the others."""
    refits = tuple(x.refit(fitted, i) for i, x in enumerate(fitted.extensions))
    return fit_channel(fitted.channel, refits, starts=fitted.starts, near=fitted)


def _spectrum_likelihood(fitted: FittedChannel) -> float:
    """Return the log likelihood of the coefficients of the residual, nats up to a constant."""
    power = fitted.power * fitted.spread**2
    return -0.5 * float(np.sum(np.log(power) + fitted.coefficients[1:] ** 2 / power))
