"""Mounting of a unit in its vehicle: estimated where wheels do not slip, else reported as unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from tuner.diagnosis.drive import diagnose_drive
from tuner.navigation.compensation import compensate

PITCH, YAW = np.radians((3.0, -4.0))


@pytest.fixture(scope="module")
def turned(simulated):
    """A unit pitched and yawed in a vehicle against its stated mounting."""
    drive = simulated(11)
    mat = rotation.mat_from_rpy((0.0, PITCH, YAW))
    rates = np.hstack([drive.rates[:, :3] @ mat.T, drive.rates[:, 3:] @ mat.T])
    return replace(drive, rates=rates, mounting=np.eye(3))


def test_a_wrong_mounting_is_named_where_wheels_do_not_slip(turned, drive_config):
    diagnosis = diagnose_drive(turned, drive_config, wheels=True)
    (finding,) = diagnosis.findings
    assert finding.cause == "mounting"
    for name, truth in (("pitch", PITCH), ("yaw", YAW)):
        angle = finding.parameters[name]
        # At 12 m/s 0.1 m/s downwards and 0.06 m/s across are 8 and 5 mrad a fix: of 300 half a mrad. Constraints
        # have a larger sd, since wheels may slip: a degree.
        assert angle.value == pytest.approx(truth, abs=np.radians(1.0))
        assert 4e-4 < (angle.interval[1] - angle.interval[0]) / 3.92 < np.radians(1.0) / 4.0
    mended = compensate(turned, diagnosis.compensation).mounting
    np.testing.assert_allclose(mended, rotation.mat_from_rpy((0.0, PITCH, YAW)), atol=0.03)


def test_a_right_mounting_is_left_alone(simulated, drive_config):
    diagnosis = diagnose_drive(replace(simulated(12), mounting=np.eye(3)), drive_config, wheels=True)
    assert diagnosis.quiet


def test_without_wheels_the_mounting_is_reported_as_unknown(turned, drive_config):
    diagnosis = diagnose_drive(turned, drive_config)
    assert diagnosis.quiet
    untold = {one.causes: one.text for one in diagnosis.inseparable}
    assert "no wheels" in untold[("mounting",)]
    assert "vertical accelerometer" in untold[("gravity", "sensor_bias")]
