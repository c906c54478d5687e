"""Diagnosis of a drive: linearised filter run, causes named with their parameters, no finding in clean drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from tuner.diagnosis.drive import diagnose_drive
from tuner.diagnosis.drive.causes.registry import significance_threshold
from tuner.diagnosis.drive.hypothesis import Hypothesis, run_filter
from tuner.diagnosis.drive.score_tests import fit_constants, late_gain, score_tests
from tuner.formats.configuration import config_json, load_config
from tuner.linear_run.likelihood import as_configured
from tuner.linear_run.whitened_innovations import WhitenedInnovations, whiten
from tuner.navigation.compensation import compensate, correction
from tuner.types import Compensation, Parameter
from tuner.types.records import DataError

DELAY = Parameter("time_offset", "delay")
DURATION = 500.0
MASKED = 2.0
"""How much less sure a constant may be beside the others that are fitted with it."""
POSITIONS = np.array([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def clean(simulated, drive_config):
    drive = simulated(1, duration=DURATION)
    return drive, run_filter(drive, Hypothesis.first(drive, drive_config))


def test_record_is_the_filter(clean):
    """Kalman recursion over Φ, Q and H gives the filter's own innovation covariances and corrections."""
    _, diagnosis = clean
    linearized, solution = diagnosis.linearized, diagnosis.solutions[0]
    noise, p = sum(linearized.noise.values()), linearized.initial.copy()
    for i in range(len(linearized)):
        p = linearized.transition[i] @ p @ linearized.transition[i].T + noise[i]
        h, sd = linearized.H[i], linearized.sd[i]
        s = h @ p @ h.T + np.diag(sd**2)
        np.testing.assert_allclose(s, solution.innovation_covariance[i], rtol=1e-9, atol=1e-12)
        gain = p @ h.T @ np.linalg.inv(s)
        off = (gain @ linearized.innovation[i] - linearized.correction[i]) / np.sqrt(np.diag(p))
        assert np.abs(off[np.isfinite(off)]).max() < 1e-6
        p = p - gain @ h @ p


def test_sensitivity_is_the_derivative(simulated, drive_config):
    """Innovations change by s θ where a constant is put into the same drive (first order)."""
    small = {
        "time_offset.delay": 2e-3,
        "gyro_scale.z": 1e-3,
        "accel_scale.x": 1e-3,
        "misalignment.pitch": 1e-3,
    }
    drive = simulated(1, duration=DURATION)
    first = run_filter(drive, Hypothesis.first(drive, drive_config))
    base = whiten(as_configured(first.linearized))
    for name, size in small.items():
        changed = run_filter(
            compensate(drive, Compensation.parse({name: -size})), Hypothesis.first(drive, drive_config)
        )
        moved = whiten(as_configured(changed.linearized))
        change = moved.residual - base.residual
        estimates = base.slope[:, first.linearized.parameters.index(Parameter.parse(name))] * size
        assert np.linalg.norm(change - estimates) < 0.15 * np.linalg.norm(estimates), name


def test_a_clean_drive_has_no_finding(clean, drive_config):
    drive, diagnosis = clean
    shifts = score_tests(whiten(as_configured(diagnosis.linearized)), diagnosis.linearized.parameters, ())
    assert min(one.p_value for one in shifts) > 1e-5
    assert diagnose_drive(drive, drive_config).quiet


def sd_alone(simulated, config, **small):
    """Sd over size of a small constant where all else is known: 1 over the change of the whitened innovations."""
    base, moved = (
        whiten(as_configured(run_filter(one, Hypothesis.first(one, config)).linearized)).residual
        for one in (simulated(7, duration=DURATION), simulated(7, duration=DURATION, **small))
    )
    return 1.0 / np.linalg.norm(moved - base)


@pytest.mark.parametrize(
    ("cause", "hidden", "truth", "small"),  # `small`: a size of each parameter alone, to see what it does
    [
        ("time_offset", {"delay": 0.05}, {"delay": 0.05}, {"delay": (2e-3, {"delay": 2e-3})}),
        ("velocity_lag", {"lag": 0.15}, {"delay": 0.15}, {"delay": (2e-3, {"lag": 2e-3})}),
        (
            "lever_arm",
            {"arm": (1.0, -0.6, 0.0)},
            {"x": 1.0, "y": -0.6},
            {"x": (0.02, {"arm": (0.02, 0.0, 0.0)}), "y": (0.02, {"arm": (0.0, 0.02, 0.0)})},
        ),
        pytest.param(
            "accel_scale",
            {"values": {"accel_scale.x": 0.012}},
            {"x": 0.012},
            {"x": (2e-4, {"values": {"accel_scale.x": 2e-4}})},
            marks=pytest.mark.slow,
        ),
        (
            "misalignment",
            {"values": {"misalignment.roll": 0.008}},
            {"roll": 0.008},
            {"roll": (2e-4, {"values": {"misalignment.roll": 2e-4}})},
        ),
    ],
)
def test_a_constant_cause_is_named(simulated, drive_config, cause, hidden, truth, small):
    """Intervals are those of two runs of the filter on drives with the same noise, wider by what is fitted besides."""
    diagnosis = diagnose_drive(simulated(7, duration=DURATION, **hidden), drive_config)
    assert [finding.cause for finding in diagnosis.findings] == [cause]
    (finding,) = diagnosis.findings
    assert finding.p_value < significance_threshold()
    for name, value in truth.items():
        estimate = finding.parameters[name]
        size, alone = small[name]
        sd = size * sd_alone(simulated, drive_config, **alone)
        assert abs(estimate.value - value) < 6.0 * MASKED * sd
        assert 0.95 * sd < (estimate.interval[1] - estimate.interval[0]) / 3.92 < MASKED * sd
    assert diagnosis.gain.nats > 0.0
    again = load_config(config_json(diagnosis.after), source="again")
    assert again == diagnosis.after
    (stored,) = again.findings
    assert stored["channels"] == list(finding.channels)
    for name, estimate in finding.parameters.items():
        assert stored["parameters"][name]["interval"] == pytest.approx(estimate.interval)
        assert stored["parameters"][name]["unit"] == estimate.unit


def test_large_delay_and_wrong_sds(simulated, drive_config):
    diagnosis = diagnose_drive(simulated(3, duration=DURATION, delay=-0.6, fixes=POSITIONS), drive_config)
    estimates = {finding.cause: finding.parameters for finding in diagnosis.findings}
    assert set(estimates) == {"time_offset", "gnss_noise_scale"}
    assert estimates["time_offset"]["delay"].value == pytest.approx(-0.6, abs=0.03)
    assert estimates["gnss_noise_scale"]["position_horizontal"].value == pytest.approx(2.0, rel=0.2)
    assert diagnosis.compensation.value("time_offset", "delay") == pytest.approx(-0.6, abs=0.03)


def test_a_constant_must_gain_in_the_last_part():
    rng = np.random.default_rng(4)
    t, slope = np.arange(2000.0), rng.standard_normal((2000, 1))
    noise = rng.standard_normal(2000)
    lasting = WhitenedInnovations(t, noise + 20.0 * 0.01 * slope[:, 0], slope)
    passing = WhitenedInnovations(t, noise + np.where(t < 1000.0, 0.4, -0.4) * slope[:, 0], slope)
    at = np.zeros(1)
    # 0.2² 800/2 = 16 nats with a sd of 6; some 40 nats lost with one of 10.
    assert late_gain(lasting, (DELAY,), ("time_offset",), "time_offset", at) > -10.0
    assert late_gain(passing, (DELAY,), ("time_offset",), "time_offset", at) < -2.0


def test_compensation_is_undone(simulated):
    """What sensor errors put in, a compensation takes out, in the axes of the sensor."""
    values = Compensation.parse(
        {"gyro_scale.x": 0.01, "accel_scale.z": -0.02, "misalignment.yaw": 0.03, "g_sensitivity.xy": 1e-4}
    )
    drive = simulated(1, duration=DURATION)
    spoiled = replace(drive, rates=drive.rates @ correction(values).sensor_matrix.T)
    np.testing.assert_allclose(compensate(spoiled, values).rates, drive.rates, rtol=1e-9, atol=1e-12)
    turn = rotation.mat_from_rpy((0.01, -0.02, 0.03))
    gnss = replace(drive.gnss, t=drive.gnss.t + 0.3, vel_n=drive.gnss.vel_n @ turn.T)
    angles = {"gnss_frame.roll": 0.01, "gnss_frame.pitch": -0.02, "gnss_frame.yaw": 0.03}
    back = compensate(
        replace(drive, gnss=gnss), Compensation.parse({"time_offset.delay": 0.3, **angles})
    ).gnss
    np.testing.assert_allclose(back.t, drive.gnss.t)
    np.testing.assert_allclose(back.vel_n, drive.gnss.vel_n, atol=1e-12)


def test_fit_adds_to_what_is_compensated(simulated, drive_config):
    """The total is the same whether a delay is compensated already or not."""
    drive = simulated(5, duration=DURATION, delay=0.04)
    totals = []
    for known in (0.0, 0.03):
        run = run_filter(drive, Hypothesis.first(drive, drive_config, Compensation({DELAY: known})))
        names = run.linearized.parameters
        at = run.hypothesis.compensation.vector(names)
        estimates = fit_constants(whiten(as_configured(run.linearized)), names, ("time_offset",), at)
        totals.append((estimates.value[0], np.sqrt(estimates.covariance[0, 0])))
    assert abs(totals[0][0] - totals[1][0]) < 0.7 * totals[0][1]


def test_a_clock_ten_times_too_fast_leaves_nothing_to_judge_by(simulated, drive_config):
    """Stamps of the samples × 0.1: the fixes of their time end before the filter has settled."""
    drive = simulated(1, duration=DURATION)
    imu_t = 0.1 * drive.imu_t
    inside = drive.gnss.t <= imu_t[-1]
    short = replace(drive, imu_t=imu_t, rates=drive.rates, gnss=drive.gnss.rows(inside))
    with pytest.raises(
        DataError, match=r"expected fixes beyond 60 s after the start|heading cannot be found"
    ):
        diagnose_drive(short, drive_config)
