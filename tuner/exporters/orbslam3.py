"""ORB-SLAM3: continuous densities; the code itself takes N √f and K / √f.

IMU.NoiseGyro rad/s/√Hz, IMU.NoiseAcc m/s²/√Hz, IMU.GyroWalk rad/s²/√Hz, IMU.AccWalk m/s³/√Hz, IMU.Frequency
Hz. Its parser wants real numbers, so every one is written with a decimal point.
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of an ORB-SLAM3 settings file."""
    entries: dict[str, Any] = {}
    if gyro := triad(config, "gyro"):
        entries["IMU.NoiseGyro"] = white(gyro, "rad/s/√Hz; N", memory=target.memory).noted()
        entries["IMU.GyroWalk"] = walk(gyro, "rad/s²/√Hz; K", target).noted()
    if accel := triad(config, "accel"):
        entries["IMU.NoiseAcc"] = white(accel, "m/s²/√Hz; N", memory=target.memory).noted()
        entries["IMU.AccWalk"] = walk(accel, "m/s³/√Hz; K", target).noted()
    entries["IMU.Frequency"] = Noted(target.rate, "Hz")
    header = provenance(config, "ORB-SLAM3: IMU entries of the settings file", walk_memory=target.memory)
    return "%YAML:1.0\n" + yaml_text(entries, header=header)


DIALECT = Dialect(
    "orbslam3", "ORB-SLAM3 settings", "rad/s/√Hz, rad/s²/√Hz, m/s²/√Hz, m/s³/√Hz (continuous)", write
)
