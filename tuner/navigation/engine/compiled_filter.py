"""One run of the compiled filter, from settings and data to solutions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from models.arrays import FloatArray
from models.strapdown import NavigationState
from tuner.navigation.data import Solution, Steps
from tuner.navigation.engine.filter_steps import SensorInput, run_filters
from tuner.navigation.engine.fixes import FixBatch, new_output
from tuner.navigation.engine.layout import layout_of
from tuner.navigation.engine.measurement_rows import Measurements
from tuner.navigation.engine.random_normal import stream
from tuner.navigation.engine.state import (
    ESTIMATE,
    REFUSED_ROW,
    TRUE_DENSITY_ROW,
    UNREACHED_LIMIT,
    new_state,
)
from tuner.navigation.settings import FilterSettings

if TYPE_CHECKING:
    from tuner.navigation.engine import SensorErrors


def filter_together(
    settings: FilterSettings,
    starts: Sequence[NavigationState],
    steps: Steps,
    rows: Sequence[Measurements],
    errors: Sequence[SensorErrors] | None,
    parameters: FloatArray | None = None,
    covariance: FloatArray | None = None,
    refused_since: FloatArray | None = None,
) -> tuple[Solution, ...]:
    """Filter with one filter or `BATCH_SIZE` of them."""
    n, w, first = settings.size, len(starts), rows[0]
    k, lay = len(first.t), layout_of(settings)
    m, slow = new_state(lay, w), np.zeros((1, 6, w))
    m.rows[:10] = np.stack([np.concatenate([s.llh, s.vel_n, s.quat_nb]) for s in starts], axis=-1)
    if parameters is not None:
        m.states[ESTIMATE, :n] = parameters[:, None]
    m.P[:n, :n] = (np.diag(settings.initial_sd**2) if covariance is None else covariance)[..., None]
    if refused_since is not None:
        m.rows[REFUSED_ROW : REFUSED_ROW + 2] = np.minimum(refused_since, UNREACHED_LIMIT)[:, None]
    every = len(steps.dt) if errors is None else errors[0].every
    if errors is not None:
        if len(errors[0].slow) * every < len(steps.dt):
            raise ValueError(f"'slow' must cover {len(steps.dt)} steps, got {len(errors[0].slow) * every}")
        slow = np.ascontiguousarray(np.stack([e.slow for e in errors], axis=-1))
        m.rows[TRUE_DENSITY_ROW : TRUE_DENSITY_ROW + 6] = np.stack([e.white for e in errors], axis=-1)
        m.stream[:] = np.stack([stream(e.rng) for e in errors], axis=-1)
    values = np.stack([own.values for own in rows])
    slots = np.arange(k)
    sds = np.stack([own.sd for own in rows])
    flags = np.stack([first.after, first.available, first.withheld, first.trusted, slots], axis=-1).astype(
        np.int64
    )
    fixes = FixBatch(first.t, values, sds, flags)
    output = new_output(w, k, lay)
    sensed = SensorInput(
        np.ascontiguousarray(steps.dt, dtype=float),
        np.ascontiguousarray(steps.increments, dtype=float),
        errors is not None,
        slow,
        every,
    )
    run_filters(lay, m, sensed, fixes, output, shared=False)
    state = m.rows
    return tuple(
        Solution(
            first.t,
            NavigationState(output.values[j, :, :3], output.values[j, :, 3:6], output.values[j, :, 6:10]),
            output.values[j, :, 16:],
            output.P[j, :, :15, :15],
            np.where(np.isnan(own.values[:, :6]), np.nan, output.values[j, :, 10:16]),
            output.S[j],
            output.use[j],
            NavigationState(state[:3, j], state[3:6, j], state[6:10, j]),
            m.states[ESTIMATE, :n, j],
            m.P[:n, :n, j],
            further_covariance=output.P[j, :, 15:, 15:],
        )
        for j, own in enumerate(rows)
    )
