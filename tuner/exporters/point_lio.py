"""Point-LIO: variances per IMU step: N²/dt of measurements and inputs, K²/dt of biases, as it adds Q dt².

The IMU as a measurement (the default): imu_meas_acc_cov, imu_meas_omg_cov; as an input (use_imu_as_input):
acc_cov_input, gyr_cov_input. acc_cov_output, gyr_cov_output and vel_cov describe the motion, which a sensor does not
know.

Source: hku-mars/Point-LIO src/parameters.cpp, src/Estimator.cpp (process_noise_cov_input, h_model_IMU_output),
include/IKFoM/IKFoM_toolkit/esekfom/esekfom.hpp (predict).
"""

from __future__ import annotations

from tuner.exporters import fastlio
from tuner.exporters.dialect import Dialect, Target
from tuner.formats.yaml_text import yaml_text
from tuner.synthesis.projection import LIDAR
from tuner.types import FilterConfig

_KEYS = {
    "imu_meas_acc_cov": "acc_cov",
    "imu_meas_omg_cov": "gyr_cov",
    "acc_cov_input": "acc_cov",
    "gyr_cov_input": "gyr_cov",
    "b_acc_cov": "b_acc_cov",
    "b_gyr_cov": "b_gyr_cov",
}
"""Its keys, and those of FAST-LIO for the same number."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the mapping entries of Point-LIO that follow from the sensor."""
    known = fastlio.entries(config, target)
    header = fastlio.header(config, target, "Point-LIO: mapping entries of the IMU")
    return yaml_text({"mapping": {key: known[same] for key, same in _KEYS.items()}}, header=header)


DIALECT = Dialect("point-lio", "Point-LIO YAML", fastlio.DIALECT.units, write, aiding=LIDAR, shared=True)
