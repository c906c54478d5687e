"""MATLAB ``imuSensor``: parameters of gyros and accelerometers, SI; RandomWalk is K, not N.

NoiseDensity N, BiasInstability B and RandomWalk K are the noise terms themselves, as the simulator draws flicker too;
where the model has other terms, B and K are those of `tuner.exporters.simulated_flicker`. ConstantBias is one turn-on
sd. NoiseType is set to single-sided, in which N and K are the densities of IEEE Std 952; its default,
double-sided, draws white noise of N/√2.

Source: MathWorks, reference pages of gyroparams and imuSensor (Algorithms); the code is not public.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.simulated_flicker import (
    FlickerAndWalk,
    flicker_words,
    simulated_flicker,
    with_mismatch,
)
from tuner.exporters.triad_values import triad, triple
from tuner.types import ChannelNoise, FilterConfig

_TERMS_WITHOUT_BIAS = frozenset({"white", "quantization", "sinusoid", "low_pass_white", "arma"})
"""Terms that are no part of a bias."""

_SAME_DEVIATION = 1.2
"""Ratio of Allan deviations up to which states stand for B and K: a ladder of a state a decade follows flicker to 10 %;
settings that were fitted to a curve instead are further off."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a script that defines ``imu``."""
    drawn: dict[str, FlickerAndWalk] = {}
    text = f"imu = imuSensor('accel-gyro', 'SampleRate', {target.rate!r}); % Hz\n"
    for sensor, field, maker, unit in (
        ("gyro", "Gyroscope", "gyroparams", "rad/s"),
        ("accel", "Accelerometer", "accelparams", "m/s²"),
    ):
        channels = triad(config, sensor)
        if not channels:
            continue
        found = {channel.axis: _own_terms(channel) or simulated_flicker(channel) for channel in channels}
        drawn |= found
        white, white_note = triple(channels, lambda c: c.white_density, f"{unit}/√Hz; N")
        flicker, flicker_note = triple(channels, _level(found), f"{unit}; B")
        walk, walk_note = triple(channels, _density(found), f"{unit}·√Hz; K")
        constant, constant_note = triple(channels, lambda c: c.constant_sd, f"{unit}; one turn-on sd")
        text += (
            f"imu.{field} = {maker}( ...\n"
            f"    'NoiseType', 'single-sided', ...\n"
            f"    'NoiseDensity', {vector(white)}, ... % {white_note}\n"
            f"    'BiasInstability', {vector(flicker)}, ... % {flicker_note}\n"
            f"    'RandomWalk', {vector(walk)}, ... % {walk_note}\n"
            f"    'ConstantBias', {vector(constant)}); % {constant_note}\n"
        )
    header = (*provenance(config, "MATLAB imuSensor"), *flicker_words(drawn))
    return commented(header, "%") + text


def _level(found: Mapping[str, FlickerAndWalk]) -> Callable[[ChannelNoise], float]:
    return lambda channel: found[channel.axis].level


def _density(found: Mapping[str, FlickerAndWalk]) -> Callable[[ChannelNoise], float]:
    return lambda channel: found[channel.axis].density


def _own_terms(channel: ChannelNoise) -> FlickerAndWalk | None:
    """Return B and K where the configured bias consists of them alone, else None."""
    fields = {"bias_instability": "level", "random_walk": "density"}
    found = dict.fromkeys(fields, 0.0)
    for term in channel.identified:
        if term.name in fields:
            found[term.name] = term.coefficients[fields[term.name]].value or 0.0
        elif term.name not in _TERMS_WITHOUT_BIAS and term.present:
            return None
    own = with_mismatch(channel, found["bias_instability"], found["random_walk"])
    return own if max(own.ratios) < _SAME_DEVIATION and min(own.ratios) > 1.0 / _SAME_DEVIATION else None


DIALECT = Dialect(
    "matlab",
    "MATLAB imuSensor (script)",
    "(rad/s)/√Hz, rad/s, (rad/s)·√Hz, (m/s²)/√Hz, m/s², (m/s²)·√Hz",
    write,
    needs=(),
)
