"""Basalt ``calibration.json``: continuous densities by axis; the code takes N √rate a sample, K √dt between frames.

imu_update_rate Hz, accel_noise_std m/s²/√Hz, gyro_noise_std rad/s/√Hz, accel_bias_std m/s³/√Hz, gyro_bias_std
rad/s²/√Hz: five entries of its ``value0``. JSON has no comments: they stand in ``comment``, which Basalt does not
read.

Source: VladyslavUsenko/basalt-headers-mirror include/basalt/calibration/calibration.hpp,
VladyslavUsenko/basalt src/vi_estimator/sqrt_keypoint_vio.cpp, include/basalt/linearization/imu_block.hpp.
"""

from __future__ import annotations

import json
from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, triple
from tuner.synthesis.equivalent_models import equivalent_random_walk, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the entries of a calibration file that follow from the sensor."""

    def density(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory)

    def walk(channel: ChannelNoise) -> float:
        return equivalent_random_walk(channel, memory=target.memory)

    entries: dict[str, Any] = {"imu_update_rate": target.rate}
    for sensor in ("accel", "gyro"):
        channels = triad(config, sensor)
        entries[f"{sensor}_noise_std"], _ = triple(channels, density, "")
        entries[f"{sensor}_bias_std"], _ = triple(channels, walk, "")
    header = provenance(config, "Basalt: noise entries of calibration.json", walk_memory=target.memory)
    return json.dumps({"comment": header, "value0": entries}, indent=2, ensure_ascii=False) + "\n"


DIALECT = Dialect(
    "basalt", "Basalt calibration.json", "Hz, m/s²/√Hz, m/s³/√Hz, rad/s/√Hz, rad/s²/√Hz (continuous)", write
)
