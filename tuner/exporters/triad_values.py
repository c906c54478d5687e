"""Numbers of a dialect: the axes of a triad combined to one figure, with its unit, formula and spread in words.

White noise and walk are those with which the target predicts best (`tuner.synthesis.projection`), for all axes of a
sensor where it has one number; an initial sd for three axes is their rms. Figures follow from several numbers and have
no interval of their own: they carry `tuner.formats.digits.DEFAULT_DIGITS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from tuner.exporters.dialect import Target
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Noted
from tuner.synthesis.projection import pooled
from tuner.types import ChannelNoise, FilterConfig


@dataclass(frozen=True)
class Figure:
    """One number of a dialect for all axes, and in words its unit, formula and spread."""

    value: float
    note: str

    def noted(self) -> Noted:
        """Return the figure as a YAML entry with its comment."""
        return Noted(self.value, self.note)


def triad(config: FilterConfig, sensor: str) -> tuple[ChannelNoise, ...]:
    """Return the axes of ``gyro`` or ``accel``; empty where the configuration has none."""
    return tuple(channel for axis, channel in config.channels.items() if axis.startswith(sensor))


def rms(channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str) -> Figure:
    """Return the rms of a quantity over the axes, with its spread in the note."""
    values = [quantity(channel) for channel in channels]
    if len(set(values)) == 1:
        return Figure(rounded(values[0]), note if len(values) == 1 else f"{note}; the same on all axes")
    value = math.sqrt(sum(v * v for v in values) / len(values))
    return Figure(rounded(value), f"{note}; rms of {_spread(channels, values)}")


def _spread(channels: tuple[ChannelNoise, ...], values: list[float]) -> str:
    return ", ".join(f"{c.axis.rpartition('_')[2]} {v:.4g}" for c, v in zip(channels, values, strict=True))


def triple(
    channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str
) -> tuple[list[float], str]:
    """Return three values, one an axis, and a note; where axes are missing, the rms of the others thrice."""
    if len(channels) == 3:
        return [rounded(quantity(channel)) for channel in channels], note
    figure = rms(channels, quantity, note)
    return [figure.value] * 3, f"{figure.note} ({len(channels)} of 3 axes known)"


def initial_bias_sd(channel: ChannelNoise) -> float:
    """Return the sd of constant and bias states together, for targets with one state for the bias."""
    return math.hypot(channel.constant_sd, *(state.sd for state in channel.markov))


def _same(value: float) -> float:
    return value


def white(
    channels: tuple[ChannelNoise, ...],
    note: str,
    target: Target,
    form: Callable[[float], float] = _same,
) -> Figure:
    """Return the one white density of a target in the form that it reads, by default as it is."""
    return _for_all(channels, target.pair(pooled(channels)).white_density, note, form)


def walk(
    config: FilterConfig,
    channels: tuple[ChannelNoise, ...],
    note: str,
    target: Target,
    form: Callable[[float], float] = _same,
) -> Figure:
    """Return the one random walk, or σ, of a target in the form that it reads, by default as it is."""
    return _for_all(channels, target.pair(pooled(channels)).bias, limited(config, channels, note), form)


def _for_all(
    channels: tuple[ChannelNoise, ...], value: float, note: str, form: Callable[[float], float]
) -> Figure:
    return Figure(rounded(form(value)), f"{note}; for all axes" if len(channels) > 1 else note)


def limited(config: FilterConfig, channels: tuple[ChannelNoise, ...], note: str) -> str:
    """Return a note on a number for the bias, with the axes where it rests on a 95 % limit."""
    axes = [c.axis.rpartition("_")[2] for c in channels if config.bias_on_limit(c.axis)]
    return f"{note}; rests on a 95 % limit: {', '.join(axes)}" if axes else note
