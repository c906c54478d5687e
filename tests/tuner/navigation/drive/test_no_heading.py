"""A drive without a heading is refused with what was measured: the sd of the heading, and the speeds of the fixes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from models.trajectory.motion import Trajectory
from models.trajectory.profiles import Profile
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.navigation.data import Steps
from tuner.navigation.drive import alignment
from tuner.simulation.drive import simulate_drive
from tuner.types.records import DataError, Gnss


def test_the_refusal_quotes_speeds_and_heading(monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds of 0 … 15 m/s were called hardly any change."""
    t = np.arange(0.0, 60.0)
    north = np.linspace(0.0, 15.0, len(t))
    vel = np.column_stack([north, 0.0 * t, 0.0 * t])
    gnss = Gnss(t, np.zeros((len(t), 3)), vel, np.full((len(t), 3), np.nan), np.full((len(t), 3), np.nan))
    steps = Steps(0.0, np.full(600, 0.1), np.zeros((600, 6)))
    for sd, words in (
        (np.radians(75.0), r"heading to 75°, .*speed of the fixes is 0.375 to 14.6 m/s"),
        (np.radians(5e7), "no part of the drive determines the heading"),  # more than a turn is no knowledge
        (
            None,
            "10 s of inertial samples without a gap that hold 4 fixes or more, found none: fixes come every 1 s",
        ),
    ):
        found = None if sd is None else SimpleNamespace(covariance=np.eye(9) * sd**2)
        monkeypatch.setattr(alignment, "_likeliest", lambda *_, found=found: (found, False))
        with pytest.raises(DataError, match=words):
            alignment.align(steps, gnss, bias_sd=np.ones(6))


@pytest.mark.parametrize("speed", [0.0, 15.0])
@pytest.mark.parametrize("seed", [1, 3])
def test_a_vehicle_that_stands_or_moves_evenly_has_no_heading(speed: float, seed: int) -> None:
    """Noise alone gave one to 5 deg, up to 170 deg off."""
    motion = Trajectory("even", 200.0, Profile(speed), Profile(0.7))
    drive, _ = simulate_drive(load_grade("stim300"), motion, load_gnss("rtk"), rate=50.0, seed=seed)
    increments = drive.rates[1:] * np.diff(drive.imu_t)[:, None]
    steps = Steps(float(drive.imu_t[0]), np.diff(drive.imu_t), increments)
    with pytest.raises(DataError, match="the heading cannot be found from the motion"):
        alignment.align(steps, drive.gnss, bias_sd=np.repeat([1e-3, 0.02], 3))
