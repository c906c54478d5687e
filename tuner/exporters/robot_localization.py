"""robot_localization: it has no bias state, so the noise of the IMU belongs into the messages of its driver.

angular_velocity_covariance = N²/dt (rad/s)², linear_acceleration_covariance = N²/dt (m/s²)², per sample. The filter's
own ``process_noise_covariance`` (state² per second) describes the vehicle, which a sensor does not know: it is left
alone. initial_estimate_covariance, 15 values, comes from P0; its last six are rates and accelerations of the
*vehicle*, which the sensor measures at once: wide where it has that sensor, the program's own 1e-9 where not.

Source: cra-ros-pkg/robot_localization src/ekf.cpp (predict), src/ros_filter.cpp (imuCallback, loadParams),
include/robot_localization/filter_common.hpp (StateMembers), params/ekf.yaml.
"""

from __future__ import annotations

from typing import Any

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, triple
from tuner.formats.digits import rounded
from tuner.formats.yaml_text import Inline, Noted, yaml_text
from tuner.types import FilterConfig

_DIAGONAL_NOTE = (
    "diagonal: m², rad², (m/s)²; rates (rad/s)² and accelerations (m/s²)² of the vehicle, measured at once"
)

_MEASURED_VARIANCE, _UNMEASURED_VARIANCE = 1.0, 1e-9
"""Initial variances of rates, (rad/s)², and accelerations, (m/s²)²: unknown before a sample, or never measured."""


def write(config: FilterConfig, target: Target) -> str:
    """Return driver covariances and the initial covariance."""
    message: dict[str, Any] = {}
    rates: dict[str, list[float]] = {"gyro": [_UNMEASURED_VARIANCE] * 3, "accel": [_UNMEASURED_VARIANCE] * 3}
    for sensor, key, unit in (
        ("gyro", "angular_velocity_covariance", "(rad/s)²"),
        ("accel", "linear_acceleration_covariance", "(m/s²)²"),
    ):
        if channels := triad(config, sensor):
            variances, note = triple(
                channels, lambda c: c.white_density**2 / target.interval, f"{unit}; N²/dt"
            )
            message[key] = Noted(Inline(_diagonal(variances)), note)
            rates[sensor] = [_MEASURED_VARIANCE] * 3
    start = config.initial
    diagonal = [
        *[start.position**2] * 3,
        *[start.tilt**2] * 2,
        start.heading**2,
        *[start.velocity**2] * 3,
        *rates["gyro"],
        *rates["accel"],
    ]
    parameters = {
        "initial_estimate_covariance": Noted(
            Inline([rounded(variance) for variance in diagonal]), _DIAGONAL_NOTE
        )
    }
    tree = {"imu_driver": {"ros__parameters": message}, "ekf_filter_node": {"ros__parameters": parameters}}
    header = (
        *provenance(config, "robot_localization: covariances of the sensor_msgs/Imu messages, and P0"),
        "no bias state in this filter: biases are left out; process_noise_covariance describes the vehicle",
        f"dt = {target.interval:g} s of the IMU",
        "imu_driver: name and parameters of the IMU's own driver; one without them has to fill its messages so",
    )
    return yaml_text(tree, header=header)


def _diagonal(values: list[float]) -> list[float]:
    return [values[i] if i == j else 0.0 for i in range(3) for j in range(3)]


DIALECT = Dialect(
    "robot-localization",
    "robot_localization YAML",
    "(rad/s)², (m/s²)² (per sample); m², rad², (m/s)²",
    write,
    needs=(),
)
