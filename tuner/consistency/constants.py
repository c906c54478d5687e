"""Constants that may be wrong in an output or in the fixes of a filter, and what one unit of each does to the errors.

A clock, a datum, an arm to another point, turned axes act on all epochs alike, along columns that follow from the
motion. What is wrong in the fixes shifts these by as much the other way.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from models import rotation
from models.arrays import LEAST_DIVISOR, FloatArray
from models.filter_states.declaration import NAVIGATION_STATES
from models.probability import student_quantile
from tuner.types.output_score import OutputCause


class Motion(NamedTuple):
    """Motion of a vehicle at n epochs.

    Attributes
    ----------
    way, vel, acc, rate : ndarray, shape (n, 3)
        Way, m, velocity, its derivative and angular rate, in north-east-down.
    mat_nb : ndarray, shape (n, 3, 3)
        Attitude.
    of_body : bool
        Whether the errors of velocity are those along the axes of the body.
    """

    way: FloatArray
    vel: FloatArray
    acc: FloatArray
    rate: FloatArray
    mat_nb: FloatArray
    of_body: bool = False


class Constant(NamedTuple):
    """A constant that errors may have: the code and subject of its cause, its parts and their columns."""

    cause: str
    subject: str
    unit: str
    parts: tuple[str, ...]
    """Names of the first columns."""
    size: int
    """First parts whose norm is its size; of one, its value."""
    columns: Callable[[Motion], FloatArray]
    """Derivatives of the errors by the parts, shape (n, 9, k)."""

    def found(
        self, value: FloatArray, covariance: FloatArray, wide: float, gain: float, *, constant: bool = False
    ) -> OutputCause:
        """Return the constant of this value as a cause, with intervals of `wide` sds."""
        vector, own = value[: self.size], covariance[: self.size, : self.size]
        length = float(np.linalg.norm(vector))
        size = length if self.size > 1 else float(value[0])
        spread = wide * math.sqrt(float(vector @ own @ vector)) / max(length, LEAST_DIVISOR)
        halves = wide * np.sqrt(np.diag(covariance))
        parts = {
            name: (float(v), float(v - half), float(v + half))
            for name, v, half in zip(self.parts, value, halves, strict=False)
        }
        interval = (size - spread, size + spread)
        return OutputCause(
            self.cause, size, interval, self.unit, gain, parts, self.subject, constant=constant
        )


def by_leaving_out(squares: FloatArray, products: FloatArray) -> tuple[FloatArray, FloatArray, float] | None:
    """Return a least squares solution, its covariance by the jackknife over parts, and the sds of 95 %.

    Parameters
    ----------
    squares, products : ndarray, shapes (q, k, k), (q, k)
        Normal equations of each of q parts of the data.

    Returns
    -------
    tuple or None
        None where the data without one of the parts leave a constant open: then no scatter shows its error.
    """
    whole, right = squares.sum(axis=0), products.sum(axis=0)
    rest = whole - squares
    if len(rest) < 2 or (np.linalg.matrix_rank(rest, hermitian=True) < len(right)).any():
        return None
    left = np.linalg.solve(rest, (right - products)[..., None])[..., 0]
    off = left - left.mean(axis=0)
    covariance = (len(left) - 1) / len(left) * off.T @ off
    return np.linalg.solve(whole, right), covariance, float(student_quantile(0.975, len(left) - 1))


def _delay(motion: Motion) -> FloatArray:
    """Return the derivative by how late the stamps are."""
    acc = motion.acc - np.cross(motion.rate, motion.vel) * motion.of_body
    return np.concatenate([motion.vel, acc, motion.rate], axis=1)[:, :, None]


def _offset(motion: Motion) -> FloatArray:
    """Return derivatives by how far north, east and down the estimate is of the truth."""
    return np.tile(-np.eye(NAVIGATION_STATES, 3), (len(motion.way), 1, 1))


def _height(motion: Motion) -> FloatArray:
    """Return the derivative by how far up the estimate is."""
    return -_offset(motion)[..., 2:]


def _antenna(motion: Motion) -> FloatArray:
    """Return derivatives by how far forward, right and down the positions are of those of the truth."""
    return np.pad(-motion.mat_nb, ((0, 0), (0, NAVIGATION_STATES - 3), (0, 0)))


def _point(motion: Motion) -> FloatArray:
    """Return derivatives by how far forward, right and down the point of positions and velocities is."""
    found = _antenna(motion)
    found[:, 3:6] = -rotation.skew(motion.rate) @ motion.mat_nb
    return found


def _turn(motion: Motion, blocks: int) -> FloatArray:
    """Return derivatives by a turn of so many blocks about the vertical of any point, and by their scale.

    A map has both, and a turn by many degrees shortens the way that it began with.
    """
    found = np.zeros((len(motion.way), NAVIGATION_STATES, 4))
    for own, of in ((slice(0, 3), motion.way), (slice(3, 6), motion.vel)):
        found[:, own, 0] = -np.cross([0.0, 0.0, 1.0], of)
        found[:, own, 1] = -of * [1.0, 1.0, 0.0]
    found[:, 8, 0] = -1.0
    found[:, :3, 2:] = -np.eye(3)[:, :2]
    found[:, 3 * blocks :] = 0.0
    return found


def _scale(motion: Motion) -> FloatArray:
    """Return derivatives by how much too long horizontal ways and velocities are, from a point north and east."""
    return _turn(motion, blocks=2)[..., 1:]


def _body(motion: Motion) -> FloatArray:
    """Return derivatives by a rotation from the body of the estimate to that of the truth."""
    return np.pad(motion.mat_nb, ((0, 0), (6, 0), (0, 0)))


XYZ = ("x", "y", "z")
OFFSET = Constant("gnss_frame", "offset", "m", ("north", "east", "down"), 3, _offset)
POINT = Constant("lever_arm", "output", "m", XYZ, 3, _point)
SCALE = Constant("gnss_frame", "scale", "1", ("scale", "north", "east"), 1, _scale)
TURNS = [
    Constant(
        "gnss_frame", "rotation", "rad", ("yaw", "scale", "north", "east"), 1, partial(_turn, blocks=number)
    )
    for number in (1, 2, 3)
]
BODY = Constant("mounting", "", "rad", ("roll", "pitch", "yaw"), 3, _body)
OF_OUTPUT = (
    Constant("gnss_frame", "height", "m", ("up",), 1, _height),
    OFFSET,
    Constant("lever_arm", "output", "m", XYZ, 3, _antenna),
    POINT,
    SCALE,
    *TURNS,
    BODY,
)
"""Constants of an output that act linearly, the simplest first."""
IN_FIXES = {"fixes", "offset", "scale", "rotation"}
"""Subjects of `OF_FILTER` that act through the fixes."""
OF_FILTER = (
    Constant("time_offset", "fixes", "s", ("delay",), 1, _delay),
    Constant("time_offset", "stamps of the output", "s", ("delay",), 1, _delay),
    POINT._replace(subject="fixes"),
    POINT,
    OFFSET,
    SCALE,
    TURNS[1],
    BODY,
)
"""Constants that a filter answers to as its gains say, in the fixes or on the output."""
