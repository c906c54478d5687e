"""How far the position of a filter drifts without fixes: predicted by its own covariance, with and without wheels.

A drive through a city is filtered without errors of sensors and fixes; the covariance of the compiled filter is then
what it predicts for them. Noise, bias states and turn-on constants count; scale factors, misalignments and errors of
the mounting come on top where the configuration has no states for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from tuner.catalogue.trajectories import load_trajectory
from tuner.consistency.error_budget import HORIZONS
from tuner.navigation import engine
from tuner.navigation.data import NON_HOLONOMIC, Constraints, Fixes, Solution, Steps
from tuner.navigation.settings import filter_settings
from tuner.simulation.monte_carlo import scenario_fixes
from tuner.simulation.scenario import FIRST_OUTAGE_TIME, OUTAGE_DURATION, Scenario, scenario
from tuner.types import FilterConfig, GnssNoise
from tuner.types.records import DataError

STEP_INTERVAL = 0.02
"""Length of a step, s: noise is given as densities, so that longer steps change the prediction by less than 1 %."""
CONSTRAINT_INTERVAL = 1.0
"""Time between two uses of the constraint, s: its errors last for seconds."""
SIDEWAYS_SD = 0.2
"""Sideways and vertical velocity of wheels, m/s: the default of `tuner navigate --non-holonomic`."""
MAX_TURN_RATE = np.radians(3.0)
"""Turn rate from which the constraint is not used, rad/s: the unit is not above the rear axle."""


@dataclass(frozen=True)
class OutageDrift:
    """Predicted horizontal error, m (rms), after times without fixes, s.

    Attributes
    ----------
    free, wheels : mapping of float to float
        Without any constraint; with wheels that do not slip sideways.
    """

    free: Mapping[float, float]
    wheels: Mapping[float, float]


def outage_drift(config: FilterConfig, horizons: Sequence[float] = HORIZONS) -> OutageDrift:
    """Return what a filter predicts of its position after times without fixes.

    Parameters
    ----------
    config : FilterConfig
        Settings with six axes and a receiver.
    horizons : sequence of float
        Times without fixes, s, up to `OUTAGE_DURATION`.

    Raises
    ------
    DataError
        Where the configuration lacks an axis or the receiver, or a time is too long.
    """
    if config.gnss is None:
        raise DataError(f"{config.name}: expected GNSS figures, found none; name a receiver (--gnss GRADE)")
    if not all(0.0 < h <= OUTAGE_DURATION for h in horizons):
        raise DataError(
            f"expected times without fixes in 0 … {OUTAGE_DURATION:g} s, got {', '.join(f'{h:g}' for h in horizons)}"
        )
    settings = filter_settings(config, constants=config.constants)
    plan = _city_drive(config.gnss)
    fixes = scenario_fixes(settings, plan)
    return OutageDrift(
        *(
            MappingProxyType(
                _errors(engine.run(settings, plan.start, plan.steps, fixes, constraints=one), fixes, horizons)
            )
            for one in (None, _constraints(plan.steps))
        )
    )


@lru_cache(maxsize=2)
def _city_drive(receiver: GnssNoise) -> Scenario:
    """Return the drive, the same for every sensor."""
    motion = load_trajectory("city", FIRST_OUTAGE_TIME + OUTAGE_DURATION)
    return scenario(motion, receiver, STEP_INTERVAL)


def _errors(solution: Solution, fixes: Fixes, horizons: Sequence[float]) -> dict[float, float]:
    """Return the horizontal sd at the fix next to each time."""
    variance = solution.covariance[:, 0, 0] + solution.covariance[:, 1, 1]
    return {
        horizon: float(np.sqrt(variance[np.argmin(np.abs(fixes.t - FIRST_OUTAGE_TIME - horizon))]))
        for horizon in horizons
    }


def _constraints(steps: Steps) -> Constraints:
    """Return that wheels do not slip sideways, once a second outside turns."""
    stride = round(CONSTRAINT_INTERVAL / STEP_INTERVAL)
    after = np.arange(stride, len(steps.dt) + 1, stride, dtype=np.int64)
    turned = np.add.reduceat(steps.increments[: after[-1], :3], after - stride, axis=0) / CONSTRAINT_INTERVAL
    after = after[np.abs(turned).max(axis=1) < MAX_TURN_RATE]
    return Constraints(
        after * STEP_INTERVAL,
        after,
        np.full(len(after), NON_HOLONOMIC, dtype=np.int64),
        np.full(len(after), SIDEWAYS_SD),
        steps.increments[after - 1] / STEP_INTERVAL,
        np.eye(3),
    )
