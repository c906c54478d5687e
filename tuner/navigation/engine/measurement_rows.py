"""Fixes and constraints as the rows of the compiled filter, in the order in which it meets them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray, IntArray
from models.strapdown import NavigationState
from tuner.navigation.data import Constrained, Constraints, Fixes, Solution
from tuner.navigation.engine.layout import (
    CONSTRAINT_CODE,
    CONSTRAINT_LENGTH,
    KIND_COLUMN,
    LIMIT_COLUMN,
    MOUNTING_COLUMNS,
    RATE_COLUMNS,
    SLIP_COLUMNS,
    STATE_COLUMN,
)
from tuner.navigation.settings import FilterSettings, chi2_gate
from tuner.types.records import velocity_known

Scalar = TypeVar("Scalar", np.float64, np.int64, np.bool_)


class Measurements(NamedTuple):
    """Fixes and constraints in the order in which the filter takes them, k rows; see `fixes.FixBatch`."""

    t: FloatArray  # (k,), s
    after: IntArray  # (k,)
    values: FloatArray  # (k, 6), or (k, CONSTRAINT_LENGTH) where there are constraints
    sd: FloatArray  # (k, 6)
    available: IntArray  # (k,)
    withheld: NDArray[np.bool_]  # (k,)
    trusted: NDArray[np.bool_]  # (k,)


def measurements(settings: FilterSettings, fixes: Fixes, constraints: Constraints | None) -> Measurements:
    """Return fixes, and constraints after those of the same instant."""
    velocity = velocity_known(fixes.vel_n)
    values = np.concatenate([fixes.llh, np.where(velocity[:, None], fixes.vel_n, 0.0)], axis=1)
    sd = np.where(np.isfinite(fixes.sd), fixes.sd, 0.0)
    sd = np.ascontiguousarray(np.where(np.isfinite(values), sd, 1.0))
    available = 1 + velocity.astype(np.int64)
    t = np.ascontiguousarray(fixes.t, dtype=float)
    if constraints is None:
        return Measurements(t, fixes.after, values, sd, available, fixes.withheld, fixes.trusted)
    count = len(constraints)
    rows, none = np.zeros((count, CONSTRAINT_LENGTH)), np.zeros(count, dtype=bool)
    rows[:, KIND_COLUMN] = constraints.kind
    rows[:, RATE_COLUMNS:SLIP_COLUMNS] = constraints.rates
    rows[:, SLIP_COLUMNS:MOUNTING_COLUMNS] = constraints.slip
    rows[:, MOUNTING_COLUMNS:STATE_COLUMN] = constraints.mat_bv.ravel()
    rows[:, STATE_COLUMN] = settings.model.layout.start("mounting")
    rows[:, LIMIT_COLUMN] = chi2_gate(settings.gate, 3)
    order = np.argsort(np.concatenate([fixes.after, constraints.after]), kind="stable")

    def merged(first: NDArray[Scalar], second: NDArray[Scalar]) -> NDArray[Scalar]:
        return np.ascontiguousarray(np.concatenate([first, second])[order])

    return Measurements(
        merged(t, constraints.t),
        merged(fixes.after, constraints.after),
        merged(np.pad(values, ((0, 0), (0, CONSTRAINT_LENGTH - 6))), rows),
        merged(sd, np.tile(constraints.sd[:, None], (1, 6))),
        merged(available, np.full(count, CONSTRAINT_CODE, dtype=np.int64)),
        merged(fixes.withheld, none),
        merged(fixes.trusted, none),
    )


def parted(solution: Solution, fixes: Fixes, constraints: Constraints | None) -> Solution:
    """Return the solution at the fixes alone, with the use of the constraints beside it."""
    if constraints is None:
        return solution
    k = len(fixes)
    order = np.argsort(np.concatenate([fixes.after, constraints.after]), kind="stable")
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    own, others = place[:k], solution.innovation[place[k:]]
    state = solution.state
    return replace(
        solution,
        t=fixes.t,
        state=NavigationState(state.llh[own], state.vel_n[own], state.quat_nb[own]),
        parameters=solution.parameters[own],
        covariance=solution.covariance[own],
        further_covariance=solution.further_covariance[own],
        innovation=solution.innovation[own],
        innovation_covariance=solution.innovation_covariance[own],
        use=solution.use[own],
        constrained=Constrained(constraints.kind, others[:, 3].astype(np.int64), others[:, 4].copy()),
    )
