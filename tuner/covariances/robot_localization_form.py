"""robot_localization's filter, and the settings with which it predicts best the errors of the streams of a recording.

Its fifteen states (`STATES`) have no place for errors that last. Velocity, rate and acceleration are in axes of the
body, and stay as they are but for the process noise::

    place' = C v       angles' = E ω       v' = a       ω' = 0       a' = 0

Around the course of a recording the filter is linear, so that what it predicts, P, and what it errs, S, are exact:
S is the covariance of its errors together with those of the streams that last, and of the motion that the model does
not have. Settings are those of the best expected log score (`tuner.exporters.judged_drive.Compared`) over position and
velocity with fixes and position after 10 and 60 s without: sds of readings, never below their white errors, and sizes
of the process noise are moved by `STEPS`, in turns. Measured are places, velocities of wheels, and rates; accelerations
are not: without states of biases, gravity in a tilt that is off is taken for motion.

T. Moore, D. Stouch, A generalized extended Kalman filter implementation for the Robot Operating System (2014); source
src/ekf.cpp (predict, correct).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from models import rotation
from models.arrays import FloatArray
from tuner.covariances.streams import StreamErrors
from tuner.diagnosis.drive.hypothesis import FilterRun
from tuner.exporters.judged_drive import PARTS, SCORED, Compared
from tuner.types import Coefficient
from tuner.types.records import Drive

STATES = (
    "x",
    "y",
    "z",
    "roll",
    "pitch",
    "yaw",
    "vx",
    "vy",
    "vz",
    "vroll",
    "vpitch",
    "vyaw",
    "ax",
    "ay",
    "az",
)
PLACE, ANGLES, SPEED, RATE, FORCE = (slice(3 * i, 3 * i + 3) for i in range(5))
FILTER_STEP = 0.1
"""Step of the filter here, s: readings that come faster count by their density."""
STEPS = (4.0, 2.0, 1.41)
"""Factors by which settings are moved, a pass each."""
SETTLED_SHARE = 0.2
"""Share of the course in which the filter settles."""
PERIODS: Mapping[float, float] = {10.0: 30.0, 60.0: 120.0}
"""Times without fixes, s, and the time from one to the next."""
WITHHELD_VARIANCE = 1e12
"""Variance of a fix that is withheld, m²."""
START = np.repeat([1.0, 0.05, 0.5, 0.05, 0.5], 3)
"""Sds with which the filter starts: m, rad, m/s, rad/s, m/s²."""
DENSITIES = "place", "angles", "speed", "rate", "force"
"""Groups of three states, each with one process noise: m²/s, rad²/s, (m/s)²/s, (rad/s)²/s, (m/s²)²/s.

Errors that last of wheels and rates are, beyond their time, white noise of places and angles; motion changes rates and
accelerations.
"""
ROWS: Mapping[str, tuple[int, ...]] = {
    "gyro": (9, 10, 11),
    "wheels forward": (6,),
    "wheels sideways": (7,),
    "wheels across": (7, 8),
    "fixes horizontal": (0, 1),
    "fixes vertical": (2,),
}
"""States that each stream measures."""


@dataclass(frozen=True)
class Course:
    """The motion of a recording in steps of `FILTER_STEP`, as the filter sees it: (n, 15, 15), (n, 15)."""

    transition: FloatArray
    change: FloatArray


@dataclass(frozen=True)
class Settings:
    """Sds of readings by the keys of `ROWS`; roots of densities of the process noise by those of `DENSITIES`."""

    sds: Mapping[str, float]
    roots: Mapping[str, float]

    @property
    def process_noise(self) -> FloatArray:
        """The diagonal of ``process_noise_covariance``: of a second."""
        return np.repeat([self.roots[name] ** 2 for name in DENSITIES], 3)

    def moved(self, name: str, factor: float) -> Settings:
        """Return the settings with one sd, or root of a density, times a factor."""
        sds, roots = (
            {one: value * (factor if one == name else 1.0) for one, value in own.items()}
            for own in (self.sds, self.roots)
        )
        return Settings(sds, roots)


def course_of(drive: Drive, run: FilterRun) -> Course:
    """Return the motion of a recording, of a run in the axes of the sensor."""
    mounting = drive.sensor_from_vehicle
    solution = max(run.solutions, key=lambda one: len(one.t))
    t = np.arange(solution.t[0], solution.t[-1], FILTER_STEP)
    angles = np.unwrap(
        rotation.rpy_from_mat(rotation.mat_from_quat(solution.state.quat_nb) @ mounting), axis=0
    )
    rpy = np.column_stack([np.interp(t, solution.t, one) for one in angles.T])
    mat = rotation.mat_from_rpy(rpy)
    v = np.einsum("nji,nj->ni", mat, CubicSpline(solution.t, solution.state.vel_n)(t))
    whole = np.cumsum(drive.rates[:, :3] @ mounting * np.diff(drive.imu_t, prepend=0.0)[:, None], axis=0)
    turned = np.column_stack([np.interp(t, drive.imu_t, one) for one in whole.T])
    rate, force = np.gradient(turned, FILTER_STEP, axis=0), np.gradient(v, FILTER_STEP, axis=0)
    eye, n = np.eye(3), len(t)

    def slopes(at: FloatArray) -> FloatArray:
        return np.linalg.inv(
            np.stack([rotation.rate_from_rpy(at, np.broadcast_to(e, at.shape)) for e in eye], -1)
        )

    e = slopes(rpy)
    f = np.tile(np.eye(15), (n, 1, 1))
    f[:, PLACE, SPEED], f[:, PLACE, FORCE] = FILTER_STEP * mat, 0.5 * FILTER_STEP**2 * mat
    f[:, PLACE, ANGLES] = (
        -FILTER_STEP * rotation.skew(np.einsum("nij,nj->ni", mat, v)) @ mat @ np.linalg.inv(e)
    )
    f[:, ANGLES, RATE], f[:, SPEED, FORCE] = FILTER_STEP * e, FILTER_STEP * eye
    for i in range(3):
        by_angle = (slopes(rpy + 1e-6 * eye[i]) - e) / 1e-6
        f[:, ANGLES, 3 + i] += FILTER_STEP * np.einsum("nij,nj->ni", by_angle, rate)
    change = np.zeros((n, 15))
    change[:-1, RATE], change[:-1, FORCE] = np.diff(rate, axis=0), np.diff(force, axis=0)
    return Course(f, change)


def predicted(
    course: Course, errors: Mapping[str, StreamErrors], tried: Sequence[Settings]
) -> list[tuple[Compared, ...]]:
    """Return what the filter predicts and errs with each of some settings, by the times without fixes of `SCORED`."""
    n, names = len(course.change), [name for name in ROWS if name in errors]
    rows = [(name, row) for name in names for row in ROWS[name]]
    own, many = [row for _, row in rows], len(rows)
    parts = [errors[name] for name, _ in rows]
    lasting, white = np.array([(_size(one.lasting), _size(one.white)) for one in parts]).T
    times = np.array([np.inf if one.time is None else one.time.value or np.inf for one in parts])
    every = np.array([max(1, round(one.interval / FILTER_STEP)) for one in parts])
    dense = np.array([min(1.0, one.interval / FILTER_STEP) for one in parts])
    keep = np.exp(-FILTER_STEP / times)
    first = int(SETTLED_SHARE * n)
    out_of = np.zeros((len(SCORED), n), dtype=bool)
    for i, seconds in enumerate(SCORED):
        if seconds:
            since = (np.arange(n) - first) % round(PERIODS[seconds] / FILTER_STEP)
            out_of[i] = (np.arange(n) >= first) & (since >= round((PERIODS[seconds] - seconds) / FILTER_STEP))
    b = len(tried) * len(SCORED)
    hidden = np.tile(out_of, (len(tried), 1))
    assumed = np.repeat([[one.sds[name] ** 2 for name, _ in rows] for one in tried], len(SCORED), axis=0)
    noise = np.repeat([one.process_noise * FILTER_STEP for one in tried], len(SCORED), axis=0)[
        :, :, None
    ] * np.eye(15)
    fix = np.array([name.startswith("fixes") for name, _ in rows])
    p = np.tile(np.diag(START**2), (b, 1, 1))
    s = np.zeros((b, 15 + many, 15 + many))
    s[:, :15, :15], s[:, range(15, 15 + many), range(15, 15 + many)] = p, lasting**2
    mean, kept = np.zeros((b, 15)), []
    fresh = np.zeros((15 + many, 15 + many))
    fresh[range(15, 15 + many), range(15, 15 + many)] = lasting**2 * (1.0 - keep**2)
    move = np.zeros((b, 15 + many, 15 + many))
    move[:, range(15, 15 + many), range(15, 15 + many)] = keep
    for k in range(n):
        f, now = course.transition[k], np.flatnonzero(k % every == 0)
        at = [own[j] for j in now]
        p = f @ p @ f.T + noise
        r = (assumed * dense)[:, now] + WITHHELD_VARIANCE * (hidden[:, k, None] & fix[now])
        cross = p[:, :, at]
        gain = np.linalg.solve(cross[:, at] + r[:, :, None] * np.eye(len(at)), cross.swapaxes(1, 2))
        gain = gain.swapaxes(1, 2)
        rest = np.tile(np.eye(15), (b, 1, 1))
        rest[:, :, at] -= gain
        p = rest @ p @ rest.swapaxes(1, 2) + (gain * r[:, None]) @ gain.swapaxes(1, 2)
        move[:, :15, :15], move[:, :15, 15:] = rest @ f, 0.0
        move[:, :15, 15 + now] = gain * keep[now]
        s = move @ s @ move.swapaxes(1, 2) + fresh
        s[:, :15, :15] += (gain * (white**2 * dense)[now]) @ gain.swapaxes(1, 2)
        mean = (rest @ (mean @ f.T - course.change[k])[:, :, None])[:, :, 0]
        if k >= first:
            ends = out_of[:, k] & ~np.append(out_of, np.zeros((len(out_of), 1), dtype=bool), 1)[:, k + 1]
            ends[0] = k % round(1.0 / FILTER_STEP) == 0
            if ends.any():
                kept.append((ends, mean, np.einsum("bii->bi", s)[:, :15], p))
    return [_of_settings(kept, i * len(SCORED)) for i in range(len(tried))]


def _of_settings(kept: Sequence[tuple[FloatArray, ...]], base: int) -> tuple[Compared, ...]:
    out = []
    for i, seconds in enumerate(SCORED):
        own = [0, 1, 2] if seconds else [0, 1, 2, 6, 7, 8]
        there = [tuple(x[base + i] for x in one[1:]) for one in kept if one[0][i]]
        if there:
            mean, spread, p = (np.stack(x) for x in zip(*there, strict=True))
            square = mean[:, own], spread[:, own], p[:, own][:, :, own]
            out.append(Compared(seconds, *square, (1,) * len(there)))
    return tuple(out)


def chosen(course: Course, errors: Mapping[str, StreamErrors]) -> tuple[Settings, tuple[Compared, ...]]:
    """Return the settings of the best expected log score, and what the filter then predicts and errs."""
    sds = {
        name: float(one.size.value or one.size.upper or 0.0) for name, one in errors.items() if name in ROWS
    }
    rate, force = (float(np.sqrt(np.mean(course.change[:, own] ** 2) / FILTER_STEP)) for own in (RATE, FORCE))
    place, angles = (_spread(errors.get(name)) for name in ("wheels forward", "gyro"))
    place, angles = max(place, FILTER_STEP**2 * force), max(angles, FILTER_STEP * rate)
    best = Settings(sds, dict(zip(DENSITIES, (place, angles, FILTER_STEP * force, rate, force), strict=True)))

    def cost(found: Sequence[Compared]) -> float:
        return sum(one.cost(part) for one in found for part in PARTS)

    for step in STEPS:
        for name in (*sds, *(one for one in DENSITIES if one != "speed")):
            tried = [best, best.moved(name, step)]
            if name not in sds or best.sds[name] > step * _size(errors[name].white):
                tried.append(best.moved(name, 1.0 / step))
            costs = [cost(found) for found in predicted(course, errors, tried)]
            best = tried[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
    return best, predicted(course, errors, [best])[0]


def _spread(one: StreamErrors | None) -> float:
    """Return the root of the density, as white noise, of an error that lasts, within the times that are scored."""
    if one is None:
        return 0.0
    time = math.inf if one.time is None or one.time.value is None else one.time.value
    return _size(one.lasting) * math.sqrt(2.0 * min(time, SCORED[-1]))


def _size(one: Coefficient) -> float:
    """Return a value, else half of its limit."""
    return one.value if one.value is not None else 0.5 * (one.upper or 0.0)
