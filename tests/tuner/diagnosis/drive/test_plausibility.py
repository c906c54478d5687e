"""What cannot be true is not given as a list of causes: a start that failed, impossible estimates, wrong axes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tuner.navigation.drive.run as drive_run
from models import rotation
from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.plausibility import heading_correction, reasons
from tuner.types import Coefficient, Finding

TURN = np.radians(40.0)


@pytest.fixture(scope="module")
def drive(simulated):
    return simulated(2, duration=240.0)


def test_a_start_that_failed_is_all_that_is_said(drive, drive_config, monkeypatch):
    """A heading 40° off, stated to 2°: biases, noise and scale factors of the catalogue take the blame otherwise."""
    align = drive_run.align

    def turned(*args, **options):
        a = align(*args, **options)
        wrong = rotation.quat_from_rotvec(np.array([0.0, 0.0, TURN]))
        return replace(a, quat_nb=rotation.quat_multiply(wrong, a.quat_nb), heading_sd=np.radians(1.0))

    monkeypatch.setattr(drive_run, "align", turned)
    found = diagnose_drive(drive, drive_config)
    assert found.findings == ()
    assert found.after is found.before
    assert "the start failed" in found.unexplained[0].statistic
    assert any("at rest" in note for note in found.notes)


@pytest.mark.parametrize(
    ("sd", "correction", "fails"), [(60.0, 45.0, True), (60.0, 15.0, False), (5.0, 45.0, False)]
)
def test_a_heading_that_a_linear_filter_cannot_correct_is_a_start_that_failed(sd, correction, fails):
    """Boats in waves, aligned to 70°, got six causes each."""
    initial, steps = np.zeros((15, 15)), np.zeros((50, 15))
    initial[8, 8], steps[:, 8] = np.radians(sd) ** 2, np.radians(correction) / 50
    starts = np.arange(50) == 0
    run = SimpleNamespace(
        linearized=SimpleNamespace(initial=initial, correction=steps, starts=starts, t=np.arange(50.0))
    )
    assert bool(heading_correction(run)) == fails


def test_axes_of_another_frame_are_told(drive, drive_config):
    """A unit whose axes are forward, left, up where its mounting says forward, right, down."""
    up = np.diag([1.0, -1.0, -1.0])
    rates = np.hstack([drive.rates[:, :3] @ up, drive.rates[:, 3:] @ up])
    found = diagnose_drive(replace(drive, rates=rates, mounting=np.eye(3)), drive_config)
    assert any("180" in one.statistic and "axes" in one.statistic for one in found.unexplained)
    right = diagnose_drive(replace(drive, rates=rates, mounting=up), drive_config)
    assert not any("axes" in one.statistic for one in right.unexplained)


def _finding(cause, value=0.0, **parameters):
    known = {name: Coefficient.known(x, 0.9 * x, 1.1 * x, "1") for name, x in parameters.items()}
    return Finding(cause, ("drive",), "", value, 0.0, known, "")


@pytest.mark.parametrize(
    ("finding", "possible"),
    [
        (_finding("sensor_bias", 10.0, gyro_x=0.1), True),
        (_finding("sensor_bias", 40.0, gyro_x=0.1), False),
        (_finding("imu_noise_scale", gyro=20.0), True),
        (_finding("imu_noise_scale", gyro=80.0), False),
        (_finding("gnss_noise_scale", velocity_vertical_class_0=0.9, velocity_vertical_class_1=900.0), True),
        (
            _finding("gnss_noise_scale", velocity_vertical_class_0=80.0, velocity_vertical_class_1=900.0),
            False,
        ),
        (_finding("correlated_gnss", sd=2.0, time_constant=300.0), True),
        (_finding("correlated_gnss", sd=2.0, time_constant=2300.0), True),  # as of the ionosphere
        (_finding("correlated_gnss", sd=2.0, time_constant=30000.0), False),
    ],
)
def test_impossible_estimates_have_a_reason(finding, possible):
    assert (not list(reasons(finding, 1000.0))) == possible


def test_a_sheet_that_stands_in_refutes_no_bias():
    """The drive measures a bias; that it is 40 turn-on sds of another sensor made it "something else"."""
    found = _finding("sensor_bias", 40.0, gyro_x=0.1)
    assert not list(reasons(found, 1000.0, ["gyro_x", "gyro_y"]))
    assert list(reasons(found, 1000.0, ["gyro_y"]))


def test_velocities_too_large_are_a_scale_not_a_sensor(drive, drive_config):
    """An odometer's radius 2 % too large; unnamed, it was read as scale factors of the accelerometers."""
    fast = replace(drive, gnss=replace(drive.gnss, vel_n=1.02 * drive.gnss.vel_n))
    (finding,) = diagnose_drive(fast, drive_config).findings
    assert finding.cause == "velocity_scale"
    assert finding.parameters["factor"].value == pytest.approx(0.02, abs=0.004)


def test_vertical_velocities_that_contradict_the_heights_are_told(drive, drive_config):
    """0.15 m/s down that no height shows: read as a bias of the vertical accelerometer where it has no name."""
    falling = replace(drive, gnss=replace(drive.gnss, vel_n=drive.gnss.vel_n + np.array([0.0, 0.0, 0.15])))
    (finding,) = diagnose_drive(falling, drive_config).findings
    assert finding.cause == "vertical_velocity"
    assert finding.parameters["offset"].value == pytest.approx(0.15, abs=0.03)
