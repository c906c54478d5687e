"""RotorS, and PX4's plugins for Gazebo Classic: elements of the IMU plugin, densities, one Gauss–Markov bias a sensor.

gyroscopeNoiseDensity N, gyroscopeBiasCorrelationTime T, gyroscopeTurnOnBiasSigma, the like for the accelerometer. The
"RandomWalk" is the driving density of that state, σ√(2/T). RotorS reads gyroscopeBiasRandomWalk, though its own
models write gyroscopeRandomWalk, which PX4's plugin reads: both are written.

Source: ethz-asl/rotors_simulator rotors_gazebo_plugins/src/gazebo_imu_plugin.cpp (Load, AddNoise);
PX4/PX4-SITL_gazebo-classic src/gazebo_imu_plugin.cpp.
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target, longest_time
from tuner.exporters.header import provenance
from tuner.exporters.one_state import drawn_words, simulated_state
from tuner.exporters.scripts import xml_comment
from tuner.exporters.triad_values import triad
from tuner.formats.digits import rounded
from tuner.synthesis.projection import pooled
from tuner.types import FilterConfig

_RANDOM_WALK_KEYS = {
    "gyroscope": ("gyroscopeBiasRandomWalk", "gyroscopeRandomWalk"),
    "accelerometer": ("accelerometerRandomWalk",),
}


def write(config: FilterConfig, _: Target) -> str:
    """Return the elements of the plugin."""
    preferred = longest_time(config)
    pools = {
        name: pooled(channels)
        for sensor, name in (("gyro", "gyroscope"), ("accel", "accelerometer"))
        if (channels := triad(config, sensor))
    }
    states = {name: simulated_state(channel, preferred=preferred) for name, channel in pools.items()}
    lines = []
    for name, channel in pools.items():
        state = states[name]
        density = state.sd * math.sqrt(2.0 / state.time_constant)
        entries = {
            f"{name}NoiseDensity": channel.white_density,
            **dict.fromkeys(_RANDOM_WALK_KEYS[name], density),
            f"{name}BiasCorrelationTime": state.time_constant,
            f"{name}TurnOnBiasSigma": channel.constant_sd,
        }
        lines += [f"  <{key}>{rounded(value)!r}</{key}>\n" for key, value in entries.items()]
    header = (
        *provenance(config, "RotorS: elements of the IMU plugin"),
        "one value for three axes: their rms",
        *drawn_words(states),
    )
    return xml_comment(header) + "<plugin>\n" + "".join(lines) + "</plugin>\n"


DIALECT = Dialect(
    "rotors",
    "RotorS and PX4 Gazebo Classic IMU plugin",
    "rad/s/√Hz, rad/s²/√Hz, s, rad/s, m/s²/√Hz, m/s³/√Hz, s, m/s²",
    write,
    needs=(),
)
