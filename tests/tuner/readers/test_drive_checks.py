"""Impossible drives are refused in one line with the place; unusual ones get a note."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tuner.readers.drive_checks import expect_streams, possible_drive
from tuner.types.records import DataError, Drive, Gnss

RATE, INTERVAL, COUNT, SPEED = 50.0, 1.0, 200, 10.0


def streams() -> tuple[np.ndarray, np.ndarray]:
    """Return inertial samples and fixes of a car that goes north at a steady speed."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, COUNT * INTERVAL, 1.0 / RATE)
    imu = np.column_stack(
        [t, 1e-3 * rng.standard_normal((len(t), 3)), np.tile([0.0, 0.0, -9.8], (len(t), 1))]
    )
    imu[:, 4:] += 1e-2 * rng.standard_normal((len(t), 3))
    fix_t = np.arange(COUNT) * INTERVAL
    fixes = np.ones((COUNT, 13))
    fixes[:, 0], fixes[:, 1], fixes[:, 2], fixes[:, 3] = fix_t, 48.0 + fix_t * SPEED / 111e3, 11.0, 500.0
    fixes[:, 4:7] = SPEED, 0.0, 0.0
    return imu, fixes


def checked(imu: np.ndarray, fixes: np.ndarray) -> Drive:
    """Return the drive of these rows, as what reads it and what begins a filter check it."""
    expect_streams(Path("d.npz"), imu, fixes)
    llh = np.column_stack([np.radians(fixes[:, 1:3]), fixes[:, 3]])
    gnss = Gnss(fixes[:, 0], llh, fixes[:, 4:7], fixes[:, 7:10], fixes[:, 10:13])
    return possible_drive(Drive("d", imu[:, 0], imu[:, 1:], gnss, source="d.npz"))


def test_a_correct_drive_is_read_without_a_note():
    assert checked(*streams()).notes == ()


def _force_lost(imu, fixes):
    imu[1000:1500, 4:7] = 0.0


def _force_off(imu, fixes):
    imu[:, 4:7] = 0.0


def _gyros_off(imu, fixes):
    imu[:, 1:4] = 0.0


def _mad_velocities(imu, fixes):
    fixes[::20, 4] = 1000.0


def _sds_endless(imu, fixes):
    fixes[20:30, 8] = np.inf


def _leaps(imu, fixes):
    fixes[::20, 1] += 0.1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_force_lost, "got 0 on all axes in 500 of 10000 samples, first at 20 s"),
        (_force_off, "specific forces that change, got the same on all axes in all 10000 samples"),
        (_gyros_off, "angular rates that change"),
        (_mad_velocities, "velocities of up to 1000 m/s in 10 of 200 fixes, first at 0 s"),
        (_leaps, "positions that ask for up to"),
        (_sds_endless, "standard deviations that are finite, got inf in 10 of 200 fixes, first at 20 s"),
    ],
)
def test_the_impossible_is_refused_with_its_place(change, words):
    imu, fixes = streams()
    change(imu, fixes)
    with pytest.raises(DataError) as refused:
        checked(imu, fixes)
    told = str(refused.value)
    assert told.startswith("d.npz: expected")
    assert words in told
    assert "\n" not in told


@pytest.mark.parametrize(
    ("columns", "value", "words"),
    [
        (4, 1000.0, "velocities of up to 1000 m/s in 1 of 200 fixes, first at 50 s"),
        (1, 49.0, "positions that ask for up to"),
        (8, 0.0, "1 fixes report a standard deviation of 0 for their position"),
        (12, 0.0, "1 fixes report a standard deviation of 0 for their velocity"),
    ],
)
def test_what_is_odd_once_is_said(columns, value, words):
    imu, fixes = streams()
    fixes[50, columns] = value
    drive = checked(imu, fixes)
    (note,) = drive.notes
    assert words in note
    assert len(drive.gnss) == COUNT - (columns == 1)  # a fix that no vehicle reaches is none
    assert np.isnan(drive.gnss.vel_n).any() == (columns == 4)


def test_lost_samples_are_said():
    imu, fixes = streams()
    imu[10, 4:7] = 0.0
    assert checked(imu, fixes).notes == ("1 inertial samples have no specific force at all, first at 0.2 s",)
