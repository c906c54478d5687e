"""Mounting angles of the unit in its vehicle, tested by the direction of motion, and causes a drive cannot separate.

Positions and velocities are those of the antenna, however the unit is mounted. Where wheels do not slip, the vehicle
moves along its x axis: on straight parts the velocity in the stated vehicle axes gives::

    yaw = atan(v_y/v_x)      pitch = −asin(v_z/|v|)      of the true axes in the stated ones, R_true = R_stated Rz Ry

Roll is a rotation about the direction of motion and is not observable. The sd of a mean angle combines the scatter of
the means of blocks of `BLOCK_DURATION` with the filter's own sd of the attitude, taken as one constant of the drive,
so that attitude errors are not mistaken for a mounting error. Pitch and yaw are tested together, χ²₂.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from models import rotation
from models.arrays import FloatArray
from models.effects.drive.imu import Mounting as Effect
from models.units import STANDARD_GRAVITY
from tuner.diagnosis.drive.causes.base import FinalCause, constant_causes
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.diagnosis.drive.score_tests import columns_of
from tuner.diagnosis.static.findings import words
from tuner.navigation.drive.vehicle_constraints import MAX_TURN_RATE, MIN_SPEED
from tuner.types import Coefficient, Finding, Inseparable

CAUSE_CODE = "mounting"
"""Code of the cause."""
CAUSE_MEANING = "the unit is turned in the vehicle against the mounting given, by {}"
CAUSE_CONSEQUENCE = "correct the mounting before axes of the vehicle are used"
BLOCK_DURATION = 30.0
"""Length of the blocks whose means are compared, s: beyond the correlation time of most receiver errors."""
MIN_BLOCKS = 8
"""Least number of blocks with straight parts: seven degrees of freedom for the sd of their mean."""
DETECTABLE_SDS = 4.0
"""Sds from which a constant can be detected: 6e-5 by chance, about the threshold of a test."""


def mounting(run: FilterRun, stated: FloatArray, threshold: float) -> Finding | None:
    """Test the stated mounting where wheels do not slip; None where it agrees, or straight parts are too few.

    Parameters
    ----------
    run : FilterRun
        The last run, in axes of the sensor.
    stated : ndarray, shape (3, 3)
        Turns vehicle axes into those of the sensor.
    threshold : float
        p value below which it is a finding.
    """
    t, angles, spread = _directions(run, stated)
    block = ((t - run.linearized.t[0]) // BLOCK_DURATION).astype(int)
    present = np.unique(block)
    if len(present) < MIN_BLOCKS:
        return None
    means = np.stack([angles[block == b].mean(axis=0) for b in present])
    value = means.mean(axis=0)
    sd = np.hypot(means.std(axis=0, ddof=1) / np.sqrt(len(means)), spread)
    statistic = float(np.sum((value / sd) ** 2))
    p_value = float(chi2.sf(statistic, 2))
    if p_value >= threshold:
        return None
    angles_found = {
        name: Coefficient.known(float(v), float(v - 1.96 * s), float(v + 1.96 * s), "rad")
        for name, v, s in zip(("pitch", "yaw"), value, sd, strict=True)
    }
    values = {
        "cause": CAUSE_CODE,
        "joins": "preprocessing",
        "parameters": {name: c.value for name, c in angles_found.items()},
    }
    title = "direction of motion in axes of the vehicle"
    text = words(CAUSE_CODE, ("imu",), CAUSE_MEANING, angles_found)
    return Finding(
        CAUSE_CODE, ("imu",), title, statistic, p_value, angles_found, text, CAUSE_CONSEQUENCE, values
    )


def _directions(run: FilterRun, stated: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times on straight parts (m,), pitch and yaw of the motion (m, 2), sds of the attitude there (2,)."""
    vel = np.concatenate([one.state.vel_n for one in run.solutions])
    mat = rotation.mat_from_quat(np.concatenate([one.state.quat_nb for one in run.solutions]))
    variance = np.concatenate(
        [np.diagonal(one.covariance, axis1=1, axis2=2)[:, 6:9] for one in run.solutions]
    )
    t, axes = run.linearized.t, mat @ stated
    ahead = np.unwrap(np.arctan2(axes[:, 1, 0], axes[:, 0, 0]))
    rate = np.abs(np.gradient(ahead, t))
    v = np.swapaxes(axes, -1, -2) @ vel[..., None]
    v = v[..., 0]
    use = run.linearized.scored & (v[:, 0] > MIN_SPEED) & (rate < MAX_TURN_RATE)
    v = v[use]
    angles = np.stack(
        [-np.arcsin(v[:, 2] / np.linalg.norm(v, axis=1)), np.arctan2(v[:, 1], v[:, 0])], axis=-1
    )
    tilt = np.sqrt(np.mean(variance[use, :2])) if use.any() else np.inf
    heading = np.sqrt(np.mean(variance[use, 2])) if use.any() else np.inf
    return t[use], angles, np.array([tilt, heading])


def untestable_causes(
    final: FilterRun, stated: FloatArray | None, *, wheels: bool, accepted: tuple[str, ...]
) -> tuple[Inseparable, ...]:
    """Return causes of the catalogue that cannot be tested on this drive, each with the reason.

    Parameters
    ----------
    final : FilterRun
        The last run.
    stated : ndarray, shape (3, 3), or None
        Mounting of the unit, if given.
    wheels : bool
        Whether the vehicle's wheels may be supposed not to slip.
    accepted : tuple of str
        Causes that are accepted.
    """
    lines = []
    if not wheels or stated is None:
        lacking = (
            "no wheels that do not slip are supposed (--wheels)" if not wheels else "the drive states none"
        )
        lines.append(
            Inseparable((CAUSE_CODE,), f"not tested on this drive: {CAUSE_CODE} of the unit, {lacking}")
        )
    if "gravity" not in accepted:
        w = final.whitened
        column = w.slope[:, columns_of("gravity", final.linearized.parameters)[0]]
        least = DETECTABLE_SDS / max(float(np.linalg.norm(column)), 1e-12)
        if least > constant_causes()["gravity"].prior_sd:
            size = (
                f"gravity off by less than {least:.1g} m/s^2" if least < STANDARD_GRAVITY else "gravity off"
            )
            text = f"{size} and a bias of the vertical accelerometer"
            lines.append(
                Inseparable(("gravity", "sensor_bias"), f"cannot be separated on this drive: {text}")
            )
    if "sensor_bias" in accepted and "g_sensitivity" not in accepted:
        text = "a constant bias of a gyro and its sensitivity to the vertical force; turn the unit over"
        lines.append(
            Inseparable(("sensor_bias", "g_sensitivity"), f"cannot be separated on this drive: {text}")
        )
    return tuple(lines)


class Mounting(FinalCause):
    """The unit is mounted in the vehicle at other angles than stated."""

    cause = CAUSE_CODE
    effect = Effect
    channels = ("imu",)
    meaning = CAUSE_MEANING
    consequence = CAUSE_CONSEQUENCE
