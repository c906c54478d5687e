"""Which white noise a drive begins with: that of the settings, or that of the samples in motion.

A unit that shakes in its vehicle errs by more than at rest. Where its white noise is stated far below, every fix
contradicts the filter, as if clocks or axes were wrong. The examination of a drive measures the scatter of samples in
motion: as white noise it is the most that the unit can have there. The drive begins with it where innovations and
outages of its first part are then likelier by `MIN_GAIN` a sensor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tuner.diagnosis.drive.candidates import MIN_GAIN, Trial
from tuner.diagnosis.drive.score_tests import FITTED_SHARE
from tuner.examination.examine import Examination
from tuner.synthesis import inflate
from tuner.types import Enlargement, FilterConfig, Quantity
from tuner.types.records import Drive

TRIADS = {"gyro": "gyro", "accelerometer": "accel"}
REASON = (
    "the scatter of samples in motion: with the noise that was stated the fixes of this drive are less likely"
)


def in_motion_to_rest(examination: Examination | None) -> Mapping[str, float]:
    """Return the scatter of samples in motion ÷ that at rest, by sensor; without those that a drive does not show."""
    found = {} if examination is None else examination.vibration
    return {TRIADS[triad]: moving / still for triad, (still, moving) in found.items() if still > 0.0}


def with_noise_in_motion(drive: Drive, config: FilterConfig, examination: Examination | None) -> FilterConfig:
    """Return the settings with the white noise that a drive begins with.

    Parameters
    ----------
    drive : Drive
        As examined.
    config : FilterConfig
        As stated.
    examination : Examination or None
        Of this drive.
    """
    root_interval = math.sqrt(float(np.median(np.diff(drive.imu_t))))
    scatter = {} if examination is None else {TRIADS[t]: pair[1] for t, pair in examination.vibration.items()}
    larger = []
    for axis, channel in config.channels.items():
        in_motion = scatter.get(axis.partition("_")[0], 0.0) * root_interval
        if in_motion > channel.white_density > 0.0:
            factor = in_motion / channel.white_density
            larger.append(Enlargement(Quantity(axis, "white_density"), factor, REASON, ("vibration",)))
    if not larger:
        return config
    begin, end = float(drive.gnss.t[0]), float(drive.gnss.t[-1])
    trial = Trial(drive, begin, begin + FITTED_SHARE * (end - begin), end)
    shaken = inflate(config, larger)
    stated, moving = (
        trial.candidate(name, one, {}) for name, one in (("stated", config), ("moving", shaken))
    )
    if moving is None:
        return config
    gain = math.inf if stated is None else moving.first.nats - stated.first.nats
    return shaken if gain > len(TRIADS) * MIN_GAIN else config
