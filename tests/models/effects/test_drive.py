"""Each effect on a drive changes perfect samples and fixes exactly as its formula says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.earth import ned_between
from models.effects.drive import EFFECTS, Course, DriveSamples, draw, hide, parse
from models.effects.drive.gnss import GnssOutliers, TimeOffset
from models.measurements import perfect_fixes
from models.trajectory.catalogue import city
from models.trajectory.motion import imu_increments
from tuner.navigation.compensation import corrected_stamps, correction
from tuner.types import Compensation, Parameter

INTERVAL, DURATION = 0.02, 200.0
MOTION = city(DURATION)
SIGMAS = 5.0
CODES = tuple(EFFECTS)

REPORTED = {
    "time_offset": {"delay"},
    "clock_drift": {"rate"},
    "velocity_lag": {"delay"},
    "lever_arm": {"x", "y", "z"},
    "correlated_gnss": {"sd", "time_constant"},
    "gnss_noise_scale": {
        "position_horizontal", "position_vertical", "velocity_horizontal", "velocity_vertical",
    },
    "imu_noise_scale": {"gyro", "accel"},
    "gnss_outliers": {"fraction"},
    "gnss_velocity": {"fraction", "rms"},
    "gyro_scale": {"x", "y", "z"},
    "accel_scale": {"x", "y", "z"},
    "misalignment": {"roll", "pitch", "yaw"},
    "g_sensitivity": {a + b for a in "xyz" for b in "xyz"},
    "gnss_frame": {"roll", "pitch", "yaw"},
    "velocity_scale": {"factor"},
    "vertical_velocity": {"offset"},
    "gravity": {"offset"},
    "mounting": {"roll", "pitch", "yaw"},
    "bias_jump": {"time", "x", "y", "z"},
}  # fmt: skip

NOTHING = (
    "time_offset:delay=0",
    "clock_drift:rate=0",
    "velocity_lag:delay=0",
    "lever_arm:",
    "correlated_gnss:sd=0,time_constant=20",
    "gnss_noise_scale:",
    "imu_noise_scale:",
    "gnss_outliers:fraction=0",
    "gnss_outliers:fraction=0.5,size=0",
    "gnss_velocity:fraction=0,rms=5",
    "gnss_velocity:fraction=0.5,rms=0",
    "gyro_scale:",
    "accel_scale:",
    "misalignment:",
    "g_sensitivity:",
    "gnss_frame:",
    "velocity_scale:",
    "vertical_velocity:",
    "gravity:offset=0",
    "mounting:",
    "bias_jump:time=50",
)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def perfect() -> DriveSamples:
    """Return a drive without errors."""
    increments = np.hstack(imu_increments(MOTION, INTERVAL)) / INTERVAL
    t = INTERVAL * np.arange(1, len(increments) + 1)
    fix_t = np.arange(1.0, DURATION)
    llh, vel = perfect_fixes(MOTION, fix_t)
    at = np.arange(0.0, DURATION + 1e-9, 0.1)
    state = MOTION.evaluate(at)
    course = Course(at, state.llh, state.vel_n, rotation.quat_from_mat(state.mat_nb))
    sd = np.full((len(fix_t), 3), 2.0)
    return DriveSamples(t, increments, fix_t, llh, vel, sd, 0.1 * sd, course)


CLEAN = perfect()


def noisy(seed: int) -> DriveSamples:
    """Return a drive with known white errors."""
    w = 1e-3 * rng(seed).standard_normal(CLEAN.rates.shape)
    sd = np.hstack([CLEAN.position_sd, CLEAN.velocity_sd])
    e = rng(seed + 1).standard_normal(sd.shape) * sd
    drive = replace(CLEAN, rates=CLEAN.rates + w, errors=w, white=w, fix_white=e)
    return drive.moved(e[:, :3], e[:, 3:])


def repeated(times: int) -> DriveSamples:
    """Return the fixes many times over, as if the drive were longer."""
    names = ("llh", "vel_n", "position_sd", "velocity_sd")
    columns = {name: np.tile(getattr(CLEAN, name), (times, 1)) for name in names}
    return replace(CLEAN, fix_t=np.arange(1.0, len(CLEAN.fix_t) * times + 1), **columns)


def only(text: str, drive: DriveSamples = CLEAN, seed: int = 0) -> DriveSamples:
    return hide(drive, [parse(text)], rng(seed))


def assert_equal(a: DriveSamples, b: DriveSamples, atol: float = 1e-13) -> None:
    np.testing.assert_allclose(a.rates, b.rates, rtol=0, atol=atol)
    np.testing.assert_allclose(ned_between(a.llh, b.llh), 0.0, atol=1e-8)
    np.testing.assert_allclose(a.vel_n, b.vel_n, rtol=0, atol=atol)
    for name in ("t", "fix_t", "position_sd", "velocity_sd"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


# ---- the contract


def test_every_cause_is_there_with_the_names_that_findings_use():
    assert set(EFFECTS) == set(REPORTED)
    for code, effect in EFFECTS.items():
        assert effect.name == code
        assert REPORTED[code] <= set(effect.__dataclass_fields__)


@pytest.mark.parametrize("code", CODES)
def test_text_and_back_draws_and_reproducibility(code):
    drive = noisy(3)
    for seed in range(3):
        effect = draw(code, rng(seed), drive)
        assert parse(str(effect)) == effect == draw(code, rng(seed), drive)
        first, again = (hide(drive, [effect], rng(seed)) for _ in range(2))
        assert_equal(first, again, 0.0)
        assert np.isfinite(first.rates).all()


@pytest.mark.parametrize("text", NOTHING)
def test_zero_amplitude_is_the_identity(text):
    for drive in (CLEAN, noisy(1)):
        assert_equal(only(text, drive), drive)


@pytest.mark.parametrize("code", CODES)
def test_input_is_left_alone(code):
    drive, twin = noisy(2), noisy(2)
    hide(drive, [draw(code, rng(1), drive)], rng(1))
    assert_equal(drive, twin, 0.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("latency:delay=1", "must be one of time_offset, .*; got 'latency'"),
        ("time_offset:", "'time_offset' needs delay=VALUE"),
        ("time_offset:delay=soon", "'delay' of 'time_offset' must be a number, got 'soon'"),
        ("gnss_noise_scale:position_vertical=0", "'position_vertical' must be positive, got 0.0"),
        ("gnss_outliers:fraction=1", "'fraction' must be at least 0.0 and below 0.95, got 1.0"),
        ("bias_jump:time=1,sensor=baro", "'sensor' must be one of gyro, accel; got 'baro'"),
        ("lever_arm:x=nan", "'x' must be finite, got nan"),
    ],
)
def test_what_cannot_be_is_refused(text, says):
    with pytest.raises(ValueError, match=says):
        parse(text)


def test_a_delay_longer_than_the_record_is_refused():
    with pytest.raises(ValueError, match="'delay' must leave fixes"):
        TimeOffset(1e4).apply(CLEAN, rng())


# ---- the receiver


@pytest.mark.parametrize("delay", [0.05, -0.2])
def test_fixes_show_the_truth_of_the_delay_before(delay):
    late = only(f"time_offset:delay={delay}")
    llh, vel = perfect_fixes(MOTION, late.fix_t, delay=delay)
    np.testing.assert_allclose(ned_between(late.llh, llh), 0.0, atol=1e-6)
    np.testing.assert_allclose(late.vel_n, vel, atol=1e-9)
    np.testing.assert_array_equal(late.rates, CLEAN.rates)


@pytest.mark.parametrize("rate", [2e-3, -0.01])
def test_a_clock_that_drifts_delays_the_last_fixes_as_much_as_it_advances_the_first(rate):
    drifting = only(f"clock_drift:rate={rate}")
    middle = 0.5 * (CLEAN.fix_t[0] + CLEAN.fix_t[-1])
    true_t = middle + (drifting.fix_t - middle) / (1.0 + rate)
    llh, _ = perfect_fixes(MOTION, true_t)
    np.testing.assert_allclose(ned_between(drifting.llh, llh), 0.0, atol=1e-6)
    taken_out = correction(Compensation({Parameter("clock_drift", "rate"): rate}))
    left = corrected_stamps(CLEAN.fix_t + rate * (CLEAN.fix_t - middle), taken_out) - CLEAN.fix_t
    np.testing.assert_allclose(left, 0.0, atol=1.1 * rate**2 * middle)


@pytest.mark.parametrize("delay", [0.13, -0.3])
def test_velocities_lag_and_positions_do_not(delay):
    late = only(f"velocity_lag:delay={delay}")
    np.testing.assert_array_equal(late.llh, CLEAN.llh)
    _, vel = perfect_fixes(MOTION, late.fix_t, delay=delay)
    np.testing.assert_allclose(late.vel_n, vel, atol=2e-4)


def test_lever_arm_moves_position_and_velocity_of_the_antenna():
    moved = only("lever_arm:x=0.8,y=-0.4,z=-1.2")
    llh, vel = perfect_fixes(MOTION, moved.fix_t, lever_arm=(0.8, -0.4, -1.2))
    np.testing.assert_allclose(ned_between(moved.llh, llh), 0.0, atol=1e-4)
    np.testing.assert_allclose(moved.vel_n, vel, atol=1e-3)
    twice = hide(CLEAN, [parse("lever_arm:x=0.5,z=-1.2"), parse("lever_arm:x=0.3,y=-0.4")], rng())
    assert_equal(moved, twice, 1e-9)
    assert moved.lever_arm == pytest.approx(twice.lever_arm)


def test_lever_arm_and_both_delays_together_in_any_order():
    texts = ["time_offset:delay=0.1", "velocity_lag:delay=0.2", "lever_arm:x=1,y=0.5"]
    drives = [hide(CLEAN, [parse(t) for t in order], rng()) for order in (texts, texts[::-1])]
    assert_equal(*drives, 1e-12)
    llh, _ = perfect_fixes(MOTION, drives[0].fix_t, lever_arm=(1.0, 0.5, 0.0), delay=0.1)
    _, vel = perfect_fixes(MOTION, drives[0].fix_t, lever_arm=(1.0, 0.5, 0.0), delay=0.3)
    np.testing.assert_allclose(ned_between(drives[0].llh, llh), 0.0, atol=1e-4)
    np.testing.assert_allclose(drives[0].vel_n, vel, atol=1e-3)


def test_known_errors_are_scaled_exactly_and_reports_stay():
    drive = noisy(4)
    worse = only("gnss_noise_scale:position_horizontal=2,position_vertical=0.5,velocity_horizontal=3", drive)
    error = ned_between(worse.llh, CLEAN.llh)
    before = ned_between(drive.llh, CLEAN.llh)
    np.testing.assert_allclose(error, before * [2.0, 2.0, 0.5], atol=1e-4)
    np.testing.assert_allclose(
        worse.vel_n - CLEAN.vel_n, drive.fix_white[:, 3:] * [3.0, 3.0, 1.0], atol=1e-12
    )
    np.testing.assert_array_equal(worse.position_sd, drive.position_sd)


def test_unknown_errors_get_more_noise_or_larger_reports():
    """Variance r² − 1 of the reported one, relative sd √(2/n) of n = 2 · 199 values."""
    worse = only("gnss_noise_scale:position_horizontal=3,position_vertical=0.25")
    added = ned_between(worse.llh, CLEAN.llh)
    assert np.mean(added[:, :2] ** 2) / (8.0 * 4.0) == pytest.approx(1.0, abs=SIGMAS * np.sqrt(2 / 398))
    np.testing.assert_allclose(added[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(worse.position_sd, np.tile([2.0, 2.0, 8.0], (199, 1)))


def test_correlated_errors_have_their_sd_and_memory():
    """exp(−lag/T) autocovariance over 1000 · 3 stationary paths of uneven times: sd below sd² √(2/3000)."""
    effect, generator = parse("correlated_gnss:sd=0.5,time_constant=10"), rng(6)
    t = np.array([0.0, 1.0, 3.0, 8.0, 20.0])
    paths = np.stack([effect.signal(t, generator) for _ in range(1000)])
    for k, lag in enumerate(t):
        product = np.mean(paths[:, 0] * paths[:, k])
        assert product == pytest.approx(0.25 * np.exp(-lag / 10.0), abs=SIGMAS * 0.25 * np.sqrt(2 / 3000))
    assert np.abs(np.mean(paths[:, 0, 0] * paths[:, 0, 1])) < SIGMAS * 0.25 / np.sqrt(1000)


def test_outliers_come_in_runs_of_their_size():
    many = repeated(20)
    out = GnssOutliers(0.1, 8.0, 4).apply(many, rng(7))
    off = np.linalg.norm(ned_between(out.llh, many.llh), axis=1)
    hit = off > 0.0
    np.testing.assert_allclose(off[hit], 16.0, rtol=1e-6)
    runs = hit[: len(hit) // 4 * 4].reshape(-1, 4)
    assert (runs.all(axis=1) | ~runs.any(axis=1)).all()
    assert runs.mean() == pytest.approx(0.1, abs=SIGMAS * np.sqrt(0.09 / len(runs)))
    np.testing.assert_array_equal(out.vel_n, many.vel_n)


def test_wrong_velocities_have_their_share_and_length():
    many = repeated(20)
    out = only("gnss_velocity:fraction=0.3,rms=10", many, 8)
    squared = np.sum((out.vel_n - many.vel_n) ** 2, axis=1)
    hit = squared > 0.0
    assert hit.mean() == pytest.approx(0.3, abs=SIGMAS * np.sqrt(0.21 / len(hit)))
    assert squared[hit].mean() == pytest.approx(100.0, rel=SIGMAS * np.sqrt(2 / 3 / hit.sum()))
    np.testing.assert_array_equal(out.llh, many.llh)


def test_a_turned_frame_turns_velocities_only():
    out = only("gnss_frame:roll=0.01,pitch=-0.02,yaw=0.5")
    expected = CLEAN.vel_n @ rotation.mat_from_rpy((0.01, -0.02, 0.5)).T
    np.testing.assert_allclose(out.vel_n, expected, atol=1e-13)
    np.testing.assert_array_equal(out.llh, CLEAN.llh)
    eastward = only(f"gnss_frame:yaw={np.pi / 2}", replace(CLEAN, vel_n=np.tile([3.0, 0.0, 0.0], (199, 1))))
    np.testing.assert_allclose(eastward.vel_n[0], [0.0, 3.0, 0.0], atol=1e-12)


def test_a_velocity_scale_scales_velocities_only():
    out = only("velocity_scale:factor=0.02")
    np.testing.assert_allclose(out.vel_n, 1.02 * CLEAN.vel_n, rtol=1e-14)
    np.testing.assert_array_equal(out.llh, CLEAN.llh)


def test_a_vertical_velocity_adds_to_velocities_down_only():
    out = only("vertical_velocity:offset=0.2")
    np.testing.assert_allclose(
        out.vel_n - CLEAN.vel_n, np.tile([0.0, 0.0, 0.2], (len(CLEAN.vel_n), 1)), atol=1e-14
    )
    np.testing.assert_array_equal(out.llh, CLEAN.llh)


# ---- the unit


@pytest.mark.parametrize("seed", [None, 5])
def test_sensor_errors_act_on_the_truth_and_leave_the_noise(seed):
    drive = CLEAN if seed is None else noisy(seed)
    out = only("gyro_scale:x=1e-3,y=-2e-3,z=5e-3", drive)
    np.testing.assert_allclose(
        out.rates[:, :3] - drive.rates[:, :3], CLEAN.rates[:, :3] * [1e-3, -2e-3, 5e-3], atol=1e-15
    )
    out = only("accel_scale:z=0.01", drive)
    np.testing.assert_allclose(out.rates[:, 5] - drive.rates[:, 5], 0.01 * CLEAN.rates[:, 5], atol=1e-14)
    out = only("misalignment:roll=0.01,pitch=0.02,yaw=-0.03", drive)
    turned = CLEAN.rates[:, :3] @ rotation.mat_from_rpy((0.01, 0.02, -0.03)).T
    np.testing.assert_allclose(out.rates[:, :3] - drive.rates[:, :3], turned - CLEAN.rates[:, :3], atol=1e-15)
    np.testing.assert_array_equal(out.rates[:, 3:], drive.rates[:, 3:])
    out = only("g_sensitivity:xz=1e-4,yx=-2e-4", drive)
    expected = np.stack([1e-4 * CLEAN.rates[:, 5], -2e-4 * CLEAN.rates[:, 3], 0.0 * CLEAN.t], axis=-1)
    np.testing.assert_allclose(out.rates[:, :3] - drive.rates[:, :3], expected, atol=1e-15)


def test_a_turned_unit_feels_the_same_in_turned_axes():
    out = only("mounting:yaw=0.1")
    np.testing.assert_allclose(
        np.linalg.norm(out.rates.reshape(-1, 2, 3), axis=2),
        np.linalg.norm(CLEAN.rates.reshape(-1, 2, 3), axis=2),
        rtol=1e-12,
    )
    forward = replace(CLEAN, rates=np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], (len(CLEAN.t), 1)))
    np.testing.assert_allclose(
        only("mounting:yaw=0.1", forward).rates[0, 3:], [np.cos(0.1), np.sin(0.1), 0.0]
    )


def test_excess_gravity_pushes_upwards_along_the_vertical():
    out = only("gravity:offset=3e-3")
    down = MOTION.evaluate(CLEAN.t - 0.5 * INTERVAL).mat_nb[:, 2, :]
    np.testing.assert_allclose(out.rates[:, 3:] - CLEAN.rates[:, 3:], -3e-3 * down, atol=1e-6)
    np.testing.assert_array_equal(out.rates[:, :3], CLEAN.rates[:, :3])


def test_known_noise_is_scaled_exactly():
    drive = noisy(9)
    out = only("imu_noise_scale:gyro=2,accel=0.5", drive)
    np.testing.assert_allclose(
        out.rates - CLEAN.rates, drive.white * [2.0, 2.0, 2.0, 0.5, 0.5, 0.5], atol=1e-14
    )
    np.testing.assert_allclose(out.errors, out.white, atol=1e-18)


def test_unknown_noise_is_added_to_what_second_differences_show():
    """Variance ratio² of a standing unit's 1e4 samples; the median tells the sd to 2 %, six axes."""
    still = replace(
        noisy(10), rates=1e-3 * rng(11).standard_normal((len(CLEAN.t), 6)), errors=None, white=None
    )
    out = only("imu_noise_scale:gyro=3,accel=1", still)
    assert out.rates[:, :3].std() / still.rates[:, :3].std() == pytest.approx(3.0, rel=0.05)
    np.testing.assert_array_equal(out.rates[:, 3:], still.rates[:, 3:])
    with pytest.raises(ValueError, match="1 or more"):
        only("imu_noise_scale:gyro=0.5", still)


@pytest.mark.parametrize(("sensor", "first"), [("gyro", 0), ("accel", 3)])
def test_a_bias_jumps_once(sensor, first):
    out = only(f"bias_jump:time=80,x=1e-3,y=-2e-3,z=3e-3,sensor={sensor}")
    expected = np.zeros_like(CLEAN.rates)
    expected[CLEAN.t > 80.0, first : first + 3] = [1e-3, -2e-3, 3e-3]
    np.testing.assert_allclose(out.rates - CLEAN.rates, expected, atol=1e-13)
