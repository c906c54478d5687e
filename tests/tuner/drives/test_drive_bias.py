"""Biases beyond their priors: named where they are, not where a compensation left them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tuner.diagnosis.drives import diagnose_drive


def test_a_gyro_bias_beyond_its_prior_is_named_with_what_it_may_be(simulated, drive_config):
    drive = simulated(21)
    off = np.array([0.0, 0.02, 0.0, 0.0, 0.0, 0.0])  # 20 prior sds
    diagnosis = diagnose_drive(replace(drive, rates=drive.rates + off), drive_config)
    told = {finding.cause: finding for finding in diagnosis.findings}
    assert told["sensor_bias"].parameters["gyro_y"].value == pytest.approx(0.02, abs=5e-3)
    assert [one.cause for one in told["sensor_bias"].alternatives] == ["g_sensitivity"]
    assert ("sensor_bias", "g_sensitivity") in {one.causes for one in diagnosis.inseparable}


def test_a_badly_known_scale_leaves_no_bias(simulated, drive_config):
    """A scale of the vertical accelerometer cannot be told from its bias; what it is off by is no finding."""
    drive = simulated(7, duration=500.0, values={"accel_scale.x": 0.012})
    assert [finding.cause for finding in diagnose_drive(drive, drive_config).findings] == ["accel_scale"]
