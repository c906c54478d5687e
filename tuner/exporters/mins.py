"""MINS ``config_imu.yaml``: continuous densities; the code divides N² by dt and multiplies K² by it.

imu: accel_noise m/s²/√Hz, accel_bias m/s³/√Hz, gyro_noise rad/s/√Hz, gyro_bias rad/s²/√Hz. The two "bias" keys are
walks.

Source: rpng/MINS mins/src/options/OptionsIMU.cpp, mins/src/state/Propagator.cpp (Qc).
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return config_imu.yaml."""
    entries: dict[str, Any] = {}
    for sensor, unit, rate in (("accel", "m/s²", "m/s³"), ("gyro", "rad/s", "rad/s²")):
        channels = triad(config, sensor)
        entries[f"{sensor}_noise"] = white(channels, f"{unit}/√Hz; N", target).noted()
        entries[f"{sensor}_bias"] = walk(config, channels, f"{rate}/√Hz; K", target).noted()
    entries["topic"] = Noted("/imu0", "set to the topic of the IMU")
    header = provenance(config, "MINS: config_imu.yaml", target)
    return "%YAML:1.0\n" + yaml_text({"imu": entries}, header=header)


DIALECT = Dialect(
    "mins",
    "MINS config_imu.yaml",
    "m/s²/√Hz, m/s³/√Hz, rad/s/√Hz, rad/s²/√Hz (continuous)",
    write,
    aiding=CAMERA,
    shared=True,
)
