"""Compiled filters of several processes on one disk: their records have the same numbers in all of them."""

from __future__ import annotations

import re
import subprocess
import sys

from tuner.navigation.engine.filter_steps import _variant
from tuner.navigation.engine.layout import BATCH_SIZE

NUMBERS = (
    "from tuner.navigation.engine.record_numbers import RECORDS; print([r.mangling_args for r in RECORDS])"
)
OTHERS = "from numba import types; kept = [types.Opaque(f'other {k}') for k in range(1000)]; "


def test_record_types_have_the_same_numbers_in_every_process():
    """Else parts compiled for one record are called with another: wrong numbers, or the end of the process."""
    first, second = (
        subprocess.run(
            [sys.executable, "-c", before + NUMBERS], capture_output=True, text=True, check=True
        ).stdout
        for before in ("", OTHERS)
    )
    assert first == second
    assert len(set(re.findall(r"\d+", first))) == 8


def test_each_variant_has_an_index_of_its_own_on_disk():
    """Numba names an index by the function: processes that add to one at a time would mix up whose code is whose."""
    variants = [(1, True), (BATCH_SIZE, True), (BATCH_SIZE, None)]
    assert len({_variant(*one).py_func.__qualname__ for one in variants}) == len(variants)
