"""The static causes by their codes: make one, read one from text, draw one, hide several in a block.

======================  ==============================================  ==========================
code                    parameters                                      module
======================  ==============================================  ==========================
line                    frequency, amplitude, modulation_frequency,     spectral
                        modulation_depth
comb                    spacing, sd                                     spectral
vibration               frequency, quality, sd                          spectral
lowpass                 cutoff                                          spectral
colour                  ar, ma                                          spectral
gauss_markov            sd, time_constant                               spectral
temperature             slope                                           thermal
thermal_lag             slope, time_constant, prompt_slope              thermal
temperature_squared     curvature                                       thermal
temperature_rate        slope                                           thermal
hysteresis              slope, width                                    thermal
warmup                  amplitude, time_constant                        thermal
step                    time, size                                      events
recovery                time, size, time_constant                       events
telegraph               size, dwell_low, dwell_high                     events
spikes                  rate, size                                      events
motion                  start, duration                                 events
heavy_tails             excess_kurtosis                                 distribution
burst                   start, duration, variance_ratio                 distribution
variance_drift          slope                                           distribution
periodic_variance       period, depth                                   distribution
skewed_noise            skewness                                        distribution
cross_axis              correlation                                     distribution
duplicates              fraction                                        sampling
timing                  gap_count, jitter_sd, clock_ratio               sampling
clipping                low, high                                       sampling
lattice                 step, deadband                                  sampling
overflow                low, high                                       sampling
attitude                tilt                                            geometry
======================  ==============================================  ==========================

Some have one further parameter that no finding reports, such as the phase of a line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from inspect import isabstract
from typing import Any

import numpy as np

from models.effects.parsing import kind
from models.effects.parsing import parse as text_parse
from models.effects.static.attitude import Attitude
from models.effects.static.base import STAMP, Effect, Samples, Scale, require_positive
from models.effects.static.distribution import (
    Burst,
    CrossAxis,
    HeavyTails,
    PeriodicVariance,
    SkewedNoise,
    VarianceDrift,
)
from models.effects.static.events import Motion, Recovery, Spikes, Step, Telegraph
from models.effects.static.sampling import Clipping, Duplicates, Overflow, Quantizer, Timing
from models.effects.static.spectral import Colour, Comb, CorrelatedDrift, Line, LowPass, Vibration
from models.effects.static.thermal import (
    Hysteresis,
    TemperatureRate,
    TemperatureSlope,
    TemperatureSquared,
    ThermalLag,
    Warmup,
)
from models.registry import Registry


def _effect_of(declared: Any) -> type[Effect] | None:
    """Return the effect of what an entry point names: that of a cause, None where it has none, or an effect."""
    effect: type[Effect] | None = getattr(declared, "effect", declared)
    return effect


def _complete(effect: type[Effect]) -> None:
    """Refuse what is not an effect that can be applied and drawn."""
    if not (isinstance(effect, type) and issubclass(effect, Effect)) or isabstract(effect):
        raise TypeError(
            f"expected a class of effects (models.effects.static.base.Effect) with apply and draw, got {effect!r}"
        )


EFFECTS: Registry[type[Effect]] = Registry(
    "effect", "tuner.causes", name_of=lambda effect: effect.name, check=_complete, declared_by=_effect_of
)
"""Class of every static cause, by its code; those of causes of other packages (`docs/extending/cause.md`) included."""
EFFECTS.extend(
    (
        Line, Vibration, LowPass, Colour, TemperatureSlope, ThermalLag, Step, Warmup, Telegraph,
        CorrelatedDrift, Spikes, HeavyTails, Burst, VarianceDrift, Duplicates, Timing, Clipping, Quantizer,
        CrossAxis, Attitude, Motion, SkewedNoise, PeriodicVariance, TemperatureSquared, TemperatureRate, Hysteresis,
        Comb, Recovery, Overflow,
    )
)  # fmt: skip


def parse(text: str) -> Effect:
    """Read an effect such as ``line:frequency=12.5,amplitude=0.01`` (see `models.effects.parsing`)."""
    return text_parse(text, EFFECTS)


def draw(
    code: str,
    rng: np.random.Generator,
    *,
    white_sd: float,
    interval: float,
    span: float,
    start: float = 0.0,
    floor: float | None = None,
    level: float = 0.0,
) -> Effect:
    """Draw the parameters of a cause at random, in the range that its class states.

    Parameters
    ----------
    code : str
        One of `EFFECTS`.
    rng : numpy.random.Generator
        Source of randomness.
    white_sd : float
        Standard deviation of the white noise of a sample, unit.
    interval, span, start : float
        Sampling interval, length and first time stamp of the record, s.
    floor : float, optional
        Smallest Allan deviation, unit; by default the white noise averaged over a hundredth of the record.
    level : float
        Mean of the channel, unit (rails lie about it).

    Returns
    -------
    Effect
        The effect.
    """
    require_positive(white_sd=white_sd, interval=interval, span=span)
    least = white_sd * float(np.sqrt(min(1.0, 100.0 * interval / span)))
    return kind(code, EFFECTS).draw(
        rng, Scale(white_sd, interval, span, start, least if floor is None else floor, level)
    )


def hide(
    block: Samples, effects: Sequence[tuple[Effect, Sequence[int]]], rng: np.random.Generator
) -> Samples:
    """Hide effects in a block, each in its own channels, in the order in which a sample meets them.

    Parameters
    ----------
    block : Samples
        The clean block.
    effects : sequence of (Effect, columns)
        Effects with the channels they act on; those on time stamps need every channel.
    rng : numpy.random.Generator
        Every effect gets a stream of its own from it.

    Returns
    -------
    Samples
        The block with the effects in it.

    Raises
    ------
    ValueError
        A channel that is not there, or stamps of some channels only.
    """
    width = block.y.shape[1]
    for effect, _ in effects:
        if effect.needs_temperature and block.temperature is None:
            raise ValueError(f"'{effect.name}' needs a block with a temperature, got one without")
    streams = rng.spawn(len(effects))
    for (effect, columns), stream in sorted(zip(effects, streams, strict=True), key=lambda e: e[0][0].stage):
        chosen = sorted(set(columns))
        if not chosen or not set(chosen) <= set(range(width)):
            raise ValueError(f"'columns' must be some of 0 … {width - 1}, got {list(columns)}")
        if len(chosen) == width:
            block = effect.apply(block, stream)
        elif effect.stage == STAMP:
            raise ValueError(f"'{effect.name}' acts on all {width} channels at once, got {list(columns)}")
        else:
            block = _hide_in(block, effect, chosen, stream)
    return block


def _hide_in(block: Samples, effect: Effect, columns: list[int], rng: np.random.Generator) -> Samples:
    white = block.white
    part = replace(block, y=block.y[:, columns], white=None if white is None else white[:, columns])
    changed = effect.apply(part, rng)
    y = block.y.copy()
    y[:, columns] = changed.y
    if white is not None and changed.white is not None:
        white = white.copy()
        white[:, columns] = changed.white
    return replace(block, y=y, white=white)
