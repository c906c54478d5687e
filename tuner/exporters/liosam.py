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
from tuner.synthesis.projection import LIDAR
from tuner.types import FilterConfig


def entries(config: FilterConfig, target: Target) -> dict[str, Any]:
    """Return the IMU entries by LIO-SAM's names."""
    found: dict[str, Any] = {}
    if accel := triad(config, "accel"):
        found["imuAccNoise"] = white(accel, "m/s²/√Hz; N", target).noted()
        found["imuAccBiasN"] = walk(config, accel, "m/s³/√Hz; K", target).noted()
    if gyro := triad(config, "gyro"):
        found["imuGyrNoise"] = white(gyro, "rad/s/√Hz; N", target).noted()
        found["imuGyrBiasN"] = walk(config, gyro, "rad/s²/√Hz; K", target).noted()
    found["imuGravity"] = Noted(STANDARD_GRAVITY, "m/s²")
    return found


def write(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of LIO-SAM."""
    header = provenance(config, "LIO-SAM: IMU entries of params.yaml", target)
    return yaml_text({"lio_sam": entries(config, target)}, header=header)


def write_ros2(config: FilterConfig, target: Target) -> str:
    """Return the settings as a parameter file of ROS 2, whose branch has no level ``lio_sam``."""
    header = provenance(config, "LIO-SAM: IMU entries of params.yaml, ROS 2", target)
    return yaml_text({"/**": {"ros__parameters": entries(config, target)}}, header=header)


_UNITS = "rad/s/√Hz, rad/s²/√Hz, m/s²/√Hz, m/s³/√Hz (continuous)"
DIALECT = Dialect("liosam", "LIO-SAM params.yaml", _UNITS, write, aiding=LIDAR, shared=True)
ROS2 = Dialect("liosam-ros2", "LIO-SAM params.yaml of ROS 2", _UNITS, write_ros2, aiding=LIDAR, shared=True)
