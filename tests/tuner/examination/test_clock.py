"""Delays of a drive by its motion alone: those that are there are found, others are not made up."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from models.trajectory.catalogue import TRAJECTORIES
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.consistency.score_drive import drive_filter, navigate_drive
from tuner.diagnosis.drive.causes.time_offset import RATE, with_clock
from tuner.examination.distant_clocks import distant_delay
from tuner.examination.examine import examine, streams_of
from tuner.examination.examined_drive import examined_drive
from tuner.examination.fit import fit
from tuner.examination.installation import _Problem
from tuner.examination.search import _inside
from tuner.examination.windows import averaged
from tuner.formats.clock_words import clock_note, late_words
from tuner.navigation.compensation import compensate
from tuner.navigation.drive.thinning import irregular_rows
from tuner.readers.drive import read_drive
from tuner.report.json.examination import examination_json
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config
from tuner.types import Compensation
from tuner.types.clock import Clock, Delay

DELAY, LAG = 0.4, 0.1


def _drive(trajectory="city", *, grade="bmi088", receiver="rtk", seed=1, interval=0.5):
    gnss = replace(load_gnss(receiver), interval=interval)
    return simulate_drive(load_grade(grade), TRAJECTORIES[trajectory](240.0), gnss, rate=50.0, seed=seed)[0]


def _late(drive, delay, lag=0.0):
    """Return a drive with positions and velocities late; velocities interpolated between exact fixes."""
    gnss = drive.gnss
    vel = np.stack([np.interp(gnss.t - lag, gnss.t, v) for v in gnss.vel_n.T], axis=-1)
    return replace(drive, gnss=replace(gnss, t=gnss.t + delay, vel_n=vel))


@pytest.fixture(scope="module")
def drive():
    return _drive()


@pytest.fixture(scope="module")
def turning(file):
    return read_drive(file)


def _near(found, true, least):
    return abs(found.value - true) < 5.0 * found.sd < least


def test_delay_and_lag_are_found_and_taken_out_whatever_the_configuration(drive):
    """By the filter the delay was +2.3, +1.0, −0.8 and +0.2 s on one measured drive."""
    late, _ = examined_drive(_late(drive, DELAY, LAG))
    assert _near(late.clock.delay, DELAY, 0.05)
    assert late.clock.lag.value == pytest.approx(LAG, abs=0.03)
    low, high = late.clock.delay.interval
    assert low < late.clock.delay.value < high
    found = navigate_drive(late, load_config("mpu9250"))
    assert found.stretches[0].alignment.delay == late.clock.delay.value
    assert found.stretches[0].lag == late.clock.lag.value
    assert "time_offset" in found.estimates
    assert "time_offset" not in navigate_drive(drive, load_config("mpu9250")).estimates
    stated = Compensation.parse({"time_offset.delay": DELAY, "velocity_lag.delay": LAG})
    settings = replace(load_config("mpu9250"), compensation=stated)
    found = navigate_drive(late, settings)
    assert found.stretches[0].alignment.delay == 0.0
    assert abs(found.estimates["time_offset"][0][0]) < 2.0 * late.clock.delay.sd  # the rest stays open
    words = (
        "a delay of +0.400 s of the fixes and +0.100 s of velocities behind positions, stated in the settings"
    )
    assert any(note.startswith(words) for note in found.notes)


def test_what_the_settings_take_out_is_not_found_again(drive):
    """A lag of velocities was taken out twice: on a measured drive two thirds of the fixes were refused."""
    known = replace(drive, clock=Clock(Delay(0.4, 0.01), Delay(0.25, 0.01)))
    left = compensate(known, Compensation.parse({"time_offset.delay": 0.4, "velocity_lag.delay": 0.05})).clock
    assert left.delay.taken_out == 0.0
    assert left.lag.taken_out == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("shown", "taken_out", "left"),
    [
        (Delay(0.127, 0.035), 0.0, math.hypot(0.127, 0.035)),
        (Delay(0.4, 0.01), 0.0, 0.01),
        (Delay(0.4, 0.01), 0.4, 0.01),
        (Delay(), 0.0, None),
    ],
)
def test_what_is_not_taken_out_of_a_delay_is_a_state(drive, shown, taken_out, left):
    """Seen: 0.127 ± 0.035 s of a true 0.207 s taken for zero: errors 31 × predicted."""
    config = replace(load_config("bmi088"), compensation=Compensation.parse({"time_offset.delay": taken_out}))
    known = compensate(replace(drive, clock=Clock(shown)), config.compensation)
    layout = drive_filter(known, config)[0].model.layout
    assert ("time_offset" in layout) == (left is not None)
    assert left is None or known.clock.delay.left == pytest.approx(left)


def test_what_remains_beside_a_delay_of_the_settings_is_said_as_what_remains():
    """Beside "a delay of +0.086 s, stated in the settings, is taken out" stood "no delay of the fixes is taken out"."""
    clock = Clock(Delay(0.086, 0.008))
    assert clock_note(clock).startswith("fixes are stamped 0.086 ± 0.016 s late")
    said = "delay of the fixes is taken out, as chance may make it: -0.016 … +0.016 s late"
    assert clock_note(clock.beside(0.086, 0.0)) == f"no further {said}"
    assert clock_note(Clock(Delay(0.0, 0.008))) == f"no {said}"


def test_a_clock_that_drifts_is_told_of_the_first_and_the_last_fix(drive):
    """Seen: 0.185 ± 0.015 s early, which is 0.126 s in the first third of a drive and 0.261 s in the last."""
    t, rate = drive.gnss.t, 5e-4
    true = {k: DELAY + rate * (t[k] - 0.5 * (t[0] + t[-1])) for k in (0, -1)}
    drifting = replace(drive, gnss=replace(drive.gnss, t=t + DELAY + rate * (t - 0.5 * (t[0] + t[-1]))))
    found = examine(drifting)
    first, last = found.clock.delays.values()
    assert abs(first.value - true[0]) < 5.0 * first.sd < 0.05
    assert abs(last.value - true[-1]) < 5.0 * last.sd < 0.05
    (said,) = [one.fault for one in found.repairs if one.stream == "receiver"]
    assert late_words(found.clock) in said
    assert re.findall(r"0\.\d+ ± \S+ s late at (\d+) s", clock_note(found.clock)) == ["1", "240"]
    assert set(examination_json(found)["delays"]) == {"receiver at 1 s", "receiver at 240 s", "velocities"}
    again = examine(found.mended).clock
    assert again.delay.taken_out == again.drift.taken_out == 0.0
    settings = with_clock(load_config("mpu9250"), found.clock)
    assert settings.compensation[RATE] == found.clock.drift.value
    assert compensate(drifting, settings.compensation).gnss.t == pytest.approx(t, abs=0.05)
    stretch = navigate_drive(replace(drifting, clock=found.clock), load_config("mpu9250")).stretches[0]
    assert np.ptp(stretch.fixes.t - t[-len(stretch.fixes.t) :]) < 0.01


@pytest.mark.parametrize("trajectory", ["city", "climb", "static"])
def test_clocks_that_agree_are_left_alone(trajectory):
    """A search for the least misfit of a filter took out more than 50 ms in 32 of 63 such drives."""
    clock = examine(_drive(trajectory, receiver="spp", grade="mpu9250", seed=3, interval=1.0)).clock
    assert clock.delay.taken_out == clock.lag.taken_out == clock.drift.taken_out == 0.0


def test_a_few_wrong_fixes_change_nothing(drive):
    gnss, rng = drive.gnss, np.random.default_rng(4)
    wrong = rng.random(len(gnss)) < 0.1
    vel = gnss.vel_n + np.where(wrong[:, None], rng.normal(0.0, 10.0, gnss.vel_n.shape), 0.0)
    clock = examine(replace(drive, gnss=replace(gnss, vel_n=vel))).clock
    assert clock.delay.taken_out == clock.lag.taken_out == 0.0


def test_positions_alone_show_the_delay(drive):
    nothing = np.full_like(drive.gnss.vel_n, np.nan)
    gnss = replace(drive.gnss, t=drive.gnss.t + DELAY, vel_n=nothing, velocity_sd=nothing)
    clock = examine(replace(drive, gnss=gnss)).clock
    assert _near(clock.delay, DELAY, 0.1)
    assert clock.lag.taken_out == 0.0


@pytest.mark.parametrize("seconds", [2.5, -18.0])
def test_leap_seconds_are_a_delay_with_its_interval(turning, seconds):
    """18 s were refused, and at 2.5 s readings of other windows made the fit a number that is none."""
    clock, small = (examine(_late(turning, one)).clock for one in (seconds, 0.0))
    moved = clock.delay.value - small.delay.value
    assert abs(moved - seconds) < 4.0 * clock.delay.sd < 0.1
    assert clock.lag.taken_out == small.lag.taken_out == 0.0


@pytest.mark.parametrize("seconds", [0.0, -2.5, 2.5, 18.0, -45.0])
def test_offsets_that_windows_show_are_left_to_them(turning, seconds):
    far = distant_delay(streams_of(_late(turning, seconds)))
    assert far == pytest.approx(seconds if abs(seconds) > 3.0 else 0.0, abs=0.5)


def test_periodic_turns_do_not_tell_an_offset(turning):
    """A circuit of 30 s agrees as well a circuit later: nothing within is beaten."""
    t = turning.imu_t
    rate = 0.3 * np.sin(2.0 * np.pi * t / 30.0)
    rates = np.column_stack([0 * t, 0 * t, rate, 0 * t, 0 * t, 0 * t - 9.8])
    course = -0.3 * 30.0 / (2.0 * np.pi) * np.cos(2.0 * np.pi * turning.gnss.t / 30.0)
    vel = 10.0 * np.column_stack([np.cos(course), np.sin(course), 0.0 * course])
    circuit = replace(turning, mounting=None, rates=rates, gnss=replace(turning.gnss, vel_n=vel))
    assert distant_delay(streams_of(circuit)) == distant_delay(streams_of(_late(circuit, 1.0))) == 0.0


def test_fixes_of_another_journey_and_without_velocities_tell_no_offset(turning):
    noise = np.random.default_rng(1).standard_normal((len(turning.gnss), 3))
    for vel in (5.0 * noise, np.nan * noise):
        assert distant_delay(streams_of(replace(turning, gnss=replace(turning.gnss, vel_n=vel)))) == 0.0


def test_thinned_fixes_keep_the_shares_of_alternating_solutions():
    rows = irregular_rows(7000, 1500)
    assert len(rows) == 1500
    assert all(np.all(np.diff(irregular_rows(count, 1500)) > 0) for count in (1501, 2197, 3001))
    for period in (2, 3, 5, 7):
        shares = np.bincount(rows % period, minlength=period) / len(rows)
        assert np.abs(shares - 1.0 / period).max() < 0.05


def test_the_search_for_constants_begins_beside_a_delay_that_is_likelier(drive):
    """A bicycle at a steady speed, 0.49 s late: 0.19 ± 0.03 s beside an antenna that was put 2.4 m too far back."""
    for late, common in ((0.49, [0.0, 0.5]), (0.0, [0.0])):
        streams = streams_of(_late(drive, late))
        streams = _inside(replace(streams, imu=averaged(streams.imu)))
        starts = _Problem.of(streams).starts(fit(streams))
        assert [at.value[0] for at in starts] == common
        assert all(at.fit.total >= starts[0].fit.total for at in starts)
