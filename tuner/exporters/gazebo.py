"""Gazebo SDF: noise elements of an IMU sensor, per sample, with one Gauss–Markov bias an axis.

stddev = N/√dt of a sample; dynamic_bias_stddev = σ√(2/T), the driving density and not the sd of the bias;
dynamic_bias_correlation_time = T. σ and T are those of `tuner.exporters.one_state`. bias_mean and bias_stddev are the
state's first value and fade with it: the sd written is σ, so that the state starts stationary, or where that is
smaller the sd of constant and states together, as of a walk. A turn-on bias that stays goes into mean, and the header
says its sd.

Source: gazebosim/gz-sensors src/GaussianNoiseModel.cc (Load, ApplyImpl).
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target, longest_time
from tuner.exporters.header import provenance
from tuner.exporters.one_state import OneState, drawn_words, simulated_state
from tuner.exporters.scripts import xml_comment
from tuner.exporters.triad_values import initial_bias_sd, triad
from tuner.formats.digits import rounded
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the ``imu`` element."""
    preferred = longest_time(config)
    states = {axis: simulated_state(c, preferred=preferred) for axis, c in config.channels.items()}
    header = (
        *provenance(config, "Gazebo SDF: noise of an IMU sensor"),
        "stddev = N/√dt; dynamic_bias_stddev = σ√(2/T), a driving density",
        "bias_mean and bias_stddev fade with T: for a turn-on bias that stays draw one of this sd into mean: "
        + ", ".join(f"{c.axis} {c.constant_sd:.4g} {c.unit}" for c in config.channels.values()),
        f"dt = {target.interval:g} s",
        *drawn_words(states),
    )
    body = "".join(
        f"  <{element}>\n{''.join(_axis(c, states[c.axis], target) for c in triad(config, sensor))}  </{element}>\n"
        for sensor, element in (("gyro", "angular_velocity"), ("accel", "linear_acceleration"))
        if triad(config, sensor)
    )
    return f"{xml_comment(header)}<imu>\n{body}</imu>\n"


def _axis(channel: ChannelNoise, state: OneState, target: Target) -> str:
    letter = channel.axis.rpartition("_")[2]
    entries = {
        "mean": 0.0,
        "stddev": channel.white_density / math.sqrt(target.interval),
        "bias_mean": 0.0,
        "bias_stddev": min(state.sd, initial_bias_sd(channel) or state.sd),
        "dynamic_bias_stddev": state.sd * math.sqrt(2.0 / state.time_constant),
        "dynamic_bias_correlation_time": state.time_constant,
    }
    noise = "".join(f"        <{name}>{rounded(value)!r}</{name}>\n" for name, value in entries.items())
    return f'    <{letter}>\n      <noise type="gaussian">\n{noise}      </noise>\n    </{letter}>\n'


DIALECT = Dialect(
    "gazebo", "Gazebo SDF noise elements", "rad/s, m/s² (per sample), rad/s/√s, m/s²/√s, s", write, needs=()
)
