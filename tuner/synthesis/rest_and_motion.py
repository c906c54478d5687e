"""Settings of a unit at rest beside those of a drive: white noise that motion makes larger."""

from __future__ import annotations

from dataclasses import replace

from tuner.types import FilterConfig


def with_rest_and_motion(rest: FilterConfig, drive: FilterConfig) -> FilterConfig:
    """Return the configuration of a drive with the white noise at rest beside its own, where they differ."""
    differ = [
        axis
        for axis, channel in drive.channels.items()
        if axis in rest.channels and channel.white_density != rest.channels[axis].white_density
    ]
    return replace(
        drive,
        noise={axis: rest.channels[axis].white_density for axis in differ},
        noise_in_motion={axis: drive.channels[axis].white_density for axis in differ},
    )


def simulated_unit(config: FilterConfig) -> FilterConfig:
    """Return the configuration with the noise that its unit has in the vehicle: after a drive as configured."""
    return in_motion(config) if config.provenance.get("drive") else config


def in_motion(config: FilterConfig) -> FilterConfig:
    """Return a configuration without the terms identified at rest: what is simulated is what is configured."""
    channels = {axis: replace(channel, identified=()) for axis, channel in config.channels.items()}
    return replace(config, channels=channels)
