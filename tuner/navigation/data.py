"""What a filter is fed: inertial steps of any length, and satellite fixes at the ends of steps.

A fix that falls inside a sampling interval splits its increments in proportion, so that the filter stands at
the very instant of every fix.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.arrays import FloatArray, IntArray
from models.strapdown import NavigationState

TIME_TOLERANCE = 1e-6
"""A fix this close to the end of a step, s, counts as there."""


@dataclass(frozen=True)
class Steps:
    """Increments of an inertial unit.

    Attributes
    ----------
    start : float
        Time at which the first step begins, s.
    dt : ndarray, shape (n,)
        Lengths, s.
    increments : ndarray, shape (n, 6)
        ∫ω dt, rad, and ∫f dt, m/s, in b, as measured.
    """

    start: float
    dt: FloatArray
    increments: FloatArray

    def ends(self) -> FloatArray:
        """Return the times at which steps begin or end, shape (n + 1,), s."""
        return self.start + np.concatenate([[0.0], np.cumsum(self.dt)])


@dataclass(frozen=True)
class Fixes:
    """Satellite fixes.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time, s.
    after : ndarray of int, shape (k,)
        How many steps are done at each fix; in rising order.
    llh : ndarray, shape (k, 3)
        Latitude, longitude, rad, height, m.
    vel_n : ndarray, shape (k, 3)
        m/s; NaN where there is none, down alone where there are horizontal ones.
    sd : ndarray, shape (k, 6)
        Standard deviations the filter assumes: north, east, down, m, and m/s.
    withheld : ndarray of bool, shape (k,)
        Fixes that are compared with the prediction but not used.
    trusted : ndarray of bool, shape (k,)
        Fixes that are used whatever the gate says, as while a filter settles.
    refused_since : ndarray, shape (2,)
        Since when positions and velocities before these were refused without a pause, s; infinite where they were not.
    """

    t: FloatArray
    after: IntArray
    llh: FloatArray
    vel_n: FloatArray
    sd: FloatArray
    withheld: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    trusted: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    refused_since: FloatArray = field(default_factory=lambda: np.full(2, np.inf))

    def __post_init__(self) -> None:
        for name in ("withheld", "trusted"):
            if len(getattr(self, name)) != len(self.t):
                object.__setattr__(self, name, np.zeros(len(self.t), dtype=bool))

    def __len__(self) -> int:
        return len(self.t)

    def rows(self, which: slice | NDArray[np.intp]) -> Fixes:
        """Return some of the fixes."""
        return Fixes(
            self.t[which],
            self.after[which],
            self.llh[which],
            self.vel_n[which],
            self.sd[which],
            self.withheld[which],
            self.trusted[which],
            self.refused_since,
        )

    def without(self, windows: ArrayLike) -> Fixes:
        """Return the fixes with those in windows (begin, end], s, shape (w, 2), withheld."""
        begin, end = np.asarray(windows, dtype=float).reshape(-1, 2).T
        inside = (self.t[:, None] > begin) & (self.t[:, None] <= end)
        return replace(self, withheld=self.withheld | inside.any(axis=1))


@dataclass(frozen=True)
class Solution:
    """What a filter says at every fix, after it has been used.

    Attributes
    ----------
    t : ndarray, shape (k,)
        s.
    state : NavigationState
        Arrays (k, 3), (k, 3), (k, 4).
    parameters : ndarray, shape (k, n)
        Estimates of all other states; zeros for position, velocity and attitude.
    covariance : ndarray, shape (k, 15, 15)
        Of position, velocity, attitude errors and of the total biases (`settings.total_bias`).
    innovation : ndarray, shape (k, 6)
        Fix minus prediction: position, velocity; 0 where the fix has none, NaN of a component that is missing.
    innovation_covariance : ndarray, shape (k, 6, 6)
        As the filter predicts it.
    use : ndarray of int, shape (k, 2)
        What became of position and velocity: `ABSENT`, `USED`, `GATED` or `WITHHELD`.
    final : NavigationState
        At the end of the steps.
    final_parameters, final_covariance : ndarray, shapes (n,), (n, n)
        At the end of the steps.
    further_covariance : ndarray, shape (k, r, r)
        Of the further states (`settings.further_states`).
    constrained : Constrained or None
        What became of the constraints, where there were any.
    """

    t: FloatArray
    state: NavigationState
    parameters: FloatArray
    covariance: FloatArray
    innovation: FloatArray
    innovation_covariance: FloatArray
    use: NDArray[np.int64]
    final: NavigationState
    final_parameters: FloatArray
    final_covariance: FloatArray
    further_covariance: FloatArray
    constrained: Constrained | None = None

    def refused_since(self, before: FloatArray) -> FloatArray:
        """Return since when positions and velocities are refused at the end, as `Fixes.refused_since`, (2,)."""
        since = []
        for use, begun in zip(self.use.T, before, strict=True):
            taken = np.flatnonzero((use != ABSENT) & (use != GATED))
            later = int(taken[-1]) + 1 if len(taken) else 0
            refused = self.t[later:][use[later:] == GATED]
            since.append(min([np.inf if len(taken) else begun, *refused[:1]]))
        return np.array(since)


ABSENT, USED, GATED, WITHHELD = 0, 1, 2, 3
NON_HOLONOMIC, ZERO_VELOCITY, ZERO_RATE = 1, 2, 3


@dataclass(frozen=True)
class Constraints:
    """What is known of a vehicle at the ends of steps, without any receiver.

    Attributes
    ----------
    t : ndarray, shape (c,)
        Time, s.
    after : ndarray of int, shape (c,)
        How many steps are done at each; in rising order.
    kind : ndarray of int, shape (c,)
        `NON_HOLONOMIC`: wheels do not slip sideways; `ZERO_VELOCITY`, `ZERO_RATE`: it stands.
    sd : ndarray, shape (c,)
        How far from zero, m/s, or rad/s of a rate.
    rates : ndarray, shape (c, 6)
        Mean angular rates and specific forces as measured: over the still time, or at the instant.
    mat_bv : ndarray, shape (3, 3)
        Rotates vehicle axes into b; a `mounting` state turns it.
    slip : tuple of 3 floats
        From the inertial unit to the point that does not slip, in b, m.
    """

    t: FloatArray
    after: IntArray
    kind: IntArray
    sd: FloatArray
    rates: FloatArray
    mat_bv: FloatArray
    slip: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True)
class Constrained:
    """What became of constraints.

    Attributes
    ----------
    kind : ndarray of int, shape (c,)
        As given.
    use : ndarray of int, shape (c,)
        `USED` or `GATED`.
    distance : ndarray, shape (c,)
        zᵀ S⁻¹ z, ideally 2 for `NON_HOLONOMIC` and 3 for the others.
    """

    kind: IntArray
    use: IntArray
    distance: FloatArray


def split_at(steps: Steps, times: ArrayLike) -> tuple[Steps, IntArray]:
    """Split steps so that every time ends one.

    Parameters
    ----------
    steps : Steps
        Increments.
    times : array_like, shape (k,)
        Rising, s, within the steps.

    Returns
    -------
    Steps
        With split steps in place of those that hold a time.
    after : ndarray of int, shape (k,)
        How many of them are done at each time.
    """
    times, ends = np.asarray(times, dtype=float), steps.ends()
    if len(times) and not (times[0] >= ends[0] - TIME_TOLERANCE and times[-1] <= ends[-1] + TIME_TOLERANCE):
        raise ValueError(f"'times' must lie within {ends[0]} … {ends[-1]} s, got {times[0]} … {times[-1]}")
    nearest = np.clip(np.searchsorted(ends, times), 0, len(ends) - 1)
    before = np.maximum(nearest - 1, 0)
    nearest = np.where(np.abs(ends[before] - times) < np.abs(ends[nearest] - times), before, nearest)
    inside = np.unique(times[np.abs(ends[nearest] - times) > TIME_TOLERANCE])
    knots = np.union1d(ends, inside)
    parent = np.clip(np.searchsorted(ends, 0.5 * (knots[1:] + knots[:-1])) - 1, 0, len(steps.dt) - 1)
    dt = np.diff(knots)
    split = Steps(steps.start, dt, steps.increments[parent] * (dt / steps.dt[parent])[:, None])
    after = np.searchsorted(
        knots, np.where(np.abs(ends[nearest] - times) > TIME_TOLERANCE, times, ends[nearest])
    )
    return split, after.astype(np.int64)
