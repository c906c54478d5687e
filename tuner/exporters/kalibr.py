"""Kalibr ``imu.yaml``: continuous two-sided densities; Kalibr divides by √dt itself and refuses zeros.

accelerometer_noise_density m/s²/√Hz, accelerometer_random_walk m/s³/√Hz, gyroscope_noise_density rad/s/√Hz,
gyroscope_random_walk rad/s²/√Hz, update_rate Hz.
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def noise_entries(config: FilterConfig, target: Target) -> dict[str, Any]:
    """Return the four densities by Kalibr's names, those of sensors the configuration has."""
    entries: dict[str, Any] = {}
    if accel := triad(config, "accel"):
        entries["accelerometer_noise_density"] = white(accel, "m/s²/√Hz, N", target).noted()
        entries["accelerometer_random_walk"] = walk(config, accel, "m/s³/√Hz, K", target).noted()
    if gyro := triad(config, "gyro"):
        entries["gyroscope_noise_density"] = white(gyro, "rad/s/√Hz, N", target).noted()
        entries["gyroscope_random_walk"] = walk(config, gyro, "rad/s²/√Hz, K", target).noted()
    return entries


def write(config: FilterConfig, target: Target) -> str:
    """Return the YAML of Kalibr's IMU."""
    tree = {
        "rostopic": Noted("/imu0", "set to the topic of the IMU"),
        "update_rate": Noted(target.rate, "Hz"),
        **noise_entries(config, target),
    }
    return yaml_text(tree, header=provenance(config, "Kalibr imu.yaml", target))


DIALECT = Dialect(
    "kalibr",
    "Kalibr imu.yaml",
    "rad/s/√Hz, rad/s²/√Hz, m/s²/√Hz, m/s³/√Hz (continuous)",
    write,
    aiding=CAMERA,
    shared=True,
)
