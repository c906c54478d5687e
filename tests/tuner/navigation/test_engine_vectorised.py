"""The loops of the compiled filter that take most of the time are packed instructions."""

from __future__ import annotations

import platform
import re

import pytest
from numba import njit

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.navigation.engine.layout import BATCH_SIZE, layout_of
from tuner.navigation.engine.mechanisation import mechanise
from tuner.navigation.engine.sensor_inputs import inputs_by_columns
from tuner.navigation.engine.state import new_state
from tuner.navigation.engine.transition import columns_through_step
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize

PACKED = re.compile(r"\bv?(?:mul|add|sub|fn?m(?:add|sub)\d+)pd\b")


@njit(fastmath=True)
def _mechanised(memory, covariance, inputs):
    mechanise(memory[0], 0.01, 1.0)


@njit(fastmath=True)
def _stepped(memory, covariance, inputs):
    columns_through_step(memory[0], covariance[0], inputs[0], 0, 16, 0.01)


@njit(fastmath=True)
def _summed(memory, covariance, inputs):
    inputs_by_columns(memory[0], covariance[0], inputs[0], 0, 16)


def packed(function, state):
    function(state.memory, state.covariance, state.inputs)
    return len(PACKED.findall(list(function.inspect_asm().values())[-1]))


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names of x86 instructions")
@pytest.mark.parametrize("filters", [1, BATCH_SIZE])
def test_loops_are_packed(filters):
    settings = filter_settings(synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp")))
    state = new_state(layout_of(settings), filters)
    assert packed(_stepped, state) >= 60
    assert packed(_summed, state) >= 4
    if filters > 1:
        assert packed(_mechanised, state) >= 150
