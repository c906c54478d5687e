"""Motion: a stretch in which the sensor was not still.

Statistic: steps between the means of short blocks over their standard deviation, which is the larger of that in the
rest of the record (from the median) and that of white noise as loud as the samples in the two blocks: a burst of
white noise is no motion. Several large ones close together make a stretch; the threshold is far beyond chance.
Where the blocks are too long to see a hand turn the sensor, jumps from sample to sample do: several beyond `JOLT`
deviations close together, after which the level is another one.
Extension: the stretch is taken out and the level may differ before and after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tuner.diagnosis.channel import Channel
from tuner.diagnosis.extension import Extension, Value

FloatArray = NDArray[np.float64]

SHORT = 0.25
"""Length of a short block, s."""
FEWEST = 16
"""Fewest samples in a short block."""
THRESHOLD = 10.0
"""Deviations that no still sensor reaches: t law of 30 degrees of freedom, 5e-11."""
TOGETHER = 4
"""Large steps that make a stretch."""
APART = 40
"""Blocks without a large step that end a stretch."""
JOLT = 12.0
"""Jump of a sample, in deviations of the white noise, that no still sensor makes."""
HANDLING = 120.0
"""Time without a jump that ends the handling of a sensor, and what is left out before and after it, s."""
MOST = 8
"""Stretches that are told apart; closer ones are joined beyond."""
RESTLESS, NEAR = 4.0, 12
"""A stretch grows to the last step of so many deviations with no more than so many quieter ones before it."""

MARGIN = 0.1
"""Share of a stretch that is left out on either side: motion dies away."""


@dataclass(frozen=True)
class Motion(Extension):
    """Samples first … last − 1 are not used."""

    cause: ClassVar[str] = "motion"
    meaning: ClassVar[str] = (
        "the sensor was not still: an Allan curve of the whole record would be that of the motion"
    )
    consequence: ClassVar[str] = "identify from the still parts only; nothing here is sensor noise"
    first: int
    last: int

    def repair(self, channel: Channel) -> Channel:
        """Take the stretch out."""
        missing = np.zeros(len(channel), dtype=bool)
        missing[self.first : self.last] = True
        return channel.refilled(missing, np.random.default_rng(self.first))

    def columns(self, channel: Channel) -> FloatArray:
        """Return the line that bridges it, from one level to the other: another pose has another level."""
        if self.first == 0 or self.last == len(channel):
            return np.empty((channel.blocks, 0))
        place = (np.arange(channel.blocks) + 0.5) * channel.block
        return np.clip((place - self.first) / (self.last - self.first), 0.0, 1.0)[:, None]


def large_steps(y: FloatArray, interval: float) -> tuple[FloatArray, int]:
    """Return the steps between short blocks over their standard deviation, and the samples in a block."""
    size = max(FEWEST, round(SHORT / interval))
    blocks = y[: len(y) // size * size].reshape(-1, size)
    mean, variance = blocks.mean(axis=1), blocks.var(axis=1, ddof=1)
    step = np.diff(mean)
    usual = float(np.median(np.abs(step))) / 0.6745
    local = (variance[1:] + variance[:-1]) / size
    return np.abs(step) / np.sqrt(np.maximum(usual**2, local) + 1e-30), size


def stretches(channels: list[Channel]) -> list[tuple[int, int]]:
    """Return the moved stretches of channels with one clock, as sample ranges."""
    found = sorted([*_swayed(channels), *_turned(channels)])
    joined: list[tuple[int, int]] = []
    for first, last in found:
        if joined and first <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(last, joined[-1][1]))
        else:
            joined.append((first, last))
    while len(joined) > MOST:
        gaps = [later[0] - earlier[1] for earlier, later in pairwise(joined)]
        at = int(np.argmin(gaps))
        joined[at : at + 2] = [(joined[at][0], joined[at + 1][1])]
    return joined


def _swayed(channels: list[Channel]) -> list[tuple[int, int]]:
    """Return the stretches that steps of short means show."""
    ratio, size = large_steps(channels[0].y, channels[0].interval)
    for channel in channels[1:]:
        ratio = np.maximum(ratio, large_steps(channel.y, channel.interval)[0])
    large = np.flatnonzero(ratio > THRESHOLD)
    if len(large) < TOGETHER:
        return []
    restless = np.flatnonzero(ratio > RESTLESS)
    found = []
    for group in np.split(large, np.flatnonzero(np.diff(large) > APART) + 1):
        if len(group) < TOGETHER:
            continue
        first, last = int(group[0]), int(group[-1])
        while len(near := restless[(restless < first) & (restless >= first - NEAR)]):
            first = int(near[0])
        while len(near := restless[(restless > last) & (restless <= last + NEAR)]):
            last = int(near[-1])
        margin = NEAR + round(MARGIN * (last - first))
        found.append((max(0, (first - margin) * size), min(len(channels[0]), (last + 1 + margin) * size)))
    return found


def _turned(channels: list[Channel]) -> list[tuple[int, int]]:
    """Return the stretches that jumps of samples show, where the level before and after differs."""
    y = np.stack([channel.y for channel in channels])
    jumps = np.flatnonzero(np.max(np.abs(np.diff(y, axis=1)), axis=0) > JOLT * np.sqrt(2.0))
    if len(jumps) < TOGETHER:
        return []
    apart = max(APART, round(HANDLING / channels[0].interval))
    found = []
    for group in np.split(jumps, np.flatnonzero(np.diff(jumps) > apart) + 1):
        first, last = int(group[0]), int(group[-1]) + 1
        if len(group) < TOGETHER:
            continue
        before, after = y[:, max(0, first - apart) : first], y[:, last + 1 : last + 1 + apart]
        if 0 in (before.shape[1], after.shape[1]):  # at an end of the record: the level changes inside
            before, after = y[:, first : (first + last) // 2 + 1], y[:, first : last + 1 + apart]
        change = np.abs(np.median(after, axis=1) - np.median(before, axis=1))
        if float(change.max()) > 0.5 * JOLT:
            found.append((max(0, first - apart), min(y.shape[1], last + apart)))
    return found


def extension(channel: Channel, first: int, last: int) -> Motion:
    """Return the stretch with its place."""
    dt = channel.interval
    error = 10.0 * max(FEWEST * dt, SHORT)
    return Motion(
        first,
        last,
        values={
            "start": Value.of(channel.start + first * dt, 0.5 * error, "s"),
            "duration": Value.of((last - first) * dt, 0.5 * error, "s"),
        },
    )
