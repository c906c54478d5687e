"""Gain of an extension: log likelihood of data that had no part in its fit, and figures of use to a user.

The extensions are fitted again, one by one, to a record A: the same record as was diagnosed where there is a second
record B, else its first 60 %. With all parameters frozen, B is scored before and after each::

    ln p(B) = Σ_j ln h(e_j) − ½ Σ_k ln E_k

with E the spectrum of the model, e its residuals on B and h their law (normal, Student's, contaminated normal, gamma).
A line may choose its phase anew, for one nat, and so may a variance with a period; a variance that drifts goes on as it
did; two levels count by what a switching filter gains on the Gaussian one. A slope of B is fitted to it, and in another
record how a thermal lag begins. What is an event of A (a step, a burst) is not in B: where it cannot be found again, or
lies near the cut or after it, its gain is that in sample, less the price of its parameters, and it is taken out before
anything else is scored.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.arrays import FloatArray
from models.probability import log_normal_density
from tuner.diagnosis.static.causes.base import Extension, gain_of, power_of
from tuner.diagnosis.static.causes.burst import Burst
from tuner.diagnosis.static.causes.comb import Comb
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.periodic_variance import PeriodicVariance
from tuner.diagnosis.static.causes.recovery import Recovery
from tuner.diagnosis.static.causes.skewed_noise import SkewedNoise
from tuner.diagnosis.static.causes.spikes import Spikes
from tuner.diagnosis.static.causes.step import Step
from tuner.diagnosis.static.causes.telegraph import Telegraph
from tuner.diagnosis.static.causes.temperature import Temperature
from tuner.diagnosis.static.causes.thermal_lag import ThermalLag
from tuner.diagnosis.static.causes.variance_drift import VarianceDrift
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.hypothesis_tests import retest
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.diagnosis.static.model.expected_power import spectrum_knots
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, fit_channel, once
from tuner.diagnosis.static.model.profile_likelihood import first_column
from tuner.diagnosis.static.model.series_statistics import RESIDUAL_CLIP
from tuner.diagnosis.static.outcome import Accepted
from tuner.diagnosis.static.search import SearchResult
from tuner.diagnosis.static.switching.models import block_noise
from tuner.diagnosis.static.variance.quantized_noise import slow_track
from tuner.types import Gain

FITTED_SHARE = 0.6
"""Part of a single record that the parameters are taken from; chosen so that both parts are long."""
MARGIN_SHARE = 0.03
"""Share of the record before the cut within which an event is not distinguished from one that begins there.

Chosen as a twentieth of the first part: a jump with less behind it is hardly found again in that part alone.
"""
MIN_SPIKES = 10
"""Spikes from which the rest of a record can contradict their rate.

Of nine, none lies in the last 40 % of one record in 100.
"""
PREDICTION_HORIZON = 60.0
"""Length of the means whose change a user has to expect, s; chosen as that of an outage of GNSS."""


@dataclass(frozen=True)
class _Free:
    """What is fitted to a test because no model foretells it, shape (n, p), and its coefficients, (p, n)."""

    columns: FloatArray
    coefficients: FloatArray

    @classmethod
    def of(cls, columns: FloatArray, interval: float) -> _Free:
        """Return columns with their coefficients."""
        return cls(columns, np.stack([transform(column, interval) for column in columns.T]))


@dataclass(frozen=True)
class _Test:
    """Samples to be scored: a stretch of a context, which carries time and temperature from its start."""

    channel: Channel
    context: Channel
    first: int

    @cached_property
    def ramp(self) -> _Free:
        """An even slope."""
        n = len(self.channel)
        return _Free.of((np.arange(n) / n - 0.5)[:, None], self.channel.interval)


def with_gains(outcome: SearchResult, second: Channel | None) -> tuple[Accepted, ...]:
    """Return what was accepted in a channel, each with its gain.

    Parameters
    ----------
    outcome : SearchResult
        Outcome of the loop.
    second : Channel, optional
        The same axis in a second record of the unit.
    """
    if not outcome.accepted:
        return ()
    cut = int(FITTED_SHARE * len(outcome.base.channel))
    late = () if second is not None else _late(outcome, cut)
    whole = _still(outcome, late)
    train, test, split = whole, None, "second record"
    if second is not None:
        test = _Test(second, second, 0)
    else:
        part, rest = whole.part(0, cut), whole.part(cut, len(whole))
        split = "60/40"
        if part is not None and rest is not None:
            train, test = part, _Test(rest, whole, cut)
    if test is None:
        return tuple(replace(a, gain=_in_sample(outcome, a)) for a in outcome.accepted)
    found = fit_channel(train)
    before = _score(found, test)
    n = len(test.channel)
    done = []
    for accepted in outcome.accepted:
        rare = isinstance(accepted.extension, Spikes) and len(accepted.extension.places) < MIN_SPIKES
        apart = rare or any(accepted.extension is one for one in late)
        result = None if apart else retest(found, accepted.extension.cause)
        if result is None or result.propose is None or result.gain <= 0:
            done.append(replace(accepted, gain=_in_sample(outcome, accepted)))
            continue
        own = accepted.extension
        smooth = isinstance(own, Temperature) and own.time_constant > 0.0
        proposed = (own,) if smooth else result.propose()
        extended = fit_channel(train, (*found.extensions, *proposed), starts=found.starts, near=found)
        free = _free(extended, test)
        if free is not test.ramp:
            before = _score(found, test, free)
        after = _score(extended, test, free)
        user = _user(found, extended, test)
        done.append(replace(accepted, gain=Gain(split, before / n, after / n, after - before, user=user)))
        found, before = extended, after
    return tuple(done)


def _late(outcome: SearchResult, cut: int) -> tuple[Extension, ...]:
    """Return gross jumps, and the jumps and bursts that are not well within the first part, samples 0 … cut − 1."""
    margin = int(MARGIN_SHARE * len(outcome.base.channel))
    return tuple(
        x
        for x in outcome.final.extensions
        if (isinstance(x, Step) and (x.taken or x.first > cut - margin))
        or (isinstance(x, Recovery) and x.first > cut - margin)
        or (isinstance(x, Burst) and x.last > cut - margin)
    )


def _still(outcome: SearchResult, late: tuple[Extension, ...]) -> Channel:
    """Return the channel without its stretches of motion, the levels between them, and late events."""
    channel = outcome.base.channel
    given = [x for x in outcome.base.extensions if isinstance(x, Motion)]
    y = outcome.base.cleaned.y.copy()
    at = 1
    for extension in given:
        columns = extension.columns(channel)
        size = columns.shape[1]
        y -= np.repeat(columns @ outcome.base.fit.beta[at : at + size], channel.block)
        at += size
    for index, event in enumerate(outcome.final.extensions):
        if not any(event is one for one in late):
            continue
        if isinstance(event, Step | Recovery):
            size = float(outcome.final.fit.beta[first_column(outcome.final, index)])
            size += event.taken if isinstance(event, Step) else 0.0
            y -= size * event.course(channel)
        elif isinstance(event, Burst):
            inside = slice(event.first, event.last)
            slow = slow_track(outcome.final)[0][inside]
            y[inside] = slow + (y[inside] - slow) * event.ratio**-0.5
    return replace(outcome.base.cleaned, y=y)


@once
def _own(fitted: FittedChannel) -> float:
    """Return the score of a model on its own samples."""
    return _score(fitted, _Test(fitted.cleaned, fitted.channel, 0))


def _in_sample(outcome: SearchResult, accepted: Accepted) -> Gain:
    n = len(outcome.base.channel)
    before = _own(outcome.base) / n
    return Gain("in sample", before, before + accepted.result.gain / n, accepted.result.gain)


def _signal(fitted: FittedChannel, test: _Test) -> FloatArray:
    """Return what the templates of the model foretell, shape (n,), in scales of the model."""
    beta, at = fitted.fit.beta, 1
    total = np.zeros(test.context.blocks)
    for extension in fitted.extensions:
        columns = extension.columns_elsewhere(test.context, same_record=test.first > 0)
        total += columns @ beta[at : at + columns.shape[1]]
        at += extension.columns(fitted.channel).shape[1]
    return np.repeat(total, test.context.block)[test.first : test.first + len(test.channel)]


def _free(fitted: FittedChannel, test: _Test) -> _Free:
    """Return what is fitted to a test: a slope, and in another record how a lag begins."""
    same = test.first == 0 and test.channel is test.context
    lags = [x for x in fitted.extensions if same and isinstance(x, ThermalLag)]
    if not lags:
        return test.ramp
    starts = [np.repeat(lag.start(test.context), test.context.block)[:, None] for lag in lags]
    return _Free.of(np.concatenate([test.ramp.columns, *starts], axis=1), test.channel.interval)


def _without(free: _Free, y: FloatArray, power: FloatArray, interval: float) -> tuple[FloatArray, FloatArray]:
    """Return samples, shape (n,), less what is free, as fitted to them in noise of this power; and coefficients."""
    root, a = 1.0 / np.sqrt(power), transform(y, interval)
    white = free.coefficients[:, 1:] * root
    size = np.linalg.lstsq(white @ white.T, white @ (a[1:] * root))[0]
    return y - free.columns @ size, a - size @ free.coefficients


def _score(fitted: FittedChannel, test: _Test, free: _Free | None = None) -> float:
    """Return the log likelihood of a test under a model with frozen parameters, nats (up to a constant)."""
    dt, n = test.channel.interval, len(test.channel)
    y = test.channel.y * (test.channel.scale / fitted.channel.scale) - _signal(fitted, test)
    power = _power(fitted, n)
    y, whitened = _without(test.ramp if free is None else free, y, power, dt)
    charge, bare = 0.0, y
    for extension in fitted.extensions:
        if isinstance(extension, Line):
            phase = 2.0 * np.pi * extension.frequency * dt * np.arange(n)
            z = 2.0 / n * complex(np.sum((y - y.mean()) * np.exp(-1j * phase)))
            y = y - np.real(z * np.exp(1j * phase))
            charge += 1.0
        if isinstance(extension, Comb):
            course, cost = extension.elsewhere(y)
            y, charge = y - course, charge + cost
        if isinstance(extension, Telegraph):
            step = test.channel.block * dt
            charge -= extension.lead(test.channel.block_mean(y), step, block_noise(fitted.fit.terms(), step))
    whitened = whitened if y is bare else transform(y, dt)
    whitened[0] = 0.0
    whitened[1:] /= np.sqrt(power)
    spread = np.zeros(n)
    for extension in fitted.extensions:
        if isinstance(extension, VarianceDrift):
            spread += extension.foretold(fitted.channel, test.context)[test.first : test.first + n]
    valid, e = test.channel.valid, inverse(whitened, 1.0)
    for extension in fitted.extensions:
        if isinstance(extension, PeriodicVariance):
            spread += extension.elsewhere(np.clip(e * np.exp(-0.5 * spread), -RESIDUAL_CLIP, RESIDUAL_CLIP))
            charge += 1.0
    e, spread = (e * np.exp(-0.5 * spread))[valid], spread[valid]
    for extension in fitted.extensions:
        if isinstance(extension, SkewedNoise):
            charge -= float(extension.log_slope(e).sum())
            e = extension.deviates(e)
    return float(_law(fitted)(e).sum() - 0.5 * spread.sum() - 0.5 * np.log(power).sum() * len(e) / n - charge)


def _power(fitted: FittedChannel, n: int) -> FloatArray:
    """Return the spectrum of the model at the n − 1 frequencies of another record."""
    dt = fitted.channel.interval
    order = np.arange(1.0, n)
    knots, hertz = spectrum_knots(1, n), 1.0 / (2.0 * n * dt)
    switching = (term for x in fitted.extensions if isinstance(x, Telegraph) for term in x.terms(dt))
    smooth = fitted.smooth_power(knots * hertz, switching)
    return np.asarray(np.interp(order, knots, smooth) + power_of(fitted.extensions, order * hertz, dt))


def _law(fitted: FittedChannel) -> Callable[[FloatArray], FloatArray]:
    """Return the log density of the residuals as fitted."""
    tails = next((x for x in fitted.extensions if isinstance(x, HeavyTails)), None)
    spikes = next((x for x in fitted.extensions if isinstance(x, Spikes)), None)
    if tails is not None:
        return lambda e: tails.log_density(e / fitted.spread) - float(np.log(fitted.spread))
    sd = float(np.std(fitted.good)) * fitted.spread
    if spikes is not None:
        share = max(spikes.values["rate"].value * fitted.channel.interval, 1e-8)
        white = float(np.sqrt(fitted.power_at(np.inf) / fitted.channel.interval))
        wide = max(spikes.values["size"].value / white, 6.0) * sd
        return lambda e: np.asarray(
            np.logaddexp(
                np.log1p(-share) + log_normal_density(e, sd),
                np.log(share) + log_normal_density(e, wide),
            )
        )
    return lambda e: -0.5 * (e / sd) ** 2 - float(np.log(sd) + 0.5 * np.log(2.0 * np.pi))


def _user(before: FittedChannel, after: FittedChannel, test: _Test) -> dict[str, tuple[float, float]]:
    """Return how far the mean of a minute changes to the next one, and the white density, before and after."""
    unit, scale = before.channel.unit, before.channel.scale
    figures = {}
    size = round(PREDICTION_HORIZON / test.channel.interval)
    if len(test.channel) > 4 * size:
        changes = [_change(found, test, size) * scale for found in (before, after)]
        figures[f"bias_prediction_60s [{unit}]"] = (changes[0], changes[1])
    densities = []
    for found in (before, after):
        gain = float(gain_of(found.extensions, np.zeros(1), found.channel.interval)[0])
        densities.append(found.model.white_density() * float(np.sqrt(gain)) * scale)
    figures[f"white_density [{unit}/√Hz]"] = (densities[0], densities[1])
    return figures


def _change(fitted: FittedChannel, test: _Test, size: int) -> float:
    """Return the rms difference of adjacent means of `size` samples, what the model foretells taken out."""
    y = test.channel.y * (test.channel.scale / fitted.channel.scale) - _signal(fitted, test)
    means = y[: len(y) // size * size].reshape(-1, size).mean(axis=1)
    return float(np.sqrt(np.mean(np.diff(means) ** 2)))


def summed(gains: Sequence[Gain | None]) -> Gain | None:
    """Return the gain of one cause in several channels: mean a sample, sum of nats, figures of the first."""
    known = [gain for gain in gains if gain is not None]
    if not known:
        return None
    split = known[0].split if len({gain.split for gain in known}) == 1 else "in sample"
    return Gain(
        split,
        float(np.mean([gain.before for gain in known])),
        float(np.mean([gain.after for gain in known])),
        float(sum(gain.nats for gain in known)),
        known[0].coverage,
        known[0].user,
    )
