"""What is known to be wrong with a drive, taken out of it: clocks, frames, the calibration of the sensors.

A compensation maps names of parameters to values, SI, in the axes of the sensor, all by the conventions of
`models.effects`. An empty one changes nothing.

================================ ==========================================================================
time_offset.delay                positions of stamp t are those of t − delay
velocity_lag.delay               velocities are so much later than the positions beside them
lever_arm.x y z                  what the given lever arm (none: 0) lacks
gnss_frame.roll pitch yaw        v_reported = Rz(yaw) Ry(pitch) Rx(roll) v
gyro_scale, accel_scale .x y z   scale factor errors
misalignment.roll pitch yaw      the gyros are turned against the accelerometers by Rz(yaw) Ry(pitch) Rx(roll)
g_sensitivity.xx …               gyro error by specific force
gravity.offset                   excess of gravity
mounting.roll pitch yaw          the unit is turned in the vehicle: true mounting = stated one times Rz Ry Rx
gnss_noise_scale.…               true ÷ reported sd: `tuner.navigation.fix_sd_model`
================================ ==========================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models import rotation
from tuner.navigation.fix_sd_model import CAUSE, fix_sd_model
from tuner.navigation.settings import FilterSettings
from tuner.types.records import Drive

FloatArray = NDArray[np.float64]

XYZ, RPY = ("x", "y", "z"), ("roll", "pitch", "yaw")


def compensate(drive: Drive, values: Mapping[str, float]) -> Drive:
    """Return the drive without what is known to be wrong with it.

    Parameters
    ----------
    drive : Drive
        As measured.
    values : mapping of str to float
        The compensation.
    """
    if not values:
        return drive
    rates = np.asarray(np.linalg.solve(sensor_matrix(values), drive.rates.T).T, dtype=float)
    gnss = drive.gnss
    turn = rotation.mat_from_rpy(_triple(values, "gnss_frame", RPY))
    gnss = replace(gnss, t=gnss.t - values.get("time_offset.delay", 0.0), vel_n=gnss.vel_n @ turn)
    if drive.mounting is not None:
        drive = replace(
            drive, mounting=drive.mounting @ rotation.mat_from_rpy(_triple(values, "mounting", RPY))
        )
    lacking = _triple(values, "lever_arm", XYZ)
    arm = drive.lever_arm
    if lacking.any() or arm is not None:
        if drive.mounting is not None:
            lacking = drive.mounting.T @ lacking
        x, y, z = (np.array(arm or (0.0, 0.0, 0.0)) + lacking).tolist()
        arm = (x, y, z)
    return replace(drive, rates=rates, gnss=gnss, lever_arm=arm)


def compensate_settings(settings: FilterSettings, values: Mapping[str, float]) -> FilterSettings:
    """Return the filter with what is known of its fixes: the lag of velocities, the laws of reported sds."""
    settings = replace(settings, velocity_lag=values.get("velocity_lag.delay", 0.0))
    if not any(name.startswith(CAUSE) for name in values):
        return settings
    return replace(
        settings, fix_sd_models=(fix_sd_model(values, "position"), fix_sd_model(values, "velocity"))
    )


def sensor_matrix(values: Mapping[str, float]) -> FloatArray:
    """Return A (6, 6) with measured (ω, f) = A true."""
    matrix = np.eye(6)
    for first, sensor in ((0, "gyro"), (3, "accel")):
        for i, axis in enumerate(XYZ):
            matrix[first + i, first + i] += values.get(f"{sensor}_scale.{axis}", 0.0)
    matrix[:3, :3] = rotation.mat_from_rpy(_triple(values, "misalignment", RPY)) @ matrix[:3, :3]
    for i, a in enumerate(XYZ):
        for j, b in enumerate(XYZ):
            matrix[i, 3 + j] += values.get(f"g_sensitivity.{a}{b}", 0.0)
    return matrix


def _triple(values: Mapping[str, float], cause: str, parts: tuple[str, ...]) -> FloatArray:
    return np.array([values.get(f"{cause}.{part}", 0.0) for part in parts])
