"""ORB-SLAM3: continuous densities; the code itself takes N √f and K / √f.

IMU.NoiseGyro rad/s/√Hz, IMU.NoiseAcc m/s²/√Hz, IMU.GyroWalk rad/s²/√Hz, IMU.AccWalk m/s³/√Hz, IMU.Frequency Hz. A
file with ``File.version: "1.0"`` is read by src/Settings.cc, which wants every number real, with a decimal point; one
without by src/Tracking.cc (ParseIMUParamFile), which wants the four noises real and the frequency an integer.
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def _write(config: FilterConfig, target: Target, first: dict[str, Any], frequency: float) -> str:
    entries = dict(first)
    if gyro := triad(config, "gyro"):
        entries["IMU.NoiseGyro"] = white(gyro, "rad/s/√Hz; N", target).noted()
        entries["IMU.GyroWalk"] = walk(config, gyro, "rad/s²/√Hz; K", target).noted()
    if accel := triad(config, "accel"):
        entries["IMU.NoiseAcc"] = white(accel, "m/s²/√Hz; N", target).noted()
        entries["IMU.AccWalk"] = walk(config, accel, "m/s³/√Hz; K", target).noted()
    entries["IMU.Frequency"] = Noted(frequency, "Hz")
    header = provenance(config, "ORB-SLAM3: IMU entries of the settings file", target)
    return "%YAML:1.0\n" + yaml_text(entries, header=header)


def write(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of a settings file of version 1.0."""
    return _write(config, target, {"File.version": "1.0"}, target.rate)


def write_unversioned(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of a settings file without version; the rate is rounded to whole Hz."""
    return _write(config, target, {}, max(1, round(target.rate)))


_UNITS = "rad/s/√Hz, rad/s²/√Hz, m/s²/√Hz, m/s³/√Hz (continuous)"
DIALECT = Dialect(
    "orbslam3", "ORB-SLAM3 settings, File.version 1.0", _UNITS, write, aiding=CAMERA, shared=True
)
UNVERSIONED = Dialect(
    "orbslam3-old",
    "ORB-SLAM3 settings without File.version",
    _UNITS,
    write_unversioned,
    aiding=CAMERA,
    shared=True,
)
