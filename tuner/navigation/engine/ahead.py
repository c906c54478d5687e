"""Compiling a variant of the filter before it is needed, beside other work, for its copy on disk."""

from __future__ import annotations

import numpy as np

from tuner.catalogue.grades import DEFAULT_RECEIVER, grade_identification, load_gnss, load_grade
from tuner.jobs import on_disk
from tuner.navigation.engine.filter_steps import SensorInput, run_filters, variant
from tuner.navigation.engine.fixes import FixBatch, new_output
from tuner.navigation.engine.layout import BATCH_SIZE, Layout, layout_of
from tuner.navigation.engine.state import new_state
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize

SAMPLE_GRADE = "mpu9250"
"""A sensor whose filter has the states that most have; numbers do not matter."""


def compile_variant(filters: int = BATCH_SIZE, *, ideal: bool = True) -> None:
    """Run a variant of the filter on no data: it is compiled, or loaded from disk. By default that of simulated runs.

    Parameters
    ----------
    filters : int
        1, or `BATCH_SIZE` side by side.
    ideal : bool
        Whether sensors have no scale factors, misalignments or g-sensitivity; of many filters alone.
    """
    lay = _layout(ideal)
    none = np.zeros((filters, 0, 6))
    run_filters(
        lay,
        new_state(lay, filters),
        SensorInput(np.zeros(0), np.zeros((0, 6)), False, np.zeros((1, 6, filters)), 1),
        FixBatch(np.zeros(0), none, none, np.zeros((0, 5), dtype=np.int64)),
        new_output(filters, 0, lay),
        shared=False,
    )


def is_stored(filters: int = BATCH_SIZE, *, ideal: bool = True) -> bool:
    """Return whether a variant, perhaps of older sources, is on disk."""
    lay = _layout(ideal)
    return on_disk(variant(lay, new_state(lay, filters)))


def _layout(ideal: bool) -> Layout:
    config = synthesize(grade_identification(load_grade(SAMPLE_GRADE)), gnss=load_gnss(DEFAULT_RECEIVER))
    return layout_of(filter_settings(config))._replace(ideal=ideal)
