"""Covariance of both filters without fixes: the textbook's growth of errors of a level system at rest.

For times far below the Schuler period (84 min), tilt φ and velocity error v of a level system at rest obey dv/dt = g φ,
dφ/dt = w: D. H. Titterton, J. L. Weston, Strapdown Inertial Navigation Technology, 2nd ed., section 12.3, and P. D.
Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed., section 5.7.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models import rotation
from models.trajectory.catalogue import TRAJECTORIES
from models.trajectory.motion import imu_increments
from models.units import STANDARD_GRAVITY as G
from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation import engine
from tuner.navigation import reference_filter as reference
from tuner.navigation.compensation import compensate_settings
from tuner.navigation.data import Fixes, Steps
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize
from tuner.types import Compensation

INTERVAL, DURATION = 0.02, 60.0
GYRO, ACCEL, GYRO_BIAS, ACCEL_BIAS = 1e-4, 2e-3, 3e-6, 1e-3  # densities, and sds of constants
POSITION, VELOCITY, TILT = 1.5, 0.02, 2e-4


def settings():
    """White noise and constants alone."""
    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("rtk"))
    channels = {}
    for axis, channel in config.channels.items():
        density, constant = (GYRO, GYRO_BIAS) if axis.startswith("gyro") else (ACCEL, ACCEL_BIAS)
        channels[axis] = replace(
            channel,
            white_density=density,
            constant_sd=constant,
            markov=(),
            random_walk_density=0.0,
            ramp_sd=0.0,
        )
    initial = replace(config.initial, position=POSITION, velocity=VELOCITY, tilt=TILT, heading=TILT)
    return filter_settings(
        replace(config, channels=channels, initial=initial, gnss=replace(config.gnss, correlated=()))
    )


@pytest.mark.parametrize("run", [reference.run, engine.run], ids=["reference", "engine"])
def test_errors_grow_as_the_textbook_says(run):
    """(ω t)² = 0.0055 with the Schuler frequency ω: the closed forms hold to a few parts in a thousand."""
    motion = TRAJECTORIES["static"](DURATION + 1.0)
    increments = np.hstack(imu_increments(motion, INTERVAL))
    steps = Steps(0.0, np.full(len(increments), INTERVAL), increments)
    t = np.array([20.0, DURATION])
    state = motion.evaluate([0.0]).at(0)
    fixes = Fixes(
        t, np.round(t / INTERVAL).astype(int), np.tile(state.llh, (2, 1)), np.zeros((2, 3)), np.ones((2, 6))
    )
    found = run(settings(), state, steps, fixes.without([[-1.0, DURATION + 1.0]]))
    for time, covariance in zip(t, found.covariance, strict=True):
        tilt = TILT**2 + GYRO**2 * time + GYRO_BIAS**2 * time**2
        vertical = VELOCITY**2 + ACCEL**2 * time + ACCEL_BIAS**2 * time**2
        level = G**2 * (TILT**2 * time**2 + GYRO**2 * time**3 / 3.0 + GYRO_BIAS**2 * time**4 / 4.0)
        height = (
            POSITION**2 + VELOCITY**2 * time**2 + ACCEL**2 * time**3 / 3.0 + ACCEL_BIAS**2 * time**4 / 4.0
        )
        along = G**2 * (TILT**2 * time**4 / 4.0 + GYRO**2 * time**5 / 20.0 + GYRO_BIAS**2 * time**6 / 36.0)
        variance = np.diag(covariance)
        np.testing.assert_allclose(variance[6:8], [tilt] * 2, rtol=0.01)
        np.testing.assert_allclose(variance[3:6], [vertical + level] * 2 + [vertical], rtol=0.01)
        np.testing.assert_allclose(variance[0:3], [height + along] * 2 + [height], rtol=0.01)


@pytest.mark.parametrize("run", [reference.run, engine.run], ids=["reference", "engine"])
def test_a_unit_at_rest_stays_there_where_the_excess_of_gravity_is_compensated(run):
    """Its accelerometers feel g + Δg upwards; unused, Δg would make Δg t of speed and Δg t²/2 of height."""
    excess = 5e-3
    motion = TRAJECTORIES["static"](DURATION + 1.0)
    increments = np.hstack(imu_increments(motion, INTERVAL))
    dt = np.full(len(increments), INTERVAL)
    state = motion.evaluate([0.0]).at(0)
    down = rotation.mat_from_quat(state.quat_nb)[2]
    felt = increments - np.concatenate([np.zeros(3), excess * INTERVAL * down])
    fix = Fixes(
        np.array([DURATION]),
        np.array([round(DURATION / INTERVAL)]),
        state.llh[None],
        np.zeros((1, 3)),
        np.ones((1, 6)),
    ).without([[-1.0, DURATION + 1.0]])
    known = Compensation.parse({"gravity.offset": excess})
    speeds, heights = [], []
    for measured, compensation in ((increments, Compensation()), (felt, Compensation()), (felt, known)):
        found = run(compensate_settings(settings(), compensation), state, Steps(0.0, dt, measured), fix)
        speeds.append(found.state.vel_n[0, 2])
        heights.append(found.state.llh[0, 2] - state.llh[2])
    # Gravity falls with height, which moves both by less than (ω_s t)², 1 % of themselves after a minute.
    np.testing.assert_allclose(np.diff(speeds[:2]), -excess * DURATION, rtol=0.01)
    np.testing.assert_allclose(np.diff(heights[:2]), excess * DURATION**2 / 2.0, rtol=0.01)
    np.testing.assert_allclose(speeds[2], speeds[0], atol=1e-6)
    np.testing.assert_allclose(heights[2], heights[0], atol=1e-5)
