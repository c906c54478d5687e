"""What the tests compile, in parts for the workers of one run: each part once, before any test needs it.

Workers that each compiled what their own tests need would compile the same, at the same time: numba writes a function
to disk for the next process, but does not wait for one that compiles it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

from tuner.navigation.engine.ahead import compile_variant
from tuner.navigation.engine.layout import BATCH_SIZE
from tuner.navigation.engine.state import LONG_ROW, SHORT_ROW

UNUSED = (LONG_ROW, 1, True)
"""What no test runs: a filter alone with many states and ideal sensors."""
VARIANTS = tuple(
    one for one in product((LONG_ROW, SHORT_ROW), (BATCH_SIZE, 1), (False, True)) if one != UNUSED
)
"""Of the compiled filter: room for states, filters, and whether sensors are ideal; those that take longest first."""
MAX_WAIT = 300.0
"""Longest time that a worker waits for what the others compile, s."""


def _likelihood_of_drives() -> None:
    from tests.tuner.diagnosis.drive.conftest import city
    from tuner.diagnosis.drive.linear_model.likelihood import as_configured, evaluate_with_gradient

    evaluate_with_gradient(as_configured(city(3)))


def _linear_model_of_drives() -> None:
    from models.trajectory.catalogue import TRAJECTORIES
    from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
    from tuner.diagnosis.drive.hypothesis import Hypothesis, run_filter
    from tuner.simulation.drive import simulate_drive
    from tuner.synthesis import synthesize

    grade, gnss = load_grade("mpu9250"), load_gnss("spp")
    drive, _ = simulate_drive(grade, TRAJECTORIES["city"](40.0), gnss, rate=25.0, seed=1)
    run_filter(drive, Hypothesis.first(drive, synthesize(grade_identification(grade), gnss=gnss)))


def _likelihood_of_outputs() -> None:
    from tests.textbook_filters import run_invariant
    from tests.tuner.consistency.test_output_causes import scored

    scored(run_invariant, 1, 1, duration=60.0, r=9.0)


def _static() -> list[Callable[[], None]]:
    from tuner.diagnosis.static.compiled_ahead import GROUPS

    return list(GROUPS)


def compile_share(number: int, workers: int, folder: Path) -> None:
    """Compile the share of one of several workers, then wait until the others have compiled theirs.

    Parameters
    ----------
    number, workers : int
        Which worker this is, from 0 on, and how many there are.
    folder : Path
        Folder that all workers of this run share, and no other.
    """
    filters = [partial(compile_variant, length, n, ideal=ideal) for length, n, ideal in VARIANTS]
    parts = [_likelihood_of_drives, _linear_model_of_drives, *filters, _likelihood_of_outputs, *_static()]
    for part in parts[number::workers]:
        part()
    (folder / f"compiled-{number}").touch()
    end = time.monotonic() + MAX_WAIT
    while len(list(folder.glob("compiled-*"))) < workers and time.monotonic() < end:
        time.sleep(0.1)
