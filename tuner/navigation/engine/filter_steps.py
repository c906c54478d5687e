# mypy: disable-error-code="no-untyped-call, untyped-decorator"
"""A whole run of the compiled filter: mechanisation, simulated sensor errors, covariance, fixes.

One filter, or `BATCH_SIZE` that see the same steps and have their fixes at the same times. Between fixes all of them go
through every loop side by side; at a fix each is updated by itself, or all with the gain of the first.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import earth, error_state, strapdown, taylor, vector3
from models.arrays import FloatArray
from models.filter_states import declaration
from tuner.navigation.engine import (
    compilation,
    further_couplings,
    layout,
    measurement_models,
    mechanisation,
    propagation,
    random_normal,
    sensor_inputs,
    transition,
    update,
)
from tuner.navigation.engine import (
    fixes as fix_module,
)
from tuner.navigation.engine import (
    state as state_module,
)
from tuner.navigation.engine.compilation import checksum, compiling, entry, prefer_small_code
from tuner.navigation.engine.fixes import AFTER, FixBatch, Output, use_fixes
from tuner.navigation.engine.further_couplings import accelerate_down, add_to_calibration
from tuner.navigation.engine.layout import GRAVITY_INDEX, Layout
from tuner.navigation.engine.mechanisation import (
    calibrate_sample,
    disturb_sample,
    invert_calibration,
    mechanise,
    set_biases,
    start_step,
    take_sample,
)
from tuner.navigation.engine.propagation import LONGEST_DECAY, advance, gather, scatter, set_decay
from tuner.navigation.engine.record_numbers import NUMBERS_CHECKSUM
from tuner.navigation.engine.state import CALIBRATED_ROW, RATE, SAMPLE_ROW, State


@cache
def _variant(filters: int, full: bool | None) -> Any:
    """Return the run compiled for records of `state.record_types`, kept on disk until a source of it changes.

    Numba looks at the file of one function only, and at the closure of that function: so the checksum of all files
    goes there. Each variant has a name, and with it an index on disk, of its own: processes that add to one index at
    the same time would mix up whose code is whose.
    """
    number = _CHECKSUM

    def filter_steps(
        memory: NDArray[np.void],
        covariance: NDArray[np.void],
        inputs: NDArray[np.void],
        each: NDArray[np.void],
        alone: bool | None,
        full: bool | None,
        longest: float,
        dt: FloatArray,
        increments: FloatArray,
        slow: FloatArray,
        unsteady: bool,
        drawn: bool,
        every: int,
        fastest: float,
        fixes: FixBatch,
        shared: bool,
        output: Output,
    ) -> None:
        """Run as many filters as the records contain over the steps; arguments are those of `run_filters` in parts.

        `alone` and `full` are as of `propagation.advance`.
        """
        prefer_small_code()
        if number == 0:
            return
        m, p, a, e = memory[0], covariance[0], inputs[0], each[0]
        after = fixes.flags[:, AFTER]
        steps, mixed = len(dt), m.ideal == 0
        elapsed, decay_dt, last_dt, aged, i = 0.0, -1.0, 0.0, 0.0, 0 * len(dt)
        due = after[0] if len(after) > 0 else -1
        changed = True
        for k in range(steps + 1):
            if k > 0:
                d = dt[k - 1]
                take_sample(m, increments, k - 1, d)
                if drawn:
                    disturb_sample(m, slow, (k - 1) // every, d)
                if full is not None and mixed:
                    calibrate_sample(m)
                stretch = 2.0 * d * d / (last_dt + d) / last_dt if last_dt > 0.0 else 0.0
                mechanise(m, d, stretch)
                if m.gravity >= 0 or m.further_count > 0 or m.constants[GRAVITY_INDEX] != 0.0:
                    accelerate_down(m, d)
                last_dt = d
                elapsed += d
            fixed = due == k
            if elapsed > 0.0 and (k == steps or fixed or elapsed + 0.5 * dt[k] > longest):
                if elapsed != decay_dt:
                    set_decay(m, elapsed)
                    decay_dt = elapsed
                advance(m, p, a, elapsed, alone, full)
                aged += elapsed * fastest
                if k == steps or aged > LONGEST_DECAY:
                    gather(m, p, e)
                    scatter(m, p, e)
                    aged = 0.0
                elapsed = 0.0
                changed = True
            if fixed:
                inverse = 1.0 / last_dt if last_dt > 0.0 else 1.0
                for r in range(6):
                    for w in range(m.rows.shape[1]):
                        m.rows[CALIBRATED_ROW + r, w] = inverse * m.rows[SAMPLE_ROW + r, w]
                i = use_fixes(m, p, e, fixes, i, shared, output, alone, full)
                due = after[i] if i < len(after) else -1
                aged = 0.0
                changed = True
            if changed:
                set_biases(m)
                if full is not None and m.further_count > 0:
                    add_to_calibration(m, False)
                if full is not None and (unsteady or (mixed and k == 0)):
                    invert_calibration(m)
                start_step(m)
                changed = False

    filter_steps.__qualname__ = f"filter_steps_{filters}_{full}"
    return entry(filter_steps)


def variant(lay: Layout, m: State) -> Any:
    """Return the compiled function for these states and records."""
    return _variant(m.rows.shape[1], _full(lay, m))


def _full(lay: Layout, m: State) -> bool | None:
    """Return None for many filters whose sensor errors are biases and noise alone, else True.

    What these leave out takes a quarter of the time of compiling and none of running: so only the filters of simulated
    runs, which a first run waits for, have code of their own.
    """
    plain = lay.ideal and lay.delay < 0 and not len(lay.ramps) and not len(lay.further)
    return None if plain and m.rows.shape[1] > 1 else True


_CHECKSUM = NUMBERS_CHECKSUM ^ checksum(
    vector3, taylor, earth, strapdown, error_state, compilation, declaration, further_couplings,
    layout, state_module, random_normal,
    mechanisation, transition, sensor_inputs, propagation, measurement_models, update, fix_module,
    sys.modules[__name__],
)  # fmt: skip
"""Of the sources of the compiled filter."""


@dataclass(frozen=True)
class SensorInput:
    """Increments of the inertial units of w filters.

    Attributes
    ----------
    dt, increments : ndarray, shapes (m,), (m, 6)
        Steps, s, and increments.
    drawn : bool
        Increments are those of perfect sensors, and errors are added to them: `slow` ones, and white noise of
        density `TRUE_DENSITY_ROW` from `State.stream`.
    slow : ndarray, shape (s, 6, w)
        Errors of rates and forces other than white noise.
    every : int
        Steps over which each row of slow errors is constant.
    """

    dt: FloatArray
    increments: FloatArray
    drawn: bool
    slow: FloatArray
    every: int


def run_filters(
    lay: Layout, m: State, sensed: SensorInput, fixes: FixBatch, output: Output, *, shared: bool
) -> None:
    """Run as many filters as the arrays contain over a stretch of data; changes `m` and `output`.

    Parameters
    ----------
    lay, m
        States and records of the filters.
    sensed, fixes
        Increments and fixes.
    output : Output
        Results at the fixes.
    shared : bool
        Whether all use the gain of the first at a fix, for their covariances alone.
    """
    alone = True if m.rows.shape[1] == 1 else None
    # Between fixes A stays, but where its states decay or follow a slope.
    mixing = np.append(np.flatnonzero(lay.source >= 0), lay.further[lay.further[:, 2] >= 0, 0])
    unsteady = bool(m.states[RATE][mixing].any() or (lay.slope[mixing] >= 0).any())
    full = _full(lay, m)
    arguments = (
        m.memory, m.covariance, m.inputs, m.each, alone, full, lay.covariance_step, sensed.dt, sensed.increments,
        sensed.slow, unsteady, sensed.drawn, sensed.every, float(m.states[RATE].max()), fixes, shared, output,
    )  # fmt: skip
    run = variant(lay, m)
    with compiling(run):
        run(*arguments)
