"""What was accepted on a drive, in words and as a finding."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tuner.diagnosis.drive.search import Accepted
from tuner.diagnosis.static.findings import words
from tuner.types import Coefficient, Finding, Gain, Inseparable
from tuner.types.records import Drive

MEANINGS: Mapping[str, tuple[tuple[str, ...], str, str]] = {
    "time_offset": (
        ("gnss",),
        "stamps of positions and velocities are late by the delay, early where it is negative",
        "shift the stamps, or give the filter a state for the delay",
    ),
    "velocity_lag": (
        ("gnss",),
        "velocities are later than the positions beside them, as behind a filter of the receiver",
        "use each velocity at its own time",
    ),
    "lever_arm": (
        ("gnss",),
        "the antenna is not where it was said to be",
        "correct the lever arm by this much, or give the filter states for it",
    ),
    "gnss_frame": (
        ("gnss",),
        "velocities are given in axes turned against north-east-down",
        "turn the velocities back",
    ),
    "gyro_scale": (("gyro",), "scale factors of the gyros are off", "calibrate, or three states"),
    "accel_scale": (("accel",), "scale factors of the accelerometers are off", "calibrate, or three states"),
    "misalignment": (
        ("gyro",),
        "the axes of the gyros are turned against those of the accelerometers",
        "calibrate, or give the filter states for the misalignment",
    ),
    "g_sensitivity": (("gyro",), "the gyros feel specific force", "calibrate, or nine states"),
    "gravity": (("imu",), "gravity is not what the model says", "a better model of gravity, or a state"),
    "sensor_bias": (
        ("imu",),
        "a constant bias far beyond its prior",
        "widen the prior of the turn-on constant, or calibrate",
    ),
    "gnss_noise_scale": (
        ("gnss",),
        "errors of the fixes are not as large as reported: true ÷ reported",
        "scale the reported standard deviations",
    ),
    "imu_noise_scale": (
        ("imu",),
        "the sensors are not as noisy as the filter was told: true ÷ assumed",
        "scale the densities",
    ),
    "correlated_gnss": (
        ("gnss",),
        "errors of the positions stay for a while",
        "three Gauss–Markov states beside the white error",
    ),
    "gnss_outliers": (("gnss",), "some positions are far off", "keep the gate; leave these fixes out"),
    "gnss_velocity": (
        ("gnss",),
        "some velocities contradict positions and inertial unit",
        "do not use velocities of such fixes",
    ),
    "bias_jump": (
        ("imu",),
        "a bias jumped",
        "raise the drive of the bias at that time, or restart the filter",
    ),
}
"""Channels of a cause, what it is, what it asks of a filter."""

JOINS = {
    "imu_noise_scale": "noise model",
    "correlated_gnss": "states",
    "gnss_noise_scale": "measurement noise",
}


def finding(one: Accepted, drive: Drive, gain: Gain | None) -> Finding:
    """Return what was accepted as a finding; a lever arm in axes of the vehicle where its mounting is known."""
    channels, meaning, consequence = MEANINGS[one.cause]
    parameters: Mapping[str, Coefficient] = one.parameters
    if one.cause == "lever_arm" and drive.mounting is not None:
        parameters = rotated_parameters(parameters, drive.mounting.T)
    alarm = one.candidate.alarm
    extension: dict[str, Any] = {
        "cause": one.cause,
        "joins": JOINS.get(one.cause, "preprocessing"),
        "parameters": {name: c.value for name, c in parameters.items()},
    }
    return Finding(
        one.cause,
        channels,
        alarm.name,
        alarm.statistic,
        min(1.0, alarm.p_value),
        parameters,
        words(one.cause, channels, meaning, parameters),
        consequence,
        extension,
        gain,
        one.alternatives,
    )


def rotated_parameters(parameters: Mapping[str, Coefficient], matrix: Any) -> dict[str, Coefficient]:
    """Return three parameters along other axes, each with the interval of a sum of independent ones."""
    known = list(parameters.values())
    value = matrix @ np.array([c.value for c in known])
    half = np.array([0.5 * (c.interval[1] - c.interval[0]) if c.interval else 0.0 for c in known])
    spread = np.sqrt(matrix**2 @ half**2)
    return {
        name: Coefficient.known(float(v), float(v - s), float(v + s), c.unit)
        for (name, c), v, s in zip(parameters.items(), value, spread, strict=True)
    }


def inseparable_causes(accepted: tuple[Accepted, ...]) -> tuple[Inseparable, ...]:
    """Return what a drive cannot tell apart, and the motion that would."""
    return tuple(
        Inseparable(
            (one.cause, *one.inseparable),
            f"cannot be told apart on this drive: {', '.join((one.cause, *one.inseparable))}; drive {REMEDY}",
        )
        for one in accepted
        if one.inseparable
    )


REMEDY = "an S-turn, with hard braking and starting, to separate them"
