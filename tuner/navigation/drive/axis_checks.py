"""Checks of the axes of a drive: velocities, positions, gyros and accelerometers read in another order or sign.

Differences of positions show in which order and with which signs velocities are given, and whether latitude and
longitude are exchanged. An alignment (`alignment`) with the gyros and the accelerometers read in each of the 2 · 48
ways that differ by more than a rotation of both shows which reading agrees with the fixes: a rotation of both is the
mounting, which an alignment determines by itself.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np

from models.arrays import FloatArray
from tuner.formats.customary_units import percent
from tuner.navigation.data import Steps
from tuner.navigation.drive.alignment import FIRST_MOTION, Alignment, align_once
from tuner.navigation.drive.mean_velocities import mean_velocities
from tuner.types.records import DataError, Drive, Gnss

AXES = {
    "north-east-up": ((0, 1, 2), (1.0, 1.0, -1.0)),
    "east-north-up": ((1, 0, 2), (1.0, 1.0, -1.0)),
    "east-north-down": ((1, 0, 2), (1.0, 1.0, 1.0)),
}
"""Ways in which velocities may be given instead of north, east, down: order and signs that correct them."""
MIN_WINDOWS = 10
"""Windows that the comparison of velocities needs."""
MAX_MISFIT_SHARE = 0.25
"""Share of the misfit that another reading of velocities and positions must leave at most."""
MAX_INERTIAL_MISFIT_SHARE = 0.5
"""Share of the rms misfit of an alignment that another reading of the inertial axes must leave at most."""
EQUAL_MISFIT_RATIO = 1.1
"""Ratio of misfits within which the reading that changes least is chosen."""
BIAS_SD = np.array([0.01] * 3 + [0.05] * 3)
"""Prior sds of biases, rad/s and m/s²: those of cheap sensors."""
MAX_READINGS = 16
"""Readings that are aligned from several biases, the best of all by one: a sixth, where one in 48 is right."""
SUMMED_STEP = 0.1
"""Increments are summed to this length before all readings are tried, s: in it a vehicle turns by far less than the
right angle by which readings differ."""


def with_axes_found(gnss: Gnss, source: str) -> tuple[Gnss, str | None]:
    """Return the fixes with velocities north, east, down, and what they were where that was not so.

    Differences of positions are compared with the velocities in every order; another order counts where it
    leaves less than a quarter of the misfit. On flat ground the vertical says little beside the others: its sign
    alone counts where it leaves less than half of the misfit of the vertical.

    Raises
    ------
    DataError
        Where positions fit only with latitude and longitude exchanged.
    """
    means = mean_velocities(gnss)
    if len(means) < MIN_WINDOWS:
        return gnss, None
    slope, mean = means.by_position, means.by_velocity

    def misfit(vel: FloatArray, parts: slice = slice(0, 3), by: FloatArray = slope) -> float:
        return float(np.mean(np.abs(vel - by)[:, parts]))

    order = {name: mean[:, list(which)] * np.array(sign) for name, (which, sign) in AXES.items()}
    name = min(order, key=lambda key: misfit(order[key]))
    least = min(misfit(order[name]), misfit(mean))
    if np.all(np.abs(gnss.llh[:, 1]) < np.pi / 2.0):
        other = mean_velocities(replace(gnss, llh=gnss.llh[:, [1, 0, 2]])).by_position
        rotated = min(misfit(vel, by=other) for vel in (mean, *order.values()))
        if rotated < MAX_MISFIT_SHARE * least:
            raise DataError(
                f"{source}: expected positions as latitude, longitude, height, got latitude and longitude exchanged: "
                f"only so do differences of positions agree with the velocities (to {rotated:.2g} instead of "
                f"{least:.2g} m/s); exchange the two columns"
            )
    if misfit(order[name]) > MAX_MISFIT_SHARE * misfit(mean):
        name, down = "north-east-up", slice(2, 3)
        if misfit(order[name], down) > 0.5 * misfit(mean, down):
            return gnss, None
    which, sign = AXES[name]
    return replace(gnss, vel_n=gnss.vel_n[:, list(which)] * np.array(sign)), name


def inertial_axes(drive: Drive) -> str | None:
    """Return how gyros and accelerometers must be read for the fixes to be met, in words; None as they are."""
    dt, gnss = np.diff(drive.imu_t), with_axes_found(drive.gnss, drive.source)[0]
    inside = (gnss.t > drive.imu_t[0]) & (gnss.t < drive.imu_t[-1])
    gnss = gnss.rows(inside)
    few = _summed_steps(Steps(float(drive.imu_t[0]), dt, drive.rates[1:] * dt[:, None]))
    stated = _misfit(few, gnss, np.eye(3), np.eye(3))
    screened = sorted(_readings(), key=lambda one: _misfit(few, gnss, *one, other_starts=False))
    ways = [(g, a, _misfit(few, gnss, g, a)) for g, a in screened[:MAX_READINGS]]
    least = min(misfit for _, _, misfit in ways)
    if least >= MAX_INERTIAL_MISFIT_SHARE * stated:  # both are infinite where nothing can be aligned
        return None
    alike = [_simplest(g, a) for g, a, misfit in ways if misfit < EQUAL_MISFIT_RATIO * least]
    gyro, accel = min(alike, key=lambda reading: _change_counts(*reading))
    readings = [
        f"the {what} read as {_triple_text(m)}"
        for what, m in (("gyros", gyro), ("accelerometers", accel))
        if _is_changed(m)
    ]
    return (
        f"the fixes agree only with {' and '.join(readings)} instead of (x, y, z): the misfit of the speed changes is "
        f"{percent(least / stated)} of the one as stated; correct the columns"
    )


def refuse_wrong_axes(drive: Drive) -> None:
    """Refuse a drive whose fixes are met only with its sensors read otherwise.

    Raises
    ------
    DataError
        With the order and the signs.
    """
    wrong = inertial_axes(drive)
    if wrong is not None:
        raise DataError(f"{drive.source or drive.name}: {wrong}")


def _readings() -> list[tuple[FloatArray, FloatArray]]:
    """Return matrices for gyros and accelerometers that differ by more than a common rotation; 96 pairs."""
    return [
        (gyro, accel) for accel in (np.eye(3), np.diag([1.0, 1.0, -1.0])) for gyro in _signed_permutations()
    ]


def _signed_permutations() -> list[FloatArray]:
    """Return the 48 signed permutations of three axes."""
    return [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]


def _simplest(gyro: FloatArray, accel: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the reading, up to a common rotation, that changes the fewest axes."""
    rotated = [(r @ gyro, r @ accel) for r in _signed_permutations() if np.linalg.det(r) > 0.0]
    return min(rotated, key=lambda reading: _change_counts(*reading))


def _change_counts(gyro: FloatArray, accel: FloatArray) -> tuple[int, int]:
    """Return how many sensors are changed, and how many axes."""
    return int(_is_changed(gyro)) + int(_is_changed(accel)), int(
        np.sum(np.diag(gyro) < 0.5) + np.sum(np.diag(accel) < 0.5)
    )


def _is_changed(mat: FloatArray) -> bool:
    return bool(np.any(np.diag(mat) < 0.5))


def _triple_text(mat: FloatArray) -> str:
    """Return a signed permutation as a triple: (y, −x, z)."""
    which = np.argmax(np.abs(mat), axis=1)
    return (
        f"({', '.join(('' if row[k] > 0.0 else '−') + 'xyz'[k] for row, k in zip(mat, which, strict=True))})"
    )


def _misfit(
    steps: Steps, gnss: Gnss, gyro: FloatArray, accel: FloatArray, *, other_starts: bool = True
) -> float:
    """Return what an alignment leaves of the changes of velocity with the sensors read so, as an angle, rad."""
    read = np.hstack([steps.increments[:, :3] @ gyro.T, steps.increments[:, 3:] @ accel.T])
    found: Alignment | None = align_once(
        replace(steps, increments=read), gnss, 2.0 * FIRST_MOTION, bias_sd=BIAS_SD, other_starts=other_starts
    )
    return float("inf") if found is None else found.tilt_sd


def _summed_steps(steps: Steps) -> Steps:
    """Return increments summed over some steps each."""
    many = max(1, round(SUMMED_STEP / float(np.median(steps.dt))))
    edges = np.arange(0, len(steps.dt), many)
    return Steps(
        steps.start, np.add.reduceat(steps.dt, edges), np.add.reduceat(steps.increments, edges, axis=0)
    )
