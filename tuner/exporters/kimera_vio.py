"""Kimera-VIO ``ImuParams.yaml``: continuous densities for GTSAM's preintegration.

gyroscope_noise_density rad/s/√Hz, gyroscope_random_walk rad/s²/√Hz, accelerometer_noise_density m/s²/√Hz,
accelerometer_random_walk m/s³/√Hz, rate_hz Hz. imu_preintegration_type 1 is GTSAM's ImuFactor with a walk of the
bias, K √dt, between frames; type 0 also adds imu_bias_init_sigma as noise of every step, so it is written as good as
zero.

Source: MIT-SPARK/Kimera-VIO src/imu-frontend/ImuFrontendParams.cpp, src/imu-frontend/ImuFrontend.cpp
(convertVioImuParamsToGtsam, generateCombinedImuParams), src/backend/VioBackend.cpp (addImuFactor).
"""

from __future__ import annotations

from typing import Any

from models.units import STANDARD_GRAVITY
from tuner.exporters import kalibr
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import initial_bias_sd, rms, triad
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig

_INTEGRATION_SIGMA = 1e-6
"""Error of the integration itself, m/√s, squared into a covariance: small beside any noise, large enough to invert."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the noise entries of ImuParams.yaml."""
    gyro, accel = (rms(triad(config, sensor), initial_bias_sd, "").value for sensor in ("gyro", "accel"))
    entries: dict[str, Any] = {
        "imu_preintegration_type": Noted(1, "ImuFactor"),
        "rate_hz": Noted(target.rate, "Hz"),
        "imu_bias_init_sigma": Noted(1e-12, "of type 0 alone, which would add it at every step"),
        **kalibr.noise_entries(config, target),
        "imu_integration_sigma": Noted(_INTEGRATION_SIGMA, "m/√s"),
        "n_gravity": Noted(Inline([0.0, 0.0, -STANDARD_GRAVITY]), "m/s²"),
    }
    header = (
        *provenance(config, "Kimera-VIO: noise entries of ImuParams.yaml", target),
        f"BackendParams.yaml: initialGyroBiasSigma: {gyro:g} (rad/s), initialAccBiasSigma: {accel:g} (m/s²)",
    )
    return "%YAML:1.0\n" + yaml_text(entries, header=header)


DIALECT = Dialect(
    "kimera-vio", "Kimera-VIO ImuParams.yaml", kalibr.DIALECT.units, write, aiding=CAMERA, shared=True
)
