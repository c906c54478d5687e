"""Settings of a unit at rest beside those of a drive: white noise that motion makes larger."""

from __future__ import annotations

import re
from dataclasses import replace

from tuner.types import ChannelNoise, FilterConfig


def with_rest_and_motion(rest: FilterConfig, drive: FilterConfig) -> FilterConfig:
    """Return the configuration of a drive with the white noise at rest beside its own, its terms handled as written."""
    differ = [
        axis
        for axis, channel in drive.channels.items()
        if axis in rest.channels and channel.white_density != rest.channels[axis].white_density
    ]
    return replace(
        drive,
        channels={
            axis: with_scaled_handling(channel, rest.channels.get(axis, channel))
            for axis, channel in drive.channels.items()
        },
        noise={axis: rest.channels[axis].white_density for axis in differ},
        noise_in_motion={axis: drive.channels[axis].white_density for axis in differ},
    )


def with_scaled_handling(channel: ChannelNoise, before: ChannelNoise) -> ChannelNoise:
    """Return an axis whose handling of terms states its own densities, not those before factors on its noise."""
    states = zip(channel.markov, before.markov, strict=False)
    slow = next((own.sd / stated.sd for own, stated in states if stated.sd > 0.0), 1.0)
    factors = {"one state": slow}
    if before.white_density > 0.0:
        factors["N²"] = (channel.white_density / before.white_density) ** 2
    if before.random_walk_density > 0.0:
        factors["K²"] = (channel.random_walk_density / before.random_walk_density) ** 2
    handling = {}
    for term, text in before.handling.items():
        words = re.split(r"(N²|K²|one state)([^=:]*(?: =|: sd) )([0-9.e+-]+)", text)
        if len(words) > 1:
            words[3] = f"{float(words[3]) * factors.get(words[1], 1.0):.4g}"
        elif "Markov" in text and slow != 1.0:
            words.append(f"; sds × {slow:.4g} after the drive")
        handling[term] = "".join(words)
    return replace(channel, handling=handling)


def simulated_unit(config: FilterConfig) -> FilterConfig:
    """Return the configuration with the noise that its unit has in motion: after a drive or a run as configured."""
    return in_motion(config) if config.provenance.get("drive") or config.noise_in_motion else config


def in_motion(config: FilterConfig) -> FilterConfig:
    """Return a configuration without the terms identified at rest: what is simulated is what is configured."""
    channels = {axis: replace(channel, identified=()) for axis, channel in config.channels.items()}
    return replace(config, channels=channels)
