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
from collections.abc import Callable
from typing import Any

from models.units import STANDARD_GRAVITY, from_si
from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.simulated_flicker import flicker_words, simulated_flicker
from tuner.exporters.triad_values import rms, triad
from tuner.types import ChannelNoise, FilterConfig

_GYRO_TAU, _ACCEL_TAU = 500.0, 800.0
"""Times, s, by whose root AirSim divides a stability; its defaults, as only the ratio counts."""


def write(config: FilterConfig, _: Target) -> str:
    """Return a sensor of the settings."""
    drawn = {axis: simulated_flicker(c, flicker=False) for axis, c in config.channels.items()}

    def walk(channel: ChannelNoise) -> float:
        return drawn[channel.axis].density

    imu: dict[str, Any] = {"SensorType": 2, "Enabled": True}
    if gyro := triad(config, "gyro"):
        stability, density = from_si(1.0, "deg/h") * math.sqrt(_GYRO_TAU), from_si(1.0, "deg/sqrt(h)")
        imu["AngularRandomWalk"] = _rms(gyro, lambda c: c.white_density, density)
        imu["GyroBiasStability"] = _rms(gyro, walk, stability)
        imu["GyroBiasStabilityTau"] = _GYRO_TAU
    if accel := triad(config, "accel"):
        stability, density = math.sqrt(_ACCEL_TAU) * 1e6 / STANDARD_GRAVITY, 1e3 / STANDARD_GRAVITY
        imu["VelocityRandomWalk"] = _rms(accel, lambda c: c.white_density, density)
        imu["AccelBiasStability"] = _rms(accel, walk, stability)
        imu["AccelBiasStabilityTau"] = _ACCEL_TAU
    header = (*provenance(config, "AirSim: IMU of settings.json"), *flicker_words(drawn))
    content = {"Comment": header, "DefaultSensors": {"Imu": imu}}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _rms(
    channels: tuple[ChannelNoise, ...], quantity: Callable[[ChannelNoise], float], factor: float
) -> float:
    return rms(channels, lambda channel: factor * quantity(channel), "").value


DIALECT = Dialect("airsim", "AirSim settings.json", "deg/√h, deg/h, s, mg/√Hz, ug, s", write, needs=())
