"""The header of an export: which configuration it is of, what was identified, assumed and enlarged."""

from __future__ import annotations

from collections.abc import Iterator

from tuner.exporters.triad_values import triad
from tuner.formats.customary_units import phrase
from tuner.synthesis.equivalent_models import equivalent_noise, structure_function
from tuner.types import ChannelNoise, FilterConfig

SENSORS = {"gyro": "gyroscopes", "accel": "accelerometers"}
"""Prefix of the axes of the two triads, and their name."""


STATES_IN_WHITE = (
    "states that the filter forgets within a thirtieth of its memory are in N, as 2σ²T each in N²"
)
"""What becomes of fast states where one state stands for all."""


def provenance(config: FilterConfig, title: str, *, walk_memory: float | None = None) -> tuple[str, ...]:
    """Return the header of an export, without comment marks.

    Parameters
    ----------
    config : FilterConfig
        What is exported.
    title : str
        What the file is.
    walk_memory : float, optional
        Memory, s, where white noise and a random walk of the target stand for Gauss–Markov states.
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
            f"Gauss–Markov states in N and K, for a filter with a memory τ of {walk_memory:g} s (assumed): T ≤ τ/30 "
            "adds 2σ²T to N², T ≥ τ adds 2σ²(1 − e^(−τ/T))/τ to K², between by the nearest Allan deviation"
        )
        for axis, channel in config.channels.items():
            if channel.markov:
                yield _equivalence(axis, channel, walk_memory)
    if still := [axis for axis, channel in config.channels.items() if not structure_function(channel, 1.0)]:
        yield (
            f"{', '.join(still)}: no wander of the bias identified; a walk of 0.1·√3·N/τ, 1 % of white noise "
            "over the memory τ, stands in, as no target may get 0"
        )
    for sensor, name in SENSORS.items():
        if not triad(config, sensor):
            yield f"{name} are left out: the configuration has none (--complete GRADE fills them in)"
    yield from _inflations(config)


def _equivalence(axis: str, channel: ChannelNoise, memory: float) -> str:
    """Say what stands for the states of an axis, and how well."""
    found = equivalent_noise(channel, memory=memory)
    low, high = found.mismatch
    return (
        f"{axis}: N = {found.white_density:.4g}, K = {found.random_walk_density:.4g} have {low:.2f} … {high:.2f} "
        f"of the Allan deviation of the configuration, τ {found.shortest:g} … {found.longest:g} s"
    )


def _inflations(config: FilterConfig) -> Iterator[str]:
    """Yield every inflation, those of like axes in one line."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for inflation in config.inflations:
        key = inflation.quantity.field, f"{inflation.factor:.4g}", inflation.reason
        groups.setdefault(key, []).append(inflation.quantity.owner)
    for (quantity, factor, reason), axes in groups.items():
        yield f"{quantity} × {factor} ({', '.join(axes)}): {reason}"
