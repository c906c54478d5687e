"""Where the errors of a filter come from: the share of every source, by linear covariance.

Along the noise-free trajectory (`tuner.navigation.engine.linear_covariance`) the covariance of every error is a sum
over sources, P = Σ_g P_g. The shares of a source in the variances are its part of the error budget;
`tuner.consistency.attribution` reads from them what explains a bad score, `blind_spots` which wrong setting would not
show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.filter_states import FILTER_STATES, Origin
from tuner.consistency.scores import BLOCKS, EQUIVALENCE_MARGIN, OUTAGE_LENGTHS, outage_epochs, scored_epochs
from tuner.jobs import usable
from tuner.navigation.engine.layout import layout_of, with_sensor_states
from tuner.navigation.engine.linear_covariance import Nominal, trace_sources
from tuner.navigation.settings import FilterSettings
from tuner.simulation.monte_carlo import assumed_fix_sd, scenario_fixes
from tuner.simulation.scenario import Scenario
from tuner.types.consistency import ERROR_UNITS, ErrorBudget

HORIZONS = (10.0, 60.0, 300.0)
"""Times without fixes of which the budget and the drift are shown, s: an underpass, a tunnel, a car park."""


@dataclass(frozen=True)
class Source:
    """One source of errors: initial variances, process noise, white noise of sensors and of fixes.

    Attributes
    ----------
    name : str
        What it is.
    initial, drive, rate : ndarray, shapes (n,)
        Variances at the start, squared densities of driving noise, inverse time constants, 1/s.
    white, fix_sd : ndarray, shapes (6,)
        Squared white densities of the sensors, sds of the fixes.
    """

    name: str
    initial: FloatArray
    drive: FloatArray
    rate: FloatArray
    white: FloatArray
    fix_sd: FloatArray


def table(budget: ErrorBudget) -> list[tuple[str, FloatArray]]:
    """Return the shares by source: aided and after 10, 60 and 300 s; rows of (name, (sources, 3)).

    The columns are position, velocity and attitude.
    """
    outages = {f"{h:g} s without fixes": budget.after[h] for h in HORIZONS if h in budget.after}
    return [
        (name, np.stack([budget.share(epochs, BLOCKS[block]) for block in ERROR_UNITS], axis=-1))
        for name, epochs in {"aided": budget.aided, **outages}.items()
    ]


def blind_spots(budget: ErrorBudget) -> dict[str, tuple[float, float]]:
    """Return how many times too small and too large the sd of each source may be before any score shows it.

    A share a of a source in a variance lets an sd f times too small raise the error by √(1 + (f² − 1) a), and
    one f times too large lower it likewise; shown is what moves some error by more than 10 %. Infinite where
    nothing does.
    """
    shares = np.max([rows.max(axis=1) for _, rows in table(budget)], axis=0)
    small = np.sqrt(1.0 + ((1.0 + EQUIVALENCE_MARGIN) ** 2 - 1.0) / np.maximum(shares, 1e-12))
    left = 1.0 - (1.0 - (1.0 + EQUIVALENCE_MARGIN) ** -2) / np.maximum(shares, 1e-12)
    large = np.where(left > 0.0, 1.0 / np.sqrt(np.maximum(left, 1e-12)), math.inf)
    return {name: (float(a), float(b)) for name, a, b in zip(budget.sources, small, large, strict=True)}


def error_budget(settings: FilterSettings, plan: Scenario) -> ErrorBudget:
    """Return the covariance of every error by source along a scenario.

    Parameters
    ----------
    settings : FilterSettings
        The filter.
    plan : Scenario
        Trajectory, fixes and outages.
    """
    return trace(settings, plan, *known_sources(settings, plan))


def known_sources(settings: FilterSettings, plan: Scenario) -> tuple[Source, list[Source]]:
    """Return all noise for which a filter is configured as one source, and its parts."""
    at = settings.model.layout
    own = Source(
        "all",
        settings.initial_sd**2,
        settings.model.driving_density**2,
        1.0 / settings.model.time_constant,
        np.concatenate([settings.model.gyro_density, settings.model.accel_density]) ** 2,
        assumed_fix_sd(settings, plan.receiver),
    )

    def only(values: FloatArray, which: slice) -> FloatArray:
        kept = np.zeros_like(values)
        kept[which] = values[which]
        return kept

    def part(
        name: str,
        *,
        started: slice = slice(0),
        driving_noise: slice = slice(0),
        sensors: slice = slice(0),
        fixes: slice = slice(0),
    ) -> Source:
        return Source(
            name,
            only(own.initial, started),
            only(own.drive, driving_noise),
            own.rate,
            only(own.white, sensors),
            only(own.fix_sd, fixes),
        )

    parts = [
        part("gyro white noise", sensors=slice(0, 3)),
        part("accelerometer white noise", sensors=slice(3, 6)),
    ]
    for sensor, title in (("gyro", "gyro"), ("accel", "accelerometer")):
        if f"{sensor}_markov" in at:
            rungs = at[f"{sensor}_markov"]
            parts.append(part(f"{title} bias noise", started=rungs, driving_noise=rungs))
        bias = at[f"{sensor}_bias"]
        parts += [
            part(f"{title} bias random walk", driving_noise=bias),
            part(f"{title} turn-on bias", started=bias),
        ]
    parts += [
        part("initial position and velocity", started=slice(0, 6)),
        part("initial tilt", started=slice(6, 8)),
        part("initial heading", started=slice(8, 9)),
        part("position fixes", fixes=slice(0, 3)),
        part("velocity fixes", fixes=slice(3, 6)),
    ]
    for name, components in settings.model.components.items():
        state = FILTER_STATES[name]
        if state.origin not in (Origin.AXIS_CONSTANT, Origin.AXIS_PROCESSES) and components:
            parts.append(part(state.meaning, started=at[name], driving_noise=at[name]))
    return own, parts


def trace(
    settings: FilterSettings,
    plan: Scenario,
    own: Source,
    sources: Sequence[Source],
    *,
    rows: Sequence[int] = (),
) -> ErrorBudget:
    """Propagate the covariance of every source along the noise-free trajectory, with the gains of the filter.

    Parameters
    ----------
    settings, plan
        The filter and its scenario.
    own : Source
        All noise of the configuration, from `known_sources`.
    sources : sequence of Source
        With n states, and as many more as `rows` has, behind them.
    rows : sequence of int
        Sensor axis, 0 … 5, to whose error each further state adds.
    """
    initial, drive, rate = (np.pad(values, (0, len(rows))) for values in (own.initial, own.drive, own.rate))
    all_of_it = replace(own, initial=initial, drive=drive, rate=rate)
    lay = with_sensor_states(layout_of(settings), np.array(rows, dtype=np.int64))
    aided = scored_epochs(plan.times, plan.outages)
    reached = {horizon: outage_epochs(plan.times, plan.outages, horizon) for horizon in OUTAGE_LENGTHS}
    after = {horizon: rows for horizon, rows in reached.items() if len(rows)}
    epochs = np.unique(np.concatenate([aided, *after.values()]))
    k, e = len(plan.times), len(epochs)
    slot = np.full(k, -1, dtype=np.int64)
    slot[epochs] = np.arange(e)
    fixes = scenario_fixes(settings, plan)
    nominal = Nominal(
        np.concatenate([plan.start.llh, plan.start.vel_n, plan.start.quat_nb]),
        plan.steps.dt,
        plan.steps.increments,
        plan.after,
        plan.times,
        np.concatenate([fixes.llh, fixes.vel_n], axis=1),
        np.full(k, 1 + (plan.receiver.velocity_sd is not None), dtype=np.int64),
        fixes.withheld,
        slot,
    )

    def carry(part: Sequence[Source]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Propagate some sources, with all noise of the configuration before them."""
        each = [all_of_it, *part]
        return trace_sources(
            lay,
            np.stack([source.initial for source in each]),
            np.stack([source.rate for source in each]),
            np.stack([source.white for source in each]),
            np.stack([source.drive for source in each]),
            np.stack([source.fix_sd for source in each]),
            nominal,
        )

    threads = min(usable(), len(sources))
    chunks = [
        sources[len(sources) * i // threads : len(sources) * (i + 1) // threads] for i in range(threads)
    ]
    with ThreadPoolExecutor(max_workers=threads) as pool:
        done = list(pool.map(carry, chunks))
    out, out_s, final = done[0]
    return ErrorBudget(
        tuple(source.name for source in sources),
        plan.times[epochs],
        np.concatenate([each[:, 1:] for each, _, _ in done], axis=1),
        out[:, 0],
        np.concatenate([each[:, 1:] for _, each, _ in done], axis=1),
        out_s[:, 0],
        slot[aided],
        {horizon: slot[which] for horizon, which in after.items()},
        settings.initial_sd,
        final[: settings.size, : settings.size],
    )
