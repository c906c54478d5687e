"""MATLAB ``imuSensor``: parameters of gyros and accelerometers, SI; RandomWalk is K, not N.

NoiseDensity N, BiasInstability B and RandomWalk K are the noise terms themselves, as the simulator draws flicker too;
where the model has other terms, their equivalents of white noise and walk take the place of N, B and K. ConstantBias
is one turn-on sd. NoiseType is set to single-sided, in which N and K are the densities of IEEE Std 952; its default,
double-sided, draws white noise of N/√2.

Source: MathWorks, reference pages of gyroparams and imuSensor (Algorithms); the code is not public.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from models.noise import BiasInstability
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.one_state import SIMULATED_HORIZON
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import triad, triple
from tuner.synthesis.equivalent_models import equivalent_noise
from tuner.types import ChannelNoise, FilterConfig

_TERMS_WITHOUT_BIAS = frozenset({"white", "quantization", "sinusoid", "low_pass_white", "arma"})
"""Terms that are no part of a bias."""

_SAME_DEVIATION = 1.2
"""Ratio of Allan deviations up to which states stand for B and K: a ladder of a state a decade follows flicker to 10 %;
settings that were fitted to a curve instead are further off."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a script that defines ``imu``."""
    text = f"imu = imuSensor('accel-gyro', 'SampleRate', {target.rate!r}); % Hz\n"
    for sensor, field, maker, unit in (
        ("gyro", "Gyroscope", "gyroparams", "rad/s"),
        ("accel", "Accelerometer", "accelparams", "m/s²"),
    ):
        channels = triad(config, sensor)
        if not channels:
            continue
        own = [_own_terms(channel) for channel in channels]
        if all(own):
            levels = {
                c.axis: (c.white_density, *terms) for c, terms in zip(channels, own, strict=True) if terms
            }
            words = ""
        else:
            found = {c.axis: equivalent_noise(c, memory=target.memory) for c in channels}
            levels = {axis: (n.white_density, 0.0, n.random_walk_density) for axis, n in found.items()}
            words = f"; N and K stand for the whole bias over {target.memory:g} s"
        white, white_note = triple(channels, _pick(levels, 0), f"{unit}/√Hz; N{words}")
        flicker, flicker_note = triple(channels, _pick(levels, 1), f"{unit}; B")
        drive, drive_note = triple(channels, _pick(levels, 2), f"{unit}·√Hz; K{words}")
        constant, constant_note = triple(channels, lambda c: c.constant_sd, f"{unit}; one turn-on sd")
        text += (
            f"imu.{field} = {maker}( ...\n"
            f"    'NoiseType', 'single-sided', ...\n"
            f"    'NoiseDensity', {vector(white)}, ... % {white_note}\n"
            f"    'BiasInstability', {vector(flicker)}, ... % {flicker_note}\n"
            f"    'RandomWalk', {vector(drive)}, ... % {drive_note}\n"
            f"    'ConstantBias', {vector(constant)}); % {constant_note}\n"
        )
    return commented(provenance(config, "MATLAB imuSensor"), "%") + text


def _pick(levels: Mapping[str, tuple[float, float, float]], index: int) -> Callable[[ChannelNoise], float]:
    return lambda channel: levels[channel.axis][index]


def _own_terms(channel: ChannelNoise) -> tuple[float, float] | None:
    """Return B and K where the configured bias consists of them alone, else None."""
    fields = {"bias_instability": "level", "random_walk": "density"}
    found = dict.fromkeys(fields, 0.0)
    for term in channel.identified:
        if term.name in fields:
            found[term.name] = term.coefficients[fields[term.name]].value or 0.0
        elif term.name not in _TERMS_WITHOUT_BIAS and term.present:
            return None
    b, k = found["bias_instability"], found["random_walk"]
    lags = np.geomspace(1.0, SIMULATED_HORIZON, 16)
    own = channel.white_density**2 / lags + k**2 * lags / 3.0
    if b:
        own = own + BiasInstability(b).allan_variance(lags)
    configured = channel.white_density**2 / lags + channel.random_walk_density**2 * lags / 3.0
    for state in channel.markov:
        configured = configured + state.allan_variance(lags)
    ratio = np.sqrt(own / configured)
    return (b, k) if ratio.max() < _SAME_DEVIATION and ratio.min() > 1.0 / _SAME_DEVIATION else None


DIALECT = Dialect(
    "matlab",
    "MATLAB imuSensor (script)",
    "(rad/s)/√Hz, rad/s, (rad/s)·√Hz, (m/s²)/√Hz, m/s², (m/s²)·√Hz",
    write,
    needs=(),
)
