"""Calibration from several static positions: the norm of gravity is the same in each.

With m_i the mean of the accelerometers in pose i and g the length of gravity::

    m_i = A f_i + b + noise,    ‖f_i‖ = g,    A = ( 1+s_x   0      0     )
                                                  ( k_yx    1+s_y  0     )
                                                  ( k_zx    k_zy   1+s_z )

so that ‖A⁻¹ (m_i − b)‖ = g for the right A and b: nonlinear least squares, each pose weighted by the variance of its
mean. A rotation of the triad cannot be seen, so A is lower triangular: the x axis of the sensor is that of the frame.
Residuals larger than the noise explains widen all intervals. The gyros read their bias in every pose (and the
Earth's rate, at most 7.3e-5 rad/s, which turns with the pose).

References
----------
.. [1] D. Tedaldi, A. Pretto, E. Menegatti, A robust and easy to implement method for IMU calibration without external
   equipments, ICRA 2014 (cost function).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from models.arrays import FloatArray
from models.earth import EARTH_RATE
from models.probability import REACH_95, student_quantile
from models.units import STANDARD_GRAVITY
from tuner.segments.stationary import find_motion
from tuner.types import Coefficient
from tuner.types.records import DataError, Record

MIN_POSE_DURATION = 1.0
"""Duration from which standing still counts as a pose, s."""
MIN_POSE_ANGLE = np.radians(15.0)
"""Angle between the directions of gravity in two poses that count as different."""
MIN_POSES = 4
"""Different poses from which a log counts as one for calibration: a log at rest has one."""
BLOCK_DURATION = 0.25
"""Length of the means whose spread gives the variance of the mean of a pose, s."""
BIAS_AND_SCALE = ("bias_x", "bias_y", "bias_z", "scale_x", "scale_y", "scale_z")
"""Parameters of the fit from seven different poses on."""
MISALIGNMENTS = ("misalignment_yx", "misalignment_zx", "misalignment_zy")
"""Further parameters from ten different poses on."""
MAX_HALF_WIDTH = 0.05
"""Half width of the interval of a scale or misalignment from which the poses are said hardly to show it."""


@dataclass(frozen=True)
class Pose:
    """A stand-still: mean and sd of that mean of each axis, in the order of the records."""

    mean: FloatArray
    sd: FloatArray


@dataclass(frozen=True)
class PoseCalibration:
    """Calibration of a log with several positions.

    Attributes
    ----------
    poses, different : int
        Stand-stills used, and how many of them have directions of their own.
    accel, gyro : mapping of str to Coefficient
        ``bias_x …`` (SI), ``scale_x …`` and ``misalignment_yx …`` (pure numbers); empty where there is none.
    misfit : float
        Residuals ÷ what the noise explains (rms); intervals are widened by it where it exceeds 1.
    notes : tuple of str
        What the poses do not show, and what to do.
    """

    poses: int
    different: int
    accel: Mapping[str, Coefficient]
    gyro: Mapping[str, Coefficient]
    misfit: float
    notes: tuple[str, ...]


def find_poses(records: Sequence[Record]) -> tuple[Pose, ...]:
    """Return the stand-stills of a log, from all records on one clock."""
    try:
        still = find_motion(records).still
    except DataError:
        return ()
    size = max(1, round(BLOCK_DURATION * records[0].rate))
    poses = []
    for start, stop in still:
        count = (stop - start) // size
        if (stop - start) * records[0].interval < MIN_POSE_DURATION or count < 4:
            continue
        inside = slice(start, start + count * size)
        columns = [column[inside].reshape(count, size).mean(axis=1) for r in records for column in r.y.T]
        rows = np.stack(columns, axis=1)
        sd = rows.std(axis=0, ddof=1) / np.sqrt(count)
        poses.append(Pose(rows.mean(axis=0), sd))
    return tuple(poses)


def different_poses(force: FloatArray) -> int:
    """Return how many of the directions (n, 3) are more than `MIN_POSE_ANGLE` from all before."""
    kept: list[FloatArray] = []
    for direction in force / np.linalg.norm(force, axis=1)[:, None]:
        if all(float(direction @ other) < np.cos(MIN_POSE_ANGLE) for other in kept):
            kept.append(direction)
    return len(kept)


def calibrate(records: Sequence[Record]) -> PoseCalibration | None:
    """Calibrate from the stand-stills of a log.

    Parameters
    ----------
    records : sequence of Record
        Sensors on one clock; the accelerometers must be a triad.

    Returns
    -------
    PoseCalibration or None
        None for a log that is not one of several poses.
    """
    accel = next((r for r in records if r.unit == "m/s^2" and len(r.axes) == 3), None)
    if accel is None or any(len(r) != len(accel) or r.segments != accel.segments for r in records):
        return None
    if _one_direction(accel):
        return None
    poses = find_poses(records)
    at = sum(len(r.axes) for r in records[: next(i for i, r in enumerate(records) if r is accel)])
    if not poses:
        return None
    mean, sd = np.array([p.mean for p in poses]), np.array([p.sd for p in poses])
    columns = slice(at, at + 3)
    different = different_poses(mean[:, columns])
    if different < MIN_POSES:
        return None
    found, misfit, notes = fit_accel(
        mean[:, columns], sd[:, columns], gravity=STANDARD_GRAVITY, different=different
    )
    gyro: dict[str, Coefficient] = {}
    place = 0
    for record in records:
        if record.unit == "rad/s" and len(poses) > 1:
            for j, axis in enumerate(record.axes):
                gyro[f"bias_{axis.rpartition('_')[2]}"] = _gyro_bias(mean[:, place + j])
        place += len(record.axes)
    return PoseCalibration(len(poses), different, found, gyro, misfit, notes)


def _one_direction(accel: Record) -> bool:
    """Return whether all samples, and with them all their means, lie within half of `MIN_POSE_ANGLE` of one direction.

    They are in a box; this is so where a ball about it is narrow as seen from the origin.
    """
    low, high = accel.y.min(axis=0), accel.y.max(axis=0)
    distance, radius = np.linalg.norm(0.5 * (low + high)), np.linalg.norm(0.5 * (high - low))
    return bool(radius < distance * np.sin(0.5 * MIN_POSE_ANGLE))


def _gyro_bias(means: FloatArray) -> Coefficient:
    """Return the bias of a gyro: the mean over poses, its interval from their scatter."""
    n = len(means)
    value = float(means.mean())
    half = float(student_quantile(0.975, n - 1) * means.std(ddof=1) / np.sqrt(n))
    left = f"the Earth's rate turns with the pose, at most {EARTH_RATE:.2g} rad/s of it is left"
    return Coefficient.known(
        value, value - half, value + half, "rad/s", f"mean over {n} stand-stills; {left}"
    )


def fit_accel(
    force: FloatArray, sd: FloatArray, *, gravity: float, different: int | None = None
) -> tuple[dict[str, Coefficient], float, tuple[str, ...]]:
    """Fit bias, scale and misalignment to the means of poses.

    Parameters
    ----------
    force, sd : ndarray, shape (n, 3)
        Mean of the accelerometers in each pose and its sd, m/s².
    gravity : float
        m/s².
    different : int, optional
        Directions that differ; nine are needed for all nine parameters, six without the misalignments.

    Returns
    -------
    coefficients : dict of str to Coefficient
    misfit : float
        Residuals ÷ what `sd` explains (rms).
    notes : tuple of str
    """
    apart = different_poses(force) if different is None else different
    few, many = len(BIAS_AND_SCALE), len(BIAS_AND_SCALE + MISALIGNMENTS)
    if apart <= few:
        needed = f"more than {few} would, more than {many} misalignment, too"
        return {}, float("nan"), (f"{apart} poses show no bias and scale of the accelerometers: {needed}",)
    names = (*BIAS_AND_SCALE, *MISALIGNMENTS) if apart > many else BIAS_AND_SCALE
    direction = force / np.linalg.norm(force, axis=1)[:, None]
    spread = np.sqrt(np.sum((direction * sd) ** 2, axis=1)) + 1e-12 * gravity

    def residual(x: FloatArray) -> FloatArray:
        true = np.linalg.solve(_matrix(x), (force - x[:3]).T)
        return np.asarray((np.linalg.norm(true, axis=0) - gravity) / spread)

    fit = least_squares(residual, _start(force, gravity, len(names)), x_scale="jac")
    _, values, rows = np.linalg.svd(fit.jac, full_matrices=False)
    freedom = len(force) - len(names)
    misfit = float(np.sqrt(2.0 * fit.cost / freedom)) if freedom > 0 else float("nan")
    inverse = 1.0 / np.maximum(values, 1e-12 * values[0])
    deviation = np.sqrt(np.sum((rows.T * inverse) ** 2, axis=1))
    half = deviation * max(1.0, misfit) * (student_quantile(0.975, freedom) if misfit > 1.0 else REACH_95)
    coefficients = {
        name: Coefficient.known(
            float(v), float(v - h), float(v + h), "m/s^2" if name.startswith("bias") else "1"
        )
        for name, v, h in zip(names, fit.x, half, strict=True)
    }
    return coefficients, misfit, tuple(_notes(coefficients, misfit))


def _notes(coefficients: Mapping[str, Coefficient], misfit: float) -> list[str]:
    """Return notes on what a fit assumes and does not show."""
    notes = ["scales rest on standard gravity: local gravity differs by up to 0.3 %"]
    if MISALIGNMENTS[0] not in coefficients:
        notes.append("too few different poses for the misalignments: taken as zero")
    blind = [
        name
        for name, c in coefficients.items()
        if c.interval
        and c.interval[1] - c.interval[0]
        > 2.0 * MAX_HALF_WIDTH * (STANDARD_GRAVITY if c.unit != "1" else 1.0)
    ]
    if blind:
        notes.append(f"hardly visible in these poses: {', '.join(blind)}; add poses about other axes")
    if misfit > 2.0:
        notes.append(
            f"the poses scatter {misfit:.3g} times more than their noise explains: intervals are widened by it"
        )
    return notes


def _matrix(x: FloatArray) -> FloatArray:
    """Return A of a vector of parameters."""
    a = np.diag(1.0 + x[3:6])
    if len(x) > 6:
        a[1, 0], a[2, 0], a[2, 1] = x[6:]
    return a


def _start(force: FloatArray, gravity: float, size: int) -> FloatArray:
    """Return parameters of the sphere through the means, by linear least squares."""
    design = np.column_stack((2.0 * force, np.ones(len(force))))
    solution = np.linalg.lstsq(design, np.sum(force**2, axis=1), rcond=None)[0]
    centre = solution[:3]
    radius = float(np.sqrt(max(solution[3] + centre @ centre, 0.25 * gravity**2)))
    start = np.zeros(size)
    start[:3], start[3:6] = centre, radius / gravity - 1.0
    return start
