"""Whether the noise of a sensor is enough for a filter: white noise and one description of its slow bias.

Without a slow bias a filter takes its estimate of the bias for known after a while, and diverges from the truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from models.noise import LowPassWhite, Quantization, Ramp, RandomWalk, Sinusoid, White
from models.noise.bias_instability import ALLAN_FLOOR
from tuner.catalogue.grades import grade_names, load_grade
from tuner.formats.customary_units import customary_unit, digits, in_customary, pretty
from tuner.types import ChannelNoise, FilterConfig, Identification

SENSORS: Mapping[str, str] = MappingProxyType({"gyro": "gyroscopes", "accel": "accelerometers"})
"""Prefix of the axes of the two triads, and their name."""
NO_SLOW_BIAS = frozenset(kind.name for kind in (White, LowPassWhite, Quantization, Ramp, Sinusoid))
"""Terms that say nothing of how a bias wanders."""
SIMILAR_GRADES = 3
"""Built-in sensors of nearest white noise whose bias instabilities are called usual: two give no range."""
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
