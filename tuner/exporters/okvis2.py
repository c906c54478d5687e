"""OKVIS2: continuous densities; the code adds dt·sigma² at each step. The bias priors are turn-on sds.

imu_parameters: sigma_g_c rad/s/√Hz, sigma_a_c m/s²/√Hz, sigma_gw_c rad/s²/√Hz, sigma_aw_c m/s³/√Hz, sigma_bg rad/s,
sigma_ba m/s², g m/s².

Source: smartroboticslab/okvis2 okvis_common/src/ViParametersReader.cpp, okvis_ceres/src/ImuError.cpp (propagation),
okvis_ceres/src/ViGraph.cpp (SpeedAndBiasError).
"""

from __future__ import annotations

from typing import Any

from models.units import STANDARD_GRAVITY
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import initial_bias_sd, rms, triad, walk, white
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return the noise entries of an OKVIS2 configuration."""
    entries: dict[str, Any] = {}
    for sensor, letter, unit, rate in (("gyro", "g", "rad/s", "rad/s²"), ("accel", "a", "m/s²", "m/s³")):
        channels = triad(config, sensor)
        entries[f"sigma_{letter}_c"] = white(channels, f"{unit}/√Hz; N", target).noted()
        entries[f"sigma_{letter}w_c"] = walk(config, channels, f"{rate}/√Hz; K", target).noted()
        entries[f"sigma_b{letter}"] = rms(
            channels, initial_bias_sd, f"{unit}; constant and states together"
        ).noted()
    entries["g"] = Noted(STANDARD_GRAVITY, "m/s²")
    header = provenance(config, "OKVIS2: noise entries of imu_parameters", target)
    return "%YAML:1.0\n" + yaml_text({"imu_parameters": entries}, header=header)


DIALECT = Dialect(
    "okvis2",
    "OKVIS2 YAML",
    "rad/s/√Hz, rad/s²/√Hz, rad/s, m/s²/√Hz, m/s³/√Hz, m/s² (continuous)",
    write,
    aiding=CAMERA,
    shared=True,
)
