"""The header of an export: which configuration it is of, what was identified, assumed and enlarged."""

from __future__ import annotations

from collections.abc import Iterator

from tuner.exporters.triad_values import triad
from tuner.formats.customary_units import phrase
from tuner.synthesis.equivalent_models import structure_function
from tuner.types import FilterConfig

SENSORS = {"gyro": "gyroscopes", "accel": "accelerometers"}
"""Prefix of the axes of the two triads, and their name."""


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
