"""What a reference says of fixes and heading that no innovation shows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models.earth import llh_displaced
from tuner.diagnosis.drive.against_reference import against_reference, errors_of_fixes, staying_time
from tuner.readers.drive import read_drive

NO_RUN = SimpleNamespace(solutions=(), stretches=(), settings=None)
SD, VELOCITY_SD = 0.4, 0.05
"""Of the simulated fixes north and east, m and m/s."""


@pytest.fixture(scope="module")
def drive(file):
    """Return a drive whose antenna is at its unit: the lever arm is no error of the fixes."""
    return read_drive(file)


def moved(drive, offset):
    return replace(drive, gnss=replace(drive.gnss, llh=llh_displaced(drive.gnss.llh, offset)))


def test_delay_and_sizes_of_the_errors_of_fixes(drive):
    later = replace(drive, reference=replace(drive.reference, t=drive.reference.t - 0.3))
    by = errors_of_fixes(later, later.reference).delay - errors_of_fixes(drive, drive.reference).delay
    assert by == pytest.approx(0.3, abs=0.02)
    (note,), _ = against_reference(drive, NO_RUN, None)
    assert "reported 0.4" in note
    assert "reported 0.05" in note


def test_a_constant_offset_of_the_datum_is_told_with_its_interval(drive):
    aside = moved(drive, np.tile([0.0, 0.0, -3.0], (len(drive.gnss), 1)))
    _, (told,) = against_reference(aside, NO_RUN, None)
    assert "another datum or height system" in told.statistic
    assert "m down" in told.statistic
    assert told.p_value < 1e-4


def test_errors_of_the_size_that_a_receiver_states_are_no_offset(drive):
    down = np.tile([0.0, 0.0, 2.0], (len(drive.gnss), 1))
    assert against_reference(moved(drive, down), NO_RUN, None)[1] == ()


def test_errors_that_stay_have_their_time():
    """The autocorrelation of a Gauss–Markov process falls to 1/e in its time constant; white noise has none."""
    rng, t = np.random.default_rng(1), np.arange(20_000.0)
    decay = np.exp(-1.0 / 30.0)
    x = np.zeros((len(t), 3))
    for k in range(1, len(t)):
        x[k] = decay * x[k - 1] + np.sqrt(1.0 - decay**2) * rng.standard_normal(3)
    assert staying_time(t, x) == pytest.approx(30.0, rel=0.3)
    assert staying_time(t, rng.standard_normal((len(t), 3))) == 1.0


def test_without_a_reference_nothing_is_said(drive):
    assert against_reference(replace(drive, reference=None), NO_RUN, None) == ((), ())
