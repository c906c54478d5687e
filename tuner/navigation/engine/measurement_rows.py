"""Fixes and constraints as the rows of the compiled filter, in the order in which it meets them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from models.strapdown import NavigationState
from tuner.navigation.data import Constrained, Constraints, Fixes, Solution
from tuner.navigation.engine.measurement_models import (
    CONSTRAINT,
    KIND,
    LENGTH,
    LIMIT,
    MOUNTING,
    RATES,
    SLIP,
    STATE,
)
from tuner.navigation.settings import FilterSettings, chi2_gate

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Scalar = TypeVar("Scalar", np.float64, np.int64, np.bool_)


class Measurements(NamedTuple):
    """Rows of the compiled filter; see `flight.fly`."""

    t: FloatArray  # (k,), s
    after: IntArray  # (k,)
    values: FloatArray  # (k, 6), or as long as those of `updates` where there are constraints
    sd: FloatArray  # (k, 6)
    available: IntArray  # (k,)
    withheld: NDArray[np.bool_]  # (k,)
    trusted: NDArray[np.bool_]  # (k,)


def measurements(settings: FilterSettings, fixes: Fixes, constraints: Constraints | None) -> Measurements:
    """Return fixes, and constraints after those of the same instant."""
    velocity: NDArray[np.bool_] = np.isfinite(fixes.vel_n.sum(axis=1))
    values = np.concatenate([fixes.llh, np.where(velocity[:, None], fixes.vel_n, 0.0)], axis=1)
    sd = np.ascontiguousarray(np.where(np.isfinite(fixes.sd), fixes.sd, 0.0))
    available = 1 + velocity.astype(np.int64)
    t = np.ascontiguousarray(fixes.t, dtype=float)
    if constraints is None:
        return Measurements(t, fixes.after, values, sd, available, fixes.withheld, fixes.trusted)
    count = len(constraints)
    rows, none = np.zeros((count, LENGTH)), np.zeros(count, dtype=bool)
    rows[:, KIND] = constraints.kind
    rows[:, RATES:SLIP] = constraints.rates
    rows[:, SLIP:MOUNTING] = constraints.slip
    rows[:, MOUNTING:STATE] = constraints.mat_bv.ravel()
    rows[:, STATE] = settings.model.layout.start("mounting")
    rows[:, LIMIT] = chi2_gate(settings.gate, 3)
    order = np.argsort(np.concatenate([fixes.after, constraints.after]), kind="stable")

    def merged(first: NDArray[Scalar], second: NDArray[Scalar]) -> NDArray[Scalar]:
        return np.ascontiguousarray(np.concatenate([first, second])[order])

    return Measurements(
        merged(t, constraints.t),
        merged(fixes.after, constraints.after),
        merged(np.pad(values, ((0, 0), (0, LENGTH - 6))), rows),
        merged(sd, np.tile(constraints.sd[:, None], (1, 6))),
        merged(available, np.full(count, CONSTRAINT, dtype=np.int64)),
        merged(fixes.withheld, none),
        merged(fixes.trusted, none),
    )


def parted(solution: Solution, fixes: Fixes, constraints: Constraints | None) -> Solution:
    """Return the solution at the fixes alone, with what became of the constraints beside it."""
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
        innovation=solution.innovation[own],
        innovation_covariance=solution.innovation_covariance[own],
        use=solution.use[own],
        constrained=Constrained(
            constraints.t, constraints.kind, others[:, 3].astype(np.int64), others[:, 4].copy()
        ),
    )
