"""Motion: a stretch of a static log in which the sensor moved.

Statistic: steps between the means of blocks of 0.25 s and of 1 s over their standard deviation. That is taken from the
median over the record, and enlarged where the second differences of the samples are larger than usual: a burst of noise
is no motion, while a hand or a gust is slow against the samples. Several large ones close together make a stretch; the
threshold is far beyond chance.
Where the blocks are too long to see a hand turn the sensor, jumps from sample to sample do: several beyond
`JUMP_THRESHOLD` deviations close together, after which the level is another one, or in gyros and accelerometers
at once.
Extension: the stretch is taken out with the change of level over it, and the level may differ further.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from models.arrays import SAMPLES_AT_ONCE, FloatArray, IndexArray
from models.effects.static.events import SWAY_FREQUENCY
from models.effects.static.events import Motion as Effect
from models.robust import normal_sd
from tuner.diagnosis.static.causes.base import Extension, Value, stretch_times
from tuner.diagnosis.static.channel import GAP_NEIGHBOURS, Channel

BLOCK_LENGTH = 0.25
"""Length of a short block, s: a hand or a gust is slower, the noise of a mean of samples is smaller than theirs."""
MIN_BLOCK_SAMPLES = 16
"""Least number of samples in a short block, so that its mean is close to normal whatever the noise."""
STEP_THRESHOLD = 10.0
"""Deviations that no still sensor reaches: t law of 30 degrees of freedom, 5e-11."""
MIN_LARGE_STEPS = 4
"""Least number of large steps that make a stretch: one or two are a step of the bias or a spike."""
MIN_GAP_BLOCKS = 40
"""Blocks without a large step that end a stretch: 10 s of short blocks."""
JUMP_THRESHOLD = 12.0
"""Jump between samples, in sds of the white noise, that a stationary sensor does not make: beyond heavy tails, too."""
HANDLING_TIME = 120.0
"""Time without a jump that ends the handling of a sensor, and what is left out before and after it, s.

Chosen as the time a person takes to turn a unit and let it settle.
"""
MAX_STRETCHES = 8
"""Most stretches that are kept apart; beyond, the closest are joined.

Chosen because each adds a free level: more of them would take up the slow noise.
"""
MIN_EDGE_BLOCKS = 3
"""Least number of blocks left out on either side of a stretch: a step is seen one block late."""
GROWTH_STEPS, GROWTH_RATIO, STEP_CLIP = 12, 6.0, 4.0
"""A stretch grows by so many steps while their mean square exceeds so many medians (a still sensor: 2.2 ± 0.9), steps
cut at so many deviations."""

MAX_UNSEEN_SHARE = 0.3
"""Largest share of a motion below the noise, at either end; chosen for swaying that decays exponentially."""
MARGIN_SHARE = 0.1
"""Share of a stretch that is left out on either side, because motion decays into the noise."""
MAX_REGROWTH = 8.0
"""Deviations by which a step of a transient may exceed one before: noise, of which both have √3, by 3 sds."""


NOISE_RATIO = 2.0
"""Sd in a motion ÷ that beside it from which a channel shows it: half of what the variance of seconds takes for one."""
EDGE_SECONDS = 2.0
"""Time at either end of samples in motion in which it begins or ends, s: a second that moves, and the one beside it."""
Ranges = Sequence[tuple[int, int]]
"""Ranges of samples, start and stop."""


class Stretch(NamedTuple):
    """A stretch of motion: samples first … last − 1 are left out, from `begun` to `ended` it is certain.

    What sways dies away under the noise: motion begins at most `unseen` samples before `first`, at the latest at
    `begun`, and ends likewise.
    """

    first: int
    last: int
    begun: int
    ended: int
    unseen: int = 0

    def joined(self, other: Stretch) -> Stretch:
        """Return the stretch that holds both."""
        return Stretch(
            min(self.first, other.first),
            max(self.last, other.last),
            min(self.begun, other.begun),
            max(self.ended, other.ended),
            max(self.unseen, other.unseen),
        )


@dataclass(frozen=True)
class Motion(Extension):
    """Motion in samples first … last − 1, which are not used."""

    cause = "motion"
    effect = Effect
    group = "several channels"
    shares = 0
    meaning = "the sensor was not still: an Allan curve of the whole record would be that of the motion"
    consequence = "identify from the still parts only; nothing here is sensor noise"
    first: int
    last: int

    def clean_samples(self, channel: Channel) -> Channel:
        """Take the stretch out, and the change of level over it as far as a few samples beside it show.

        The template is left with the rest: blocks are too coarse for a change of hundreds of deviations.
        """
        missing = np.zeros(len(channel), dtype=bool)
        missing[self.first : self.last] = True
        y = channel.y.copy()
        if self.first > 0 and self.last < len(channel):
            before = np.median(y[max(0, self.first - GAP_NEIGHBOURS) : self.first])
            y[self.last :] -= np.median(y[self.last : self.last + GAP_NEIGHBOURS]) - before
        return replace(channel, y=y).refilled(missing, np.random.default_rng(self.first))

    def columns(self, channel: Channel) -> FloatArray:
        """Return the line that bridges it, from one level to the other: another pose has another level."""
        if self.first == 0 or self.last == len(channel):
            return np.empty((channel.blocks, 0))
        place = (np.arange(channel.blocks) + 0.5) * channel.block
        return np.clip((place - self.first) / (self.last - self.first), 0.0, 1.0)[:, None]

    def columns_elsewhere(self, channel: Channel, *, same_record: bool) -> FloatArray:  # noqa: ARG002
        """Return zeros: elsewhere the level moves otherwise."""
        return np.zeros_like(self.columns(channel))

    def near(self, first: int, last: int, interval: float) -> bool:
        """Return whether an event, samples first … last − 1, lies close to an edge of the stretch."""
        reach = round(HANDLING_TIME / interval) + (self.last - self.first) // 2
        short = last - first <= reach
        return short and last >= self.first - reach and first <= self.last + reach

    def including(self, first: int, last: int, n: int) -> Motion:
        """Return the stretch with an event at its edge, and a margin about that, in a record of n samples."""
        margin = max(MIN_BLOCK_SAMPLES, round(MARGIN_SHARE * (self.last - self.first)))
        return replace(
            self, first=max(0, min(self.first, first - margin)), last=min(n, max(self.last, last + margin))
        )


def large_steps(y: FloatArray, interval: float, length: float) -> tuple[FloatArray, int]:
    """Return the steps between blocks of `length`, s, over their standard deviation, and the samples in a block.

    Steps in a row of one sign at the beginning of a record, none much larger than the one before, are 0: a sensor that
    warms up.
    """
    size = max(MIN_BLOCK_SAMPLES, round(length / interval))
    blocks = y[: len(y) // size * size].reshape(-1, size)
    step = np.diff(blocks.mean(axis=1))
    usual = float(normal_sd(step)) + 1e-15
    rows = max(1, SAMPLES_AT_ONCE // size)
    local = 1e-30 + np.concatenate(
        [
            np.mean(np.diff(blocks[at : at + rows], 2, axis=1) ** 2, axis=1)
            for at in range(0, max(len(blocks), 1), rows)
        ]
    )
    variance_ratio = 0.5 * (local[1:] + local[:-1]) / float(np.median(local))
    ratio = np.abs(step) / (usual * np.sqrt(np.maximum(variance_ratio, 1.0)))
    return np.where(np.arange(len(ratio)) < _settling(step, ratio), 0.0, ratio), size


def _settling(step: FloatArray, ratio: FloatArray) -> int:
    """Return how many blocks at the beginning only settle: their large steps are of one sign and shrink."""
    large = np.flatnonzero(ratio > STEP_THRESHOLD)
    if not len(large) or large[0] > 1:
        return 0
    first = np.split(large, np.flatnonzero(np.diff(large) > MIN_GAP_BLOCKS) + 1)[0]
    shrinks = ratio[first[1:]] < np.minimum.accumulate(ratio[first])[:-1] + MAX_REGROWTH
    settles = bool(np.all(shrinks)) and len(set(np.sign(step[first]).tolist())) == 1
    return int(first[-1]) + 1 if settles else 0


def stretches(channels: list[Channel]) -> list[Stretch]:
    """Return the moved stretches of channels with one clock."""
    return together([*_swayed(channels), *_turned(channels)])


def together(found: Iterable[Stretch]) -> list[Stretch]:
    """Return stretches in order, those that touch joined, and the closest where they are more than `MAX_STRETCHES`."""
    joined: list[Stretch] = []
    for stretch in sorted(found):
        if joined and stretch.first <= joined[-1].last:
            joined[-1] = joined[-1].joined(stretch)
        else:
            joined.append(stretch)
    while len(joined) > MAX_STRETCHES:
        gaps = [later.first - earlier.last for earlier, later in pairwise(joined)]
        at = int(np.argmin(gaps))
        joined[at : at + 2] = [joined[at].joined(joined[at + 1])]
    return joined


def outside(found: Iterable[Stretch], first: int, last: int) -> list[Stretch]:
    """Return what stretches of motion have before and after samples first … last − 1, which are at rest."""
    parts = []
    for one in found:
        if one.first >= last or one.last <= first:
            parts.append(one)
            continue
        before = Stretch(one.first, first, min(one.begun, first), min(one.ended, first))
        after = Stretch(last, one.last, max(one.begun, last), max(one.ended, last))
        parts += [part for part in (before, after) if part.last > part.first]
    return parts


def met(found: Iterable[Stretch], moving: Ranges) -> list[tuple[int, int]]:
    """Return the ranges of samples in motion of which stretches hold some."""
    known = tuple(found)
    return [part for part in moving if any(_meet(one, part) for one in known)]


def missed(channels: list[Channel], found: Iterable[Stretch], moving: Ranges) -> list[tuple[int, int]]:
    """Return the ranges of samples in motion of which no stretch holds any, and which are motion all the same.

    Several channels are noisier in one, and the level is the same after it: else it is a burst of one axis, a step or a
    transient.
    """
    known = met(found, moving)
    return [part for part in moving if part not in known and _shakes(channels, part)]


def _shakes(channels: list[Channel], part: tuple[int, int]) -> bool:
    """Return whether several channels are noisier in a range than beside it, and none changes its level."""
    n, (first, last) = len(channels[0]), part
    beside = [(max(0, first - GAP_NEIGHBOURS), first), (last, min(n, last + GAP_NEIGHBOURS))]
    beside = [one for one in beside if one[1] > one[0]]
    levels = [_level(channels, *one) for one in (part, *beside)]
    if not beside or float(np.ptp(levels, axis=0).max()) > 0.5 * JUMP_THRESHOLD:
        return False
    shaken = [
        np.std(c.y[first:last]) > NOISE_RATIO * max(float(np.std(c.y[a:b])) for a, b in beside)
        for c in channels
    ]
    return bool(sum(shaken) > 1)


def motions(
    channel: Channel, found: Iterable[Stretch], moving: Ranges
) -> list[tuple[Stretch, Mapping[str, Value]]]:
    """Return when the sensor moved: samples known to be in motion, and stretches that hold none of these.

    Other stretches hold what is about motions and between them, too; they bound where these motions begin and end.

    Parameters
    ----------
    channel : Channel
        One of those that moved together.
    found : iterable of Stretch
        What steps of means and samples show.
    moving : sequence of (start, stop)
        Samples in motion, as the variance of seconds shows them.

    Returns
    -------
    list of (Stretch, mapping of str to Value)
        Each motion in order of time, with its ``start`` and ``duration``.
    """
    known, edge = tuple(found), round(EDGE_SECONDS / channel.interval)
    out = [
        (one, extension(channel, one).values) for one in known if not any(_meet(one, part) for part in moving)
    ]
    for first, last in moving:
        about = [one for one in known if _meet(one, (first, last))]
        middle, unseen = (first + last) // 2, max((one.unseen for one in about), default=edge)
        begun = max([min(first + edge, middle), *(one.begun for one in about if first <= one.begun < last)])
        ended = min([max(last - edge, middle), *(one.ended for one in about if begun < one.ended <= last)])
        outer = max(first - unseen, 0), min(last + unseen, len(channel))
        values = stretch_times(channel, (first, last), outer, (begun, ended))
        out.append((Stretch(first, last, begun, max(ended, begun), unseen), values))
    return sorted(out, key=lambda one: one[0].first)


def _meet(one: Stretch, part: tuple[int, int]) -> bool:
    """Return whether a stretch and a range of samples have some in common."""
    return one.first < part[1] and one.last > part[0]


def moved(channel: Channel, stretch: Stretch) -> bool:
    """Return whether an axis shows a stretch of motion: large steps of its means or samples, or another level after."""
    inside = slice(stretch.first, stretch.last)
    for length in (BLOCK_LENGTH, 4.0 * BLOCK_LENGTH):
        ratio, size = large_steps(channel.y, channel.interval, length)
        if np.any(ratio[stretch.first // size : stretch.last // size] > STEP_THRESHOLD):
            return True
    if np.any(np.abs(np.diff(channel.y[inside])) > JUMP_THRESHOLD * np.sqrt(2.0)):
        return True
    before, after = (
        channel.y[max(0, stretch.first - GAP_NEIGHBOURS) : stretch.first],
        channel.y[stretch.last : stretch.last + GAP_NEIGHBOURS],
    )
    return bool(
        len(before) and len(after) and abs(np.median(after) - np.median(before)) > 0.5 * JUMP_THRESHOLD
    )


def _swayed(channels: list[Channel]) -> list[Stretch]:
    """Return the stretches that steps of short means show, on two scales."""
    found, sizes = [], set()
    for length in (BLOCK_LENGTH, 4.0 * BLOCK_LENGTH):
        ratio, size = large_steps(channels[0].y, channels[0].interval, length)
        for channel in channels[1:]:
            ratio = np.maximum(ratio, large_steps(channel.y, channel.interval, length)[0])
        if size not in sizes:
            found += _groups(ratio, size, len(channels[0]))
        sizes.add(size)
    return found


def _groups(ratio: FloatArray, size: int, n: int) -> list[Stretch]:
    """Return the stretches that steps between blocks of `size` samples show."""
    large = np.flatnonzero(ratio > STEP_THRESHOLD)
    if len(large) < MIN_LARGE_STEPS:
        return []
    usual = float(np.median(np.minimum(ratio, STEP_CLIP) ** 2))
    power = np.minimum(ratio, STEP_CLIP) ** 2 / usual
    found = []
    for group in np.split(large, np.flatnonzero(np.diff(large) > MIN_GAP_BLOCKS) + 1):
        if len(group) < MIN_LARGE_STEPS:
            continue
        first, last = int(group[0]), int(group[-1])
        while first > 0 and power[max(0, first - GROWTH_STEPS) : first].mean() > GROWTH_RATIO:
            first = max(0, first - GROWTH_STEPS // 4)
        while last < len(power) and power[last : last + GROWTH_STEPS].mean() > GROWTH_RATIO:
            last = min(len(power), last + GROWTH_STEPS // 4)
        margin = MIN_EDGE_BLOCKS + round(MARGIN_SHARE * (last - first))
        begun, ended = (int(group[0]) + 2) * size, int(group[-1]) * size
        unseen = max(0, round(_foot(float(ratio[group].max())) * (last + 1 - first)) - margin) * size
        outer = max(0, (first - margin) * size), min(n, (last + 1 + margin) * size)
        found.append(Stretch(*outer, begun, ended, unseen))
    return found


def _foot(peak: float) -> float:
    """Return how much of a motion lies before the part of it that is seen ÷ that part, by its largest step.

    Under a swell sin²(πx), x from 0 to 1, of which what exceeds `STEP_THRESHOLD` is seen.
    """
    x = min(float(np.arcsin(np.sqrt(STEP_THRESHOLD / peak))) / np.pi, MAX_UNSEEN_SHARE)
    return x / (1.0 - 2.0 * x)


def _turned(channels: list[Channel]) -> list[Stretch]:
    """Return the stretches that jumps of samples show, where the level before and after differs."""
    n = len(channels[0])
    jumps = np.unique(np.concatenate([_jumps(channel.y) for channel in channels]))
    if len(jumps) < MIN_LARGE_STEPS:
        return []
    apart = max(MIN_GAP_BLOCKS, round(HANDLING_TIME / channels[0].interval))
    found = []
    for group in np.split(jumps, np.flatnonzero(np.diff(jumps) > apart) + 1):
        first, last = int(group[0]), int(group[-1]) + 1
        if len(group) < MIN_LARGE_STEPS:
            continue
        before, after = (max(0, first - apart), first), (last + 1, min(n, last + 1 + apart))
        if (
            before[0] == before[1] or after[0] >= after[1]
        ):  # at an end of the record: the level changes inside
            before, after = (first, (first + last) // 2 + 1), (first, last + 1 + apart)
        change = np.abs(_level(channels, *after) - _level(channels, *before))
        if float(change.max()) > 0.5 * JUMP_THRESHOLD or _felt(channels, first, last):
            found.append(Stretch(max(0, first - apart), min(n, last + apart), first + 1, last))
    return found


def _jumps(y: FloatArray) -> IndexArray:
    """Return the samples, shape (m,), from which a channel (n,) jumps to the next one."""
    return np.concatenate(
        [
            start
            + np.flatnonzero(
                np.abs(np.diff(y[start : start + SAMPLES_AT_ONCE + 1])) > JUMP_THRESHOLD * np.sqrt(2.0)
            )
            for start in range(0, len(y) - 1, SAMPLES_AT_ONCE)
        ]
    )


def _level(channels: list[Channel], first: int, last: int) -> FloatArray:
    """Return the median of each channel over samples first … last − 1, shape (k,)."""
    return np.array([float(np.median(channel.y[first:last])) for channel in channels])


def _felt(channels: list[Channel], first: int, last: int) -> bool:
    """Return whether sensors of two kinds jump within samples first … last: noise of one never does that to both."""
    jumps = {
        channel.unit
        for channel in channels
        if np.sum(np.abs(np.diff(channel.y[first : last + 1])) > JUMP_THRESHOLD * np.sqrt(2.0))
        >= MIN_LARGE_STEPS
    }
    return len(jumps) > 1


def sway(channel: Channel, stretch: Stretch) -> Value:
    """Return the standard deviation, scales, of the motion in the middle half of its stretch: it swells and ebbs.

    It sways at about `SWAY_FREQUENCY`, so that a stretch shows it twice a period.
    """
    quarter = (stretch.ended - stretch.begun) // 4
    inside = channel.y[stretch.begun + quarter : max(stretch.ended - quarter, stretch.begun + quarter + 2)]
    sd = float(np.sqrt(max(float(np.var(inside)) - 1.0, 1.0)))
    number = max(2.0 * len(inside) * channel.interval * SWAY_FREQUENCY, 1.0)
    return Value.log(sd, float(np.sqrt(0.5 / number)), "{u}")


def extension(channel: Channel, stretch: Stretch) -> Motion:
    """Return the stretch with its place: between what may have moved and what certainly did."""
    first, last = max(stretch.first - stretch.unseen, 0), min(stretch.last + stretch.unseen, len(channel))
    inner = stretch.begun, stretch.ended
    likely = 0.5 * (first + stretch.begun), 0.5 * (last + max(stretch.ended, stretch.begun))
    values = stretch_times(channel, likely, (first, last), inner)
    return Motion(stretch.first, stretch.last, values=values)
