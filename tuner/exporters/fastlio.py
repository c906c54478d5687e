"""FAST-LIO and FAST-LIO2: variances per IMU step, as the filter adds (dt F) Q (dt F)'.

acc_cov, gyr_cov = N² / dt        b_acc_cov, b_gyr_cov = K² / dt
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import limited, mean, triad
from tuner.formats.yaml_text import yaml_text
from tuner.synthesis.projection import LIDAR
from tuner.types import ChannelNoise, FilterConfig


def entries(config: FilterConfig, target: Target) -> dict[str, Any]:
    """Return the four variances by FAST-LIO's names."""

    def white(channel: ChannelNoise) -> float:
        return target.white_density(channel) ** 2 / target.interval

    def walk(channel: ChannelNoise) -> float:
        return target.bias(channel) ** 2 / target.interval

    found: dict[str, Any] = {}
    quantities: tuple[tuple[str, str, str, Callable[[ChannelNoise], float]], ...] = (
        ("acc_cov", "accel", "(m/s²)²; N²/dt", white),
        ("gyr_cov", "gyro", "(rad/s)²; N²/dt", white),
        ("b_acc_cov", "accel", "(m/s³)²; K²/dt", walk),
        ("b_gyr_cov", "gyro", "(rad/s²)²; K²/dt", walk),
    )
    for key, sensor, note, quantity in quantities:
        if channels := triad(config, sensor):
            words = limited(config, channels, note) if quantity is walk else note
            found[key] = mean(channels, quantity, words).noted()
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
DIALECT = Dialect("fastlio", "FAST-LIO and FAST-LIO2 YAML", _UNITS, write, aiding=LIDAR)
ROS2 = Dialect("fastlio-ros2", "FAST-LIO2 parameters of ROS 2", _UNITS, write_ros2, aiding=LIDAR)
