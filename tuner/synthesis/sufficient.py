"""Whether the noise of a sensor is enough for a filter: white noise and one description of its slow bias.

Without a slow bias a filter takes its estimate of the bias for known after a while, and diverges from the truth. A slow
term of which a log shows a limit alone is ASSUMED at half of it in our own file, which marks it; what another program
is given cannot be marked, so that nothing is written for it where such a term decides the drift.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

from models.noise import LowPassWhite, Quantization, Ramp, RandomWalk, Sinusoid, White
from models.noise.bias_instability import ALLAN_FLOOR
from tuner.catalogue.grades import grade_names, load_grade
from tuner.formats.axis_words import axes_text
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty, range_text
from tuner.formats.grouping import gathered
from tuner.limits import HONEST_RATIO
from tuner.synthesis.error_growth import modelled_growth
from tuner.types import (
    BoundUsed,
    ChannelIdentification,
    ChannelNoise,
    FilterConfig,
    Identification,
    TermEstimate,
)
from tuner.types.borrowed import SHEET_OF, with_borrowed
from tuner.types.coefficient import hours_needed

SENSORS: Mapping[str, str] = MappingProxyType({"gyro": "gyroscopes", "accel": "accelerometers"})
"""Prefix of the axes of the two triads, and their name."""
NO_SLOW_BIAS = frozenset(kind.name for kind in (White, LowPassWhite, Quantization, Ramp, Sinusoid))
"""Terms that say nothing of how a bias wanders."""
SIMILAR_GRADES = 3
"""Built-in sensors of nearest white noise whose bias instabilities are called usual: two give no range."""
LIMITED_TERMS: Mapping[str, str] = MappingProxyType(
    {"random_walk.density": "bias random walk", "bias_instability.level": "bias instability"}
)
"""Slow terms of which half of a limit may stand in the settings, in words."""
UNAIDED_TIME = 60.0
"""Time without aiding over which a term that is only limited is judged, s."""
WITHOUT_SLOW_BIAS = (
    "A filter without a slow bias trusts its biases for ever and diverges from the truth: put bias terms into the "
    "sheet, name one that has them (--datasheet), or record 3 h at rest"
)
"""Why nothing is written, and what would do."""


def lacking_slow_bias(source: Identification | FilterConfig) -> Mapping[str, str]:
    """Return why a filter cannot be configured from some noise, by sensor (``gyro``, ``accel``); empty where it can.

    Parameters
    ----------
    source : Identification or FilterConfig
        Noise of a sensor, or settings made from it. A sensor that it lacks as a whole is not named, nor one with a
        95 % limit alone: of that half is used.
    """
    reasons = {}
    for sensor, name in SENSORS.items():
        axes = [axis for axis in source.channels if axis.startswith(sensor)]
        if axes and not any(_has_slow_bias(source, axis) for axis in axes):
            reasons[sensor] = (
                f"{name}: neither bias instability nor bias random walk nor a bias state is stated or measured; "
                f"usual is {_usual(sensor, _white_density(source, axes))}"
            )
    return MappingProxyType(reasons)


def why_insufficient(source: Identification | FilterConfig) -> str | None:
    """Return in one line why a filter cannot be configured from some noise, and what would do; None where it can."""
    reasons = "; ".join(lacking_slow_bias(source).values())
    return f"{reasons}. {WITHOUT_SLOW_BIAS}" if reasons else None


def decisive_limits(config: FilterConfig) -> list[tuple[BoundUsed, float]]:
    """Return the limits of slow terms, a share of which stands in the settings, that decide the drift of a minute.

    With each stands by how much: the sd of the drift after `UNAIDED_TIME` with the term at its limit ÷ that of the
    measured terms alone, `HONEST_RATIO` or more.
    """
    found = []
    for one in config.inflations:
        channel, term = config.channels.get(one.quantity.owner), one.quantity.field
        if channel is None or not isinstance(one, BoundUsed) or not one.factor or term not in LIMITED_TERMS:
            continue
        limited = config.states_on_limit(channel.axis)
        walk = channel.random_walk_density
        seen = replace(
            channel,
            markov=tuple(state for state in channel.markov if state not in limited),
            random_walk_density=0.0 if "random_walk_density" in config.on_limit(channel.axis) else walk,
        )
        if term == "random_walk.density":
            most = replace(seen, random_walk_density=walk / one.factor)
        else:
            at_limit = tuple(replace(state, sd=state.sd / one.factor) for state in limited)
            most = replace(seen, markov=(*seen.markov, *at_limit))
        high, low = (float(modelled_growth(noise, UNAIDED_TIME)) for noise in (most, seen))
        if high >= HONEST_RATIO**2 * low:
            found.append((one, math.sqrt(high / low) if low else math.inf))
    return found


def undetermined_bias(config: FilterConfig) -> str | None:
    """Return in words which slow terms decide the drift of a minute and are not seen; None where none does."""
    found = decisive_limits(config)
    if not found:
        return None
    axes = gathered((LIMITED_TERMS[one.quantity.field], one.quantity.owner) for one, _ in found)
    terms = " and ".join(f"{term} ({axes_text(those)})" for term, those in axes.items())
    return (
        f"{terms}: not seen, half of the limit is ASSUMED (drift in {UNAIDED_TIME:g} s: at the limit "
        f"{range_text([ratio for _, ratio in found], significant=2)} × that without it)"
    )


def why_undetermined(config: FilterConfig) -> str | None:
    """Return in one line why no other program is given the settings, and what would do; None where it may be."""
    words = undetermined_bias(config)
    if words is None:
        return None
    needed = [hours for one, _ in decisive_limits(config) if (hours := hours_needed(one.reason)) is not None]
    longer = f"a log of {digits(max(needed), 2)} h shows half as much" if needed else "or record longer"
    return f"{words}; `tuner tune LOG --datasheet NAME` takes what a log does not show from a sheet; {longer}"


def with_terms_of_sheet(found: Identification, axes: Iterable[str], sheet: Identification) -> Identification:
    """Return noise of which some axes have the slow terms of a sheet in place of those that are only limited.

    None is above its limit, as the unit is better than its sheet there; what the sheet does not state of them is left
    out. An axis of which the sheet has no slow term stays as it is.
    """
    slow = {
        axis: [term for term in channel.terms if term.name not in NO_SLOW_BIAS]
        for axis, channel in sheet.channels.items()
    }
    lent = {axis: _with_stated(found.channels[axis], slow[axis]) for axis in axes if slow.get(axis)}
    source = with_borrowed(found.source, lent, f"{SHEET_OF}{sheet.source.get('name', 'the sensor')}")
    return replace(found, channels={**found.channels, **lent}, source=source)


def _with_stated(channel: ChannelIdentification, stated: Iterable[TermEstimate]) -> ChannelIdentification:
    """Return an axis with terms of a sheet in place of slow ones that are only limited."""
    limits = {
        term.name: next(iter(term.coefficients.values())).upper for term in channel.terms if not term.present
    }
    known = [term for term in channel.terms if term.present or term.name in NO_SLOW_BIAS]
    lent = []
    for term in stated:
        name, size = next(iter(term.coefficients.items()))
        most = limits.get(term.name)
        if most is not None and size.value is not None and size.value > most:
            term = replace(term, coefficients={**term.coefficients, name: replace(size, value=most)})
        lent += [term] * (term.name not in {one.name for one in known})
    return replace(channel, terms=(*known, *lent))


def unstated_terms(source: Identification | FilterConfig) -> tuple[str, ...]:
    """Return the slow terms, in words, of which some axis has neither a value nor a limit.

    What is predicted without such a term is a least error: the term is unknown and not zero.

    Parameters
    ----------
    source : Identification or FilterConfig
        Noise of a sensor, or settings made from it.
    """
    axes = [
        {term.name for term in (one.identified if isinstance(one, ChannelNoise) else one.terms)}
        for one in source.channels.values()
    ]
    walk = all(RandomWalk.name in terms for terms in axes)
    flicker = all(terms - NO_SLOW_BIAS - {RandomWalk.name} for terms in axes)
    return ("bias instability",) * (not flicker) + ("bias random walk",) * (not walk)


def _has_slow_bias(source: Identification | FilterConfig, axis: str) -> bool:
    if isinstance(source, FilterConfig):
        channel = source.channels[axis]
        return bool(channel.markov) or channel.random_walk_density > 0.0
    return any(
        term.name not in NO_SLOW_BIAS and any(c.value or c.upper for c in term.coefficients.values())
        for term in source.channels[axis].terms
    )


def _white_density(source: Identification | FilterConfig, axes: list[str]) -> float:
    """Return the white density of a sensor, unit/√Hz, rms over its axes; 0 where none is known."""
    if isinstance(source, FilterConfig):
        known = [source.channels[axis].white_density for axis in axes]
    else:
        terms = [term for axis in axes for term in source.channels[axis].terms if term.name == White.name]
        known = [c.value or c.upper or 0.0 for term in terms for c in term.coefficients.values()]
    return math.sqrt(sum(value**2 for value in known) / len(known)) if known else 0.0


def _usual(sensor: str, white: float) -> str:
    """Return the bias instabilities of the built-in sensors of nearest white noise, and their names."""
    stated = {}
    for name in grade_names():
        triad = getattr(load_grade(name), sensor)
        if triad.white is not None and triad.bias_instability is not None:
            stated[name] = (triad.white.value, triad.bias_instability.value, triad.unit)
    near = sorted(stated, key=lambda name: abs(math.log(stated[name][0] / white)) if white else 0.0)
    chosen = near[:SIMILAR_GRADES]
    unit = stated[chosen[0]][2]
    low, high = (
        digits(
            in_customary(ALLAN_FLOOR * end(stated[n][1] for n in chosen), "bias_instability.level", unit), 2
        )
        for end in (min, max)
    )
    span = low if low == high else f"{low} to {high}"
    shown = pretty(customary_unit("bias_instability.level", unit))
    return f"{span} {shown}, the Allan minimum, by the built-in sheets of nearest white noise ({', '.join(chosen)})"
