"""AirSim ``settings.json``: white noise and a random walk a sensor, in customary units.

AngularRandomWalk deg/√h, VelocityRandomWalk mg/√Hz, GyroBiasStability deg/h, AccelBiasStability ug,
GyroBiasStabilityTau, AccelBiasStabilityTau s. The code draws a random walk of the density stability/√Tau, without
end; so stability = K √Tau with its own Tau of 500 and 800 s. JSON has no comments: they stand in ``Comment``, which
AirSim does not read.

Source: microsoft/AirSim AirLib/include/sensors/imu/ImuSimpleParams.hpp (initializeFromSettings), ImuSimple.hpp
(addNoise).
"""

from __future__ import annotations

import json
import math
from typing import Any

from models.units import STANDARD_GRAVITY, from_si
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.triad_values import triad, walk, white
from tuner.types import FilterConfig

_GYRO_TAU, _ACCEL_TAU = 500.0, 800.0
"""Times, s, by whose root AirSim divides a stability; its defaults, as only the ratio counts."""


def write(config: FilterConfig, target: Target) -> str:
    """Return a sensor of the settings."""
    imu: dict[str, Any] = {"SensorType": 2, "Enabled": True}
    if gyro := triad(config, "gyro"):
        factor = from_si(1.0, "deg/h") * math.sqrt(_GYRO_TAU)
        density = from_si(1.0, "deg/sqrt(h)")
        imu["AngularRandomWalk"] = white(gyro, "", factor=density, memory=target.memory).value
        imu["GyroBiasStability"] = walk(gyro, "", target, factor=factor).value
        imu["GyroBiasStabilityTau"] = _GYRO_TAU
    if accel := triad(config, "accel"):
        factor = math.sqrt(_ACCEL_TAU) * 1e6 / STANDARD_GRAVITY
        density = 1e3 / STANDARD_GRAVITY
        imu["VelocityRandomWalk"] = white(accel, "", factor=density, memory=target.memory).value
        imu["AccelBiasStability"] = walk(accel, "", target, factor=factor).value
        imu["AccelBiasStabilityTau"] = _ACCEL_TAU
    header = provenance(config, "AirSim: IMU of settings.json", walk_memory=target.memory)
    content = {"Comment": header, "DefaultSensors": {"Imu": imu}}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


DIALECT = Dialect("airsim", "AirSim settings.json", "deg/√h, deg/h, s, mg/√Hz, ug, s", write, needs=())
