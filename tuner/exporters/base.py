"""What every dialect shares: axes combined to one figure, and a header that says where the figures come from.

One value for three axes is their rms: the noise power of the triad is then right, and the spread stands in
the comment. Random-walk-only targets get the walk that wanders as far as the modelled bias over the memory
of the filter (`tuner.synthesis.equivalent_models`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tuner.formats.customary_units import phrase
from tuner.formats.yaml_text import Noted
from tuner.synthesis.equivalent_models import MEMORY, equivalent_random_walk, structure_function
from tuner.types import ChannelNoise, FilterConfig

SENSORS = {"gyro": "gyroscopes", "accel": "accelerometers"}
"""Prefix of the axes of the two triads, and their name."""


DEFAULT_TIME_CONSTANT = 3600.0
"""Time constant, s, of one-state targets where the configuration has no Gauss–Markov state."""


@dataclass(frozen=True)
class Target:
    """The filter that will read an export.

    Attributes
    ----------
    interval : float
        Sampling interval of the IMU it reads, s.
    step : float
        Prediction step of the filter, s, where it differs.
    memory : float
        Time over which it renews its biases, s.
    """

    interval: float
    step: float = 0.01
    memory: float = MEMORY


@dataclass(frozen=True)
class Exporter:
    """A dialect: its name, what it is for, its units, and the function that writes it."""

    name: str
    title: str
    units: str
    write: Callable[[FilterConfig, Target], str]


@dataclass(frozen=True)
class Figure:
    """One number of a dialect: rms of the axes, and in words its unit, formula and spread."""

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
        return Figure(values[0], note if len(values) == 1 else f"{note}; the same on all axes")
    value = math.sqrt(sum(v * v for v in values) / len(values))
    return Figure(value, f"{note}; rms of {_spread(channels, values)}")


def mean(channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str) -> Figure:
    """Return the mean of a variance over the axes, with its spread in the note."""
    values = [quantity(channel) for channel in channels]
    if len(set(values)) == 1:
        return Figure(values[0], note if len(values) == 1 else f"{note}; the same on all axes")
    return Figure(sum(values) / len(values), f"{note}; mean of {_spread(channels, values)}")


def _spread(channels: tuple[ChannelNoise, ...], values: list[float]) -> str:
    return ", ".join(f"{c.axis.rpartition('_')[2]} {v:.4g}" for c, v in zip(channels, values, strict=True))


def triple(
    channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], note: str
) -> tuple[list[float], str]:
    """Return three values, one an axis, and a note; where axes are missing, the rms of the others thrice."""
    if len(channels) == 3:
        return [quantity(channel) for channel in channels], note
    figure = rms(channels, quantity, note)
    return [figure.value] * 3, f"{figure.note} ({len(channels)} of 3 axes known)"


def longest_time(config: FilterConfig) -> float:
    """Return the longest time constant of the configuration, s, for targets with one; 1 h without any."""
    times = [state.time_constant for channel in config.channels.values() for state in channel.markov]
    return max(times, default=DEFAULT_TIME_CONSTANT)


@dataclass(frozen=True)
class Limits:
    """Range a target clamps a parameter to."""

    low: float
    high: float


def limited(figure: Figure, limits: Limits) -> Figure:
    """Return a figure within the limits of its target; where it had to be moved, the note says so."""
    value = min(max(figure.value, limits.low), limits.high)
    if value == figure.value:
        return figure
    moved = (
        f"WARNING {figure.value:.4g} is outside [{limits.low:g}, {limits.high:g}] and was set to {value:g}"
    )
    return Figure(value, f"{figure.note}; {moved}")


def white(channels: tuple[ChannelNoise, ...], note: str, *, factor: float = 1.0) -> Figure:
    """Return the white density times a factor, rms of the axes."""
    return rms(channels, lambda channel: factor * channel.white_density, note)


def walk(channels: tuple[ChannelNoise, ...], note: str, target: Target, *, factor: float = 1.0) -> Figure:
    """Return the density of the equivalent random walk times a factor, rms of the axes."""
    return rms(channels, lambda channel: factor * equivalent_random_walk(channel, memory=target.memory), note)


def provenance(config: FilterConfig, title: str, *, walk_memory: float | None = None) -> tuple[str, ...]:
    """Return the header of an export, without comment marks.

    Parameters
    ----------
    config : FilterConfig
        What is exported.
    title : str
        What the file is.
    walk_memory : float, optional
        Memory, s, where the target's random walk stands for Gauss–Markov states.
    """
    return tuple(_provenance(config, title, walk_memory))


def _provenance(config: FilterConfig, title: str, walk_memory: float | None) -> Iterator[str]:
    yield title
    yield f"from {config.name}; densities are two-sided, SI; 95 % intervals in brackets"
    for axis, channel in config.channels.items():
        known = "; ".join(
            f"{term.name} {phrase(coefficient, f'{term.name}.{name}', channel.unit)}"
            for term in channel.identified
            for name, coefficient in term.coefficients.items()
        )
        yield f"{axis}: N = {channel.white_density:.4g} {channel.unit}/√Hz; identified: {known or 'nothing'}"
    if walk_memory is not None and any(channel.markov for channel in config.channels.values()):
        yield (
            f"random walk: K² = D/τ with τ = {walk_memory:g} s (assumed memory of the filter) "
            "and D the growth of the modelled bias, Σ 2σ²(1 − e^(−τ/T)) + K²τ"
        )
    if still := [axis for axis, channel in config.channels.items() if not structure_function(channel, 1.0)]:
        yield (
            f"{', '.join(still)}: no wander of the bias identified; a walk of 0.1·√3·N/τ, 1 % of white noise "
            "over the memory τ, stands in, as no target may get 0"
        )
    for sensor, name in SENSORS.items():
        if not triad(config, sensor):
            yield f"{name} are left out: the configuration has none (--complete GRADE fills them in)"
    yield from _inflations(config)


def _inflations(config: FilterConfig) -> Iterator[str]:
    """Yield every inflation, those of like axes in one line."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for inflation in config.inflations:
        key = inflation.quantity.field, f"{inflation.factor:.4g}", inflation.reason
        groups.setdefault(key, []).append(inflation.quantity.owner)
    for (quantity, factor, reason), axes in groups.items():
        yield f"{quantity} × {factor} ({', '.join(axes)}): {reason}"
