"""The filter compiled: the same states, equations and answers as `tuner.navigation.reference_filter`.

`run` is one filter, `run_together` many that see the same steps. A first use compiles the kernels (some ten
seconds; a line on standard error says so) and keeps them on disk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.imu_errors import OFF_DIAGONAL
from models.state_layout import ErrorModel
from models.strapdown import NavigationState
from tuner.navigation.data import Constraints, Fixes, Solution, Steps
from tuner.navigation.engine.measurement_rows import Measurements, measurements, parted
from tuner.navigation.engine.random_normal import stream
from tuner.navigation.engine.run import Flight, Given, fly, kept
from tuner.navigation.engine.simd import WIDTH
from tuner.navigation.engine.types import Layout, own_of, sensed_states, total_rows
from tuner.navigation.engine.workspace import memory
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
        Source of the stream of white noise.
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
    constraints: Constraints | None = None,
) -> Solution:
    """Filter a stretch of data; arguments as of `tuner.navigation.reference_filter.run`.

    Parameters
    ----------
    errors : SensorErrors, optional
        What to add to the increments, which then are those of perfect sensors.
    """
    own = None if errors is None else (errors,)
    rows = measurements(settings, fixes, constraints)
    (solution,) = _fly(settings, (start,), steps, (rows,), own, parameters, covariance)
    return parted(solution, fixes, constraints)


def run_together(
    settings: FilterSettings,
    starts: Sequence[NavigationState],
    steps: Steps,
    fixes: Sequence[Fixes],
    *,
    errors: Sequence[SensorErrors] | None = None,
) -> tuple[Solution, ...]:
    """Filter the same steps from several starts, with fixes of one pattern and different values.

    Eight filters take about twice the time of one (`tuner.navigation.engine.simd`).

    Parameters
    ----------
    starts : sequence of NavigationState
        One for each filter.
    fixes : sequence of Fixes
        One for each filter; times and flags are those of the first.
    errors : sequence of SensorErrors, optional
        What to add to the increments of each, which then are those of perfect sensors.
    """
    answers: list[Solution] = []
    rows = [measurements(settings, own, None) for own in fixes]
    for first in range(0, len(starts), WIDTH):
        among = [min(first + w, len(starts) - 1) for w in range(WIDTH)]
        own = None if errors is None else [errors[j] for j in among]
        block = _fly(settings, [starts[j] for j in among], steps, [rows[j] for j in among], own)
        answers.extend(block[: len(starts) - first])
    return tuple(answers)


def _fly(
    settings: FilterSettings,
    starts: Sequence[NavigationState],
    steps: Steps,
    rows: Sequence[Measurements],
    errors: Sequence[SensorErrors] | None,
    parameters: FloatArray | None = None,
    covariance: FloatArray | None = None,
) -> tuple[Solution, ...]:
    """Filter with one filter or `WIDTH` of them."""
    n, w, first = settings.size, len(starts), rows[0]
    k, lay = len(first.t), layout(settings)
    m = memory(lay, w)
    m.state[:] = np.stack([np.concatenate([s.llh, s.vel_n, s.quat_nb]) for s in starts], axis=-1)
    if parameters is not None:
        m.x[:] = parameters[:, None]
    m.P[:n, :n] = (np.diag(settings.initial_sd**2) if covariance is None else covariance)[..., None]
    every = len(steps.dt) if errors is None else errors[0].every
    if errors is not None:
        if len(errors[0].slow) * every < len(steps.dt):
            msg = f"'slow' must cover {len(steps.dt)} steps, got {len(errors[0].slow) * every}"
            raise ValueError(msg)
        m = m._replace(slow=np.ascontiguousarray(np.stack([e.slow for e in errors], axis=-1)))
        m.density[:] = np.stack([e.white for e in errors], axis=-1)
        m.stream[:] = np.stack([stream(e.rng) for e in errors], axis=-1)
    values = np.stack([own.values for own in rows])
    slots = np.arange(k)
    sds = np.stack([own.sd for own in rows])
    given = Given(
        first.after, first.t, values, sds, first.available, first.withheld, first.trusted, slots, False
    )
    room = kept(w, k, n)
    flight = Flight(
        np.ascontiguousarray(steps.dt, dtype=float),
        np.ascontiguousarray(steps.increments, dtype=float),
        errors is not None,
        every,
        float(m.rate.max()),
    )
    fly(lay, m, own_of(n), flight, given, room)
    return tuple(
        Solution(
            first.t,
            NavigationState(room.state[j, :, :3], room.state[j, :, 3:6], room.state[j, :, 6:]),
            room.x[j],
            room.P[j],
            room.z[j],
            room.S[j],
            room.use[j],
            NavigationState(m.state[:3, j], m.state[3:6, j], m.state[6:, j]),
            m.x[:, j],
            m.P[:n, :n, j],
        )
        for j in range(w)
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
        np.flatnonzero(slope >= 0),
        at.start("gravity"),
        at.start("lever_arm"),
        at.start("time_offset"),
        at.start("gnss_position"),
        (gnss.stop - gnss.start) // 3,
        total_rows(row, source),
        not (source >= 0).any(),
        *sensed_states(row),
        np.array(settings.lever_arm, dtype=float),
        chi2_gate(settings.gate, 3),
        settings.covariance_step,
        settings.patience,
    )


def _sensors(model: ErrorModel) -> tuple[tuple[int, str, tuple[int, ...]], ...]:
    return (0, "gyro", model.gyro_markov_axes), (3, "accel", model.accel_markov_axes)
