"""All built-in causes of a drive, in the order in which they are tested.

Another package adds a cause by an entry point in the group ``tuner.drive_causes`` that names its class.
"""

from __future__ import annotations

from tuner.diagnosis.drive.causes.base import DRIVE_CAUSES
from tuner.diagnosis.drive.causes.bias_jump import BiasJump
from tuner.diagnosis.drive.causes.constant_errors import (
    AccelScale,
    ClockDrift,
    GnssFrame,
    Gravity,
    GSensitivity,
    GyroScale,
    LeverArm,
    Misalignment,
    TimeOffset,
    VelocityLag,
    VelocityScale,
    VerticalVelocity,
)
from tuner.diagnosis.drive.causes.correlated_gnss import CorrelatedGnss
from tuner.diagnosis.drive.causes.correlated_velocity import CorrelatedVelocity
from tuner.diagnosis.drive.causes.gnss_outliers import GnssOutliers, GnssVelocity
from tuner.diagnosis.drive.causes.mounting import Mounting
from tuner.diagnosis.drive.causes.noise_scale import GnssNoiseScale, ImuNoiseScale
from tuner.diagnosis.drive.causes.sensor_bias import SensorBias

__all__ = ["DRIVE_CAUSES", "FALSE_FINDING_PROBABILITY", "significance_threshold"]

FALSE_FINDING_PROBABILITY = 3e-3
"""Probability of any finding in a clean drive: below the 2 % that hard clean drives are allowed, with room for their
non-normal errors."""

DRIVE_CAUSES.extend(
    (
        TimeOffset, ClockDrift, VelocityLag, LeverArm, GnssFrame, VelocityScale, VerticalVelocity, GyroScale,
        AccelScale, Misalignment, GSensitivity, Gravity, GnssNoiseScale, ImuNoiseScale, CorrelatedGnss,
        CorrelatedVelocity, BiasJump, GnssOutliers, GnssVelocity, SensorBias, Mounting,
    )
)  # fmt: skip


def significance_threshold() -> float:
    """Return the p value below which a test with one share of the probability of a false finding is significant."""
    return FALSE_FINDING_PROBABILITY / sum(cause.shares for cause in DRIVE_CAUSES.values())
