"""PX4 EKF2 parameters: noises per prediction step of the filter, not per IMU sample.

Each step of dt = EKF2_PREDICT_US the filter adds (dt·EKF2_GYR_NOISE)² to an angle and
(dt·EKF2_GYR_B_NOISE)² to a bias. So EKF2_GYR_NOISE = N/√dt, EKF2_GYR_B_NOISE = K/√dt, the like for ACC, and
EKF2_GBIAS_INIT and EKF2_ABIAS_INIT are turn-on sds.

Source: PX4/PX4-Autopilot src/modules/ekf2: EKF/covariance.cpp (predictCovariance, initialiseCovariance), and the
ranges of module.yaml, params_gyro_bias.yaml, params_accel_bias.yaml.
"""

from __future__ import annotations

import math

from tuner.exporters.autopilot import Parameter, given, loaded, parameter_lines
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import Figure, rms, triad, walk, white
from tuner.formats.yaml_text import comment
from tuner.synthesis.projection import AUTOPILOT
from tuner.types import FilterConfig

_PARAMETERS = {
    "EKF2_GYR_NOISE": Parameter("gyro", "white", 1e-4, 0.1, 0.015),
    "EKF2_ACC_NOISE": Parameter("accel", "white", 0.01, 1.0, 0.35),
    "EKF2_GYR_B_NOISE": Parameter("gyro", "walk", 0.0, 0.01, 0.001),
    "EKF2_ACC_B_NOISE": Parameter("accel", "walk", 0.0, 0.01, 0.003),
    "EKF2_GBIAS_INIT": Parameter("gyro", "turn_on", 0.0, 0.2, 0.1),
    "EKF2_ABIAS_INIT": Parameter("accel", "turn_on", 0.0, 0.5, 0.2),
}

_RELEASE = "PX4 v1.11.2, src/modules/ekf2/ekf2_params.c"
"""Release of the stock values: read from the log of such a vehicle, test/sample_log_small.ulg of PX4/pyulog.

Those of the gyro bias are the same in params_gyro_bias.yaml of commit 15c4f0887da9.
"""

_PREDICTION_STEP = 0.01
"""Step, s, of the stock EKF2_PREDICT_US."""

_REAL_TYPE_CODE = 9
"""Type code of a real parameter in the file format."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a parameter file: vehicle, component, name, value, type, by tabs; comments where stock is kept."""
    step = _PREDICTION_STEP if target.step is None else target.step

    def per_step(density: float) -> float:
        return density / math.sqrt(step)

    figures: dict[str, Figure] = {}
    if gyro := triad(config, "gyro"):
        figures["EKF2_GYR_NOISE"] = white(gyro, "rad/s; N/√dt", target, per_step)
        figures["EKF2_GYR_B_NOISE"] = walk(config, gyro, "rad/s²; K/√dt", target, per_step)
        figures["EKF2_GBIAS_INIT"] = rms(gyro, lambda c: c.constant_sd, "rad/s; turn-on sd")
    if accel := triad(config, "accel"):
        figures["EKF2_ACC_NOISE"] = white(accel, "m/s²; N/√dt", target, per_step)
        figures["EKF2_ACC_B_NOISE"] = walk(config, accel, "m/s³; K/√dt", target, per_step)
        figures["EKF2_ABIAS_INIT"] = rms(accel, lambda c: c.constant_sd, "m/s²; turn-on sd")
    values = loaded(figures, _PARAMETERS, config)
    lines = [
        *provenance(config, "PX4 EKF2 parameters", target, given(values, _PARAMETERS)),
        f"dt = {step:g} s, the prediction step: EKF2_PREDICT_US = {1e6 * step:g}, stock 10000",
        *parameter_lines(figures, _PARAMETERS, config, _RELEASE),
    ]
    parameters = [f"1\t1\t{name}\t{value:.9g}\t{_REAL_TYPE_CODE}" for name, value in values.items()]
    return "".join(f"{line}\n" for line in (*map(comment, lines), *parameters))


DIALECT = Dialect(
    "px4",
    "PX4 EKF2 parameters",
    "rad/s, rad/s², m/s², m/s³ (per prediction step)",
    write,
    needs=(),
    aiding=AUTOPILOT,
    shared=True,
)
