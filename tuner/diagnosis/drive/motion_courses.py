"""Motion at the fixes of a drive, and courses that errors of sensors and fixes may follow: speed, force and time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.units import STANDARD_GRAVITY
from tuner.diagnosis.drive.causes.time_offset import OFFSET_DELAY
from tuner.diagnosis.drive.score_tests import columns_of
from tuner.linear_run.linearized_run import LinearizedRun

WARM_UP = (20.0, 32.0, 50.0, 80.0, 126.0, 200.0, 316.0, 500.0)
"""Time constants of warm-up that are tried, s: those of boards to boxes; one between two of them fits either to 1 %."""
COSINE_COUNT = 12
"""Number of cosines of which a slow change is made: a period down to a sixth of the drive, minutes for most."""
COSINES_OF_A_WAVE, WAVE_BANDS = 4, 9
"""Cosines of a band, of which a wave is made, and bands, down to a period of 1/18 of the drive.

A wave that is not whole in the drive has most of its power in two cosines to either side of its period.
"""
STEP_COUNT = 12
"""Number of times of steps that are tried, evenly over the drive."""


WAVES = "goes up and down"
"""How the names of waves begin."""


@dataclass(frozen=True)
class Motion:
    """Motion at k fixes: times, attitude, velocity, acceleration NED, turn rate and force in axes of the sensor."""

    t: FloatArray
    mat: FloatArray
    velocity: FloatArray
    force: FloatArray
    rate: FloatArray

    @classmethod
    def of(cls, linearized: LinearizedRun) -> Motion:
        """Return the motion behind the sensitivities of a run."""
        delay = linearized.parameters.index(OFFSET_DELAY)
        arm = list(columns_of("lever_arm", linearized.parameters))
        velocity, acceleration = -linearized.D[:, :3, delay], -linearized.D[:, 3:, delay]
        mat = linearized.D[:, :3, arm]
        around = linearized.D[:, 3:, arm] @ np.swapaxes(mat, 1, 2)
        rate = np.stack([around[:, 2, 1], around[:, 0, 2], around[:, 1, 0]], axis=-1)
        down = np.array([0.0, 0.0, STANDARD_GRAVITY])
        body = np.einsum("kji,kj->ki", mat, acceleration - down)
        return cls(linearized.t, mat, velocity, body, np.einsum("kji,kj->ki", mat, rate))


def covariates(motion: Motion) -> dict[str, list[FloatArray]]:
    """Return courses (k,) of rms 1 by what an error does with them; those of one name act together."""
    t = motion.t - motion.t[0]
    speed = np.linalg.norm(motion.velocity, axis=1)
    way = np.cumsum(motion.velocity * np.diff(t, prepend=0.0)[:, None], axis=0)
    forward = motion.mat[:, :, 0]
    heading = np.arctan2(forward[:, 1], forward[:, 0])
    found = {
        "grows with the speed": [speed],
        "grows with the square of the speed": [speed**2],
        "grows with the force forward": [motion.force[:, 0]],
        "grows with the force to the right": [motion.force[:, 1]],
        "grows with the force down": [motion.force[:, 2] + STANDARD_GRAVITY],
        "grows with the square of the force": [np.sum(motion.force[:, :2] ** 2, axis=1)],
        "grows with the rate of roll": [motion.rate[:, 0]],
        "grows with the rate of pitch": [motion.rate[:, 1]],
        "grows with the rate of yaw": [motion.rate[:, 2]],
        "grows with the rate of yaw of either sign": [np.abs(motion.rate[:, 2])],
        "grows with speed and rate of yaw": [speed * motion.rate[:, 2]],
        "changes with the heading": [np.sin(heading), np.cos(heading)],
        "grows with the way": [way[:, 0], way[:, 1]],
        "grows with the height": [way[:, 2]],
        "grows with time": [t],
    }
    span = max(float(t[-1]), 1e-9)
    waves = [np.cos(np.pi * j * t / span) for j in range(1, 1 + COSINES_OF_A_WAVE * WAVE_BANDS)]
    found["changes slowly with time"] = waves[:COSINE_COUNT]
    for first in range(0, len(waves), COSINES_OF_A_WAVE):
        shortest, longest = 2.0 * span / (first + COSINES_OF_A_WAVE), 2.0 * span / (first + 1)
        name = f"{WAVES} with a period of {shortest:.0f} to {longest:.0f} s"
        found[name] = waves[first : first + COSINES_OF_A_WAVE]
    for memory in WARM_UP:
        found[f"settles within {memory:.0f} s"] = [1.0 - np.exp(-t / memory)]
    for begin in np.linspace(0.0, t[-1], STEP_COUNT + 2)[1:-1]:
        found[f"changes at {motion.t[0] + begin:.0f} s"] = [(t > begin).astype(float)]
    unit = {id(course): _of_unit_rms(course) for courses in found.values() for course in courses}
    return {name: [unit[id(course)] for course in courses] for name, courses in found.items()}


def _of_unit_rms(course: FloatArray) -> FloatArray:
    return np.asarray(course / max(float(np.sqrt(np.mean(course**2))), 1e-12))
