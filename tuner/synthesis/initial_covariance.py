"""What the filter does not know at the start: turn-on constants and P0, each with the reason of its size.

Allan methods cannot see a constant. Its prior comes, best first, from the spread of the means of several
runs, from a turn-on figure of a grade or datasheet, or from the mean of the one log at hand:

* accelerometer: | ‖mean‖ − g |, the part along gravity, at least 0.03 m/s², as gravity varies that much;
* gyro: rms of the three means, at least Earth's rate, which may be in them;
* no mean, or none as long as gravity: ten times the bias instability; refused where that is not known, either.

A stationary filter levels by gravity, so tilt errs by accelerometer bias ÷ g; it finds north by Earth's
rate, so heading errs by gyro bias ÷ (Ω cos φ), which serves only where it is small.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from models.earth import EARTH_RATE
from models.units import STANDARD_GRAVITY
from tuner.types import ChannelIdentification, ChannelNoise, GnssNoise, Identification, InitialUncertainty
from tuner.types.records import DataError

GRAVITY_SPREAD = 0.03
"""Half the range of gravity on the Earth's surface, m/s²."""

GYROCOMPASS_LATITUDE = math.radians(45.0)
"""Latitude for which gyrocompassing is judged, rad."""

HEADING_DEFAULT = math.radians(10.0)
TILT_DEFAULT = math.radians(2.0)
POSITION_DEFAULT = 10.0
VELOCITY_DEFAULT = 0.1


def turn_on_spread(runs: Sequence[Identification]) -> dict[str, float]:
    """Return the sd of the mean of every axis from run to run, unit.

    Parameters
    ----------
    runs : sequence of Identification
        Two or more switch-ons of one sensor, in one pose.

    Raises
    ------
    ValueError
        With fewer than two runs.
    """
    if len(runs) < 2:
        raise ValueError(f"'runs' must hold two or more identifications, got {len(runs)}")
    spread = {}
    for axis in runs[0].channels:
        means = [run.channels[axis].mean.value for run in runs if axis in run.channels]
        known = [mean for mean in means if mean is not None]
        if len(known) > 1 and (sd := float(np.std(known, ddof=1))) > 0.0:
            spread[axis] = sd
    return spread


def turn_on_sd(identification: Identification, axis: str, spread: Mapping[str, float]) -> tuple[float, str]:
    """Return the prior sd of the constant of one axis, unit, and its reason."""
    if axis in spread:
        return spread[axis], "turn-on sd given: spread between runs, grade or datasheet"
    channel = identification.channels[axis]
    prefix = axis.rpartition("_")[0]
    means = [c.mean.value for name, c in identification.channels.items() if name.rpartition("_")[0] == prefix]
    known = np.array([mean for mean in means if mean is not None])
    if known.any():
        if channel.unit == "rad/s":
            rms = float(np.sqrt(np.mean(known**2)))
            return max(
                rms, EARTH_RATE
            ), "rms of the means of the axes, at least Earth's rate, which may be in them"
        if len(known) == 3 and abs(float(np.linalg.norm(known)) - STANDARD_GRAVITY) < 0.5 * STANDARD_GRAVITY:
            excess = abs(float(np.linalg.norm(known)) - STANDARD_GRAVITY)
            return max(excess, GRAVITY_SPREAD), "length of the mean minus gravity, at least 0.03 m/s²"
    why = "the mean is not as long as gravity" if known.any() else "no mean"
    return 10.0 * _level(channel), f"{why}: ten times the bias instability"


def _level(channel: ChannelIdentification) -> float:
    """Return the best stand-in for B, unit."""
    for coefficient in (channel.floor, channel.minimum, channel.sigma_10s):
        figure = coefficient.value if coefficient.value is not None else coefficient.upper
        if figure:
            return figure
    if not len(channel.allan.tau):
        raise DataError(
            f"{channel.axis}: expected a mean, a turn-on sd or a term with a value, found none: state its turn-on sd "
            "(constant_sd of noise.yaml)"
        )
    return float(np.min(channel.allan.deviation()))


def initial_uncertainty(
    channels: Mapping[str, ChannelNoise], reasons: Mapping[str, str], gnss: GnssNoise | None
) -> InitialUncertainty:
    """Return P0 of position, velocity, tilt and heading from the constants of the sensors and from GNSS.

    Parameters
    ----------
    channels : mapping of str to ChannelNoise
        Axes of the filter.
    reasons : mapping of str to str
        Reason of the constant of every axis; carried along.
    gnss : GnssNoise or None
        Errors of the aiding.
    """
    why = dict(reasons)
    position, velocity = POSITION_DEFAULT, VELOCITY_DEFAULT
    why["position"] = f"no GNSS figures: {POSITION_DEFAULT:g} m assumed"
    why["velocity"] = f"standing still within {VELOCITY_DEFAULT:g} m/s assumed"
    if gnss is not None:
        factors = (1.0, 1.0, gnss.correlated_down)
        position = max(
            math.hypot(sd, *(factor * state.sd for state in gnss.correlated))
            for sd, factor in zip(gnss.position_sd, factors, strict=True)
        )
        why["position"] = "largest position sd of GNSS, with its correlated part"
        if gnss.velocity_sd is not None:
            velocity = max(gnss.velocity_sd)
            why["velocity"] = "largest velocity sd of GNSS"
    accel = _largest_constant(channels, "m/s^2")
    tilt = TILT_DEFAULT if accel is None else accel / STANDARD_GRAVITY
    why["tilt"] = (
        "no accelerometer figures: 2° assumed" if accel is None else "accelerometer turn-on sd ÷ gravity"
    )
    gyro = _largest_constant(channels, "rad/s")
    heading = math.inf if gyro is None else gyro / (EARTH_RATE * math.cos(GYROCOMPASS_LATITUDE))
    why["heading"] = "gyrocompassing: gyro turn-on sd ÷ Earth's horizontal rate at 45°"
    if heading > HEADING_DEFAULT:
        heading = HEADING_DEFAULT
        why["heading"] = (
            "gyro turn-on sd too large against Earth's rate to find north: 10° from another source assumed"
        )
    return InitialUncertainty(position, velocity, tilt, heading, why)


def _largest_constant(channels: Mapping[str, ChannelNoise], unit: str) -> float | None:
    return max((c.constant_sd for c in channels.values() if c.unit == unit), default=None)
