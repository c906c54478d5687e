"""Monte-Carlo runs: many draws of one sensor along one trajectory, each filtered.

The truth is the sensor's own noise model (`tuner.simulation.imu`), a receiver with white and correlated
errors, the further states of the filter (`further_states`), and a start that errs by P0. Every run has a stream of its
own, spawned from the seed: the answer does not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import llh_displaced, ned_between
from models.error_state import corrected, navigation_error
from models.measurements import perfect_fixes
from tuner.jobs import usable
from tuner.navigation import engine
from tuner.navigation.data import Fixes, Solution
from tuner.navigation.engine.layout import BATCH_SIZE
from tuner.navigation.settings import FilterSettings, error_rows, total_bias
from tuner.simulation.further_states import antenna_fixes, draw_further, with_short_rows
from tuner.simulation.imu import Sensor
from tuner.simulation.receiver import draw_fix_errors
from tuner.simulation.scenario import Scenario
from tuner.stages import reached
from tuner.types import GnssNoise

AVERAGING_RATIO = 0.8
"""Window of a mean ÷ shortest time constant of a ladder, for which both leave the same flicker: see `resolution`."""


@dataclass(frozen=True)
class Runs:
    """Errors and innovations of m runs at k fixes.

    Attributes
    ----------
    t : ndarray, shape (k,)
        s.
    error : ndarray, shape (m, k, 15)
        Truth minus estimate: position, velocity, attitude, total biases.
    covariance : ndarray, shape (m, k, 15, 15)
        As the filters predict it, float32 to save memory.
    innovation : ndarray, shape (m, k, 6)
        Fix minus prediction.
    innovation_covariance : ndarray, shape (m, k, 6, 6)
        As predicted.
    use : ndarray of int, shape (m, k, 2)
        What became of each fix.
    further_error, further_covariance : ndarray, shapes (m, k, r), (m, k, r, r)
        The same as the first two, of the further states.
    """

    t: FloatArray
    error: FloatArray
    covariance: NDArray[np.float32]
    innovation: FloatArray
    innovation_covariance: NDArray[np.float32]
    use: NDArray[np.int64]
    further_error: FloatArray
    further_covariance: FloatArray


def simulate(
    settings: FilterSettings,
    sensor: Sensor,
    plan: Scenario,
    *,
    runs: int,
    seed: int,
) -> Runs:
    """Simulate and filter a scenario many times.

    Parameters
    ----------
    settings : FilterSettings
        Configuration of the filter.
    sensor : Sensor
        What the inertial unit is.
    plan : Scenario
        Trajectory and receiver.
    runs : int
        How many.
    seed : int
        Seed of all randomness.
    """
    streams = np.random.default_rng(seed).spawn(runs)
    fixes = _as_assumed(settings, plan, *antenna_fixes(settings, plan, {}))
    out = _room(plan.times, runs, int(np.count_nonzero(error_rows(settings.model) >= 15)))

    def fill(first: int) -> int:
        own = streams[first : first + BATCH_SIZE]
        for i, (error, solution) in enumerate(_together(settings, sensor, plan, fixes, own), first):
            out.error[i], out.further_error[i] = error[:, :15], error[:, 15:]
            out.covariance[i], out.further_covariance[i] = solution.covariance, solution.further_covariance
            out.innovation[i], out.innovation_covariance[i] = (
                solution.innovation,
                solution.innovation_covariance,
            )
            out.use[i] = solution.use
        return first + len(own)

    blocks = range(0, runs, BATCH_SIZE)
    with ThreadPoolExecutor(max_workers=min(len(blocks), usable())) as pool:
        for done in pool.map(fill, blocks):
            reached(done, runs)
    return out


def solutions_by(
    filtered: Callable[..., Solution],
    settings: FilterSettings,
    sensor: Sensor,
    plan: Scenario,
    *,
    runs: int,
    seed: int,
) -> list[Solution]:
    """Return what one function says of simulated runs: the same runs, whatever the function.

    Starts, fixes and slow sensor errors are those of the first runs of `simulate` with that seed; the white noise of
    the sensor is drawn by numpy.

    Parameters
    ----------
    filtered : function
        `run` of `tuner.navigation.engine` or of `tuner.navigation.reference_filter`.
    settings, sensor, plan, runs, seed
        As of `simulate`.
    """
    fixes = _as_assumed(settings, plan, *antenna_fixes(settings, plan, {}))
    each = partial(engine.run_each, filtered)
    streams = np.random.default_rng(seed).spawn(runs)
    return [_together(settings, sensor, plan, fixes, [own], each)[0][1] for own in streams]


def scenario_fixes(settings: FilterSettings, plan: Scenario) -> Fixes:
    """Return the error-free fixes of a scenario whose installation is as the filter assumes, outages withheld."""
    return _as_assumed(settings, plan, *perfect_fixes(plan.motion, plan.times, lever_arm=settings.lever_arm))


def _as_assumed(settings: FilterSettings, plan: Scenario, llh: FloatArray, vel_n: FloatArray) -> Fixes:
    """Return fixes with the sds that a filter assumes, those of outages withheld."""
    sd = np.tile(assumed_fix_sd(settings, plan.receiver), (len(plan.times), 1))
    return Fixes(plan.times, plan.after, llh, vel_n, sd).without(plan.outages)


def assumed_fix_sd(settings: FilterSettings, receiver: GnssNoise) -> FloatArray:
    """Return the sds that a filter assumes of fixes, shape (6,): as configured, else as the receiver reports."""
    position = settings.position_sd or receiver.position_sd
    velocity = settings.velocity_sd or receiver.velocity_sd or (1.0, 1.0, 1.0)
    return np.array([*position, *velocity])


def _room(t: FloatArray, m: int, r: int) -> Runs:
    """Return arrays for m runs with r further states, to be filled."""
    k = len(t)
    return Runs(
        t,
        np.empty((m, k, 15)),
        np.empty((m, k, 15, 15), dtype=np.float32),
        np.empty((m, k, 6)),
        np.empty((m, k, 6, 6), dtype=np.float32),
        np.empty((m, k, 2), dtype=np.int64),
        np.empty((m, k, r)),
        np.empty((m, k, r, r)),
    )


def resolution(settings: FilterSettings, sensor: Sensor) -> FloatArray:
    """Return how long a true bias is averaged before the estimate is compared with it, s; shape (6,).

    A ladder from the time constant T on, at r = 10 a rung, has the variance of flicker below the frequency
    √r/(2πT); flicker averaged over w has that of flicker below 0.40/w. So w = 0.8 T: what is faster no state
    represents, and white noise masks. Without states it is the sensor's own corner of white noise and
    flicker.
    """
    model, shortest = settings.model, np.full(6, np.inf)
    for first, name, axes in (
        (0, "gyro_markov", model.gyro_markov_axes),
        (3, "accel_markov", model.accel_markov_axes),
    ):
        for axis, constant in zip(axes, model.time_constant[model.layout[name]] if axes else (), strict=True):
            shortest[first + axis] = min(shortest[first + axis], constant)
    return np.where(
        np.isfinite(shortest), np.minimum(AVERAGING_RATIO * shortest, sensor.corners), sensor.corners
    )


def _together(
    settings: FilterSettings,
    sensor: Sensor,
    plan: Scenario,
    perfect: Fixes,
    streams: list[np.random.Generator],
    filtering: Callable[..., tuple[Solution, ...]] = engine.run_together,
) -> list[tuple[FloatArray, Solution]]:
    """Draw some runs and filter them by `filtering`; return errors (k, 15 + r) and solution of each."""
    steps, interval = plan.steps, float(plan.steps.dt[0])
    smoothing = resolution(settings, sensor)
    starts, fixes, errors, biases, others = [], [], [], [], []
    further = np.flatnonzero(error_rows(settings.model) >= 15)
    for rng in streams:
        spread = settings.initial_sd[:9]
        if plan.start_sd is not None:
            spread = np.where(np.isfinite(plan.start_sd), plan.start_sd, spread)
        starts.append(corrected(plan.start, -spread * rng.standard_normal(9)))
        fixes.append(_with_errors(perfect, plan.receiver, rng))
        own, bias = sensor.draw(len(steps.dt), interval, rng, smoothing=smoothing, after=plan.after)
        values = np.zeros((len(plan.times), 0))
        if len(further):
            own = with_short_rows(own, settings.model, interval)
            truth = draw_further(settings, plan, len(own.slow), own.every, rng)
            own, bias, values = replace(own, slow=own.slow + truth.sensors), bias + truth.bias, truth.values
            llh = llh_displaced(truth.llh, ned_between(fixes[-1].llh, perfect.llh))
            fixes[-1] = replace(fixes[-1], llh=llh, vel_n=fixes[-1].vel_n + truth.vel_n - perfect.vel_n)
        errors.append(own)
        biases.append(bias)
        others.append(values)
    solutions = filtering(settings, starts, steps, fixes, errors=errors)
    total = total_bias(settings.model)[9:]
    return [
        (
            np.hstack(
                [
                    navigation_error(plan.truth, s.state),
                    bias - s.parameters @ total.T,
                    other - s.parameters[:, further],
                ]
            ),
            s,
        )
        for s, bias, other in zip(solutions, biases, others, strict=True)
    ]


def _with_errors(perfect: Fixes, receiver: GnssNoise, rng: np.random.Generator) -> Fixes:
    """Return fixes with the errors of a receiver."""
    interval = float(perfect.t[0]) if len(perfect) else 1.0
    errors = draw_fix_errors(receiver, len(perfect), interval, rng)
    llh, vel_n = llh_displaced(perfect.llh, errors.position), perfect.vel_n + errors.velocity
    return Fixes(perfect.t, perfect.after, llh, vel_n, perfect.sd, perfect.withheld)
