"""pyins: a Python snippet with the two ``EstimationModel`` objects, SI; its biases are random walks.

It refuses a walk for a bias whose initial sd is 0: the sd is that of constant and states together, and where neither
is known what the walk makes in `tuner.synthesis.projection.STILL_TIME`.

Source: nmayorov/pyins pyins/inertial_sensor.py (EstimationModel).
"""

from __future__ import annotations

import math

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import initial_bias_sd, limited, triad, triple
from tuner.synthesis.projection import STILL_TIME
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a Python module with ``gyro_model`` and ``accel_model``."""

    def start(channel: ChannelNoise) -> float:
        return initial_bias_sd(channel) or target.bias(channel) * math.sqrt(STILL_TIME)

    text = "from pyins.inertial_sensor import EstimationModel\n"
    for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s²")):
        channels = triad(config, sensor)
        if not channels:
            continue
        constant, constant_note = triple(channels, start, f"{unit}; constant and states together")
        white, white_note = triple(channels, target.white_density, f"{unit}/√Hz; N")
        drive, drive_note = triple(channels, target.bias, limited(config, channels, f"{unit}/√s; K"))
        text += (
            f"\n{sensor}_model = EstimationModel(\n"
            f"    bias_sd={vector(constant)},  # {constant_note}\n"
            f"    noise={vector(white)},  # {white_note}\n"
            f"    bias_walk={vector(drive)},  # {drive_note}\n)\n"
        )
    header = provenance(config, "pyins estimation models", target)
    return commented(header, "#") + text


DIALECT = Dialect(
    "pyins", "pyins estimation models (Python)", "rad/s, rad/s/√Hz, rad/s/√s, m/s², m/s²/√Hz, m/s²/√s", write
)
