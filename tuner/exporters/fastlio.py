"""FAST-LIO and FAST-LIO2: variances per IMU step, as the filter adds (dt F) Q (dt F)'.

acc_cov, gyr_cov = N² / dt        b_acc_cov, b_gyr_cov = K² / dt
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.formats.yaml_text import yaml_text
from tuner.synthesis.projection import LIDAR
from tuner.types import FilterConfig


def entries(config: FilterConfig, target: Target) -> dict[str, Any]:
    """Return the four variances by FAST-LIO's names."""

    def per_step(density: float) -> float:
        return density**2 / target.interval

    found: dict[str, Any] = {}
    for sensor, letters, sample, rate in (
        ("accel", "acc", "(m/s²)²", "(m/s³)²"),
        ("gyro", "gyr", "(rad/s)²", "(rad/s²)²"),
    ):
        if channels := triad(config, sensor):
            found[f"{letters}_cov"] = white(channels, f"{sample}; N²/dt", target, per_step).noted()
            found[f"b_{letters}_cov"] = walk(config, channels, f"{rate}; K²/dt", target, per_step).noted()
    return found


def header(config: FilterConfig, target: Target, title: str) -> tuple[str, ...]:
    """Return the comment lines before the entries."""
    return (
        *provenance(config, title, target),
        f"dt = {target.interval:g} s of the IMU",
    )


def write(config: FilterConfig, target: Target) -> str:
    """Return the mapping entries of FAST-LIO."""
    tree = {"mapping": entries(config, target)}
    return yaml_text(tree, header=header(config, target, "FAST-LIO: mapping entries"))


def write_ros2(config: FilterConfig, target: Target) -> str:
    """Return the same as a parameter file of ROS 2."""
    tree = {"/**": {"ros__parameters": {"mapping": entries(config, target)}}}
    return yaml_text(tree, header=header(config, target, "FAST-LIO: mapping entries, ROS 2"))


_UNITS = "(rad/s)², (rad/s²)², (m/s²)², (m/s³)² (per IMU step)"
DIALECT = Dialect("fastlio", "FAST-LIO and FAST-LIO2 YAML", _UNITS, write, aiding=LIDAR, shared=True)
ROS2 = Dialect("fastlio-ros2", "FAST-LIO2 parameters of ROS 2", _UNITS, write_ros2, aiding=LIDAR, shared=True)
