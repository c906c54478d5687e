"""Gazebo SDF: noise elements of an IMU sensor, per sample, with one Gauss–Markov bias an axis.

stddev = N/√dt of a sample; dynamic_bias_stddev = σ√(2/T), the driving density and not the sd of the bias;
dynamic_bias_correlation_time = T; bias_stddev = turn-on sd.
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import STATES_IN_WHITE, provenance
from tuner.exporters.triad_values import longest_time, triad
from tuner.formats.digits import rounded
from tuner.synthesis.equivalent_models import equivalent_markov_sd, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the ``imu`` element."""
    time = longest_time(config)
    header = (
        *provenance(config, "Gazebo SDF: noise of an IMU sensor"),
        "stddev = N/√dt; dynamic_bias_stddev = σ√(2/T), a driving density; bias_stddev: turn-on sd",
        f"dt = {target.interval:g} s; one T = {time:g} s",
        f"σ lets the bias wander as far in {target.memory:g} s as the modelled one",
        STATES_IN_WHITE,
    )
    body = "".join(
        f"  <{element}>\n{''.join(_axis(c, time, target) for c in triad(config, sensor))}  </{element}>\n"
        for sensor, element in (("gyro", "angular_velocity"), ("accel", "linear_acceleration"))
        if triad(config, sensor)
    )
    remarks = "\n".join(" ".join(line.split()).replace("--", "–") for line in header)
    return f"<!--\n{remarks}\n-->\n<imu>\n{body}</imu>\n"


def _axis(channel: ChannelNoise, time: float, target: Target) -> str:
    letter = channel.axis.rpartition("_")[2]
    density = equivalent_white_density(channel, memory=target.memory)
    sd = equivalent_markov_sd(channel, time, memory=target.memory)
    entries = {
        "mean": 0.0,
        "stddev": density / math.sqrt(target.interval),
        "bias_mean": 0.0,
        "bias_stddev": channel.constant_sd,
        "dynamic_bias_stddev": sd * math.sqrt(2.0 / time),
        "dynamic_bias_correlation_time": time,
    }
    noise = "".join(f"        <{name}>{rounded(value)!r}</{name}>\n" for name, value in entries.items())
    return f'    <{letter}>\n      <noise type="gaussian">\n{noise}      </noise>\n    </{letter}>\n'


DIALECT = Dialect(
    "gazebo", "Gazebo SDF noise elements", "rad/s, m/s² (per sample), rad/s/√s, m/s²/√s, s", write
)
