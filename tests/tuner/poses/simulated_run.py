"""Samples of a unit that is turned and moved by hand, and poses of it: sums of sines, exact up to the sampling."""

from __future__ import annotations

import numpy as np

from models import rotation
from tuner.poses.misfit import Poses
from tuner.types.records import Record

RATE, FINE = 200.0, 5
"""Samples a second, and steps of the exact motion in each."""
GRAVITY = np.array([0.0, 0.0, -9.81])
"""In the axes of the world, m/s²."""
NONE = (np.zeros((3, 3)), np.zeros((3, 3)))
"""Without errors of scale and axes."""
REST = {"gyro": (1.7e-4, 2e-5), "accel": (2e-3, 3e-4)}
"""N and K of the unit at rest, SI."""


def _sines(rng, t, sd, order):
    """Return a sum of sines whose derivative of some order has an sd; from 0.1 to 1.5 Hz."""
    w = 2.0 * np.pi * rng.uniform(0.1, 1.5, 12)
    phase, size = rng.uniform(0.0, 2.0 * np.pi, 12), rng.normal(size=12)
    x, derived = (
        (size[:, None] * w[:, None] ** power * np.sin(np.outer(w, t) + phase[:, None])).sum(axis=0)
        for power in (-order, 0)
    )
    return x * sd / derived.std()


def simulated_run(
    seed,
    *,
    seconds=120.0,
    factors=(1.0, 1.0),
    scales=NONE,
    delay=0.0,
    drift=0.0,
    sds=(3e-4, 3e-4),
    pose_rate=20.0,
    axes=(1.0, 1.0, 1.0),
    turn=(0.0, 0.0, 0.0),
    arm=(0.0, 0.0, 0.0),
):
    """Return records and poses.

    `factors` are those of white noise of gyroscopes and accelerometers, `scales` errors of scale and axes. Stamps of
    the poses are late by `delay`, s, and by `drift` more each second; `sds` are errors of positions, m, and attitudes,
    rad; `axes` are sizes of the rotations; the body of the poses is turned by `turn`, rad, and the unit lies at `arm`
    in it, m.
    """
    rng = np.random.default_rng(seed)
    n = int(seconds * RATE) * FINE + 1
    t = np.arange(n) / (RATE * FINE)
    quat = rotation.quat_from_rotvec(np.column_stack([size * _sines(rng, t, 0.7, 1) for size in axes]))
    place = np.column_stack([_sines(rng, t, 1.0, 2) for _ in range(3)])
    ends = quat[::FINE]
    rate = (
        rotation.rotvec_from_quat(rotation.quat_multiply(rotation.quat_conjugate(ends[:-1]), ends[1:])) * RATE
    )
    accel = np.gradient(np.gradient(place, t, axis=0), t, axis=0) - GRAVITY
    force = np.einsum("nji,nj->ni", rotation.mat_from_quat(quat), accel)
    parts = [force[k : n - FINE + k : FINE] for k in range(FINE + 1)]
    mean = (0.5 * (parts[0] + parts[-1]) + sum(parts[1:-1])) / FINE
    records = []
    stamps = (np.arange(len(rate)) + 0.5) / RATE
    for (name, unit), true, factor, scale in zip(
        (("gyro", "rad/s"), ("accel", "m/s^2")), (rate, mean), factors, scales, strict=True
    ):
        white, walk = REST[name]
        noise = factor * white * np.sqrt(RATE) * rng.normal(size=true.shape)
        bias = np.cumsum(walk / np.sqrt(RATE) * rng.normal(size=true.shape), axis=0)
        y = true @ (np.eye(3) + scale).T + noise + bias + 20.0 * white * rng.normal(size=3)
        names = tuple(f"{name}_{x}" for x in "xyz")
        records.append(Record(name, stamps, y, names, unit, 1.0 / RATE, ((0, len(y)),)))
    step = round(RATE * FINE / pose_rate)
    body = rotation.quat_multiply(quat[::step], rotation.quat_from_rotvec(np.array(turn)))
    moved = place[::step] - np.einsum("nij,j->ni", rotation.mat_from_quat(body), arm)
    errors = rotation.quat_from_rotvec(sds[1] * rng.normal(size=moved.shape))
    poses = Poses(
        t[::step] * (1.0 + drift) + delay,
        moved + sds[0] * rng.normal(size=moved.shape),
        rotation.quat_multiply(body, errors),
    )
    return tuple(records), poses
