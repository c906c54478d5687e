"""The same motion anywhere on the Earth: across the date line, near the poles, high above."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.trajectory.catalogue import city, climb
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.consistency.drive_scores import differences
from tuner.consistency.score_drive import navigate_drive
from tuner.examination.examine import examine
from tuner.examination.examined_drive import examined_drive
from tuner.formats.logs import write_drive
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment import align
from tuner.readers.drive import read_drive
from tuner.report.solution_files import local_track, solution_csv, tracks
from tuner.simulation.drive import simulate_drive
from tuner.synthesis.load_config import load_config

RATE = 25.0
STIM300 = np.repeat([1e-3, 0.02], 3)
PLACES = {
    "date line": (10.0, 179.9995, 100.0),
    "80° S": (-80.0, -179.999, 100.0),
    "89° N": (89.0, 179.99, 12e3),
}


def _drive(place, motion, receiver="rtk"):
    lat, lon, height = PLACES[place]
    motion = replace(motion, start=(np.radians(lat), np.radians(lon), height))
    gnss = replace(load_gnss(receiver), interval=0.5, correlated=())
    return simulate_drive(load_grade("stim300"), motion, gnss, rate=RATE, seed=5)[0]


@pytest.fixture(scope="module", params=PLACES)
def drive(request, tmp_path_factory):
    """A drive whose file has longitudes within ±180°, as receivers write them."""
    path = tmp_path_factory.mktemp("earth") / "drive.npz"
    write_drive(_drive(request.param, city(240.0)), path)
    assert np.abs(np.load(path)["gnss_llh"][:, 1]).max() <= 180.0
    return read_drive(path)


def test_filter_is_consistent_and_its_checks_are_silent(drive):
    """Errors by their sds: 0.5 … 1.6 leaves room for their correlation over the 150 s that count."""
    examined, _ = examined_drive(drive)
    assert examined.notes == drive.notes
    found = navigate_drive(examined, load_config("stim300"))
    solution = found.solutions[0]
    rows = np.flatnonzero(solution.t > 90.0)
    sd = np.sqrt(np.diagonal(solution.covariance, axis1=1, axis2=2)[rows, :9])
    ratio = np.sqrt(np.mean((differences(drive.reference, solution, rows) / sd) ** 2, axis=0))
    assert np.all((ratio[:6] > 0.5) & (ratio[:6] < 1.6))
    assert not any("turned" in note or "left out" in note or "unit" in note for note in found.notes)
    rows = np.array([line.split(",")[:3] for line in solution_csv(found, 0.0).splitlines()[1:]], dtype=float)
    assert np.abs(rows[:, 2]).max() <= 180.0
    plane = np.concatenate(local_track(tracks(found))["fixes"])
    assert np.abs(np.diff(plane, axis=0)).max() < 30.0


def test_clocks_agree_near_the_pole():
    clock = examine(_drive("89° N", city(240.0))).clock
    assert not clock.delay.certain
    assert not clock.lag.certain
    assert np.abs([clock.delay.value, clock.lag.value]).max() < 0.02


@pytest.mark.parametrize("place", PLACES)
def test_fast_aeroplane_is_aligned(place):
    """At 89° north turns by 0.13° a second below an aeroplane at 230 m/s: 30° in the four minutes."""
    drive = _drive(place, climb(240.0, speed=230.0, turn_period=80.0), "rtk")
    dt = np.diff(drive.imu_t)
    steps = Steps(float(drive.imu_t[0]), dt, drive.rates[1:] * dt[:, None])
    found = align(steps, drive.gnss, bias_sd=STIM300)
    true = np.stack(
        [np.interp(found.t, drive.reference.t, c) for c in np.unwrap(drive.reference.rpy, axis=0).T]
    )
    off = rotation.rotvec_from_mat(rotation.mat_from_quat(found.quat_nb) @ rotation.mat_from_rpy(true).T)
    assert np.degrees(np.abs(off)).max() < 0.5
