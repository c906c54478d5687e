"""Recovery: a bias that jumps once and decays back, as after an overload or a knock.

Statistic: likelihood ratio of an exponential transient from the best block boundary, the noise refitted; Davies' bound
over boundaries and time constants. The sums over all boundaries are one recursion; their norms, which change slowly
with the place, are computed at some of them. Extension: a template. A warm-up is one that begins with the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.events import Recovery as Effect
from models.recursion import decaying_sum
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.template import TimeConstantTemplate
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model import jump
from tuner.diagnosis.static.model.dct import block_sums, block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel, without
from tuner.diagnosis.static.model.null_distributions import EDGE_NATS, SLOW_RATIO_FACTOR, davies
from tuner.diagnosis.static.model.profile_likelihood import first_column
from tuner.diagnosis.static.model.score_scan import Scan, judge, project, rest, scan, weights
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult
from tuner.diagnosis.static.variance.quantized_noise import hides_noise

MIN_BLOCKS, MAX_SHARE = 2.0, 1.0 / 12.0
"""Shortest time constant, blocks, and longest, as a share of the record: beyond, a step or a walk looks like it."""
TIME_CONSTANTS = 6
"""Time constants of the scan, a factor of three apart: one between two of them correlates by 0.93 with either."""
NORM_PLACES = 24
"""Places at which the norm of a template is computed, denser towards the ends, where it changes."""
LASTING_CONSTANTS = 3.0
"""Time constants within which a transient has nearly all of its power."""
PLACES_A_BLOCK = 8
"""Places tried within a block once it is known."""


@dataclass(frozen=True)
class Recovery(TimeConstantTemplate):
    """exp(−(t − t_first)/time_constant) from sample `first` on; the fast part of `jump` times it leaves the samples."""

    cause = "recovery"
    effect = Effect
    meaning = "the bias jumps once and decays back, as after an overload or a knock"
    consequence = (
        "leave out some time constants after such an event; "
        "a filter needs its bias variance opened at that moment"
    )
    repeats = 4
    contained_in = ("telegraph",)
    happens_once = True
    size = ("size", "{u}")
    statistic = "likelihood ratio of a transient after an event"
    first: int = 0
    jump: float = 0.0

    def template(self, channel: Channel) -> FloatArray:
        """Return the transient on the blocks, shape (M,)."""
        constant = self.time_constant / channel.interval
        after = np.maximum(np.arange(channel.blocks + 1) * channel.block - self.first, 0) / constant
        return np.asarray(np.diff(-np.expm1(-after)) * constant / channel.block)

    def course(self, channel: Channel) -> FloatArray:
        """Return the transient of size 1 on the samples, shape (n,)."""
        after = np.arange(len(channel)) - self.first
        course = np.exp(-np.maximum(after, 0) * channel.interval / self.time_constant)
        return np.where(after >= 0, course, 0.0)

    def columns_elsewhere(self, channel: Channel, *, same_record: bool) -> FloatArray:  # noqa: ARG002
        """Return zeros: elsewhere there is no such event."""
        return np.zeros((channel.blocks, 1))

    def clean_samples(self, channel: Channel) -> Channel:
        """Take out what the slow track does not show of it."""
        if not self.jump:
            return channel
        return replace(
            channel, y=channel.y - jump.above_slow_track(channel, self.jump * self.course(channel))
        )

    @classmethod
    def time_constants(cls, channel: Channel) -> FloatArray:
        """Return the time constants of the scan, s."""
        shortest = MIN_BLOCKS * channel.block * channel.interval
        return np.geomspace(shortest, MAX_SHARE * channel.span, TIME_CONSTANTS)

    @classmethod
    def choice(cls, channel: Channel) -> float:
        """Return the price of a place and a time constant, nats."""
        return float(np.log(channel.blocks / 8.0) + np.log(0.5 * TIME_CONSTANTS))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult | None:
        """Search for a transient of any time constant at any block boundary.

        None where a quantizer hides the noise: means of a few blocks have no normal law there.
        """
        channel = fitted.channel
        if hides_noise(fitted):
            return None
        constants = cls.time_constants(channel)
        scans = [_scan(fitted, constant) for constant in constants.tolist()]
        which = max(range(len(scans)), key=lambda i: abs(scans[i].score[scans[i].best]))
        best = scans[which]
        if not best.promising:
            return TestResult(cls.cause, 1.0, NO_GAIN, float(best.score[best.best] ** 2), cls.statistic)
        found = cls(float(constants[which]), (best.best + 1) * channel.block).likeliest(fitted)
        template = block_transform(found.columns(channel), fitted.cleaned, fitted.track.singles)
        correlation = np.concatenate([one.correlation for one in scans])
        result = judge(fitted, template[:, 0], correlation, price=cls.choice(channel))
        ratio = result.ratio / found.noise_ratio(fitted.cleaned)
        gain = result.gain - 0.5 * (result.ratio - ratio)
        chance = davies(SLOW_RATIO_FACTOR * ratio, correlation)
        return TestResult(cls.cause, chance, gain, ratio, cls.statistic, lambda: (found,))

    def noise_ratio(self, channel: Channel) -> float:
        """Return the variance of the noise while it lasts ÷ that of the record, by differences; not less than 1.

        The likelihood has one variance for all of the record: a mean of a burst would be far too large for it.
        """
        last = self.first + round(LASTING_CONSTANTS * self.time_constant / channel.interval)
        step = np.diff(channel.y[self.first : max(last, self.first + 2)])
        return max(0.5 * float(np.mean(step**2)), 1.0)

    def likeliest(self, fitted: FittedChannel) -> Self:
        """Return the transient near this one that scores most: its place in parts of a block, and its time constant."""
        found = self
        for _ in range(2):
            found = found._placed(fitted)
            found = super(Recovery, found).likeliest(fitted)
        return found

    def refit(self, fitted: FittedChannel, index: int) -> Self:
        """Fit the time constant again, and take the size as it is."""
        other = super().refit(fitted, index)
        return replace(other, jump=float(fitted.fit.beta[first_column(fitted, index)]))

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Self:
        """Take time, size and time constant from the joint fit."""
        bare = without(fitted, index)
        tried = self._near(fitted.channel)
        square = scan(bare, np.stack([one.template(fitted.channel) for one in tried], axis=1))[0].score ** 2
        near = np.flatnonzero(square > square.max() - 2.0 * EDGE_NATS / SLOW_RATIO_FACTOR)
        part = fitted.channel.block / PLACES_A_BLOCK
        ends = min(tried[near[0]].first, self.first) - part, max(tried[near[-1]].first, self.first) + part
        reach = Value.moment(fitted.channel, self.first, *ends)
        estimated = super().with_joint_estimate(fitted, index, size)
        return replace(estimated, values={"time": reach, **estimated.values})

    def _near(self, channel: Channel) -> Sequence[Self]:
        """Return transients whose beginning lies within two blocks of this one's."""
        offsets = np.arange(-2 * PLACES_A_BLOCK, 2 * PLACES_A_BLOCK + 1) * channel.block / PLACES_A_BLOCK
        places = np.unique(
            np.clip(self.first + np.rint(offsets).astype(int), 0, len(channel) - channel.block)
        )
        return [replace(self, first=int(place)) for place in places]

    def _placed(self, fitted: FittedChannel) -> Self:
        """Return the one of these that scores most."""
        tried = self._near(fitted.channel)
        scores, _ = scan(fitted, np.stack([one.template(fitted.channel) for one in tried], axis=1))
        return tried[scores.best]


def _scan(fitted: FittedChannel, time_constant: float) -> Scan:
    """Score a transient of one time constant, s, from each block boundary 1 … M − 1."""
    channel, m = fitted.channel, fitted.channel.blocks
    blocks = time_constant / (channel.block * channel.interval)
    first = max(4, m // 500, int(np.ceil(0.5 * blocks)))
    each = block_sums(weights(fitted) * rest(fitted), channel)
    total = -np.expm1(-1.0 / blocks) * blocks * decaying_sum(each[::-1], float(np.exp(-1.0 / blocks)))[::-1]
    turn = np.linspace(0.0, np.pi, NORM_PLACES)
    places = np.unique(np.rint(first + 0.5 * (m - 2 * first) * (1.0 - np.cos(turn))).astype(int))
    pairs = [Recovery(time_constant, int(p + d) * channel.block) for p in places for d in (0, 1)]
    templates = np.stack([one.template(channel) for one in pairs], axis=1)
    white, norm = project(fitted, block_transform(templates, fitted.cleaned, fitted.track.singles))
    boundary = np.arange(1, m)
    score = total[1:] / np.interp(boundary, places, norm[::2])
    outside = (boundary < first) | (boundary > m - first)
    neighbours = np.sum(white[:, ::2] * white[:, 1::2], axis=0)
    return Scan(np.where(outside, 0.0, score), np.interp(boundary[:-1], places, neighbours))
