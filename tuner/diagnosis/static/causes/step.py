"""Step: a bias that jumps once.

Statistic: likelihood ratio of a step at the best of all block boundaries, the noise refitted; Davies' bound over
the boundaries. Extension: a template; its time by the profile of the likelihood, to the sample where the step is clear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from models.arrays import FloatArray
from models.effects.static.events import Step as Effect
from models.robust import normal_sd
from tuner.diagnosis.static.causes.base import Value
from tuner.diagnosis.static.causes.template import Template
from tuner.diagnosis.static.channel import Channel
from tuner.diagnosis.static.model import jump
from tuner.diagnosis.static.model.dct import block_transform
from tuner.diagnosis.static.model.fitted_channel import FittedChannel
from tuner.diagnosis.static.model.profile_likelihood import MIN_LOG_CHANGE, first_column
from tuner.diagnosis.static.model.score_scan import judge, scan_steps
from tuner.diagnosis.static.outcome import NO_GAIN, TestResult

GROSS_WINDOW = 64
"""Samples on either side of a gross step whose means are compared: their difference is known to 0.2 white sds."""
GROSS_STEP = 10.0
"""Change of these means, in white sds, that goes before any noise is fitted.

Chosen far beyond heavy tails and far above what a fit of the noise could take up without harm to the other tests.
"""
GROSS_DEVIATE = 12.0
"""The same in robust sds of all such changes, so that coloured noise and a walk are no steps."""
SHARP_SHARE, LASTING_SHARE = 0.7, 0.5
"""Shares of a gross step that lie within a few samples, and that are still there after eight windows.

Chosen apart from a bump (0) and a transient, and below 1 for the noise that moves on meanwhile.
"""
PLACES_IN_PAIRS = 96
"""Places tried beside another cause: about every hundredth of a record, as wide as a step among them is known."""


@dataclass(frozen=True)
class Step(Template):
    """A step before sample `first`.

    On the blocks it is a template, the block it falls into part of the way. Where its size is known, `jump` in scales,
    its fast part is taken out of the samples. Of a gross one so much, `taken`, goes out of the samples, and the
    template is left with the rest.
    """

    cause = "step"
    effect = Effect
    meaning = "the bias jumps once and stays; the noise alone would have to be called a random walk for it"
    consequence = (
        "keep the jump out of the random walk; a filter that meets such jumps needs its bias variance "
        "opened at that moment"
    )
    repeats = 4
    contained_in = ("telegraph",)
    happens_once = True
    size = ("size", "{u}")
    statistic = "likelihood ratio of a step"
    first: int
    jump: float = 0.0
    taken: float = 0.0

    def template(self, channel: Channel) -> FloatArray:
        """Return the step on the blocks, shape (M,)."""
        share = np.arange(1, channel.blocks + 1) - self.first / channel.block
        return np.asarray(np.clip(share, 0.0, 1.0))

    def columns_elsewhere(self, channel: Channel, *, same_record: bool) -> FloatArray:  # noqa: ARG002
        """Return zeros: elsewhere the level has no such jump."""
        return np.zeros((channel.blocks, 1))

    @classmethod
    def candidates_in_pairs(cls, channel: Channel) -> Sequence[Self]:
        """Return steps all over the record."""
        places = np.linspace(0.02, 0.98, PLACES_IN_PAIRS) * channel.blocks
        return [cls(int(m) * channel.block) for m in places]

    @classmethod
    def choice(cls, channel: Channel) -> float:
        """Return the price of a place, nats."""
        return float(np.log(channel.blocks / 8.0))

    @classmethod
    def test(cls, fitted: FittedChannel) -> TestResult:
        """Search for a jump of the slow track."""
        scores, channel = scan_steps(fitted), fitted.channel
        if not scores.promising:
            return TestResult(cls.cause, 1.0, NO_GAIN, float(scores.score[scores.best] ** 2), cls.statistic)
        boundary = scores.best + 1
        best = cls(boundary * channel.block)
        template = block_transform(best.columns(channel), fitted.cleaned, fitted.track.singles)
        result = judge(fitted, template[:, 0], scores.correlation, price=cls.choice(channel))

        def propose() -> tuple[Step]:
            return (replace(best, values={"time": jump.likely_time(fitted, scores, boundary)}),)

        return TestResult(cls.cause, result.p_value, result.gain, result.ratio, cls.statistic, propose)

    def likeliest(self, fitted: FittedChannel) -> Self:
        """Return the best step about as far away as the candidates are apart."""
        scores, channel = scan_steps(fitted), fitted.channel
        boundary, reach = self.first // channel.block, channel.blocks // PLACES_IN_PAIRS
        first = max(1, boundary - reach)
        best = first + int(np.argmax(np.abs(scores.score[first - 1 : boundary + reach])))
        time = jump.likely_time(fitted, scores, best)
        return replace(self, first=best * channel.block, values={"time": time})

    def clean_samples(self, channel: Channel) -> Channel:
        """Take out what the slow track does not show of the step, or what is known of a gross one."""
        if self.taken:
            return replace(channel, y=channel.y - self.taken * self.course(channel))
        if not self.jump:
            return channel
        return replace(
            channel, y=channel.y - jump.above_slow_track(channel, self.jump * self.course(channel))
        )

    def course(self, channel: Channel) -> FloatArray:
        """Return the step of size 1 on the samples, shape (n,)."""
        return np.where(np.arange(len(channel)) >= self.first, 1.0, 0.0)

    def with_joint_estimate(self, fitted: FittedChannel, index: int, size: Value) -> Self:
        """Take the size from the joint fit, beside what was taken out of the samples."""
        whole = Value(self.taken + size.value, self.taken + size.lower, self.taken + size.upper)
        return super().with_joint_estimate(fitted, index, whole)

    def refit(self, fitted: FittedChannel, index: int) -> Step:
        """Place the step to the sample, with the size it has there."""
        if self.taken:
            return self
        size = float(fitted.fit.beta[first_column(fitted, index)])
        if self.jump != 0.0 and abs(size - self.jump) < MIN_LOG_CHANGE * abs(size):
            return self
        channel, time = fitted.channel, self.values["time"]
        begin, end = (round(channel.place(t)) for t in (time.lower, time.upper))
        if end - begin > jump.CLEAR_BLOCKS * channel.block:
            return replace(self, jump=size)
        fast = jump.above_slow_track(channel, self.jump * self.course(channel))
        whole = replace(fitted.cleaned, y=fitted.cleaned.y + fast)
        lowest = 1.0 / (jump.CLEAR_BLOCKS * channel.block * channel.interval)
        noise = float(fitted.power_at(lowest)) / channel.interval
        first, placed = jump.placed(whole, begin, end, size, max(noise, 1.0))
        return Step(first, size, values={"time": placed})


def gross(channel: Channel, apart: Sequence[tuple[int, int]] = ()) -> TestResult | None:
    """Return the test result of jumps that are large against all noise; None where there are none, or too many.

    Parameters
    ----------
    channel : Channel
        Samples, without those that are missing.
    apart : sequence of (int, int)
        Stretches of samples at whose edges levels are known to change.
    """
    n, w = len(channel), GROSS_WINDOW
    total = np.empty(n + 1)
    total[0] = 0.0
    np.cumsum(channel.y, out=total[1:])
    change = total[2 * w :] - total[w : n + 1 - w]
    change -= total[w : n + 1 - w]
    change += total[: n + 1 - 2 * w]
    change /= w
    del total
    usual = float(normal_sd(change))
    size = np.abs(change)
    large = np.flatnonzero(size > max(GROSS_STEP, GROSS_DEVIATE * usual))
    if not len(large):
        return None
    found = []
    for group in np.split(large, np.flatnonzero(np.diff(large) > 2 * w) + 1):
        first = int(group[np.argmax(size[group])]) + w
        if not any(a - 2 * w < first < b + 2 * w for a, b in apart):
            found.append((first, float(change[first - w])))
    if not found or len(found) > Step.repeats or not all(_jumps(channel.y, *one) for one in found):
        return None
    steps = tuple(
        Step(first, taken=jump, values={"time": Value.moment(channel, first, first - 1, first + 1)})
        for first, jump in found
    )
    most = max(abs(jump) for _, jump in found)
    gain = 0.25 * w * most**2
    return TestResult(Step.cause, 0.0, gain, most, f"change between means of {w} samples", lambda: steps)


def _jumps(y: FloatArray, first: int, jump: float) -> bool:
    """Return whether the level changes by `jump` within a few samples, and stays."""
    near, far = GROSS_WINDOW // 8, 8 * GROSS_WINDOW
    sharp, lasting = (
        float(
            np.median(y[first + gap : first + gap + width])
            - np.median(y[max(0, first - gap - width) : first - gap])
        )
        for gap, width in ((near // 2, near), (GROSS_WINDOW // 2, far))
    )
    return sharp / jump > SHARP_SHARE and lasting / jump > LASTING_SHARE
