"""Whether the readable filter and the compiled one give the same answers on the same simulated runs."""

from __future__ import annotations

import numpy as np

from models.arrays import FloatArray
from models.error_state import navigation_error
from tuner.consistency.observability import physical_states
from tuner.navigation import engine
from tuner.navigation.data import Solution
from tuner.navigation.settings import FilterSettings
from tuner.simulation.imu import Sensor
from tuner.simulation.monte_carlo import solutions_by
from tuner.simulation.scenario import Scenario
from tuner.types.consistency import EngineComparison
from tuner.types.records import DataError

COMPARED_STEPS = 400_000
"""Samples that filterpy gets: half a minute at 12 000 a second; one run of an hour at 100 Hz fits in."""


def compare_engines(
    settings: FilterSettings, sensor: Sensor, plan: Scenario, *, runs: int, seed: int
) -> EngineComparison:
    """Filter the first simulated runs in both engines and return where they differ most.

    Parameters
    ----------
    settings, sensor, plan, runs, seed
        As of `simulation.monte_carlo.simulate`. As many of the runs are compared as have together no more than
        `COMPARED_STEPS` samples, but one in any case.

    Raises
    ------
    DataError
        Where the compiled filter cannot be loaded: there is nothing to compare with.
    """
    if not engine.is_compiled():
        raise DataError(
            "engine: expected numba, which compiles the filter to compare with; it cannot be loaded"
        )
    from tuner.navigation import reference_filter as readable  # loaded when used: filterpy is slow to import

    some = max(1, min(runs, COMPARED_STEPS // len(plan.steps.dt)))
    first, second = (
        solutions_by(filtered, settings, sensor, plan, runs=some, seed=seed)
        for filtered in (readable.run, engine.run)
    )
    names, m = physical_states(settings)
    apart = np.array([_apart(*both, m[9:]) for both in zip(first, second, strict=True)])
    run, fix, kind, state = np.unravel_index(np.argmax(apart), apart.shape)
    return EngineComparison(
        some,
        runs,
        float(apart[run, fix, kind, state]),
        ("", "sd of ")[kind] + names[state],
        int(run) + 1,
        float(plan.times[fix]),
    )


def _apart(one: Solution, other: Solution, m: FloatArray) -> FloatArray:
    """Return |difference| ÷ sd of `one` at k fixes: of the estimates, of their sds; shape (k, 2, 15 + r).

    `m`, shape (6 + r, n), takes the states to total biases and further states. NaN where a variance is negative.
    """
    estimates = np.hstack(
        [navigation_error(one.state, other.state), (one.parameters - other.parameters) @ m.T]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        sd, others = (
            np.sqrt(
                np.hstack([np.diagonal(p, axis1=1, axis2=2) for p in (s.covariance, s.further_covariance)])
            )
            for s in (one, other)
        )
        change = np.abs(np.stack([estimates, others - sd], axis=1))
        return np.asarray(np.divide(change, sd[:, None], out=np.zeros_like(change), where=change != 0.0))
