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
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the entries of a calibration file that follow from the sensor."""
    entries: dict[str, Any] = {"imu_update_rate": target.rate}
    for sensor in ("accel", "gyro"):
        channels = triad(config, sensor)
        entries[f"{sensor}_noise_std"], _ = triple(channels, target.white_density, "")
        entries[f"{sensor}_bias_std"], _ = triple(channels, target.bias, "")
    header = provenance(config, "Basalt: noise entries of calibration.json", target)
    return json.dumps({"comment": header, "value0": entries}, indent=2, ensure_ascii=False) + "\n"


DIALECT = Dialect(
    "basalt",
    "Basalt calibration.json",
    "Hz, m/s²/√Hz, m/s³/√Hz, rad/s/√Hz, rad/s²/√Hz (continuous)",
    write,
    aiding=CAMERA,
)
