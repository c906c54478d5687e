"""A linear model of a drive to draw replicas from: a car in a city, a filter of 15 states, fixes at 1 Hz."""

from __future__ import annotations

import numpy as np
import pytest

from tuner.linear_run.linearized_run import LinearizedRun
from tuner.types import Parameter

GRAVITY = 9.80665
DEG, HOUR = np.pi / 180.0, 3600.0


def _skew(a):
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def city(fixes: int, *, interval: float = 1.0, seed: int = 0, break_at: int | None = None) -> LinearizedRun:
    """Drive blocks of a city: 50 Hz consumer unit, receiver of 1/1/1.8 m and 0.06/0.06/0.1 m/s.

    Columns: delay of the fixes, lever arm (3), scale factors of the gyroscopes (3).
    """
    rng = np.random.default_rng(seed)
    step = 0.1
    per_fix = round(interval / step)
    n, k = 15, fixes
    density = {"gyro_white": 0.2 * DEG / 60.0, "accel_white": 0.05 / 60.0}
    bias_sd = {"gyro_bias": 12.0 * DEG / HOUR, "accel_bias": 4e-4 * GRAVITY}
    time_constant = 300.0
    phi, drive = np.empty((k, n, n)), np.zeros((k, n, 7))
    noise = {g: np.zeros((k, n, n)) for g in ("gyro_white", "accel_white", "gyro_bias", "accel_bias")}
    H, seen = np.zeros((k, 6, n)), np.zeros((k, 6, 7))
    H[:, :6, :6] = np.eye(6)
    steps = k * per_fix
    t = np.arange(steps) * step
    yaw_rate = np.zeros(steps)
    for begin in np.arange(10.0, t[-1], 25.0) + rng.uniform(0.0, 10.0, len(np.arange(10.0, t[-1], 25.0))):
        length = rng.uniform(3.0, 7.0)
        yaw_rate += rng.choice([-1, 1]) * np.pi / 2.0 / length * ((t > begin) & (t < begin + length))
    speed = 12.0 + 5.0 * np.sin(2.0 * np.pi * t / 37.0) + 3.0 * np.sin(2.0 * np.pi * t / 91.0)
    along = np.gradient(speed, step)
    yaw = np.cumsum(yaw_rate) * step
    decay = np.exp(-step / time_constant)
    for i in range(k):
        F, B = np.eye(n), np.zeros((n, 7))
        Q = {g: np.zeros((n, n)) for g in noise}
        for j in range(i * per_fix, (i + 1) * per_fix):
            c, s = np.cos(yaw[j]), np.sin(yaw[j])
            C = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            force = C @ np.array([along[j], speed[j] * yaw_rate[j], 0.0]) - np.array([0.0, 0.0, GRAVITY])
            A = np.eye(n)
            A[:3, 3:6] = step * np.eye(3)
            A[3:6, 6:9] = -step * _skew(force)
            A[6:9, 9:12] = -step * C
            A[3:6, 12:15] = -step * C
            A[9:, 9:] *= decay
            F, B = A @ F, A @ B
            B[6:9, 4:7] -= step * C @ np.diag([0.0, 0.0, yaw_rate[j]])
            for g in Q:
                Q[g] = A @ Q[g] @ A.T
            Q["gyro_white"][6:9, 6:9] += density["gyro_white"] ** 2 * step * np.eye(3)
            Q["accel_white"][3:6, 3:6] += density["accel_white"] ** 2 * step * np.eye(3)
            Q["gyro_bias"][9:12, 9:12] += bias_sd["gyro_bias"] ** 2 * (1.0 - decay**2) * np.eye(3)
            Q["accel_bias"][12:, 12:] += bias_sd["accel_bias"] ** 2 * (1.0 - decay**2) * np.eye(3)
        phi[i], drive[i] = F, B
        for g in Q:
            noise[g][i] = Q[g]
        seen[i, :3, 0] = -speed[j] * C[:, 0]
        seen[i, 3:, 0] = -C @ np.array([along[j], speed[j] * yaw_rate[j], 0.0])
        seen[i, :3, 1:4] = C
        seen[i, 3:, 1:4] = C @ _skew([0.0, 0.0, yaw_rate[j]])
    initial = np.diag(
        np.concatenate(
            [
                np.full(3, 1.0),
                np.full(3, 0.1),
                np.array([0.5, 0.5, 2.0]) * DEG,
                np.full(3, 0.05 * DEG),
                np.full(3, 0.05),
            ]
        )
        ** 2
    )
    sd = np.tile([1.0, 1.0, 1.8, 0.06, 0.06, 0.1], (k, 1))
    starts = np.zeros(k, dtype=bool)
    starts[0] = True
    if break_at is not None:
        starts[break_at] = True
    yes = np.ones((k, 6), dtype=bool)
    names = (
        Parameter("time_offset", "delay"),
        Parameter("lever_arm", "x"),
        Parameter("lever_arm", "y"),
        Parameter("lever_arm", "z"),
        Parameter("gyro_scale", "x"),
        Parameter("gyro_scale", "y"),
        Parameter("gyro_scale", "z"),
    )
    return LinearizedRun(
        (np.arange(k) + 1.0) * interval, phi, noise, H, np.zeros((k, 6)), sd, sd, yes, yes, np.zeros((k, n)),
        initial, names, drive, seen, starts,
    )  # fmt: skip


@pytest.fixture(scope="session")
def city_drive() -> LinearizedRun:
    """900 fixes."""
    return city(900)


@pytest.fixture(scope="session")
def short_drive() -> LinearizedRun:
    """200 fixes in two stretches."""
    return city(200, break_at=120)


@pytest.fixture(scope="session")
def long_drive() -> LinearizedRun:
    """1200 fixes."""
    return city(1200)
