"""The filter compiled: the same states, equations and answers as `tuner.navigation.reference_filter`.

`run` is one filter, `run_together` many that see the same steps. A first use compiles the filter (a line on standard
error says so) and keeps it on disk. Where numba is missing or cannot be loaded, the reference filter answers, some
hundred times slower, and a line says so once.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from types import ModuleType

import numpy as np

from models.arrays import FloatArray
from models.strapdown import NavigationState
from tuner.navigation.data import Constraints, Fixes, Solution, Steps
from tuner.navigation.engine.layout import BATCH_SIZE
from tuner.navigation.engine.measurement_rows import measurements, parted
from tuner.navigation.settings import FilterSettings


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
        Steps over which each row of `slow` is constant.
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
    compiled = _compiled()
    if compiled is None:
        from tuner.navigation import reference_filter  # loaded when used: filterpy is slow to import

        steps = steps if errors is None else disturbed(steps, errors)
        return reference_filter.run(
            settings,
            start,
            steps,
            fixes,
            parameters=parameters,
            covariance=covariance,
            constraints=constraints,
        )
    own = None if errors is None else (errors,)
    rows = measurements(settings, fixes, constraints)
    (solution,) = compiled.filter_together(
        settings, (start,), steps, (rows,), own, parameters, covariance, fixes.refused_since
    )
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

    `BATCH_SIZE` of them go through the compiled loops side by side.

    Parameters
    ----------
    starts : sequence of NavigationState
        One for each filter.
    fixes : sequence of Fixes
        One for each filter; times and flags are those of the first.
    errors : sequence of SensorErrors, optional
        What to add to the increments of each, which then are those of perfect sensors.
    """
    compiled = _compiled()
    if compiled is None:
        from tuner.navigation import reference_filter  # loaded when used: filterpy is slow to import

        return run_each(reference_filter.run, settings, starts, steps, fixes, errors=errors)
    answers: list[Solution] = []
    rows = [measurements(settings, own, None) for own in fixes]
    for first in range(0, len(starts), BATCH_SIZE):
        among = [min(first + w, len(starts) - 1) for w in range(BATCH_SIZE)]
        own = None if errors is None else [errors[j] for j in among]
        block = compiled.filter_together(
            settings, [starts[j] for j in among], steps, [rows[j] for j in among], own
        )
        answers.extend(block[: len(starts) - first])
    return tuple(answers)


def run_each(
    filtered: Callable[[FilterSettings, NavigationState, Steps, Fixes], Solution],
    settings: FilterSettings,
    starts: Sequence[NavigationState],
    steps: Steps,
    fixes: Sequence[Fixes],
    *,
    errors: Sequence[SensorErrors] | None = None,
) -> tuple[Solution, ...]:
    """Filter as `run_together`, one after another by `filtered`: the filters of both engines have the same increments.

    Parameters
    ----------
    filtered : function
        `run` of this module or of `tuner.navigation.reference_filter`.
    """
    drawn = [steps] * len(starts) if errors is None else [disturbed(steps, one) for one in errors]
    each = zip(starts, drawn, fixes, strict=True)
    return tuple(filtered(settings, start, own, some) for start, own, some in each)


def is_compiled() -> bool:
    """Return whether the compiled filter can be loaded: else `run` and `run_together` are the reference filter."""
    return _compiled() is not None


def disturbed(steps: Steps, errors: SensorErrors) -> Steps:
    """Return the increments of perfect sensors with errors drawn by numpy, as the reference filter needs them.

    The white noise is that of another generator than that of the compiled filter.
    """
    row = np.arange(len(steps.dt)) // errors.every
    white = errors.rng.standard_normal((len(steps.dt), 6)) * np.sqrt(steps.dt)[:, None] * errors.white
    return replace(steps, increments=steps.increments + errors.slow[row] * steps.dt[:, None] + white)


@cache
def _compiled() -> ModuleType | None:
    """Return the compiled filter, or None and a message where numba cannot be loaded."""
    try:
        return import_module("tuner.navigation.engine.compiled_filter")
    except Exception as error:  # numba broken in whatever way must not stop the reference filter
        logging.getLogger("tuner").warning(
            "tuner: numba cannot be used (%s: %s); the reference filter runs instead, much slower",
            type(error).__name__,
            error,
        )
        return None
