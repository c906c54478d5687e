"""FAST-LIO and FAST-LIO2: variances per IMU step, as the filter adds (dt F) Q (dt F)'.

acc_cov, gyr_cov = N² / dt        b_acc_cov, b_gyr_cov = K² / dt
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import mean, triad
from tuner.formats.yaml_text import yaml_text
from tuner.synthesis.equivalent_models import equivalent_random_walk, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the mapping entries of FAST-LIO."""

    def white(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory) ** 2 / target.interval

    def walk(channel: ChannelNoise) -> float:
        return equivalent_random_walk(channel, memory=target.memory) ** 2 / target.interval

    entries: dict[str, Any] = {}
    quantities: tuple[tuple[str, str, str, Callable[[ChannelNoise], float]], ...] = (
        ("acc_cov", "accel", "(m/s²)²; N²/dt", white),
        ("gyr_cov", "gyro", "(rad/s)²; N²/dt", white),
        ("b_acc_cov", "accel", "(m/s³)²; K²/dt", walk),
        ("b_gyr_cov", "gyro", "(rad/s²)²; K²/dt", walk),
    )
    for key, sensor, note, quantity in quantities:
        if channels := triad(config, sensor):
            entries[key] = mean(channels, quantity, note).noted()
    header = (
        *provenance(config, "FAST-LIO: mapping entries", walk_memory=target.memory),
        f"dt = {target.interval:g} s of the IMU",
    )
    return yaml_text({"mapping": entries}, header=header)


DIALECT = Dialect(
    "fastlio", "FAST-LIO and FAST-LIO2 YAML", "(rad/s)², (rad/s²)², (m/s²)², (m/s³)² (per IMU step)", write
)
