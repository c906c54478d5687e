"""The header of an export: which configuration it is of, what was identified, assumed and enlarged."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from tuner.exporters.dialect import Target
from tuner.exporters.triad_values import triad
from tuner.formats.customary_units import digits, phrase
from tuner.formats.grouping import gathered
from tuner.synthesis.error_growth import structure_function
from tuner.synthesis.projection import STILL_SHARE, STILL_TIME, BiasModel, Projected
from tuner.synthesis.sufficient import unstated_terms
from tuner.types import Coefficient, FilterConfig
from tuner.types.borrowed import borrowed_words, white_is_measured

SENSORS = {"gyro": "gyroscopes", "accel": "accelerometers"}
"""Prefix of the axes of the two triads, and their name."""

RATIO = "true ÷ predicted error"
"""What the header states of two numbers that stand for another model."""


def provenance(
    config: FilterConfig, title: str, target: Target | None = None, loaded: Iterable[str] = tuple(SENSORS)
) -> tuple[str, ...]:
    """Return the header of an export, without comment marks.

    Parameters
    ----------
    config : FilterConfig
        What is exported.
    title : str
        What the file is.
    target : Target, optional
        The filter, where two of its numbers stand for all states of an axis.
    loaded : iterable of str, optional
        Keys of `SENSORS` whose two numbers it is given; by default both.
    """
    return tuple(_provenance(config, title, target, loaded))


def _provenance(
    config: FilterConfig, title: str, target: Target | None, loaded: Iterable[str]
) -> Iterator[str]:
    yield title
    measured = any(white_is_measured(config, axis) for axis in config.channels)
    of_sheet = not measured and any(channel.identified for channel in config.channels.values())
    intervals = "numbers of a sheet, not of a unit" if of_sheet else "95 % intervals in brackets"
    yield f"from {config.name}; densities are two-sided; {intervals}"
    yield from borrowed_words(config)
    if of_sheet and (lost := unstated_terms(config)):
        yield f"{' and '.join(lost)} not stated: true errors are at least those that these numbers predict"
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
    if config.compensation:
        taken = ", ".join(
            f"{name} {digits(value, 3)}" for name, value in config.compensation.as_text().items()
        )
        yield f"not in these settings, take it out of the data before the filter (SI): {taken}"
    if config.noise_in_motion:
        rest = ", ".join(
            f"{axis} {_figure(value, 'white.density', config.channels[axis].unit)}"
            for axis, value in config.noise.items()
        )
        yield f"N is that in motion, for rest and motion alike; at rest N of {rest}"
    if target is not None:
        yield from _projected_words(config, target, loaded)
    if still := [axis for axis, channel in config.channels.items() if not structure_function(channel, 1.0)]:
        yield (
            f"{', '.join(still)}: no wander of the bias identified; one of {100.0 * STILL_SHARE:g} % of white noise "
            f"in the variance of the integrated error after {STILL_TIME:g} s stands in, as no target may get 0"
        )
    for sensor, name in SENSORS.items():
        if not triad(config, sensor):
            yield f"{name} are left out: the configuration has none (--complete GRADE fills them in)"
    yield from _inflations(config)


def _projected_words(config: FilterConfig, target: Target, loaded: Iterable[str]) -> Iterator[str]:
    """Yield what stands for the noise of each axis, and how well a filter predicts with it."""
    axes = {sensor: channels for sensor in loaded if (channels := triad(config, sensor))}
    pairs = {sensor: target.pairs(channels) for sensor, channels in axes.items()}
    if any(channel.markov for channels in axes.values() for channel in channels):
        what = "Gauss–Markov states are in N and K"
    elif any(len(set(map(BiasModel.of, channels))) > 1 for channels in axes.values()) and target.shared:
        what = "one N and one K for all axes"
    else:
        return
    yield f"{what}; a filter that is aided by {target.aiding.words} (assumed) predicts best with"
    for sensor, channels in axes.items():
        words = [
            f"N = {_figure(pair.white_density, 'white.density', channel.unit)}, "
            f"K = {_figure(pair.bias, 'random_walk.density', channel.unit)}"
            for channel, pair in zip(channels, pairs[sensor], strict=True)
        ]
        if target.shared:
            yield f"{SENSORS[sensor]}, one number for all axes: {words[0]}"
        else:
            yield from (f"{channel.axis}: {text}" for channel, text in zip(channels, words, strict=True))
    yield from predicted_words(config, target, pairs)


def _figure(value: float, quantity: str, unit: str) -> str:
    """Return a number without an interval in its customary unit."""
    return phrase(Coefficient(value, None, None, unit), quantity, unit)


def predicted_words(
    config: FilterConfig, target: Target, pairs: Mapping[str, Sequence[Projected]]
) -> Iterator[str]:
    """Yield true ÷ predicted errors of a filter with two numbers an axis, by sensor: the range over its axes."""
    for sensor, numbers in pairs.items():
        ratios = [target.errors(*one) for one in zip(triad(config, sensor), numbers, strict=True)]
        ranges = {key: sorted({f"{one[key]:.2f}" for one in ratios}, key=float) for key in ratios[0]}
        words = ", ".join(f"{key} {' to '.join(found[:1] + found[1:][-1:])}" for key, found in ranges.items())
        yield f"{SENSORS[sensor]}: {RATIO}: {words}"


def stated_ratios(text: str) -> list[float]:
    """Return the ratios that the header of a file states."""
    lines = [line.partition(RATIO)[2] for line in text.splitlines() if RATIO in line]
    return [float(one) for line in lines for one in re.findall(r"\d+\.\d\d", line)]


def _inflations(config: FilterConfig) -> Iterator[str]:
    """Yield every inflation of the sensors, those of like axes in one line.

    Factors on the sds of fixes hold only beside the further states of our filter: no other program gets them.
    """
    groups = gathered(
        ((one.quantity.field, f"{one.factor:.4g}", one.reason), one.quantity.owner)
        for one in config.inflations
        if one.quantity.owner != "gnss"
    )
    for (quantity, factor, reason), axes in groups.items():
        yield f"{quantity} × {factor} ({', '.join(axes)}): {reason}"
