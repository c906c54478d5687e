"""Gain of an extension: log likelihood of data that had no part in its fit, and figures of use to a user.

The extensions are fitted again, one by one, to a record A: the same record as was diagnosed where there is a second
record B, else its first 60 %. With all parameters frozen, B is scored before and after each::

    ln p(B) = Σ_j ln h(e_j) − ½ Σ_k ln E_k

with E the spectrum of the model, e its residuals on B and h their law (normal, Student's, contaminated normal). A line
may choose its phase anew, for one nat; a variance that drifts goes on as it did; two levels count by what a switching
filter gains on the Gaussian one. What is an event of A (a step, a burst) is not in B: where it cannot be found again
its gain is that in sample, less the price of its parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from models.noise import NoiseModel, White
from tuner.diagnosis.static.causes.heavy_tails import HeavyTails
from tuner.diagnosis.static.causes.line import Line
from tuner.diagnosis.static.causes.motion import Motion
from tuner.diagnosis.static.causes.spikes import Spikes
from tuner.diagnosis.static.causes.telegraph import Telegraph
from tuner.diagnosis.static.causes.variance_drift import VarianceDrift
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.hypothesis_tests import retest
from tuner.diagnosis.static.model.dct import inverse, transform
from tuner.diagnosis.static.model.residual import Residual, gain_of, once, power_of, residual
from tuner.diagnosis.static.search import Accepted, SearchResult
from tuner.diagnosis.static.switching.models import block_noise
from tuner.types import Gain

FloatArray = NDArray[np.float64]

FITTED_SHARE = 0.6
"""Part of a single record that the parameters are taken from; chosen so that both parts are long."""
PREDICTION_HORIZON = 60.0
"""Length of the means whose change a user has to expect, s; chosen as that of an outage of GNSS."""


@dataclass(frozen=True)
class _Test:
    """Samples to be scored: a stretch of a context, which carries time and temperature from its start."""

    channel: Channel
    context: Channel
    first: int

    @cached_property
    def ramp(self) -> FloatArray:
        """Cosine coefficients 1 … n − 1 of an even slope."""
        n = len(self.channel)
        return transform(np.arange(n) / n - 0.5, self.channel.interval)[1:]


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
    whole = _still(outcome)
    train, test, split = whole, None, "second record"
    if second is not None:
        test = _Test(second, second, 0)
    else:
        cut = int(FITTED_SHARE * len(whole))
        part, rest = whole.part(0, cut), whole.part(cut, len(whole))
        split = "60/40"
        if part is not None and rest is not None:
            train, test = part, _Test(rest, whole, cut)
    if test is None:
        return tuple(replace(a, gain=_in_sample(outcome, a)) for a in outcome.accepted)
    found = residual(train)
    before = _score(found, test)
    n = len(test.channel)
    done = []
    for accepted in outcome.accepted:
        result = retest(found, accepted.extension.cause)
        if result is None or result.propose is None or result.gain <= 0:
            done.append(replace(accepted, gain=_in_sample(outcome, accepted)))
            continue
        extended = residual(train, (*found.extensions, *result.propose()), starts=found.starts)
        after = _score(extended, test)
        user = _user(found, extended, test)
        done.append(replace(accepted, gain=Gain(split, before / n, after / n, after - before, user=user)))
        found, before = extended, after
    return tuple(done)


def _still(outcome: SearchResult) -> Channel:
    """Return the channel without its stretches of motion and the levels between them."""
    channel = outcome.base.channel
    given = [x for x in outcome.base.extensions if isinstance(x, Motion)]
    y = outcome.base.cleaned.y.copy()
    at = 1
    for extension in given:
        columns = extension.columns(channel)
        size = columns.shape[1]
        y -= np.repeat(columns @ outcome.base.fit.beta[at : at + size], channel.block)
        at += size
    return replace(outcome.base.cleaned, y=y)


@once
def _own(fitted: Residual) -> float:
    """Return the score of a model on its own samples."""
    return _score(fitted, _Test(fitted.cleaned, fitted.channel, 0))


def _in_sample(outcome: SearchResult, accepted: Accepted) -> Gain:
    n = len(outcome.base.channel)
    before = _own(outcome.base) / n
    return Gain("in sample", before, before + accepted.result.gain / n, accepted.result.gain)


def _signal(fitted: Residual, test: _Test) -> FloatArray:
    """Return what the templates of the model foretell, shape (n,), in scales of the model."""
    beta, at = fitted.fit.beta, 1
    total = np.zeros(test.context.blocks)
    for extension in fitted.extensions:
        columns = extension.columns_elsewhere(test.context, same_record=test.first > 0)
        total += columns @ beta[at : at + columns.shape[1]]
        at += extension.columns(fitted.channel).shape[1]
    return np.repeat(total, test.context.block)[test.first : test.first + len(test.channel)]


def _score(fitted: Residual, test: _Test) -> float:
    """Return the log likelihood of a test under a model with frozen parameters, nats (up to a constant)."""
    dt, n = test.channel.interval, len(test.channel)
    y = test.channel.y * (test.channel.scale / fitted.channel.scale) - _signal(fitted, test)
    charge = 0.0
    for extension in fitted.extensions:
        if isinstance(extension, Line):
            phase = 2.0 * np.pi * extension.frequency * dt * np.arange(n)
            z = 2.0 / n * complex(np.sum((y - y.mean()) * np.exp(-1j * phase)))
            y = y - np.real(z * np.exp(1j * phase))
            charge += 1.0
        if isinstance(extension, Telegraph):
            step = test.channel.block * dt
            charge -= extension.lead(test.channel.block_mean(y), step, block_noise(fitted.fit.terms(), step))
    power = _power(fitted, n)
    a = transform(y, dt)[1:]
    weighted = test.ramp / power
    a = a - test.ramp * float((a @ weighted) / (test.ramp @ weighted))
    whitened = np.concatenate(([0.0], a / np.sqrt(power)))
    spread = np.zeros(n)
    for extension in fitted.extensions:
        if isinstance(extension, VarianceDrift):
            spread += extension.foretold(fitted.channel, test.context)[test.first : test.first + n]
    valid = test.channel.valid
    e, spread = (inverse(whitened, 1.0) * np.exp(-0.5 * spread))[valid], spread[valid]
    return float(_law(fitted)(e).sum() - 0.5 * spread.sum() - 0.5 * np.log(power).sum() * len(e) / n - charge)


def _power(fitted: Residual, n: int) -> FloatArray:
    """Return the spectrum of the model at the n − 1 frequencies of another record."""
    dt = fitted.channel.interval
    f = np.arange(1.0, n) / (2.0 * n * dt)
    white = sum(term.density**2 for term in fitted.fit.terms() if isinstance(term, White))
    others = [term for term in fitted.fit.terms() if not isinstance(term, White)]
    others += [term for x in fitted.extensions if isinstance(x, Telegraph) for term in x.terms(dt)]
    shaped = white * gain_of(fitted.extensions, f, dt) + power_of(fitted.extensions, f, dt)
    return shaped + NoiseModel(others).psd(f, interval=dt)


def _law(fitted: Residual) -> Callable[[FloatArray], FloatArray]:
    """Return the log density of the residuals as fitted."""
    raw = fitted.e[fitted.valid] * fitted.spread
    tails = next((x for x in fitted.extensions if isinstance(x, HeavyTails)), None)
    spikes = next((x for x in fitted.extensions if isinstance(x, Spikes)), None)
    sd = float(np.std(raw))
    if tails is not None:
        return lambda e: tails.log_density(e / fitted.spread) - float(np.log(fitted.spread))
    if spikes is not None:
        share = max(spikes.values["rate"].value * fitted.channel.interval, 1e-8)
        wide = (
            max(spikes.values["size"].value / float(np.sqrt(fitted.power[-1] / fitted.channel.interval)), 6.0)
            * sd
        )
        return lambda e: np.asarray(
            np.logaddexp(
                np.log1p(-share) + norm.logpdf(e, 0.0, sd), np.log(share) + norm.logpdf(e, 0.0, wide)
            )
        )
    return lambda e: np.asarray(norm.logpdf(e, 0.0, sd))


def _user(before: Residual, after: Residual, test: _Test) -> dict[str, tuple[float, float]]:
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


def _change(fitted: Residual, test: _Test, size: int) -> float:
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
