"""Recordings of three streams whose errors are known: an IMU, fixes with velocities, wheels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.earth import llh_displaced
from models.trajectory.catalogue import city
from tuner.catalogue.grades import load_gnss, load_grade
from tuner.simulation.drive import simulate_drive
from tuner.types.records import BodyVelocity, Gnss

DECLARED = {"right": 1.0, "three times": 3.0, "a third": 1.0 / 3.0, "zero": 0.0}


@dataclass(frozen=True)
class Errors:
    """White sd, sd that lasts and its time constant, s, of a reading."""

    white: float
    lasting: float
    time: float

    @property
    def size(self):
        return float(np.hypot(self.white, self.lasting))

    def drawn(self, t, columns, rng):
        """Errors at times, (k, columns)."""
        out = np.empty((len(t), columns))
        out[0] = self.lasting * rng.standard_normal(columns)
        for k, keep in enumerate(np.exp(-np.diff(t) / self.time)):
            out[k + 1] = keep * out[k] + self.lasting * np.sqrt(1.0 - keep**2) * rng.standard_normal(columns)
        return out + self.white * rng.standard_normal(out.shape)


def recording(
    seed, *, duration=240.0, rate=50.0, declared="right", velocities=False, fixes=None, wheels=None
):
    """A drive of a car and its true errors by stream."""
    rng = np.random.default_rng([seed, 48])
    fixes = fixes or Errors(
        float(np.exp(rng.uniform(np.log(0.1), np.log(1.0)))),
        float(np.exp(rng.uniform(np.log(0.3), np.log(2.0)))),
        float(rng.uniform(8.0, 30.0)),
    )
    wheels = wheels or Errors(
        float(np.exp(rng.uniform(np.log(0.02), np.log(0.1)))),
        float(np.exp(rng.uniform(np.log(0.02), np.log(0.2)))),
        float(rng.uniform(8.0, 30.0)),
    )
    speed = Errors(0.05, 0.0, 1.0)
    motion = city(duration)
    receiver = load_gnss("spp")
    drive, _ = simulate_drive(load_grade("icm20602"), motion, receiver, rate=rate, seed=seed)
    truth = motion.evaluate(np.arange(1.0, duration))
    t = np.arange(1.0, duration)
    llh = llh_displaced(truth.llh, fixes.drawn(t, 3, rng))
    vel = truth.vel_n + speed.drawn(t, 3, rng) if velocities else np.full((len(t), 3), np.nan)
    factor = DECLARED[declared]
    sd = np.full((len(t), 3), factor * fixes.size)
    speed_sd = np.full((len(t), 3), factor * speed.size if velocities else np.nan)
    at = np.arange(0.5, duration, 0.1)
    there = motion.evaluate(at)
    body = np.einsum("nji,nj->ni", there.mat_nb, there.vel_n)
    errors = wheels.drawn(at, 3, rng)
    errors[:, 1:] = wheels.white * rng.standard_normal((len(at), 2))
    measured = BodyVelocity(at, body + errors, np.full((len(at), 3), factor * wheels.size))
    return replace(drive, gnss=Gnss(t, llh, vel, sd, speed_sd), wheels=measured, name=f"recording-{seed}"), {
        "fixes": fixes,
        "wheels": wheels,
        "velocities": speed,
    }
