"""The loops of the compiled filter that take most of the time are packed instructions."""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys

import pytest
from llvmlite.binding import get_host_cpu_features
from numba import njit
from numba.extending import is_jitted

from tuner.catalogue.grades import grade_identification, load_gnss, load_grade
from tuner.linear_run import kalman_kernels
from tuner.navigation.engine import filter_steps
from tuner.navigation.engine.layout import BATCH_SIZE, layout_of
from tuner.navigation.engine.mechanisation import mechanise
from tuner.navigation.engine.sensor_inputs import inputs_by_columns
from tuner.navigation.engine.state import new_state
from tuner.navigation.engine.transition import columns_through_step
from tuner.navigation.settings import filter_settings
from tuner.synthesis import synthesize

PACKED = re.compile(r"\bv?(?:mul|add|sub|fn?m(?:add|sub)\d+)pd\b")
WIDE = re.compile(PACKED.pattern + r".*%zmm")


@njit
def _mechanised(memory, covariance, inputs, _):
    mechanise(memory[0], 0.01, 1.0)


@njit
def _stepped(memory, covariance, inputs, _):
    columns_through_step(memory[0], covariance[0], inputs[0], 0, 16, 0.01)


@njit
def _summed(memory, covariance, inputs, alone):
    inputs_by_columns(memory[0], covariance[0], inputs[0], 0, 16, alone)


def packed(function, state):
    function(state.memory, state.covariance, state.inputs, True if state.rows.shape[1] == 1 else None)
    code = list(function.inspect_asm().values())[-1]
    return len(PACKED.findall(code)), len(WIDE.findall(code))


def counts(filters):
    settings = filter_settings(synthesize(grade_identification(load_grade("mpu9250")), gnss=load_gnss("spp")))
    state = new_state(layout_of(settings), filters)
    return [packed(function, state) for function in (_stepped, _summed, _mechanised)]


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names of x86 instructions")
@pytest.mark.slow
def test_loops_are_packed(tmp_path):
    """In a process and a cache of its own: a function read from the cache is called, and its code is not seen."""
    finished = subprocess.run(
        [sys.executable, __file__],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    alone, together = json.loads(finished.stdout)
    for (stepped, wide), (summed, _), _ in (alone, together):
        assert stepped >= 60
        assert summed >= 4
        if get_host_cpu_features().get("avx512f"):
            assert wide >= 0.9 * stepped
    assert together[2][0] >= 150  # of the mechanisation


def test_no_kernel_rounds_otherwise_where_it_is_inlined():
    """With `fastmath` the process that compiles would differ in the last digits from those that load its code."""
    kernels = (*vars(kalman_kernels).values(), *vars(filter_steps).values())
    options = [one.targetoptions for one in kernels if is_jitted(one)]
    assert options
    assert not any(one.get("fastmath") for one in options)


if __name__ == "__main__":
    sys.stdout.write(json.dumps([counts(filters) for filters in (1, BATCH_SIZE)]))
