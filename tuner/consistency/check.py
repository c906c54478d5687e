"""A configuration on trial: the filter it configures, flown many times on a simulated sensor.

The sensor is what the configuration was made from (its identified terms), or another one: then the question
is what becomes of a filter that believes the wrong thing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from models.trajectory.motion import Motion
from tuner.consistency.attribution import Cause, attribute
from tuner.consistency.attribution.sensitivity import responses
from tuner.consistency.divergence import divergence
from tuner.consistency.error_budget import Budget, error_budget
from tuner.consistency.false_observability import spurious_information
from tuner.consistency.observability import Observability, observability
from tuner.consistency.scores import Consistency, evaluate
from tuner.consistency.verdicts import explained, verdicts
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import Sensor, sensor_of_config
from tuner.simulation.monte_carlo import resolution, scenario, simulate
from tuner.types import FilterConfig, GnssNoise
from tuner.types.records import DataError

RUNS = 40
DURATION = 3600.0
FASTEST = 0.01
"""Shortest sampling interval that is simulated, s: densities do not depend on it."""


@dataclass(frozen=True)
class Check:
    """The outcome of a check.

    Attributes
    ----------
    consistency : Consistency
        Scores and verdicts.
    states : int
        States of the filter.
    notes : tuple of str
        What had to be assumed.
    budget : Budget or None
        Variance by source; where it was asked for or the filter is not consistent.
    seen : Observability or None
        What the trajectory shows of the states; beside the budget.
    causes : tuple of Cause
        What would explain the scores of an inconsistent filter, best first.
    """

    consistency: Consistency
    states: int
    notes: tuple[str, ...]
    budget: Budget | None = None
    seen: Observability | None = None
    causes: tuple[Cause, ...] = ()


def check(
    config: FilterConfig,
    motion: Motion,
    *,
    sensor: Sensor | None = None,
    receiver: GnssNoise | None = None,
    runs: int = RUNS,
    seed: int = 0,
    budget: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Check:
    """Fly a configuration many times and score it.

    Parameters
    ----------
    config : FilterConfig
        What the filter believes.
    motion : Motion
        Trajectory; outages are those of `simulate.outage_windows`.
    sensor : Sensor, optional
        What the inertial unit truly is; by default what the configuration identified.
    receiver : GnssNoise, optional
        What the receiver truly is; by default what the filter believes.
    runs : int
        Simulated switch-ons.
    seed : int
        Seed of all randomness.
    budget : bool
        Whether the error budget is wanted in any case.
    progress : callable, optional
        Called with (done, runs).

    Raises
    ------
    DataError
        Where the configuration lacks an axis or the receiver.
    """
    settings = filter_settings(config)
    if config.gnss is None:
        msg = f"{config.name}: expected GNSS figures, found none; name a receiver (--gnss GRADE)"
        raise DataError(msg)
    truth = sensor or sensor_of_config(config)
    notes = list(truth.notes)
    if config.interval < 0.999 * FASTEST:
        notes.append(f"simulated at {1.0 / FASTEST:g} Hz, not {1.0 / config.interval:g} Hz")
    plan = scenario(motion, receiver or config.gnss, max(config.interval, FASTEST))
    flown = simulate(settings, truth, plan, runs=runs, seed=seed, progress=progress)
    found = evaluate(flown, plan.outages)
    if found.diverged:
        words = divergence(flown, plan, settings, truth)
        return Check(replace(found, verdicts=words), settings.size, tuple(notes))
    if found.consistent and not budget:
        return Check(replace(found, verdicts=explained(found, ())), settings.size, tuple(notes))
    shares = error_budget(settings, plan)
    seen = observability(settings, shares.final)
    optimistic = any(s.ratio > 1.0 and not s.consistent for s in found.scores)
    spurious = spurious_information(flown, shares) if optimistic else None
    causes: tuple[Cause, ...] = ()
    if not found.consistent and spurious is None:
        answers = responses(settings, plan, shares, window=resolution(settings, truth))
        causes = attribute(found, flown, answers)
    words = explained(found, causes) if spurious is None else (spurious.text, *verdicts(found))
    return Check(replace(found, verdicts=words), settings.size, tuple(notes), shares, seen, causes)
