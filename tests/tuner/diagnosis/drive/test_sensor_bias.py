"""Biases beyond their priors are named where they are, not where a compensation removed them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.hypothesis import Hypothesis, Jump


def test_a_gyro_bias_beyond_its_prior_is_named_with_what_it_may_be(simulated, drive_config):
    drive = simulated(21)
    off = np.array([0.0, 0.015, 0.0, 0.0, 0.0, 0.0])  # 15 prior sds; beyond 20 it is withdrawn
    diagnosis = diagnose_drive(replace(drive, rates=drive.rates + off), drive_config)
    findings = {finding.cause: finding for finding in diagnosis.findings}
    assert findings["sensor_bias"].parameters["gyro_y"].value == pytest.approx(0.015, abs=5e-3)
    assert [one.cause for one in findings["sensor_bias"].alternatives] == ["g_sensitivity"]
    assert ("sensor_bias", "g_sensitivity") in {one.causes for one in diagnosis.inseparable}


def test_a_badly_known_scale_leaves_no_bias(simulated, drive_config):
    """A scale factor of the vertical accelerometer is inseparable from its bias: its error is no finding."""
    drive = simulated(7, duration=500.0, values={"accel_scale.x": 0.012})
    assert [finding.cause for finding in diagnose_drive(drive, drive_config).findings] == ["accel_scale"]


def test_a_jump_at_the_same_place_again_is_no_further_jump(simulated, drive_config):
    once = Jump(100.0, "accel", np.array([0.0, -0.06, 0.0]))
    one = replace(Hypothesis.first(simulated(21), drive_config), jumps=(once,))
    assert replace(one, jumps=(once, replace(once, size=0.9 * once.size))).is_equivalent_to(one)
    assert not replace(one, jumps=(once, replace(once, time=130.0))).is_equivalent_to(one)
    assert not replace(one, jumps=(once, replace(once, sensor="gyro"))).is_equivalent_to(one)
