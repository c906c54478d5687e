"""Fixes that contradict their neighbours are left out before a filter sees them."""

from __future__ import annotations

import numpy as np

from models.measurements import perfect_fixes
from models.trajectory.catalogue import TRAJECTORIES
from tuner.navigation.drive.gross_outliers import without_gross_outliers
from tuner.types.records import Gnss


def test_fixes_that_contradict_their_neighbours_are_left_out():
    rng = np.random.default_rng(8)
    motion = TRAJECTORIES["city"](200.0)
    t = np.arange(1.0, 199.0, 0.2)
    llh, vel = perfect_fixes(motion, t)
    llh = llh + rng.standard_normal(llh.shape) * np.array([2.0, 2.0, 4.0]) / [6.37e6, 4.2e6, 1.0]
    vel = vel + 0.1 * rng.standard_normal(vel.shape)
    sd = np.ones_like(llh)
    clean = Gnss(t, llh, vel, sd, sd)
    assert without_gross_outliers(clean)[1:] == (0, 0)
    bad, lost = llh.copy(), vel.copy()
    bad[50:900:23, 0] += 40.0 / 6.37e6
    lost[60:900:31] += [10.0, -5.0, 0.0]
    kept, positions, velocities = without_gross_outliers(Gnss(t, bad, lost, sd, sd))
    assert positions == len(range(50, 900, 23))
    assert 24 <= velocities <= len(range(60, 900, 31))  # in hard turns neighbours scatter, too
    assert not set(t[50:900:23].tolist()) & set(kept.t.tolist())
    sparse = Gnss(t[::10], bad[::10], vel[::10], sd[::10], sd[::10])
    assert without_gross_outliers(sparse)[1:] == (0, 0)  # too few neighbours to judge: the gate's business
    for i in (0, 1, 40, len(sparse) - 1):
        far = sparse.llh.copy()
        far[i, 0] += np.radians(1.0)
        for velocities in (sparse.vel_n, np.full_like(far, np.nan)):
            kept, positions, _ = without_gross_outliers(
                Gnss(sparse.t, far, velocities, sparse.position_sd, sparse.velocity_sd)
            )
            assert positions == 1
            assert sparse.t[i] not in kept.t
