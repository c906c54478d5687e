"""Clocks of a drive by its motion alone: delays that are there are found, others are not made up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile, Wave
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.consistency.score_drive import navigate_drive
from tuner.diagnosis.drive.hypothesis import placed_in_sensor_axes
from tuner.navigation.compensation import compensate
from tuner.navigation.data import Steps
from tuner.navigation.drive.clock import chosen_clock, clock_of_drive, remaining_clock
from tuner.navigation.drive.clock_offset import MAX_CLOCK_OFFSET, ClockOffset, estimate_clock_offset
from tuner.navigation.drive.integrated_increments import integrate_increments
from tuner.navigation.drive.thinning import irregular_rows
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config
from tuner.types import Compensation

DELAY, LAG = 0.4, 0.1


def _drive(trajectory="city", duration=240.0, *, grade="bmi088", receiver="rtk", seed=1, interval=0.5):
    gnss = replace(load_gnss(receiver), interval=interval)
    return simulate_drive(load_grade(grade), TRAJECTORIES[trajectory](duration), gnss, rate=50.0, seed=seed)[
        0
    ]


def _late(drive, delay, lag):
    """Return a drive with positions and velocities late; velocities interpolated between exact fixes."""
    gnss = drive.gnss
    vel = np.stack([np.interp(gnss.t - lag, gnss.t, v) for v in gnss.vel_n.T], axis=-1)
    return replace(drive, gnss=replace(gnss, t=gnss.t + delay, vel_n=vel))


@pytest.fixture(scope="module")
def drive():
    return _drive()


def test_delay_and_lag_are_found_within_five_sds(drive):
    clock = clock_of_drive(_late(drive, DELAY, LAG))
    assert clock.delay_sd < 0.02
    assert abs(clock.delay - DELAY) < 5.0 * clock.delay_sd
    assert clock.lag == pytest.approx(LAG, abs=0.03)
    assert clock.delay_interval[0] < clock.delay < clock.delay_interval[1]


def test_what_the_settings_take_out_is_not_found_again(drive):
    """A lag of velocities was taken out twice: on a measured drive two thirds of the fixes were refused."""
    stated = Compensation.parse({"time_offset.delay": DELAY, "velocity_lag.delay": LAG})
    clock = remaining_clock(compensate(_late(drive, DELAY, LAG), stated), stated)
    assert clock.delay == clock.lag == 0.0
    assert clock.note.startswith(
        "a delay of +0.400 s of the fixes and +0.100 s of velocities behind positions"
    )
    assert "of what remains: no offset of the clocks is taken out" in clock.note
    sharp = _drive("city", interval=1.0, seed=9)
    late = _late(sharp, 0.0, 0.25)
    stated = Compensation.parse({"velocity_lag.delay": 0.25})
    assert abs(remaining_clock(compensate(late, stated), stated).lag) < 0.05
    more = remaining_clock(compensate(late, stated), Compensation.parse({"velocity_lag.delay": 0.05}))
    assert more.lag == pytest.approx(0.2, abs=0.05)


@pytest.mark.parametrize("trajectory", ["city", "climb"])
def test_clocks_that_agree_are_left_alone(trajectory):
    """A search for the least misfit of a filter took out more than 50 ms in 32 of 63 such drives."""
    clock = clock_of_drive(_drive(trajectory, receiver="spp", grade="mpu9250", seed=3, interval=1.0))
    assert clock.delay == clock.lag == clock.delay_sd == 0.0
    assert "no offset of the clocks is taken out" in clock.note


WALKER = Trajectory(
    "walker",
    240.0,
    Profile(1.4, waves=(Wave(0.3, 1.0 / 40.0), Wave(0.15, 0.9))),
    Profile(waves=(Wave(2.0, 1.0 / 70.0), Wave(0.05, 0.9))),
    pitch=Profile(waves=(Wave(0.03, 1.8),)),
    roll=Profile(waves=(Wave(0.04, 0.9),)),
)


@pytest.mark.parametrize(("interval", "delay"), [(1.0, 0.0), (0.2, 0.2)])
def test_an_antenna_that_swings_with_the_steps_of_a_walker_makes_no_offset(interval, delay):
    """With 1.2 m of lever arm clocks that agree were 0.18, 0.19 and -0.28 s apart in three of seven such drives."""
    gnss = replace(load_gnss("rtk"), interval=interval)
    arm = (0.6, 0.1, -1.0)
    drive, _ = simulate_drive(
        load_grade("bmi088"), WALKER, gnss, rate=100.0, seed=5, lever_arm=arm, effects=()
    )
    clock = clock_of_drive(_late(drive, delay, 0.0))
    assert clock.delay == pytest.approx(delay, abs=max(5.0 * clock.delay_sd, 1e-12))
    assert clock.delay_sd < 0.02
    assert clock.lag == 0.0


def test_the_diagnosis_knows_the_lever_arm_that_swings_with_a_walker():
    """The stated lever arm was dropped in the axes of the sensor: 0.15 s were not found, 0.4 s made up elsewhere."""
    gnss = replace(load_gnss("dgnss"), interval=0.2)
    bobbing = Profile(waves=tuple(Wave(0.05, f) for f in (1.67, 1.81, 1.93)))
    walker = replace(WALKER, duration=80.0, pitch=bobbing)
    drive, _ = simulate_drive(
        load_grade("mpu9250"), walker, gnss, rate=100.0, seed=1, lever_arm=(0.6, 0.1, -1.0), effects=()
    )
    clock = clock_of_drive(placed_in_sensor_axes(_late(drive, 0.15, 0.0)))
    assert clock.delay == pytest.approx(0.15, abs=0.01)


def test_an_offset_beyond_the_search_is_a_bound(drive):
    """Of positions alone: velocities would show where the clocks are."""
    unknown = np.full_like(drive.gnss.vel_n, np.nan)
    late = replace(drive, gnss=replace(drive.gnss, t=drive.gnss.t + MAX_CLOCK_OFFSET + 1.0, vel_n=unknown))
    clock = clock_of_drive(late)
    assert clock.delay == 0.0
    assert "or more" in clock.note


def test_the_filter_takes_the_offset_out_whatever_its_configuration(drive):
    """It was +2.3, +1.0, −0.8 and +0.2 s on one measured drive."""
    late = _late(drive, 0.3, 0.0)
    found = navigate_drive(late, load_config("mpu9250"))
    assert found.stretches[0].alignment.delay == clock_of_drive(late).delay
    assert "time_offset" in found.estimates
    assert "time_offset" not in navigate_drive(drive, load_config("mpu9250")).estimates


def test_a_few_wrong_fixes_change_nothing(drive):
    gnss, rng = drive.gnss, np.random.default_rng(4)
    wrong = rng.random(len(gnss)) < 0.1
    vel = gnss.vel_n + np.where(wrong[:, None], rng.normal(0.0, 10.0, gnss.vel_n.shape), 0.0)
    clock = clock_of_drive(replace(drive, gnss=replace(gnss, vel_n=vel)))
    assert clock.delay == clock.lag == 0.0


def test_positions_alone_show_the_delay(drive):
    nothing = np.full_like(drive.gnss.vel_n, np.nan)
    gnss = replace(drive.gnss, t=drive.gnss.t + DELAY, vel_n=nothing, velocity_sd=nothing)
    clock = clock_of_drive(replace(drive, gnss=gnss))
    assert abs(clock.delay - DELAY) < 5.0 * clock.delay_sd < 0.1
    assert clock.lag == 0.0


def test_the_simplest_clock_that_is_not_refuted_is_chosen():
    def clock(delays, sds):
        return chosen_clock(ClockOffset(np.array(delays), np.diag(np.square(sds)), 20.0, 1e-9, False))

    one = clock([0.1, 0.11], [0.01, 0.01])
    assert one.delay == pytest.approx(0.105)
    assert one.lag == 0.0
    velocities = clock([0.001, 0.2], [0.01, 0.01])
    assert velocities.delay == 0.0
    assert velocities.lag == pytest.approx(0.2)
    both = clock([-0.2, 0.2], [0.01, 0.01])
    assert (both.delay, both.lag) == pytest.approx((-0.2, 0.4))


def test_without_motion_there_is_no_clock():
    clock = clock_of_drive(_drive("static"))
    assert clock.delay == clock.lag == 0.0


def test_derivatives_are_those_of_the_integrals():
    """Central differences of biases and scale factors put into the increments; a relation of first order."""
    rng = np.random.default_rng(0)
    dt = np.full(200, 0.05)
    steps = Steps(0.0, dt, rng.normal(0.0, 1.0, (200, 6)) * [0.02, 0.02, 0.05, 0.1, 0.1, 0.5])
    exact = integrate_increments(steps, np.zeros(3))
    size = 1e-5
    for i in range(4):
        for axis in range(3):
            column = axis if i in (0, 2) else 3 + axis
            ends = []
            for sign in (1.0, -1.0):
                changed = steps.increments.copy()
                changed[:, column] -= sign * size * (dt if i < 2 else changed[:, column])
                ends.append(integrate_increments(replace(steps, increments=changed), np.zeros(3)))
            for name in ("velocity", "position"):
                by = getattr(exact, f"by_{name}").reshape(-1, 4, 3, 3)[-1, i, :, axis]
                difference = (getattr(ends[0], name)[-1] - getattr(ends[1], name)[-1]) / (2.0 * size)
                np.testing.assert_allclose(by, difference, rtol=0.02, atol=0.02 * np.abs(difference).max())


def test_thinned_fixes_keep_the_shares_of_alternating_solutions():
    rows = irregular_rows(7000, 1500)
    assert len(rows) == 1500
    assert all(np.all(np.diff(irregular_rows(count, 1500)) > 0) for count in (1501, 2197, 3001))
    for period in (2, 3, 5, 7):
        shares = np.bincount(rows % period, minlength=period) / len(rows)
        assert np.abs(shares - 1.0 / period).max() < 0.05


def test_too_few_fixes_show_nothing(drive):
    steps = Steps(0.0, np.diff(drive.imu_t), drive.rates[1:] * np.diff(drive.imu_t)[:, None])
    assert estimate_clock_offset(steps, drive.gnss.rows(slice(0, 10)), None) is None
