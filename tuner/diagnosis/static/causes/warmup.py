"""Warm-up: an exponential transient after power-on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from models.effects.static.thermal import Warmup as Effect
from tuner.diagnosis.static.causes.template import TimeConstantTemplate
from tuner.diagnosis.static.channel import Channel


@dataclass(frozen=True)
class Warmup(TimeConstantTemplate):
    """exp(−t/time_constant), t from the first sample."""

    cause = "warmup"
    effect = Effect
    meaning = "the bias decays exponentially after power-on"
    consequence = "wait five time constants before use, or carry the transient as a decaying bias state"
    contained_in = ("telegraph",)
    happens_once = True
    size = ("amplitude", "{u}")
    statistic = "likelihood ratio of an exponential transient"
    price = float(np.log(5.0))

    def template(self, channel: Channel) -> NDArray[np.float64]:
        """Return the transient on the blocks, shape (M,)."""
        return np.asarray(np.exp(-channel.block_time / self.time_constant))

    @classmethod
    def time_constants(cls, channel: Channel) -> NDArray[np.float64]:
        """Return the grid of time constants, s."""
        shortest = max(8.0 * channel.block * channel.interval, channel.span / 300.0)
        return np.geomspace(shortest, channel.span / 3.0, 14)

    @classmethod
    def candidates_in_pairs(cls, channel: Channel) -> Sequence[Self]:
        """Return every second candidate: the others differ little from these."""
        return cls.candidates(channel)[:13:2]
