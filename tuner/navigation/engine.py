"""The filter compiled: the same states, equations and answers as `tuner.navigation.filter`.

A first use compiles the kernels (some ten seconds) and keeps them on disk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.calibration import OFF_DIAGONAL
from models.layout import ErrorModel
from models.strapdown import NavigationState
from tuner.navigation.compiled import Layout
from tuner.navigation.flight import kept_fly
from tuner.navigation.inputs import Fixes, Solution, Steps
from tuner.navigation.settings import FilterSettings, chi2_gate

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SensorErrors:
    """Errors that a simulated inertial unit adds to true increments, drawn while the filter runs.

    Attributes
    ----------
    white : ndarray, shape (6,)
        White densities, rad/s/√Hz and m/s²/√Hz.
    slow : ndarray, shape (s, 6)
        All other errors, rad/s and m/s².
    every : int
        Steps for which each row of `slow` is held.
    rng : numpy.random.Generator
        Source of the white noise.
    """

    white: FloatArray
    slow: FloatArray
    every: int
    rng: np.random.Generator


def run(
    settings: FilterSettings,
    start: NavigationState,
    steps: Steps,
    fixes: Fixes,
    *,
    parameters: FloatArray | None = None,
    covariance: FloatArray | None = None,
    errors: SensorErrors | None = None,
) -> Solution:
    """Filter a stretch of data; arguments as of `tuner.navigation.filter.run`.

    Parameters
    ----------
    errors : SensorErrors, optional
        What to add to the increments, which then are those of perfect sensors.
    """
    n, k = settings.size, len(fixes)
    state = np.concatenate([start.llh, start.vel_n, start.quat_nb]).astype(float)
    x = np.zeros(n) if parameters is None else parameters.astype(float)
    p = np.diag(settings.initial_sd**2) if covariance is None else covariance.astype(float)
    velocity: NDArray[np.bool_] = np.isfinite(fixes.vel_n.sum(axis=1))
    values = np.concatenate([fixes.llh, np.where(velocity[:, None], fixes.vel_n, 0.0)], axis=1)
    out_state, out_x = np.empty((k, 10)), np.empty((k, n))
    out_p, out_z, out_s = np.empty((k, 15, 15)), np.empty((k, 6)), np.empty((k, 6, 6))
    use = np.empty((k, 2), dtype=np.int64)
    added = errors or SensorErrors(np.zeros(6), np.zeros((1, 6)), 1, np.random.default_rng(0))
    if errors is not None and len(errors.slow) * errors.every < len(steps.dt):
        msg = f"'slow' must cover {len(steps.dt)} steps, got {len(errors.slow) * errors.every}"
        raise ValueError(msg)
    kept_fly(
        layout(settings),
        state,
        x,
        p,
        np.ascontiguousarray(steps.dt, dtype=float),
        np.ascontiguousarray(steps.increments, dtype=float),
        errors is not None,
        added.white,
        np.ascontiguousarray(added.slow),
        added.every,
        added.rng,
        fixes.after,
        values,
        np.ascontiguousarray(np.where(np.isfinite(fixes.sd), fixes.sd, 0.0)),
        1 + velocity.astype(np.int64),
        fixes.withheld,
        fixes.trusted,
        np.ascontiguousarray(fixes.t, dtype=float),
        out_state,
        out_x,
        out_p,
        out_z,
        out_s,
        use,
    )
    return Solution(
        fixes.t,
        NavigationState(out_state[:, :3], out_state[:, 3:6], out_state[:, 6:]),
        out_x,
        out_p,
        out_z,
        out_s,
        use,
        NavigationState(state[:3], state[3:6], state[6:]),
        x,
        p,
    )


def layout(settings: FilterSettings) -> Layout:
    """Return a filter as the plain numbers of the kernels."""
    model = settings.model
    at, n = model.layout, model.layout.size
    row, source, slope = (np.full(n, -1) for _ in range(3))
    for first, sensor, axes in _sensors(model):
        row[at[f"{sensor}_bias"]] = range(first, first + 3)
        if axes:
            row[at[f"{sensor}_markov"]] = first + np.array(axes)
        if f"{sensor}_scale" in at:
            row[at[f"{sensor}_scale"]] = source[at[f"{sensor}_scale"]] = range(first, first + 3)
        if f"{sensor}_misalignment" in at:
            row[at[f"{sensor}_misalignment"]] = [first + i for i, _ in OFF_DIAGONAL]
            source[at[f"{sensor}_misalignment"]] = [first + j for _, j in OFF_DIAGONAL]
        if f"{sensor}_ramp" in at:
            ramp = at[f"{sensor}_ramp"]
            slope[at[f"{sensor}_bias"]] = range(ramp.start, ramp.stop)
    if "g_sensitivity" in at:
        row[at["g_sensitivity"]] = np.repeat(range(3), 3)
        source[at["g_sensitivity"]] = np.tile(range(3, 6), 3)
    gnss = at["gnss_position"] if "gnss_position" in at else slice(0, 0)
    return Layout(
        n,
        1.0 / model.time_constant,
        model.driving_density**2,
        np.concatenate([model.gyro_density, model.accel_density]) ** 2,
        row,
        source,
        slope,
        at.start("gravity"),
        at.start("lever_arm"),
        at.start("time_offset"),
        at.start("gnss_position"),
        (gnss.stop - gnss.start) // 3,
        not (source >= 0).any(),
        np.array(settings.lever_arm, dtype=float),
        chi2_gate(settings.gate, 3),
        settings.covariance_step,
        settings.patience,
    )


def _sensors(model: ErrorModel) -> tuple[tuple[int, str, tuple[int, ...]], ...]:
    return (0, "gyro", model.gyro_markov_axes), (3, "accel", model.accel_markov_axes)
