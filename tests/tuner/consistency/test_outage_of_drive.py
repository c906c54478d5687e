"""An outage of a measured drive is scored where it ends: at the last fix that is withheld, not before."""

from dataclasses import replace

import numpy as np
import pytest

from tuner.consistency.score_drive import _outage, drive_filter
from tuner.navigation.drive.run import RECOVERY_TIME, prepare
from tuner.readers.drive import read_drive

HORIZON = 10.0
FAR = 1e-3
"""Wrong by this latitude, rad: 6.4 km, against an error of the filter of some metres after ten seconds."""


@pytest.fixture(scope="module")
def flown(file, configuration):
    drive = replace(read_drive(file), reference=None)
    settings, _ = drive_filter(drive, configuration())
    stretches, _ = prepare(drive, settings)
    return settings, stretches


def spoilt(stretch, settings, back):
    """Return the stretch whose fixes are far off, `back` fixes before the end of every window."""
    fixes = stretch.fixes
    llh = fixes.llh.copy()
    for begin in np.arange(stretch.settled, fixes.t[-1] - HORIZON, HORIZON + RECOVERY_TIME):
        inside = np.flatnonzero((fixes.t > begin) & (fixes.t <= begin + HORIZON))
        llh[inside[-1 - back], 0] += FAR
    return replace(stretch, fixes=replace(fixes, llh=llh))


@pytest.mark.parametrize(("back", "least", "most"), [(0, 6e3, 7e3), (1, 0.0, 100.0)])
def test_only_the_last_withheld_fix_counts(flown, back, least, most):
    settings, (stretch,) = flown
    found = _outage(None, (spoilt(stretch, settings, back),), settings, HORIZON)
    assert least <= found.rms <= most
