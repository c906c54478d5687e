"""Known errors of a drive taken out before it is filtered: clocks, frames, the calibration of the sensors.

A `Compensation` has values of the parameters of constant causes, SI, in the axes of the sensor, with the conventions of
`models.effects.drive`, whose classes state how each is taken out. An empty one changes nothing.

================================ ==========================================================================
time_offset.delay                positions of stamp t are those of t − delay
clock_drift.rate                 … of t − delay − rate (t − t₀), t₀ halfway between the first and the last fix
velocity_lag.delay               velocities are so much later than the positions beside them
lever_arm.x y z                  true lever arm less the given one (none: 0)
gnss_frame.roll pitch yaw        v_reported = Rz(yaw) Ry(pitch) Rx(roll) v
velocity_scale.factor            v_reported = (1 + factor) v
vertical_velocity.offset         velocity down reported less the rate at which the heights fall
gyro_scale, accel_scale .x y z   scale factor errors
misalignment.roll pitch yaw      the gyros are rotated against the accelerometers by Rz(yaw) Ry(pitch) Rx(roll)
g_sensitivity.xx …               gyro error by specific force
gravity.offset                   gravity less that of the formula
mounting.roll pitch yaw          true mounting of the unit = stated one times Rz Ry Rx
gnss_noise_scale.…               true ÷ reported sd: `tuner.navigation.fix_sd_model`
================================ ==========================================================================
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.effects.drive import EFFECTS
from models.effects.drive.base import Correction
from models.effects.drive.gnss import without_drift
from tuner.navigation.fix_sd_model import GNSS_NOISE_SCALE, fix_sd_model
from tuner.navigation.settings import FilterSettings
from tuner.types import Compensation, FilterConfig
from tuner.types.records import Drive

LEVER_ARM = "lever_arm"
"""Code of the cause, and name of the state."""
AS_STATED = "the lever arm is used as stated: what a drive showed of it, in the settings, is left out"


def correction(compensation: Compensation) -> Correction:
    """Return what a compensation changes in a drive and in its filter, all causes together.

    Raises
    ------
    RegistryError
        A cause that is not declared.
    """
    unknown = [cause for cause in compensation.causes if cause not in EFFECTS]
    declared = [*(cause for cause in EFFECTS if cause in compensation.causes), *unknown]
    answer = Correction()
    for cause in declared:
        answer = EFFECTS[cause].corrected(answer, compensation.of(cause))
    return answer


def corrected_stamps(t: FloatArray, change: Correction) -> FloatArray:
    """Return the times of fixes on the clock of the inertial unit, from all their stamps t (k,)."""
    return without_drift(t, change.fix_delay_rate) - change.fix_delay


def compensate(drive: Drive, compensation: Compensation) -> Drive:
    """Return the drive with known errors of stamps, frames, lever arm, mounting and sensors taken out.

    Its clock is what remains; of a lag of velocities the filter takes out what is stated (`compensate_settings`).
    """
    if not compensation:
        return drive
    change = correction(compensation)
    rates = np.asarray(np.linalg.solve(change.sensor_matrix, drive.rates.T).T, dtype=float)
    gnss = drive.gnss
    gnss = replace(
        gnss,
        t=corrected_stamps(gnss.t, change),
        vel_n=np.where(
            np.isfinite(gnss.vel_n),
            np.nan_to_num(gnss.vel_n - change.velocity_offset) @ change.velocity_rotation,
            np.nan,
        ),
    )
    if drive.mounting is not None:
        drive = replace(drive, mounting=drive.mounting @ change.mounting)
    offset, arm = change.lever_arm, drive.lever_arm
    if offset.any() or arm is not None:
        if drive.mounting is not None:
            offset = drive.mounting.T @ offset
        x, y, z = (np.array(arm or (0.0, 0.0, 0.0)) + offset).tolist()
        arm = (x, y, z)
    clock = drive.clock.beside(change.fix_delay, change.velocity_lag, change.fix_delay_rate)
    return replace(drive, rates=rates, gnss=gnss, lever_arm=arm, clock=clock)


def with_stated_arm(
    config: FilterConfig, lever_arm: tuple[float, float, float] | None
) -> tuple[FilterConfig, tuple[str, ...]]:
    """Return a configuration that moves no lever arm where the user states one, and what is left out in words.

    Parameters
    ----------
    config : FilterConfig
        Settings; a correction of theirs is of the lever arm that their drive stated.
    lever_arm : tuple of 3 floats or None
        As the user states it, m.
    """
    if lever_arm is None or LEVER_ARM not in (*config.compensation.causes, *config.constants):
        return config, ()
    constants = {name: sd for name, sd in config.constants.items() if name != LEVER_ARM}
    compensation = config.compensation.without({LEVER_ARM})
    return replace(config, compensation=compensation, constants=constants), (AS_STATED,)


def compensate_settings(settings: FilterSettings, compensation: Compensation) -> FilterSettings:
    """Return the settings with the compensation of gravity, of the lag of velocities and of the sds of fixes."""
    change = correction(compensation)
    settings = replace(settings, velocity_lag=change.velocity_lag, gravity_excess=change.gravity_excess)
    values = compensation.of(GNSS_NOISE_SCALE)
    if not values:
        return settings
    return replace(
        settings, fix_sd_models=(fix_sd_model(values, "position"), fix_sd_model(values, "velocity"))
    )
