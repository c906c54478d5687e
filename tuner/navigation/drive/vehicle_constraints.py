"""Motion constraints of a vehicle from a drive: zero velocity while stationary, no sideways velocity of its wheels.

Stationary seconds are found by the inertial unit alone, so that no fixes are needed: a second counts where every axis
is as calm, and every gyro as near its mean, as in the seconds in which the fixes showed it stationary at the start.
Where it was never stationary there, nothing is assumed. Each constraint still passes the gate of the filter.

A wheeled vehicle does not slip sideways. The errors of that constraint last for seconds, so that it is used once a
second, and not in turns, where the middle of the rear axle, which is unknown, moves otherwise than the unit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import rotation
from models.arrays import FloatArray
from models.robust import normal_sd
from tuner.navigation.data import (
    GATED,
    NON_HOLONOMIC,
    USED,
    ZERO_RATE,
    ZERO_VELOCITY,
    Constraints,
    Solution,
    Steps,
)
from tuner.navigation.drive.alignment import Alignment
from tuner.navigation.drive.run import Stretch
from tuner.navigation.settings import FilterSettings

WINDOW_DURATION = 1.0
"""Length of the windows, s."""
MIN_WINDOWS = 5
"""Stationary windows that a comparison needs."""
MAX_SCATTER_RATIO = 1.5
"""Scatter of a calm window relative to the largest one of the stationary windows."""
MAX_SCATTERS, MAX_RATE_DRIFT = 4.0, np.radians(0.3)
"""Distance of mean rates from those at rest, in scatters, and a drift that is allowed besides, rad/s."""
MAX_TURN_RATE = np.radians(3.0)
"""Turn rate from which sideways velocity is not constrained, rad/s."""
MIN_SPEED = 3.0
"""Speed from which the direction of motion determines the mounting, m/s."""
MAX_MOUNTING_ERROR = np.radians(45.0)
"""Angle between the axes of the motion and the stated ones from which the stated mounting is not used, rad."""
MOUNTING_SD = np.radians(10.0)
"""Prior of the mounting angles, rad."""


@dataclass(frozen=True)
class Vehicle:
    """What may be assumed: sd of sideways and vertical velocity, and of velocity while standing, m/s, or None."""

    sideways: float | None = None
    standing: float | None = None

    @property
    def free(self) -> bool:
        """Whether nothing is assumed."""
        return self.sideways is None and self.standing is None


@dataclass(frozen=True)
class ConstraintCount:
    """Constraints of one kind: used, refused by the gate, rms of those used ÷ predicted sd."""

    used: int
    refused: int
    ratio: float


MAX_CRAB_ANGLE = math.radians(25.0)
"""Angle between motion and axis up to which a vehicle moves along the axis: boats in a wind crab so much, cars less."""
MIN_SHARE_ALONG = 2.0 / 3.0
"""Share of the time in motion in which it must move so: cars reverse at times, multicopters move to all sides."""
KINDS = (
    ("non-holonomic", NON_HOLONOMIC, 2),
    ("zero velocity", ZERO_VELOCITY, 3),
    ("zero rate", ZERO_RATE, 3),
)
"""Names, kinds and components of constraints."""


def forward_axes(solution: Solution) -> FloatArray | None:
    """Return vehicle axes in b (3, 3), from the mean direction of motion and of the vertical.

    None without motion, and where there is no such direction, as of a multicopter.
    """
    speed = np.hypot(*solution.state.vel_n[:, :2].T)
    moving = speed > MIN_SPEED
    if np.count_nonzero(moving) < 10:
        return None
    to_body = np.swapaxes(rotation.mat_from_quat(solution.state.quat_nb[moving]), -1, -2)
    directions = (to_body @ (solution.state.vel_n[moving] / speed[moving, None])[..., None])[..., 0]
    ahead = np.median(directions, axis=0)
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    if np.mean(directions @ ahead > math.cos(MAX_CRAB_ANGLE)) < MIN_SHARE_ALONG:
        return None
    down = np.median(to_body[..., 2], axis=0)
    down -= (down @ ahead) * ahead
    down /= np.linalg.norm(down)
    return np.stack([ahead, np.cross(down, ahead), down], axis=-1)


def turned_from(solution: Solution) -> str | None:
    """Return a note where the vehicle moves in other axes than those stated for it; None where it does not."""
    axes = forward_axes(solution)
    if axes is None or np.linalg.norm(rotation.rotvec_from_mat(axes)) < MAX_MOUNTING_ERROR:
        return None
    angles = ", ".join(f"{value:.0f}" for value in np.round(np.degrees(rotation.rpy_from_mat(axes))) + 0.0)
    return (
        f"the vehicle moves as if its axes were turned by {angles}° (roll, pitch, yaw) from those stated: check "
        "the frame of the unit, the mounting and the lever arm"
    )


def constraints(
    vehicle: Vehicle, steps: Steps, alignment: Alignment, settings: FilterSettings, mat_bv: FloatArray
) -> Constraints:
    """Return what holds along a stretch.

    Parameters
    ----------
    vehicle : Vehicle
        What is assumed.
    steps : Steps
        Increments in b.
    alignment : Alignment
        When it stood at the start.
    settings : FilterSettings
        For the noise of mean rates.
    mat_bv : ndarray, shape (3, 3)
        Vehicle axes in b.
    """
    ends = steps.ends()
    edges = np.searchsorted(ends, np.arange(ends[0], ends[-1], WINDOW_DURATION) + 1e-9)
    first, last = edges[:-1], edges[1:]
    full = last - first > 2
    first, last = first[full], last[full]
    rates = steps.increments / steps.dt[:, None]
    count = (last - first)[:, None]
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(rates, axis=0)])
    square = np.concatenate([np.zeros((1, 6)), np.cumsum((rates - rates.mean(axis=0)) ** 2, axis=0)])
    mean = (total[last] - total[first]) / count
    scatter = np.sqrt(
        np.maximum((square[last] - square[first]) / count - (mean - rates.mean(axis=0)) ** 2, 0.0)
    )
    t = ends[last]
    kinds: list[tuple[NDArray[np.bool_], int, float]] = []
    stood = (t > alignment.t + WINDOW_DURATION) & (t < alignment.t + alignment.still)
    still = np.zeros(len(t), dtype=bool)
    if np.count_nonzero(stood) >= MIN_WINDOWS:
        spread = mean[stood, :3].std(axis=0)
        off = np.abs(mean[:, :3] - np.median(mean[stood, :3], axis=0))
        still = (scatter < MAX_SCATTER_RATIO * scatter[stood].max(axis=0)).all(axis=1)
        still &= (off < np.maximum(MAX_SCATTERS * spread, MAX_RATE_DRIFT)).all(axis=1)
        if vehicle.standing is not None:
            noise = np.hypot(settings.model.gyro_density.max() / np.sqrt(WINDOW_DURATION), spread.max())
            kinds += [(still, ZERO_VELOCITY, vehicle.standing), (still, ZERO_RATE, float(noise))]
    if vehicle.sideways is not None:
        straight = (np.abs(mean[:, :3]) < MAX_TURN_RATE).all(axis=1)
        kinds.append((straight & ~still, NON_HOLONOMIC, vehicle.sideways))
    where = np.concatenate([np.zeros(0, dtype=np.intp), *(np.flatnonzero(which) for which, _, _ in kinds)])
    kind = np.concatenate([np.zeros(0, dtype=np.int64), *(np.full(int(w.sum()), k) for w, k, _ in kinds)])
    sd = np.concatenate([np.zeros(0), *(np.full(int(w.sum()), s) for w, _, s in kinds)])
    order = np.argsort(where, kind="stable")
    where, kind, sd = where[order], kind[order], sd[order]
    at = last[where].astype(np.int64)
    felt = np.where((kind == NON_HOLONOMIC)[:, None], rates[at - 1], mean[where])
    return Constraints(t[where], at, kind, sd, felt, mat_bv)


def stationary_noise(steps: Steps, alignment: Alignment) -> FloatArray | None:
    """Return the Allan deviations (6,) of rates and forces over a second at rest; None if it was hardly stationary.

    Each is at most what the median of the differences says: seconds in which the vehicle was touched are no noise.
    """
    ends = steps.ends()
    begin, end = alignment.t, alignment.t + alignment.still
    edges = np.searchsorted(ends, np.arange(begin, end, WINDOW_DURATION) + 1e-9)
    if len(edges) < MIN_WINDOWS + 2:
        return None
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(steps.increments, axis=0)])
    mean = np.diff(total[edges], axis=0) / np.diff(ends[edges])[:, None]
    steps_of_mean = np.diff(mean, axis=0)
    rms = np.sqrt(np.mean(steps_of_mean**2, axis=0))
    return np.asarray(np.sqrt(0.5) * np.minimum(rms, normal_sd(steps_of_mean, axis=0)))


def constraint_counts(solutions: Sequence[Solution]) -> dict[str, ConstraintCount]:
    """Return how many constraints of each kind were used and refused; kinds that never applied are left out."""
    found = {}
    for name, kind, dof in KINDS:
        parts = [(c, c.kind == kind) for s in solutions if (c := s.constrained) is not None]
        if parts and sum(int(own.sum()) for _, own in parts):
            use = np.concatenate([c.use[own] for c, own in parts])
            square = np.concatenate([c.distance[own] for c, own in parts])[use == USED]
            ratio = float(np.sqrt(square.mean() / dof)) if len(square) else 0.0
            found[name] = ConstraintCount(int((use == USED).sum()), int((use == GATED).sum()), ratio)
    return found


def with_constraints(
    stretches: tuple[Stretch, ...],
    solutions: Sequence[Solution],
    settings: FilterSettings,
    vehicle: Vehicle,
    *,
    mounted: bool,
) -> tuple[tuple[Stretch, ...], tuple[str, ...]]:
    """Return the stretches with their constraints; an unknown mounting is taken from the motion."""
    notes: list[str] = []
    answers = []
    for stretch, solution in zip(stretches, solutions, strict=True):
        axes = np.eye(3) if mounted else forward_axes(solution)
        own = vehicle
        if axes is None:
            notes.append(
                "the vehicle hardly moved, or to all sides: its mounting is unknown, sideways motion is not constrained"
            )
            own, axes = replace(vehicle, sideways=None), np.eye(3)
        elif not mounted and vehicle.sideways is not None:
            angles = ", ".join(f"{value:.1f}" for value in np.degrees(rotation.rpy_from_mat(axes)))
            notes.append(f"mounting of the unit in the vehicle from its motion: {angles}° (roll, pitch, yaw)")
        found = constraints(own, stretch.steps, stretch.alignment, settings, axes)
        answers.append(replace(stretch, constraints=found if len(found) else None))
    return tuple(answers), tuple(notes)


def constraint_notes(found: Mapping[str, ConstraintCount], vehicle: Vehicle) -> tuple[str, ...]:
    """Return how the constraints were used, in words."""
    notes = [
        f"{name}: {one.used} used, {one.refused} refused by the gate, {one.ratio:.2f} × as large as predicted"
        for name, one in found.items()
    ]
    if vehicle.standing is not None and "zero velocity" not in found:
        notes.append("zero velocity: never, it did not stand long enough at the start to know how that looks")
    return tuple(notes)
