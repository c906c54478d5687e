"""Noise of unit and receiver on simulated drives: wrong together, told by class of fix."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis.drives import diagnose_drive

WIDER = 4.9 / 1.96
"""A normal estimate is further off than 4.9 sds in 1e-6 of drives."""
UNIT = {"gyro": 0, "accel": 1}


def holds(coefficient, truth):
    """Whether an interval, as many times as wide in the log, or a limit, as far above, holds the truth."""
    if coefficient.interval is None:
        return truth < coefficient.upper * WIDER
    low, high = np.log(coefficient.interval)
    middle = np.log(coefficient.value)
    return middle - WIDER * (middle - low) < np.log(truth) < middle + WIDER * (high - middle)


@pytest.mark.parametrize(
    ("fixes", "gyro", "accel", "seed"),
    [(1.5, 3.0, 1.0, 1), (2.0, 3.0, 3.0, 2), (0.6, 5.0, 1.0, 3), (1.5, 1.0, 6.0, 4)],
)
def test_wrong_receiver_and_wrong_unit_are_both_named(simulated, drive_config, fixes, gyro, accel, seed):
    """Found in 24 of 24 such drives; what one of the two is off by does not leak into the other."""
    drive = simulated(seed, fixes=fixes, unit=np.repeat([gyro, accel], 3))
    told = {f.cause: f.parameters for f in diagnose_drive(drive, drive_config).findings}
    assert set(told) == {"gnss_noise_scale", "imu_noise_scale"}
    for name, c in told["gnss_noise_scale"].items():
        assert holds(c, fixes), name
    for name, c in told["imu_noise_scale"].items():
        assert holds(c, (gyro, accel)[UNIT[name]]), name


def test_noisy_gyros_are_named_alone(simulated, drive_config):
    """A factor 2.5 on the noise that a datasheet tells is some 40 nats on 300 s: the datasheet is not to hide it."""
    drive = simulated(5, unit=np.repeat([2.5, 1.0], 3))
    (finding,) = diagnose_drive(drive, drive_config).findings
    assert finding.cause == "imu_noise_scale"
    assert holds(finding.parameters["gyro"], 2.5)
