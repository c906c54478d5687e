"""Clocks that are further apart than an offset is searched are refused, others are not."""

from dataclasses import replace

import numpy as np
import pytest

from tuner.navigation.drive.clock import clock_of_drive
from tuner.navigation.drive.clock_mismatch import refuse_distant_clocks
from tuner.readers.drive import read_drive
from tuner.types.records import DataError


@pytest.fixture(scope="module")
def drive(file):
    return read_drive(file)


def shifted(drive, seconds):
    return replace(drive, gnss=replace(drive.gnss, t=drive.gnss.t + seconds))


@pytest.mark.parametrize("seconds", [18.0, -18.0, -45.0])
def test_leap_seconds_are_refused_with_the_offset(drive, seconds):
    with pytest.raises(DataError, match=r"put both on one clock") as refused:
        clock_of_drive(shifted(drive, seconds))
    found = float(str(refused.value).split("fixes are ")[1].split(" s")[0])
    assert found == pytest.approx(seconds, abs=0.5)


@pytest.mark.parametrize("seconds", [0.0, -2.5, 2.5])
def test_offsets_within_the_search_are_left_to_it(drive, seconds):
    refuse_distant_clocks(shifted(drive, seconds))


def test_periodic_turns_do_not_tell_an_offset(drive):
    """A circuit of 30 s agrees as well a circuit later: nothing within is beaten."""
    t = drive.imu_t
    rate = 0.3 * np.sin(2.0 * np.pi * t / 30.0)
    rates = np.column_stack([0 * t, 0 * t, rate, 0 * t, 0 * t, 0 * t - 9.8])
    course = -0.3 * 30.0 / (2.0 * np.pi) * np.cos(2.0 * np.pi * drive.gnss.t / 30.0)
    vel = 10.0 * np.column_stack([np.cos(course), np.sin(course), 0.0 * course])
    circuit = replace(drive, mounting=None, rates=rates, gnss=replace(drive.gnss, vel_n=vel))
    refuse_distant_clocks(circuit)
    refuse_distant_clocks(shifted(circuit, 1.0))


def test_fixes_of_another_journey_and_without_velocities_are_not_judged(drive):
    noise = np.random.default_rng(1).standard_normal((len(drive.gnss), 3))
    refuse_distant_clocks(replace(drive, gnss=replace(drive.gnss, vel_n=5.0 * noise)))
    refuse_distant_clocks(replace(drive, gnss=replace(drive.gnss, vel_n=np.nan * noise)))
