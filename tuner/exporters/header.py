"""The header of an export: which configuration it is of, what was identified, assumed and enlarged."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from models.arrays import FloatArray
from tuner.exporters.triad_values import triad
from tuner.formats.customary_units import phrase
from tuner.synthesis.equivalent_models import (
    STILL_SHARE,
    EquivalentNoise,
    equivalent_noise,
    structure_function,
)
from tuner.synthesis.error_growth import fading_growth, modelled_growth
from tuner.types import ChannelNoise, Coefficient, FilterConfig
from tuner.types.borrowed import borrowed_words, white_is_measured

SENSORS = {"gyro": "gyroscopes", "accel": "accelerometers"}
"""Prefix of the axes of the two triads, and their name."""


STATES_IN_PAIR = "Gauss–Markov states are in N and K"
"""What the header says of a file whose two numbers stand for all states."""
REPORTED_LAGS = (1.0, 10.0)
"""Lags, s, at which exports say how far their prediction is off, beside the memory of the filter."""


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
    measured = any(white_is_measured(config, axis) for axis in config.channels)
    of_sheet = not measured and any(channel.identified for channel in config.channels.values())
    intervals = "numbers of a sheet, not of a unit" if of_sheet else "95 % intervals in brackets"
    yield f"from {config.name}; densities are two-sided; {intervals}"
    yield from borrowed_words(config)
    for axis, channel in config.channels.items():
        known = "; ".join(
            f"{term.name} {phrase(coefficient, f'{term.name}.{name}', channel.unit)}"
            for term in channel.identified
            for name, coefficient in term.coefficients.items()
        )
        why = channel.handling.get("white", "")
        fitted = why.removeprefix("not used") if why.startswith("not used") else ""
        white = _figure(channel.white_density, "white.density", channel.unit)
        yield f"{axis}: N = {white}{fitted}; {'stated' if of_sheet else 'identified'}: {known or 'nothing'}"
    if config.noise_in_motion:
        rest = ", ".join(
            f"{axis} {_figure(value, 'white.density', config.channels[axis].unit)}"
            for axis, value in config.noise.items()
        )
        yield f"N is that in motion, for rest and motion alike; at rest N of {rest}"
    if walk_memory is not None and any(channel.markov for channel in config.channels.values()):
        yield (
            f"{STATES_IN_PAIR}, for a filter with a memory τ of {walk_memory:g} s (assumed): those "
            "whose prediction of the integrated error is nearest"
        )
        for axis, channel in config.channels.items():
            if channel.markov:
                yield _equivalence(axis, channel, walk_memory)
    if still := [axis for axis, channel in config.channels.items() if not structure_function(channel, 1.0)]:
        yield (
            f"{', '.join(still)}: no wander of the bias identified; one of {100.0 * STILL_SHARE:g} % of white noise "
            "in the variance of the integrated error over the memory stands in, as no target may get 0"
        )
    for sensor, name in SENSORS.items():
        if not triad(config, sensor):
            yield f"{name} are left out: the configuration has none (--complete GRADE fills them in)"
    yield from _inflations(config)


def _equivalence(axis: str, channel: ChannelNoise, memory: float) -> str:
    """Say what stands for the states of an axis, and how well."""
    found = equivalent_noise(channel, memory=memory)
    white = _figure(found.white_density, "white.density", channel.unit)
    walk = _figure(found.bias, "random_walk.density", channel.unit)
    return f"{axis}: N = {white}, K = {walk}; {_mismatch(found)}"


def _figure(value: float, quantity: str, unit: str) -> str:
    """Return a number without an interval in its customary unit."""
    return phrase(Coefficient(value, None, None, unit), quantity, unit)


def _mismatch(found: EquivalentNoise) -> str:
    low, high = found.mismatch
    return (
        f"predicted ÷ modelled sd of the integrated error {low:.2f} … {high:.2f} from {found.shortest:g} to "
        f"{found.longest:g} s, the least that two numbers can do"
    )


def fading_words(config: FilterConfig, time: float, memory: float) -> Iterator[str]:
    """Yield how one fading state of time constant `time`, s, was chosen, and its prediction at some lags."""
    yield (
        f"one T = {time:g} s for all states; N and σ are those whose prediction of the integrated error is nearest "
        f"from 1 s to {memory:g} s (assumed memory of the filter)"
    )

    def predicted(channel: ChannelNoise, lag: float) -> FloatArray:
        found = equivalent_noise(channel, memory=memory, fading_time=time)
        return fading_growth(found.white_density, found.bias, time, lag)

    yield from mismatch_words(config, predicted, memory)


def mismatch_words(
    config: FilterConfig, predicted: Callable[[ChannelNoise, float], FloatArray], memory: float
) -> Iterator[str]:
    """Yield how far a target's prediction of the integrated error is off, by sensor; `predicted` is its variance."""
    for sensor, name in SENSORS.items():
        if channels := triad(config, sensor):
            ratios = []
            for lag in (*REPORTED_LAGS, memory):
                modelled = sum(modelled_growth(c, lag, memory=memory) for c in channels)
                ratios.append(
                    f"{math.sqrt(sum(predicted(c, lag) for c in channels) / modelled):.2f} at {lag:g} s"
                )
            yield f"{name}: predicted ÷ modelled sd of the integrated error {', '.join(ratios)}"


def _inflations(config: FilterConfig) -> Iterator[str]:
    """Yield every inflation of the sensors, those of like axes in one line.

    Factors on the sds of fixes hold only beside the further states of our filter: no other program gets them.
    """
    groups: dict[tuple[str, str, str], list[str]] = {}
    for inflation in config.inflations:
        if inflation.quantity.owner == "gnss":
            continue
        key = inflation.quantity.field, f"{inflation.factor:.4g}", inflation.reason
        groups.setdefault(key, []).append(inflation.quantity.owner)
    for (quantity, factor, reason), axes in groups.items():
        yield f"{quantity} × {factor} ({', '.join(axes)}): {reason}"
