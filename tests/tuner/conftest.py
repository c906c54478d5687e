"""Simulated drives for the tests: a car in a city after standing still; as a drive, and as the arrays of a file."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

INTERVAL, STILL, STOOD = 0.02, 30.0, 40.0
LEVER, MOUNTING_RPY, DELAY = (0.5, -0.3, -1.2), (180.0, 3.0, 100.0), 0.15
"""Of the drive that is written to files."""
SD = np.array([1.0, 1.0, 1.8, 0.06, 0.06, 0.1])
WHITE, CONSTANT = np.repeat([1.7e-4, 3e-3], 3), np.repeat([1e-3, 0.02], 3)


@pytest.fixture(scope="session")
def drive_config():
    """What the simulated unit is: white noise and constant biases."""
    from tuner.catalogue.grades import grade_identification, load_grade
    from tuner.synthesis import synthesize
    from tuner.types import GnssNoise

    receiver = GnssNoise((1.0, 1.0, 1.8), (0.06, 0.06, 0.1), 1.0, 5.0)
    told = synthesize(grade_identification(load_grade("mpu9250")), gnss=receiver)
    exact = {
        axis: replace(noise, white_density=density, markov=(), random_walk_density=0.0, constant_sd=sd)
        for (axis, noise), density, sd in zip(told.channels.items(), WHITE, CONSTANT, strict=True)
    }
    return replace(told, channels=exact)


@cache
def course(duration):
    """The trajectory, and what is felt on it."""
    from models.trajectory.catalogue import TRAJECTORIES
    from models.trajectory.motion import imu_increments

    motion = TRAJECTORIES["city"](duration)
    return motion, np.hstack(imu_increments(motion, INTERVAL)) / INTERVAL


@pytest.fixture(scope="session")
def simulated():
    """Return the function that makes a drive: `values` as of a compensation, `unit` and `fixes` factors on noise.

    `reported` (k,) are factors on the sds that the receiver tells.
    """
    from models.earth import llh_displaced
    from models.measurements import perfect_fixes
    from tuner.navigation.compensation import correction
    from tuner.types import Compensation
    from tuner.types.records import Drive, Gnss

    def make(
        seed, *, duration=300.0, values=None, delay=0.0, lag=0.0, arm=(0.0, 0.0, 0.0), unit=1.0, fixes=1.0,
        reported=None,
    ):  # fmt: skip
        rng = np.random.default_rng(seed)
        motion, moving = course(duration)
        rates = np.vstack([np.tile(moving[0], (round(STILL / INTERVAL), 1)), moving])
        rates = rates @ correction(Compensation.parse(values or {})).sensor_matrix.T
        rates = rates + CONSTANT * rng.standard_normal(6)
        rates = rates + rng.standard_normal(rates.shape) * unit * WHITE / np.sqrt(INTERVAL)
        t = INTERVAL * np.arange(1, len(rates) + 1)
        fix_t = np.arange(1.0, STILL + duration - 1.0)
        there = [(fix_t - STILL - late).clip(0.0, duration) for late in (delay, delay + lag)]
        llh, _ = perfect_fixes(motion, there[0], lever_arm=arm)
        _, vel = perfect_fixes(motion, there[1], lever_arm=arm)
        error = rng.standard_normal((len(fix_t), 6)) * SD * fixes
        sd = np.tile(SD, (len(fix_t), 1))
        if reported is not None:
            sd = sd * reported[: len(fix_t), None]
        gnss = Gnss(fix_t, llh_displaced(llh, error[:, :3]), vel + error[:, 3:], sd[:, :3], sd[:, 3:])
        return Drive("simulated", t, rates, gnss, lever_arm=(0.0, 0.0, 0.0), source="simulated")

    return make


def _arrays(duration=400.0, *, seed=1, mounting=MOUNTING_RPY, delay=DELAY):
    """A simulated drive as the arrays of a file: a city after standing still."""
    from models import rotation
    from models.measurements import perfect_fixes
    from models.trajectory.catalogue import TRAJECTORIES
    from models.trajectory.motion import imu_increments

    rng = np.random.default_rng(seed)
    motion = TRAJECTORIES["city"](duration)
    moving = np.hstack(imu_increments(motion, INTERVAL)) / INTERVAL
    still = np.tile(moving[0], (round(STOOD / INTERVAL), 1))
    rates = np.vstack([still, moving])
    sensor = rotation.mat_from_rpy(np.radians(mounting))
    rates = np.hstack([rates[:, :3] @ sensor.T, rates[:, 3:] @ sensor.T])
    rates += np.concatenate([[2e-3, -1e-3, 1.5e-3], [0.05, -0.04, 0.06]])
    density = np.repeat([1.2e-4, 3e-3], 3)
    rates += rng.standard_normal(rates.shape) * density / np.sqrt(INTERVAL)
    t = 1000.0 + INTERVAL * np.arange(1, len(rates) + 1)
    gnss_t = 1000.0 + np.arange(1.0, STOOD + duration - 1.0)
    llh, vel = perfect_fixes(motion, (gnss_t - 1000.0 - STOOD - delay).clip(0.0, duration), lever_arm=LEVER)
    metres = np.array([6.37e6, 6.37e6 * np.cos(0.84), 1.0])
    llh = llh + rng.standard_normal(llh.shape) * np.array([0.4, 0.4, 0.8]) / metres
    vel = vel + 0.05 * rng.standard_normal(vel.shape)
    truth_t = np.arange(0.0, duration, 0.1)
    state = motion.evaluate(truth_t)
    return {
        "imu_t": t,
        "gyro": rates[:, :3],
        "accel": rates[:, 3:],
        "gnss_t": gnss_t,
        "gnss_llh": np.column_stack([np.degrees(llh[:, :2]), llh[:, 2]]),
        "gnss_vned": vel,
        "gnss_pstd": np.tile([0.4, 0.4, 0.8], (len(gnss_t), 1)),
        "gnss_vstd": np.full((len(gnss_t), 3), 0.05),
        "ref_t": 1000.0 + STOOD + truth_t,
        "ref_llh": np.column_stack([np.degrees(state.llh[:, :2]), state.llh[:, 2]]),
        "ref_vned": state.vel_n,
        "ref_rpy": np.degrees(state.rpy),
    }


def _saved(path, data, **meta):
    np.savez(path, meta=np.array(json.dumps(meta)), **data)
    return path


def _configuration(receiver="dgnss"):
    from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
    from tuner.synthesis import synthesize

    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss(receiver))
    return replace(config, gnss=replace(config.gnss, position_sd=(0.4, 0.4, 0.8), correlated=()))


@pytest.fixture(scope="module")
def data():
    return _arrays()


@pytest.fixture(scope="module")
def file(data, tmp_path_factory):
    return _saved(
        tmp_path_factory.mktemp("drive") / "drive.npz",
        data,
        lever_arm_frd_m=LEVER,
        mounting_rpy_deg=MOUNTING_RPY,
    )


@pytest.fixture(scope="session")
def arrays():
    """Return the function that makes the arrays of a file."""
    return _arrays


@pytest.fixture(scope="session")
def saved():
    """Return the function that writes them."""
    return _saved


@pytest.fixture(scope="session")
def configuration():
    """Return the function that makes the filter that suits them."""
    return _configuration
