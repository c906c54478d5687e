"""Parts of the innovations of a drive between which the effect of a cause that is true does not differ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from models.arrays import FloatArray, IndexArray
from tuner.diagnosis.drive.causes.time_offset import OFFSET_DELAY
from tuner.linear_run.linearized_run import LinearizedRun

TIME_PARTS, MOTION_PARTS = 4, 3
"""Parts of the drive in time, and of the fixes by what the vehicle does."""
MIN_SIZE_RANGE = 0.2
"""Range of the sizes of an effect ÷ its largest, from which small and large ones are compared."""
MIN_SPEED_SHARE = 0.1
"""Share of the usual speed from which a vehicle moves: at rest sensors are not shaken."""

BETWEEN = {
    "rows": "positions and velocities, level and vertical",
    "time": "quarters of the drive",
    "course": "courses to the north, east, south and west",
    "along": "braking and accelerating",
    "turn": "left and right turns",
    "speed": "slow and fast",
    "size": "where it is small and where it is large",
    "vehicle": "along and across the vehicle",
}
"""What the parts of each division are."""


@dataclass(frozen=True)
class Check:
    """Evidence against a named cause, nats, and the division of the innovations that has most of it."""

    evidence: float
    between: str


def divisions(linearized: LinearizedRun) -> dict[str, IndexArray]:
    """Return the part of every row of k fixes, by division; (k, 6) each, −1 where the row is in none."""
    k, t = len(linearized.t), linearized.t
    delay = linearized.parameters.index(OFFSET_DELAY)
    velocity, acceleration = -linearized.D[:, :3, delay], -linearized.D[:, 3:, delay]
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > MIN_SPEED_SHARE * float(np.quantile(speed, 0.9))
    heading = velocity / np.maximum(speed, 1e-9)[:, None]
    along = np.einsum("ki,ki->k", heading, acceleration)
    left = heading[:, 0] * acceleration[:, 1] - heading[:, 1] * acceleration[:, 0]
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    quadrant = np.floor((course + 0.25 * np.pi) / (0.5 * np.pi)).astype(np.intp) % 4
    span = max(float(t[-1] - t[0]), 1e-9)
    by_fix = {
        "time": np.minimum((TIME_PARTS * (t - t[0]) / span).astype(np.intp), TIME_PARTS - 1),
        "course": np.where(moving, quadrant, -1),
        **{
            name: np.where(moving, _thirds(values, moving), -1)
            for name, values in (("along", along), ("turn", left), ("speed", speed))
        },
    }
    rows = np.broadcast_to(np.array([0, 0, 1, 2, 2, 3], dtype=np.intp), (k, 6))
    return {"rows": rows, **{name: np.repeat(part[:, None], 6, axis=1) for name, part in by_fix.items()}}


def thirds_by_size(size: FloatArray) -> IndexArray | None:
    """Return parts of k fixes, each with a third of the information of an effect; None where its sizes are alike.

    What is in proportion to its cause is so in all three; a square, or what saturates, is not.
    """
    order = np.argsort(size)
    information = np.cumsum(size[order] ** 2)
    if information[-1] <= 0.0:
        return None
    ends = size[order[np.searchsorted(information, information[-1] * np.array([0.1, 0.9]))]]
    if np.ptp(ends) < MIN_SIZE_RANGE * size.max():
        return None
    part = np.empty(len(size), dtype=np.intp)
    part[order] = np.minimum(MOTION_PARTS * information / information[-1], MOTION_PARTS - 1).astype(np.intp)
    return part


def _thirds(values: FloatArray, among: NDArray[np.bool_]) -> IndexArray:
    if not among.any():
        return np.zeros(len(values), dtype=np.intp)
    edges = np.quantile(values[among], np.arange(1, MOTION_PARTS) / MOTION_PARTS)
    return np.asarray(np.digitize(values, edges), dtype=np.intp)


def mixed(evidence: Mapping[str, float]) -> Check:
    """Return the evidence of all divisions together, each as likely as the others beforehand."""
    names = list(evidence)
    values = np.array([evidence[name] for name in names])
    return Check(float(logsumexp(values)) - math.log(len(values)), names[int(np.argmax(values))])
