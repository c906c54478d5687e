"""Criticism of a drive: the pass made linear, causes named with their figures, clean drives left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.earth import llh_displaced
from models.gnss import perfect_fixes
from models.motion import imu_increments
from models.trajectories import TRAJECTORIES
from tuner.diagnosis.drives import diagnose_drive
from tuner.diagnosis.drives.hypothesis import Hypothesis, examine
from tuner.diagnosis.drives.likelihood import believed
from tuner.diagnosis.drives.loop import THRESHOLD
from tuner.diagnosis.drives.score import carried, families, fit
from tuner.diagnosis.drives.sensitivity import Whitened, whitened
from tuner.exporters import native
from tuner.grades import grade_identification, load_grade
from tuner.navigation.compensation import compensated, sensor_matrix
from tuner.records import Drive, Gnss
from tuner.results import GnssNoise
from tuner.synthesis import synthesize

INTERVAL, STILL, DURATION = 0.02, 30.0, 500.0
SD = np.array([1.0, 1.0, 1.8, 0.06, 0.06, 0.1])
WHITE, CONSTANT = np.repeat([1.7e-4, 3e-3], 3), np.repeat([1e-3, 0.02], 3)


@pytest.fixture(scope="module")
def config():
    """What the simulated unit is: white noise and constant biases."""
    receiver = GnssNoise((1.0, 1.0, 1.8), (0.06, 0.06, 0.1), 1.0, 5.0)
    told = synthesize(grade_identification(load_grade("mpu9250")), gnss=receiver)
    exact = {
        axis: replace(noise, white_density=density, markov=(), random_walk_density=0.0, constant_sd=sd)
        for (axis, noise), density, sd in zip(told.channels.items(), WHITE, CONSTANT, strict=True)
    }
    return replace(told, channels=exact)


@pytest.fixture(scope="module")
def motion():
    motion = TRAJECTORIES["city"](DURATION)
    return motion, np.hstack(imu_increments(motion, INTERVAL)) / INTERVAL


def simulated(motion, seed, *, values=None, delay=0.0, lag=0.0, arm=(0.0, 0.0, 0.0), scale=1.0):
    """A city after standing still, with white noise and constant biases; `values` as of a compensation."""
    rng = np.random.default_rng(seed)
    course, moving = motion
    rates = np.vstack([np.tile(moving[0], (round(STILL / INTERVAL), 1)), moving])
    rates = rates @ sensor_matrix(values or {}).T
    rates = rates + CONSTANT * rng.standard_normal(6)
    rates = rates + rng.standard_normal(rates.shape) * WHITE / np.sqrt(INTERVAL)
    t = INTERVAL * np.arange(1, len(rates) + 1)
    fix_t = np.arange(1.0, STILL + DURATION - 1.0)
    there = [(fix_t - STILL - late).clip(0.0, DURATION) for late in (delay, delay + lag)]
    llh, _ = perfect_fixes(course, there[0], lever_arm=arm)
    _, vel = perfect_fixes(course, there[1], lever_arm=arm)
    error = rng.standard_normal((len(fix_t), 6)) * SD
    sd = np.tile(SD, (len(fix_t), 1))
    gnss = Gnss(fix_t, llh_displaced(llh, scale * error[:, :3]), vel + error[:, 3:], sd[:, :3], sd[:, 3:])
    return Drive("simulated", t, rates, gnss, lever_arm=(0.0, 0.0, 0.0), source="simulated")


@pytest.fixture(scope="module")
def clean(motion, config):
    drive = simulated(motion, 1)
    return drive, examine(drive, Hypothesis.first(drive, config))


def test_record_is_the_filter(clean):
    """Kalman recursion over Φ, Q and H gives the filter's own innovation covariances and corrections."""
    _, found = clean
    record, solution = found.record, found.solutions[0]
    noise, p = sum(record.noise.values()), record.initial.copy()
    for i in range(len(record)):
        p = record.transition[i] @ p @ record.transition[i].T + noise[i]
        h, sd = record.H[i], record.sd[i]
        s = h @ p @ h.T + np.diag(sd**2)
        np.testing.assert_allclose(s, solution.innovation_covariance[i], rtol=1e-9, atol=1e-12)
        gain = p @ h.T @ np.linalg.inv(s)
        off = (gain @ record.innovation[i] - record.correction[i]) / np.sqrt(np.diag(p))
        assert np.abs(off[np.isfinite(off)]).max() < 1e-6
        p = p - gain @ h @ p


def test_sensitivity_is_the_derivative(motion, config):
    """Innovations change by s θ where a constant is put into the same drive (first order)."""
    small = {
        "time_offset.delay": 2e-3,
        "gyro_scale.z": 1e-3,
        "accel_scale.x": 1e-3,
        "misalignment.pitch": 1e-3,
    }
    drive = simulated(motion, 1)
    first = examine(drive, Hypothesis.first(drive, config))
    base = whitened(believed(first.record))
    for name, size in small.items():
        changed = examine(compensated(drive, {name: -size}), Hypothesis.first(drive, config))
        moved = whitened(believed(changed.record))
        change = moved.residual - base.residual
        told = base.slope[:, first.record.parameters.index(name)] * size
        assert np.linalg.norm(change - told) < 0.15 * np.linalg.norm(told), name


def test_clean_drive_is_quiet(clean, config):
    drive, found = clean
    shifts = families(whitened(believed(found.record)), found.record.parameters, ())
    assert min(one.p_value for one in shifts) > 1e-5
    assert diagnose_drive(drive, config).quiet


@pytest.mark.parametrize(
    ("cause", "hidden", "truth"),
    [
        ("time_offset", {"delay": 0.05}, {"delay": 0.05}),
        ("velocity_lag", {"lag": 0.15}, {"delay": 0.15}),
        ("lever_arm", {"arm": (1.0, -0.6, 0.0)}, {"x": 1.0, "y": -0.6}),
        ("accel_scale", {"values": {"accel_scale.x": 0.012}}, {"x": 0.012}),
        ("misalignment", {"values": {"misalignment.roll": 0.008}}, {"roll": 0.008}),
    ],
)
def test_shift_is_named(motion, config, cause, hidden, truth):
    found = diagnose_drive(simulated(motion, 7, **hidden), config)
    assert [finding.cause for finding in found.findings] == [cause]
    (finding,) = found.findings
    assert finding.p_value < THRESHOLD
    for name, value in truth.items():
        told = finding.parameters[name]
        half = 0.5 * (told.interval[1] - told.interval[0])
        assert abs(told.value - value) < 2.6 * half
    assert found.gain.nats > 0.0
    assert native.loads(native.dumps(found.after)) == found.after


def test_large_delay_and_wrong_sds(motion, config):
    found = diagnose_drive(simulated(motion, 3, delay=-0.6, scale=2.0), config)
    told = {finding.cause: finding.parameters for finding in found.findings}
    assert set(told) == {"time_offset", "gnss_noise_scale"}
    assert told["time_offset"]["delay"].value == pytest.approx(-0.6, abs=0.03)
    assert told["gnss_noise_scale"]["position_horizontal"].value == pytest.approx(2.0, rel=0.2)
    assert found.compensation["time_offset.delay"] == pytest.approx(-0.6, abs=0.03)


def test_a_shift_must_carry_to_the_last_part():
    rng = np.random.default_rng(4)
    t, slope = np.arange(2000.0), rng.standard_normal((2000, 1))
    noise = rng.standard_normal(2000)
    lasting = Whitened(t, noise + 20.0 * 0.01 * slope[:, 0], slope)
    passing = Whitened(t, noise + np.where(t < 1000.0, 0.4, -0.4) * slope[:, 0], slope)
    at = np.zeros(1)
    # 0.2² 800/2 = 16 nats with a sd of 6; some 40 nats lost with one of 10.
    assert carried(lasting, ("time_offset.delay",), ("time_offset",), "time_offset", at) > -10.0
    assert carried(passing, ("time_offset.delay",), ("time_offset",), "time_offset", at) < -2.0


def test_compensation_is_undone(motion):
    """What sensor errors put in, a compensation takes out, in the axes of the sensor."""
    values = {
        "gyro_scale.x": 0.01,
        "accel_scale.z": -0.02,
        "misalignment.yaw": 0.03,
        "g_sensitivity.xy": 1e-4,
    }
    drive = simulated(motion, 1)
    spoiled = replace(drive, rates=drive.rates @ sensor_matrix(values).T)
    np.testing.assert_allclose(compensated(spoiled, values).rates, drive.rates, rtol=1e-9, atol=1e-12)
    turn = rotation.mat_from_rpy((0.01, -0.02, 0.03))
    gnss = replace(drive.gnss, t=drive.gnss.t + 0.3, vel_n=drive.gnss.vel_n @ turn.T)
    angles = {"gnss_frame.roll": 0.01, "gnss_frame.pitch": -0.02, "gnss_frame.yaw": 0.03}
    back = compensated(replace(drive, gnss=gnss), {"time_offset.delay": 0.3, **angles}).gnss
    np.testing.assert_allclose(back.t, drive.gnss.t)
    np.testing.assert_allclose(back.vel_n, drive.gnss.vel_n, atol=1e-12)


def test_fit_adds_to_what_is_compensated(motion, config):
    """The total is the same whether a delay is compensated already or not."""
    drive = simulated(motion, 5, delay=0.04)
    totals = []
    for known in (0.0, 0.03):
        found = examine(drive, Hypothesis.first(drive, config, {"time_offset.delay": known}))
        names = found.record.parameters
        at = np.array([found.hypothesis.values.get(name, 0.0) for name in names])
        told = fit(whitened(believed(found.record)), names, ("time_offset",), at)
        totals.append((told.value[0], np.sqrt(told.covariance[0, 0])))
    assert abs(totals[0][0] - totals[1][0]) < 0.7 * totals[0][1]
