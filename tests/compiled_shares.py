"""What the tests compile, in parts for the workers of one run: each part once, by the worker that is free.

Workers that each compiled what their own tests need would compile the same, at the same time: numba writes a function
to disk for the next process, but does not wait for one that compiles it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tuner.navigation.engine.ahead import compile_variant
from tuner.navigation.engine.layout import BATCH_SIZE

VARIANTS = ((1, False), (BATCH_SIZE, False), (BATCH_SIZE, True))
"""Of the compiled filter: filters, and whether sensors are ideal. What takes longest comes first."""
ALONE = VARIANTS[0]
"""The variant that a linear model of a drive is taken from."""
MAX_WAIT = 300.0
"""Longest time that a worker waits for what the others compile, s."""


def _likelihood_of_drives() -> None:
    from tests.tuner.diagnosis.drive.conftest import city
    from tuner.linear_run.likelihood import as_configured, evaluate_with_gradient

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


class Part(NamedTuple):
    """What one worker compiles, after another part, and whether the others wait for it."""

    name: str
    run: Callable[[], None]
    after: str = ""
    awaited: bool = True


def parts() -> list[Part]:
    """Return all parts, those that take longest first; few tests need the linear model: the others do not wait."""
    filters = [
        Part("-".join(map(str, one)), partial(compile_variant, one[0], ideal=one[1])) for one in VARIANTS
    ]
    linear = Part("linear", _linear_model_of_drives, after=filters[0].name, awaited=False)
    others = [_likelihood_of_outputs, _likelihood_of_drives, *_static()]
    return [*filters, linear, *(Part(run.__name__, run) for run in others)]


def compile_share(folder: Path) -> None:
    """Compile what no other worker does yet, then wait until all of it is compiled.

    Parameters
    ----------
    folder : Path
        Folder that all workers of this run share, and no other.
    """

    def wait(*names: str) -> None:
        end = time.monotonic() + MAX_WAIT
        while time.monotonic() < end and not all((folder / f"compiled-{name}").exists() for name in names):
            time.sleep(0.1)

    every = parts()
    for part in every:
        try:
            (folder / f"compiling-{part.name}").touch(exist_ok=False)
        except FileExistsError:
            continue
        if part.after:
            wait(part.after)
        try:
            part.run()
        finally:
            (folder / f"compiled-{part.name}").touch()
    wait(*(part.name for part in every if part.awaited))
