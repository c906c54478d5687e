"""True values of the further states of a filter in a simulated run, and what they do to sensors and fixes.

They are drawn from the priors and processes of the filter: no other part of a configuration describes them. A state
that adds to a sensor in proportion to a true rate does so with the mean rate of each interval at which slow errors are
drawn. The effect of gravity on the motion is one on the accelerometers: the motion is given, and what accelerates the
unit without being felt is missing in the measured force.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.earth import llh_displaced
from models.filter_states import FILTER_STATES, Origin
from models.measurements import perfect_fixes
from models.recursion import decaying_sum
from models.state_layout import ErrorModel
from tuner.navigation.settings import FilterSettings, error_rows
from tuner.simulation.scenario import Scenario

if TYPE_CHECKING:
    from tuner.navigation.engine import SensorErrors


FELT_INTERVAL = 0.02
"""Longest time for which an error in proportion to a true rate stays the same, s: the filter takes it out sample by
sample, and turns of vehicles begin and end within tenths of a second."""


@dataclass(frozen=True)
class FurtherTruth:
    """Further states of one run.

    Attributes
    ----------
    values : ndarray, shape (k, r)
        At the fixes; 0 for what is not drawn.
    bias : ndarray, shape (k, 6)
        What slopes among them add to the total biases.
    sensors : ndarray, shape (s, 6)
        Errors of rates and forces, each constant over `every` steps.
    llh, vel_n : ndarray, shape (k, 3)
        The fixes with the errors of these states.
    """

    values: FloatArray
    bias: FloatArray
    sensors: FloatArray
    llh: FloatArray
    vel_n: FloatArray


def drawn_states(model: ErrorModel) -> NDArray[np.bool_]:
    """Return which states are drawn here, shape (n,): those a configuration names.

    Ramps of an axis are not: the noise terms of the sensor have them.
    """
    drawn = np.zeros(model.layout.size, dtype=bool)
    for name in model.components:
        drawn[model.layout[name]] = FILTER_STATES[name].origin is Origin.NAME
    return drawn


def with_short_rows(errors: SensorErrors, model: ErrorModel, interval: float) -> SensorErrors:
    """Return the same errors, in rows of at most `FELT_INTERVAL` where a state that is drawn multiplies a true rate."""
    state, _, source, _ = model.sensor_couplings
    every = max(1, round(FELT_INTERVAL / interval))
    if errors.every % every or not (drawn_states(model)[state] & (source >= 0)).any():
        return errors
    return replace(errors, slow=np.repeat(errors.slow, errors.every // every, axis=0), every=every)


def draw_further(
    settings: FilterSettings, plan: Scenario, rows: int, every: int, rng: np.random.Generator
) -> FurtherTruth:
    """Draw the further states of one run.

    Parameters
    ----------
    settings, plan : FilterSettings, Scenario
        The filter, and the motion and its error-free fixes.
    rows, every : int
        How many slow errors are drawn, and over how many steps each is constant.
    rng : numpy.random.Generator
        Source of the draw.
    """
    model, interval = settings.model, float(plan.steps.dt[0])
    own = error_rows(model)
    step = every * interval
    paths = {int(j): _path(settings, int(j), rows, step, rng) for j in np.flatnonzero(drawn_states(model))}
    values = np.zeros((rows, int(own.max()) - 14))
    for j, path in paths.items():
        values[:, own[j] - 15] = path
    bias = np.zeros((rows, 6))
    for parent in np.flatnonzero(model.slopes >= 0):
        if model.slopes[parent] in paths:
            slope = paths[int(model.slopes[parent])]
            grown = step * (np.cumsum(slope) - slope)
            paths[int(parent)] = paths.get(int(parent), np.zeros(rows)) + grown
            if 9 <= own[parent] < 15:
                bias[:, own[parent] - 9] += grown
            elif own[parent] >= 15:
                values[:, own[parent] - 15] += grown
    at = np.minimum(plan.after // every, rows - 1)
    errors = np.zeros((len(plan.times), 6))
    for state, row, _, factor in zip(*model.fix_couplings, strict=True):
        if int(state) in paths:
            errors[:, row] += factor * paths[int(state)][at]
    llh, vel_n = antenna_fixes(settings, plan, {j: float(path[0]) for j, path in paths.items()})
    return FurtherTruth(
        values[at],
        bias[at],
        _sensor_errors(plan, model, paths, rows, every),
        llh_displaced(llh, errors[:, :3]),
        vel_n + errors[:, 3:],
    )


def _path(
    settings: FilterSettings, state: int, rows: int, step: float, rng: np.random.Generator
) -> FloatArray:
    """Return one state at the beginning of every step, s; shape (rows,)."""
    constant, density = settings.model.time_constant[state], settings.model.driving_density[state]
    first = settings.initial_sd[state] * rng.standard_normal()
    if density == 0.0 and np.isinf(constant):
        return np.full(rows, first)
    decay = np.exp(-step / constant)
    variance = step if np.isinf(constant) else -0.5 * constant * np.expm1(-2.0 * step / constant)
    steps = density * np.sqrt(variance) * rng.standard_normal(rows - 1)
    return decaying_sum(np.concatenate([[first], steps]), float(decay))


def antenna_fixes(
    settings: FilterSettings, plan: Scenario, values: Mapping[int, float]
) -> tuple[FloatArray, FloatArray]:
    """Return error-free fixes of the antenna as it is, with the true offset of the clocks.

    Parameters
    ----------
    settings : FilterSettings
        Configuration of the filter, with its lever arm.
    plan : Scenario
        Trajectory, and how the installation differs from what the filter knows.
    values : mapping of int to float
        True values of the states of the filter that describe the installation, by number; 0 where none is named.

    Returns
    -------
    llh, vel_n : ndarray, shape (k, 3)
        rad, rad, m; m/s.
    """
    layout, arm, delay = settings.model.layout, np.add(settings.lever_arm, plan.lever_arm), plan.delay
    if "lever_arm" in layout:
        arm = arm + [values.get(j, 0.0) for j in range(layout["lever_arm"].start, layout["lever_arm"].stop)]
    if "time_offset" in layout:
        delay += values.get(layout["time_offset"].start, 0.0)
    return perfect_fixes(plan.motion, plan.times, lever_arm=arm, delay=delay)


def _sensor_errors(
    plan: Scenario, model: ErrorModel, paths: dict[int, FloatArray], rows: int, every: int
) -> FloatArray:
    """Return the errors of rates and forces, the mean of every row; shape (rows, 6)."""
    interval, steps = float(plan.steps.dt[0]), len(plan.steps.dt)
    padded = np.zeros((rows * every, 6))
    padded[:steps] = plan.steps.increments / interval
    true = padded.reshape(rows, every, 6).mean(axis=1)
    errors = np.zeros((rows, 6))
    for state, sensor, source, factor in zip(*model.sensor_couplings, strict=True):
        if int(state) in paths:
            felt = 1.0 if source < 0 else true[:, source]
            errors[:, sensor] += factor * paths[int(state)] * felt
    down = np.zeros(rows)
    for state, _, _, factor in zip(*model.down_couplings, strict=True):
        if int(state) in paths:
            down += factor * paths[int(state)]
    if down.any():
        middle = ((np.arange(rows) + 0.5) * every * interval).clip(max=plan.motion.duration)
        errors[:, 3:] -= plan.motion.evaluate(middle).mat_nb[:, 2] * down[:, None]
    return errors
