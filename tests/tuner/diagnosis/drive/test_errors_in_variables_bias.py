"""Errors-in-variables bias of fitted constants, by simulation–extrapolation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.diagnosis.drive import diagnose_drive, examine_drive
from tuner.diagnosis.drive.errors_in_variables_bias import errors_in_variables_bias, with_more_noise
from tuner.diagnosis.drive.hypothesis import Hypothesis, in_sensor_axes, run_filter
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config
from tuner.types import Parameter

RECEIVER = replace(load_gnss("spp"), interval=2.4)


@pytest.fixture(scope="module")
def hour():
    """An hour of gentle slopes with gyros of 2°/√h: slopes give little information, noise biases them."""
    drive, _ = simulate_drive(
        load_grade("adis16405"), TRAJECTORIES["city"](3600.0), RECEIVER, rate=25.0, seed=5
    )
    drive, config = in_sensor_axes(drive), load_config("adis16405", gnss=RECEIVER)
    return drive, config, run_filter(drive, Hypothesis.first(drive, config))


def test_errors_in_variables_bias_of_constants_is_reported(hour):
    """Gravity is biased by sds on a clean drive; without that bias its score is one of mean 0 (5 sds)."""
    drive, _, run = hour
    bias, names = errors_in_variables_bias(drive, run), run.linearized.parameters
    w = run.whitened
    corrected = replace(run, hypothesis=replace(run.hypothesis, errors_in_variables_bias=bias)).whitened
    s = w.slope[:, names.index(Parameter("gravity", "offset"))]
    before, after = (float(s @ each.residual / np.sqrt(s @ s)) for each in (w, corrected))
    assert after - before > 2.0
    assert abs(after) < 5.0


@pytest.mark.slow
def test_a_clean_hour_has_no_finding(hour):
    """Where sensitivities were taken for exact, scale factors of the gyros were found with a chance of 8e-5."""
    drive, config, _ = hour
    assert diagnose_drive(drive, config).quiet


def test_the_noise_that_is_added_is_the_one_configured(hour):
    drive, config, run = hour
    more = with_more_noise(drive, run, np.random.default_rng(3))
    step = float(np.median(np.diff(drive.imu_t)))
    white = np.diff(more.rates - drive.rates, axis=0).std(axis=0) * np.sqrt(0.5 * step)
    densities = [
        config.channels[f"{sensor}_{axis}"].white_density for sensor in ("gyro", "accel") for axis in "xyz"
    ]
    np.testing.assert_allclose(white, densities, rtol=0.02)
    np.testing.assert_allclose(
        (more.gnss.vel_n - drive.gnss.vel_n).std(axis=0),
        RECEIVER.velocity_sd,
        rtol=5.0 / np.sqrt(2.0 * len(drive.gnss)),
    )


def test_errors_in_variables_bias_is_reported_where_a_shift_is_removed():
    """With a delay of 60 ms present the bias seems to be 3 ms; the interval would miss the truth by half."""
    receiver = load_gnss("dgnss")
    drive, _ = simulate_drive(
        load_grade("adis16465"),
        TRAJECTORIES["city"](400.0),
        receiver,
        rate=50.0,
        seed=44,
        effects=("time_offset:delay=0.06",),
    )
    run = examine_drive(drive, load_config("adis16465", gnss=receiver))
    final = run.search.final
    assert [finding.cause for finding in run.diagnosis.findings] == ["time_offset"]
    place = final.linearized.parameters.index(Parameter("time_offset", "delay"))
    assert abs(final.hypothesis.errors_in_variables_bias[place]) < 5e-4
