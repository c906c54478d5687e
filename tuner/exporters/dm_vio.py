"""DM-VIO settings: continuous densities for GTSAM's preintegration; the bias walks K √dt between keyframes.

accelerometer_noise_density m/s²/√Hz, gyroscope_noise_density rad/s/√Hz, accelerometer_random_walk m/s³/√Hz,
gyroscope_random_walk rad/s²/√Hz, integration_sigma m/√s. The files it ships state far larger numbers,
integration_sigma 0.3 among them: its photometric residuals are weighted on their own, and these are a tuning, not a
sensor.

Source: lukasvst/dm-vio src/IMU/IMUSettings.cpp (registerArgs), src/IMU/IMUIntegration.cpp, src/IMU/IMUUtils.cpp.
"""

from __future__ import annotations

from tuner.exporters import kalibr
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.formats.yaml_text import Noted, yaml_text
from tuner.synthesis.projection import CAMERA
from tuner.types import FilterConfig

_INTEGRATION_SIGMA = 1e-6
"""Error of the integration itself, m/√s, squared into a covariance: small beside any noise, large enough to invert."""


def write(config: FilterConfig, target: Target) -> str:
    """Return the noise entries of DM-VIO's settings."""
    entries = {
        **kalibr.noise_entries(config, target),
        "integration_sigma": Noted(_INTEGRATION_SIGMA, "m/√s; the default of 0.316227 is 0.3 m after 1 s"),
    }
    header = (
        *provenance(config, "DM-VIO: noise entries of the settings", target),
        "the sensor's own numbers; those of DM-VIO's examples are larger, tuned beside its photometric weights",
    )
    return yaml_text(entries, header=header)


DIALECT = Dialect(
    "dm-vio", "DM-VIO settings", f"{kalibr.DIALECT.units}, m/√s", write, aiding=CAMERA, shared=True
)
