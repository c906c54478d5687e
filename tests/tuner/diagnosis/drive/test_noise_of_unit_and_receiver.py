"""Wrong noise of unit and receiver together, and receiver noise by class of fix."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.diagnosis.drive import diagnose_drive
from tuner.formats.configuration import config_json, load_config
from tuner.navigation.compensation import compensate_settings
from tuner.navigation.settings import filter_settings

SD = np.array([1.0, 1.0, 1.8, 0.06, 0.06, 0.1])

UNIT = {"gyro": 0, "accel": 1}


def is_scale_of_fixes(coefficient, name, truth, fixes):
    """Within 4.9 sds, 1e-6: a sd from n errors has the relative sd 1/√(2 n); a third more for the filter."""
    errors = fixes * (2 if "horizontal" in name else 1)
    return abs(np.log(coefficient.value / truth)) < 4.9 * 1.3 / np.sqrt(2.0 * errors)


def is_scale_of_unit(coefficient, truth):
    """Within a factor of two of the truth, which a drive of 300 s with fixes of 1 m shows; a limit is not below it."""
    if coefficient.interval is None:
        return truth < 2.0 * coefficient.upper
    low, high = coefficient.interval
    return abs(np.log(coefficient.value / truth)) < np.log(2.0) and low < 2.0 * truth and high > 0.5 * truth


@pytest.mark.parametrize(
    ("fixes", "gyro", "accel", "seed"),
    [
        (1.5, 3.0, 1.0, 1),
        (2.0, 3.0, 3.0, 2),
        pytest.param(0.6, 5.0, 1.0, 3, marks=pytest.mark.slow),
        pytest.param(1.5, 1.0, 6.0, 4, marks=pytest.mark.slow),
    ],
)
def test_wrong_receiver_and_wrong_unit_are_both_named(simulated, drive_config, fixes, gyro, accel, seed):
    """Found in 24 of 24 such drives; what one of the two is off by does not leak into the other."""
    drive = simulated(seed, fixes=fixes, unit=np.repeat([gyro, accel], 3))
    parameters = {f.cause: f.parameters for f in diagnose_drive(drive, drive_config).findings}
    assert set(parameters) == {"gnss_noise_scale", "imu_noise_scale"}
    for name, c in parameters["gnss_noise_scale"].items():
        assert is_scale_of_fixes(c, name, fixes, 328), name
    for name, c in parameters["imu_noise_scale"].items():
        assert is_scale_of_unit(c, (gyro, accel)[UNIT[name]]), name


def test_noisy_gyros_are_named_alone(simulated, drive_config):
    """A factor 2.5 on the noise of a datasheet is some 40 nats on 300 s: the datasheet is not to hide it."""
    drive = simulated(5, unit=np.repeat([2.5, 1.0], 3))
    (finding,) = diagnose_drive(drive, drive_config).findings
    assert finding.cause == "imu_noise_scale"
    assert is_scale_of_unit(finding.parameters["gyro"], 2.5)


def test_half_of_the_fixes_report_four_times_their_error(simulated, drive_config):
    """As a receiver whose float solutions are better than it says: factors by class, and a filter that has them."""
    level = np.where(np.random.default_rng(9).random(400) < 0.5, 4.0, 1.0)
    drive = simulated(6, reported=level)
    diagnosis = diagnose_drive(drive, drive_config)
    (finding,) = diagnosis.findings
    assert finding.cause == "gnss_noise_scale"
    for row in ("position_horizontal", "position_vertical", "velocity_horizontal", "velocity_vertical"):
        assert is_scale_of_fixes(finding.parameters[f"{row}_class_0"], row, 1.0, 164), row
        assert is_scale_of_fixes(finding.parameters[f"{row}_class_1"], row, 0.25, 164), row
    assert SD[0] < finding.parameters["position_edge_1"].value < 4.0 * SD[0]
    assert diagnosis.gain.nats > 0.0
    models = compensate_settings(filter_settings(diagnosis.after), diagnosis.compensation).fix_sd_models
    reported = np.hstack([drive.gnss.position_sd, drive.gnss.velocity_sd])
    stated = drive.gnss.solution
    modelled = np.hstack([models[0].sds(reported[:, :3], stated), models[1].sds(reported[:, 3:], stated)])
    np.testing.assert_allclose(modelled, np.tile(SD, (len(modelled), 1)), rtol=0.3)
    assert load_config(config_json(diagnosis.after), source="again") == diagnosis.after


def test_a_receiver_that_tells_the_truth_of_every_fix_is_left_alone(simulated, drive_config):
    """Errors and reported sds vary together."""
    level = np.exp(0.5 * np.random.default_rng(8).standard_normal(400))
    drive = simulated(7, reported=level, fixes=level[: round(300.0 + 28.0), None])
    assert diagnose_drive(drive, drive_config).quiet
