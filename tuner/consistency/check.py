"""Monte-Carlo check of a configuration: its filter on many simulated runs of a sensor, scored.

The sensor is the one behind the configuration (its identified terms), or another one: then the check says what a
filter does whose configuration is wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from models.trajectory.motion import Motion
from tuner.consistency.attribution import attribute
from tuner.consistency.attribution.sensitivity import score_sensitivity
from tuner.consistency.divergence import divergence
from tuner.consistency.error_budget import error_budget
from tuner.consistency.false_observability import spurious_information
from tuner.consistency.observability import observability
from tuner.consistency.scores import evaluate
from tuner.consistency.verdicts import verdicts, with_explanations
from tuner.navigation.settings import filter_settings
from tuner.simulation.imu import Sensor, sensor_of_config
from tuner.simulation.monte_carlo import resolution, scenario, simulate
from tuner.types import FilterConfig, GnssNoise
from tuner.types.consistency import Check, Explanation
from tuner.types.records import DataError

RUNS = 40
"""Simulated runs: an sd off by 10 % shows in NEES, an sd off by 30 % in the position after 60 s without fixes."""
DURATION = 3600.0
"""Length of a run, s: three outages of five minutes fit in."""
MIN_INTERVAL = 0.01
"""Shortest sampling interval that is simulated, s: densities do not depend on it."""


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
    """Run the filter of a configuration on many simulated switch-ons of a sensor and score it.

    Parameters
    ----------
    config : FilterConfig
        Configuration of the filter.
    motion : Motion
        Trajectory; outages are those of `tuner.simulation.monte_carlo.outage_windows`.
    sensor : Sensor, optional
        The true inertial unit; by default what the configuration identified.
    receiver : GnssNoise, optional
        The true receiver; by default that of the configuration.
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
    if config.interval < 0.999 * MIN_INTERVAL:
        notes.append(f"simulated at {1.0 / MIN_INTERVAL:g} Hz, not {1.0 / config.interval:g} Hz")
    plan = scenario(motion, receiver or config.gnss, max(config.interval, MIN_INTERVAL))
    simulated = simulate(settings, truth, plan, runs=runs, seed=seed, progress=progress)
    found = evaluate(simulated, plan.outages)
    if found.diverged:
        reasons = divergence(simulated, plan, settings, truth)
        return Check(replace(found, verdicts=reasons), settings.size, tuple(notes))
    if found.consistent and not budget:
        return Check(replace(found, verdicts=verdicts(found)), settings.size, tuple(notes))
    shares = error_budget(settings, plan)
    seen = observability(settings, shares.final)
    optimistic = any(s.ratio > 1.0 and not s.consistent for s in found.scores)
    spurious = spurious_information(simulated, shares) if optimistic else None
    explanations: tuple[Explanation, ...] = ()
    if not found.consistent and spurious is None:
        sensitivity = score_sensitivity(settings, plan, shares, window=resolution(settings, truth))
        explanations = attribute(found, simulated, sensitivity)
    reasons = (
        with_explanations(found, explanations) if spurious is None else (spurious.verdict, *verdicts(found))
    )
    return Check(replace(found, verdicts=reasons), settings.size, tuple(notes), shares, seen, explanations)
