"""LVI-SAM: its lidar half reads LIO-SAM's continuous densities, its visual half VINS' figures per sample.

params_lidar.yaml, below the project's name ``lvi_sam``: imuAccNoise, imuGyrNoise, imuAccBiasN, imuGyrBiasN.
params_camera.yaml: acc_n, gyr_n, acc_w, gyr_w of the mid-point integration of VINS.

Source: TixiaoShan/LVI-SAM src/lidar_odometry/imuPreintegration.cpp, utility.h (PROJECT_NAME);
src/visual_odometry/visual_estimator/parameters.cpp, factor/integration_base.h.
"""

from __future__ import annotations

from tuner.exporters import liosam, vins
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.formats.yaml_text import yaml_text
from tuner.types import FilterConfig


def write_lidar(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of params_lidar.yaml."""
    header = provenance(config, "LVI-SAM: IMU entries of params_lidar.yaml", target)
    return yaml_text({"lvi_sam": liosam.entries(config, target)}, header=header)


def write_camera(config: FilterConfig, target: Target) -> str:
    """Return the IMU entries of params_camera.yaml."""
    return vins.text(config, target, "LVI-SAM: IMU entries of params_camera.yaml")


LIDAR = Dialect(
    "lvi-sam",
    "LVI-SAM params_lidar.yaml",
    liosam.DIALECT.units,
    write_lidar,
    aiding=liosam.DIALECT.aiding,
    shared=True,
)
CAMERA = Dialect(
    "lvi-sam-camera",
    "LVI-SAM params_camera.yaml",
    vins.DIALECT.units,
    write_camera,
    aiding=vins.DIALECT.aiding,
    shared=True,
)
