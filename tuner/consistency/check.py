"""Monte-Carlo check of a configuration: its filter on many simulated runs of a sensor, scored.

The sensor is the one behind the configuration (its identified terms), or another one: then the check says what a
filter does whose configuration is wrong.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Literal

from models.filter_states import FILTER_STATES, Origin
from models.trajectory.motion import Motion
from tuner.catalogue.grades import DEFAULT_RECEIVER, receiver_or_default
from tuner.catalogue.trajectories import load_trajectory
from tuner.consistency.attribution import attribute
from tuner.consistency.attribution.installation import of_installation, without_means
from tuner.consistency.attribution.sensitivity import ScoreSensitivity, score_sensitivity
from tuner.consistency.compare_engines import compare_engines
from tuner.consistency.divergence import divergence
from tuner.consistency.error_budget import error_budget
from tuner.consistency.false_observability import spurious_information
from tuner.consistency.observability import observability
from tuner.consistency.scores import evaluate
from tuner.consistency.start_scores import start_scores, wrong_starts
from tuner.consistency.verdicts import verdicts, with_explanations
from tuner.navigation.settings import FilterSettings, filter_settings, further_states
from tuner.simulation.imu import Sensor, sensor_of_config
from tuner.simulation.load_truth import Truth, installation, load_truth
from tuner.simulation.monte_carlo import Runs, resolution, simulate
from tuner.simulation.scenario import Scenario, scenario
from tuner.stages import stage, task
from tuner.synthesis.load_config import load_config
from tuner.synthesis.rest_and_motion import simulated_unit
from tuner.types import FilterConfig, GnssNoise
from tuner.types.consistency import Check, Consistency
from tuner.types.number_ranges import Positive, Several, Whole
from tuner.types.public import public
from tuner.types.verdict import Explanation, Severity, Verdict, VerdictCode

DEFAULT_RUNS = 25
"""Simulated runs: errors 1.5 times as large as predicted then show in every score, up to a minute without fixes."""
DEFAULT_DURATION = 3600.0
"""Length of a run, s: three outages of five minutes fit in."""
MIN_INTERVAL = 0.01
"""Shortest sampling interval that is simulated, s: densities do not depend on it."""
MIN_FIX_INTERVAL = 1.0
"""Shortest interval of fixes that is simulated, s; smaller sds stand for the fixes in between, whose errors average."""


@public("check")
@task()
def check(
    config: FilterConfig | str | Path,
    trajectory: Motion | str = "city",
    *,
    duration: Positive = DEFAULT_DURATION,
    truth: Truth | FilterConfig | Sensor | str | Path | None = None,
    receiver: GnssNoise | None = None,
    runs: Several = DEFAULT_RUNS,
    seed: Whole = 0,
    budget: bool = False,
    engine: Literal["compiled", "filterpy"] = "compiled",
) -> Check:
    """Run a configured filter on many simulated switch-ons and score its errors against its covariances.

    Parameters
    ----------
    config : FilterConfig, str or Path
        The filter: a configuration, its file, or the name of a built-in grade.
    trajectory : Motion or str
        Trajectory, or the name of a built-in one; outages are those of `simulation.scenario`.
    duration : float
        Length of a run on a built-in trajectory, s.
    truth : FilterConfig, Sensor, str or Path, optional
        What is simulated: a configuration, its file or a grade says unit, receiver, lever arm, delay of the fixes and
        by how much the start errs; or the inertial unit alone. By default what the configuration identified, after a
        drive what it showed in motion.
    receiver : GnssNoise, optional
        The simulated receiver; by default that of `truth`, where it names one, else that of the configuration.
    runs : int
        Simulated switch-ons, two or more.
    seed : int
        Seed of all randomness.
    budget : bool
        Whether the error budget is wanted in any case.
    engine : {"compiled", "filterpy"}
        ``filterpy``: the first runs, as many as it takes half a minute for, are filtered by
        `tuner.navigation.reference_filter`, too; `Check.engines` says whether both agree. The scores are in any case
        those of all runs in the compiled filter.

    Raises
    ------
    DataError
        Where the configuration lacks an axis, and where there is no compiled filter to compare filterpy with.
    """
    if not isinstance(config, FilterConfig):
        config = load_config(config, default_gnss=DEFAULT_RECEIVER)
    assumed = receiver_or_default(config.gnss)
    config = replace(config, gnss=assumed)
    motion = load_trajectory(trajectory, duration) if isinstance(trajectory, str) else trajectory
    real = truth if truth is None or isinstance(truth, Truth) else load_truth(truth)
    receiver = receiver or (real.receiver if real is not None else None) or assumed
    often = receiver.interval / MIN_FIX_INTERVAL
    if often < 0.999:
        config, receiver = (
            replace(config, gnss=_with_fewer_fixes(assumed, often)),
            _with_fewer_fixes(receiver, often),
        )
    settings = filter_settings(config, constants=config.constants)
    sensor = sensor_of_config(simulated_unit(config)) if real is None else real.sensor
    notes = list(sensor.notes)
    if config.interval < 0.999 * MIN_INTERVAL:
        notes.append(f"simulated at {1.0 / MIN_INTERVAL:g} Hz, not {1.0 / config.interval:g} Hz")
    if often < 0.999:
        notes.append(
            f"simulated with a fix every {MIN_FIX_INTERVAL:g} s, as accurate as {1.0 / often:.3g} fixes together"
        )
    stage("simulating the trajectory", 0.35)
    plan = scenario(motion, receiver, max(config.interval, MIN_INTERVAL))
    if real is not None:
        arm, delay = installation(real.compensation, config.compensation)
        plan = replace(plan, start_sd=real.start_sd, lever_arm=arm, delay=delay)
    stage(f"filtering {runs} simulated runs", 0.8)
    simulated = simulate(settings, sensor, plan, runs=runs, seed=seed)
    compared = None
    if engine == "filterpy":
        stage("filtering the first runs with filterpy", 0.82)
        compared = compare_engines(settings, sensor, plan, runs=runs, seed=seed)
    stage("scoring the filter", 0.84)
    settled = _settled_scores(settings, plan, simulated)
    starts = start_scores(simulated) if plan.start_sd is not None and not settled.diverged else ()
    found = replace(settled, blocks=(*settled.blocks, *starts))
    if found.diverged:
        reasons = divergence(simulated, plan, settings, sensor)
        if constant := of_installation(simulated, plan):
            reasons = (Verdict(VerdictCode.EXPLAINED, Severity.EXPLANATION, explanations=constant), *reasons)
        return Check(
            replace(found, verdicts=reasons),
            settings.size,
            tuple(notes),
            explanations=constant,
            engines=compared,
        )
    if found.consistent and not budget:
        return Check(replace(found, verdicts=verdicts(found)), settings.size, tuple(notes), engines=compared)
    stage("computing the share of each error source", 0.9)
    shares = error_budget(settings, plan)
    seen = observability(settings, shares.final)
    optimistic = any(s.ratio > 1.0 and not s.consistent for s in found.scores)
    spurious = spurious_information(simulated, shares) if optimistic else None
    stage("finding which setting is wrong", 1.0)
    explanations: tuple[Explanation, ...] = ()
    if spurious is not None:
        reasons = (spurious, *verdicts(found))
    else:
        explanations = () if found.consistent else wrong_starts(found.scores)
        if not settled.consistent:
            effects = score_sensitivity(
                settings, plan, shares, window=resolution(settings, sensor), config=config
            )
            named = {one.source for one in explanations}
            others = _wrong_settings(settings, plan, simulated, settled, effects)
            explanations += tuple(one for one in others if one.source not in named)
        reasons = with_explanations(found, explanations)
    return Check(
        replace(found, verdicts=reasons), settings.size, tuple(notes), shares, seen, explanations, compared
    )


def _settled_scores(settings: FilterSettings, plan: Scenario, runs: Runs) -> Consistency:
    """Return the scores after the start, of the states too that a configuration names."""
    drawn = {
        name: own
        for name, own in further_states(settings.model).items()
        if FILTER_STATES[name].origin is Origin.NAME
    }
    return evaluate(runs, plan.outages, further=drawn)


def _wrong_settings(
    settings: FilterSettings, plan: Scenario, runs: Runs, settled: Consistency, effects: ScoreSensitivity
) -> tuple[Explanation, ...]:
    """Return the wrong settings that explain the scores: constants of the installation, then the noise beside them."""
    constant = of_installation(runs, plan)
    if not constant:
        return attribute(settled, runs, effects)
    rest = without_means(runs)
    left = _settled_scores(settings, plan, rest)
    return (*constant, *(() if left.consistent else attribute(left, rest, effects)))


def _with_fewer_fixes(gnss: GnssNoise, share: float) -> GnssNoise:
    """Return a receiver with a share of the fixes, whose white errors are so much smaller that they tell as much."""
    less = math.sqrt(share)

    def smaller(sd: tuple[float, float, float]) -> tuple[float, float, float]:
        return (less * sd[0], less * sd[1], less * sd[2])

    velocity = None if gnss.velocity_sd is None else smaller(gnss.velocity_sd)
    return replace(
        gnss, position_sd=smaller(gnss.position_sd), velocity_sd=velocity, interval=gnss.interval / share
    )
