"""The few factors that are moved: noise of gyros and accelerometers, wander of their biases, sds of fixes.

A program with white noise and one kind of bias gets two numbers an axis (`tuner.synthesis.projection`); the
factors act on these two, so that what is exported is what is multiplied.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from tuner.exporters.dialect import Dialect
from tuner.types import ChannelNoise, Enlargement, FilterConfig, Quantity

NOISE_FACTORS = ("gyro noise", "accelerometer noise", "bias walks", "fix sds")
"""What is multiplied: white densities of either sensor, walks of all biases, sds of the fixes (R by the square)."""


def with_two_numbers(config: FilterConfig, dialect: Dialect) -> FilterConfig:
    """Return a configuration with white noise and a random walk alone, for programs that hold no more."""
    target = dialect.target(config)

    def reduced(channel: ChannelNoise) -> ChannelNoise:
        start = math.hypot(channel.constant_sd, *(state.sd for state in channel.markov))
        return replace(
            channel,
            white_density=target.white_density(channel),
            markov=(),
            random_walk_density=target.bias(channel),
            constant_sd=start,
        )

    return replace(config, channels={axis: reduced(channel) for axis, channel in config.channels.items()})


def with_factors(config: FilterConfig, factors: Mapping[str, float], *, reason: str = "") -> FilterConfig:
    """Return a configuration with its numbers multiplied by `NOISE_FACTORS`; with a reason, they are named in it."""
    white = {"gyro": factors["gyro noise"], "accel": factors["accelerometer noise"]}
    walk, fixes = factors["bias walks"], factors["fix sds"]
    channels = {
        axis: channel.scaled(white[axis.partition("_")[0]], walk) for axis, channel in config.channels.items()
    }
    receiver = config.gnss
    if receiver is not None:
        north, east, down = receiver.position_sd
        receiver = replace(receiver, position_sd=(fixes * north, fixes * east, fixes * down))
    enlargements: list[Enlargement] = []
    if reason:
        for axis in channels:
            enlargements.append(
                Enlargement(Quantity(axis, "white_density"), white[axis.partition("_")[0]], reason)
            )
            enlargements.append(Enlargement(Quantity(axis, "random_walk_density"), walk, reason))
        enlargements.append(Enlargement(Quantity("gnss", "position_sd"), fixes, reason))
    return replace(config, channels=channels, gnss=receiver, inflations=(*config.inflations, *enlargements))
