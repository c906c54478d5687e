"""pyins: a Python snippet with the two ``EstimationModel`` objects, SI; its biases are random walks.

It refuses a walk for a bias whose initial sd is 0: the sd is that of constant and states together, and where neither
is known what the walk makes in the memory of the filter.

Source: nmayorov/pyins pyins/inertial_sensor.py (EstimationModel).
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import initial_bias_sd, limited, triad, triple
from tuner.synthesis.equivalent_models import equivalent_random_walk, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a Python module with ``gyro_model`` and ``accel_model``."""

    def density(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory)

    def walk(channel: ChannelNoise) -> float:
        return equivalent_random_walk(channel, memory=target.memory)

    def start(channel: ChannelNoise) -> float:
        return initial_bias_sd(channel) or walk(channel) * math.sqrt(target.memory)

    text = "from pyins.inertial_sensor import EstimationModel\n"
    for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s²")):
        channels = triad(config, sensor)
        if not channels:
            continue
        constant, constant_note = triple(channels, start, f"{unit}; constant and states together")
        white, white_note = triple(channels, density, f"{unit}/√Hz; N")
        drive, drive_note = triple(channels, walk, limited(config, channels, f"{unit}/√s; K"))
        text += (
            f"\n{sensor}_model = EstimationModel(\n"
            f"    bias_sd={vector(constant)},  # {constant_note}\n"
            f"    noise={vector(white)},  # {white_note}\n"
            f"    bias_walk={vector(drive)},  # {drive_note}\n)\n"
        )
    header = provenance(config, "pyins estimation models", walk_memory=target.memory)
    return commented(header, "#") + text


DIALECT = Dialect(
    "pyins", "pyins estimation models (Python)", "rad/s, rad/s/√Hz, rad/s/√s, m/s², m/s²/√Hz, m/s²/√s", write
)
