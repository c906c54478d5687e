"""LIO-SAM ``params.yaml``: continuous densities for GTSAM's preintegration.

imuAccNoise m/s²/√Hz, imuGyrNoise rad/s/√Hz, imuAccBiasN m/s³/√Hz, imuGyrBiasN rad/s²/√Hz, imuGravity m/s².
"""

from __future__ import annotations

from typing import Any

from models.units import STANDARD_GRAVITY
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of LIO-SAM."""
    entries: dict[str, Any] = {}
    if accel := triad(config, "accel"):
        entries["imuAccNoise"] = white(accel, "m/s²/√Hz; N", memory=target.memory).noted()
        entries["imuAccBiasN"] = walk(accel, "m/s³/√Hz; K", target).noted()
    if gyro := triad(config, "gyro"):
        entries["imuGyrNoise"] = white(gyro, "rad/s/√Hz; N", memory=target.memory).noted()
        entries["imuGyrBiasN"] = walk(gyro, "rad/s²/√Hz; K", target).noted()
    entries["imuGravity"] = Noted(STANDARD_GRAVITY, "m/s²")
    header = provenance(config, "LIO-SAM: IMU entries of params.yaml", walk_memory=target.memory)
    return yaml_text({"lio_sam": entries}, header=header)


DIALECT = Dialect(
    "liosam", "LIO-SAM params.yaml", "rad/s/√Hz, rad/s²/√Hz, m/s²/√Hz, m/s³/√Hz (continuous)", write
)
