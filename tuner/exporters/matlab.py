"""MATLAB ``imuSensor``: parameters of gyros and accelerometers, SI; RandomWalk is K, not N.

NoiseDensity N, RandomWalk K, ConstantBias one turn-on sd. The walk stands for all of the bias, Gauss–Markov
states included, so BiasInstability stays at its default of zero: it would count flicker twice.
"""

from __future__ import annotations

from tuner.exporters.dialect import Dialect, Target
from tuner.exporters.header import provenance
from tuner.exporters.scripts import commented, vector
from tuner.exporters.triad_values import triad, triple
from tuner.synthesis.equivalent_models import equivalent_random_walk, equivalent_white_density
from tuner.types import ChannelNoise, FilterConfig


def write(config: FilterConfig, target: Target) -> str:
    """Return a script that defines ``imu``."""

    def density(channel: ChannelNoise) -> float:
        return equivalent_white_density(channel, memory=target.memory)

    def walk(channel: ChannelNoise) -> float:
        return equivalent_random_walk(channel, memory=target.memory)

    text = f"imu = imuSensor('accel-gyro', 'SampleRate', {target.rate!r}); % Hz\n"
    for sensor, field, maker, unit in (
        ("gyro", "Gyroscope", "gyroparams", "rad/s"),
        ("accel", "Accelerometer", "accelparams", "m/s²"),
    ):
        channels = triad(config, sensor)
        if not channels:
            continue
        white, white_note = triple(channels, density, f"{unit}/√Hz; N")
        drive, drive_note = triple(channels, walk, f"{unit}·√Hz; K")
        constant, constant_note = triple(channels, lambda c: c.constant_sd, f"{unit}; one turn-on sd")
        text += (
            f"imu.{field} = {maker}( ...\n"
            f"    'NoiseDensity', {vector(white)}, ... % {white_note}\n"
            f"    'RandomWalk', {vector(drive)}, ... % {drive_note}\n"
            f"    'ConstantBias', {vector(constant)}); % {constant_note}\n"
        )
    return commented(provenance(config, "MATLAB imuSensor", walk_memory=target.memory), "%") + text


DIALECT = Dialect(
    "matlab",
    "MATLAB imuSensor (script)",
    "(rad/s)/√Hz, (rad/s)·√Hz, rad/s, (m/s²)/√Hz, (m/s²)·√Hz, m/s²",
    write,
)
