"""A simulated drive: a car in a city after standing still, its unit and receiver exactly as the configuration says."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

INTERVAL, STILL = 0.02, 30.0
SD = np.array([1.0, 1.0, 1.8, 0.06, 0.06, 0.1])
WHITE, CONSTANT = np.repeat([1.7e-4, 3e-3], 3), np.repeat([1e-3, 0.02], 3)


@pytest.fixture(scope="session")
def drive_config():
    """What the simulated unit is: white noise and constant biases."""
    from tuner.grades import grade_identification, load_grade
    from tuner.results import GnssNoise
    from tuner.synthesis import synthesize

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
    from models.motion import imu_increments
    from models.trajectories import TRAJECTORIES

    motion = TRAJECTORIES["city"](duration)
    return motion, np.hstack(imu_increments(motion, INTERVAL)) / INTERVAL


@pytest.fixture(scope="session")
def simulated():
    """Return the function that makes a drive: `values` as of a compensation, `unit` and `fixes` factors on noise.

    `reported` (k,) are factors on the sds that the receiver tells.
    """
    from models.earth import llh_displaced
    from models.gnss import perfect_fixes
    from tuner.navigation.compensation import sensor_matrix
    from tuner.records import Drive, Gnss

    def make(
        seed, *, duration=300.0, values=None, delay=0.0, lag=0.0, arm=(0.0, 0.0, 0.0), unit=1.0, fixes=1.0,
        reported=None,
    ):  # fmt: skip
        rng = np.random.default_rng(seed)
        motion, moving = course(duration)
        rates = np.vstack([np.tile(moving[0], (round(STILL / INTERVAL), 1)), moving])
        rates = rates @ sensor_matrix(values or {}).T
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
