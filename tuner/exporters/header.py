"""The header of an export: which configuration it is of, what was identified, assumed and enlarged."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from tuner.exporters.dialect import Target
from tuner.exporters.triad_values import triad
from tuner.formats.customary_units import phrase
from tuner.synthesis.error_growth import structure_function
from tuner.synthesis.projection import STILL_SHARE, STILL_TIME, Projected
from tuner.types import ChannelNoise, Coefficient, FilterConfig
from tuner.types.borrowed import borrowed_words, white_is_measured

SENSORS = {"gyro": "gyroscopes", "accel": "accelerometers"}
"""Prefix of the axes of the two triads, and their name."""

STATES_IN_PAIR = "Gauss–Markov states are in N and K"
"""What the header says of a file whose two numbers stand for all states."""


def provenance(config: FilterConfig, title: str, target: Target | None = None) -> tuple[str, ...]:
    """Return the header of an export, without comment marks.

    Parameters
    ----------
    config : FilterConfig
        What is exported.
    title : str
        What the file is.
    target : Target, optional
        The filter, where two of its numbers stand for all states of an axis.
    """
    return tuple(_provenance(config, title, target))


def _provenance(config: FilterConfig, title: str, target: Target | None) -> Iterator[str]:
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
    if target is not None:
        yield from _projected_words(config, target)
    if still := [axis for axis, channel in config.channels.items() if not structure_function(channel, 1.0)]:
        yield (
            f"{', '.join(still)}: no wander of the bias identified; one of {100.0 * STILL_SHARE:g} % of white noise "
            f"in the variance of the integrated error after {STILL_TIME:g} s stands in, as no target may get 0"
        )
    for sensor, name in SENSORS.items():
        if not triad(config, sensor):
            yield f"{name} are left out: the configuration has none (--complete GRADE fills them in)"
    yield from _inflations(config)


def _projected_words(config: FilterConfig, target: Target) -> Iterator[str]:
    """Yield what stands for the states of each axis, and how well a filter predicts with it."""
    if target.fading_time is None and not any(channel.markov for channel in config.channels.values()):
        return
    what = (
        STATES_IN_PAIR if target.fading_time is None else f"one T = {target.fading_time:g} s for all states"
    )
    name, quantity = ("K", "random_walk.density") if target.fading_time is None else ("σ", "gauss_markov.sd")
    yield f"{what}; a filter that is aided by {target.aiding.words} (assumed) predicts best with"
    for axis, channel in config.channels.items():
        pair = target.pair(channel)
        white = _figure(pair.white_density, "white.density", channel.unit)
        yield f"{axis}: N = {white}, {name} = {_figure(pair.bias, quantity, channel.unit)}"
    yield from predicted_words(config, target.pair, target)


def _figure(value: float, quantity: str, unit: str) -> str:
    """Return a number without an interval in its customary unit."""
    return phrase(Coefficient(value, None, None, unit), quantity, unit)


def predicted_words(
    config: FilterConfig, pair: Callable[[ChannelNoise], Projected], target: Target
) -> Iterator[str]:
    """Yield true ÷ predicted errors of a filter with two numbers an axis: by sensor, of the axis furthest from 1."""
    for sensor, name in SENSORS.items():
        if channels := triad(config, sensor):
            ratios = [target.errors(channel, pair(channel)) for channel in channels]
            worst = {key: max((one[key] for one in ratios), key=_distance) for key in ratios[0]}
            words = ", ".join(f"{key} {ratio:.2f}" for key, ratio in worst.items())
            yield f"{name}: true ÷ predicted error with fixes and after a time without: {words}"


def _distance(ratio: float) -> float:
    return max(ratio, 1.0 / ratio)


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
