"""Every variant of the compiled filter, run on no data: it is compiled, or loaded from disk, and nothing else."""

from __future__ import annotations

from itertools import product

import numpy as np

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.engine.filter_steps import SensorInput, run_filters
from tuner.navigation.engine.fixes import FixBatch, new_output
from tuner.navigation.engine.layout import BATCH_SIZE, layout_of, with_sensor_states
from tuner.navigation.engine.state import LONG_ROW, SHORT_ROW, new_state
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize

UNUSED = (LONG_ROW, 1, True)
"""What no test runs: a filter alone with many states and ideal sensors."""
VARIANTS = tuple(
    one for one in product((LONG_ROW, SHORT_ROW), (BATCH_SIZE, 1), (False, True)) if one != UNUSED
)
"""Room for states, filters, and whether sensors are ideal; those that take longest to compile first."""


def run_on_no_data(length: int, filters: int, ideal: bool) -> None:
    config = synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp"))
    lay = layout_of(filter_settings(config))._replace(ideal=ideal)
    if length == LONG_ROW:
        lay = with_sensor_states(lay, np.zeros(SHORT_ROW + 1 - lay.size, dtype=np.int64))
    none = np.zeros((filters, 0, 6))
    run_filters(
        lay,
        new_state(lay, filters),
        SensorInput(np.zeros(0), np.zeros((0, 6)), False, np.zeros((1, 6, filters)), 1),
        FixBatch(np.zeros(0), none, none, np.zeros((0, 5), dtype=np.int64)),
        new_output(filters, 0, lay),
        shared=False,
    )
