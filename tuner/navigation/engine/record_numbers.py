"""Numbers of the filter's record types that are the same in every process.

Numba names a compiled function by the numbers of its argument types, which it gives in the order in which a process
meets types. Two processes that compile the filter for different records would give both the same number, and a third
one, which loads both from disk, would call the parts of one with the records of the other. So the records get their
numbers here, before any of them is compiled, and counted from a fixed beginning.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numba import from_dtype, types

from tuner.navigation.engine.layout import BATCH_SIZE
from tuner.navigation.engine.state import record_types

FIRST_NUMBER = 20_000
"""From here on: more than a process has types before it compiles the filter (about 400 at first, some thousands when
all else of the project is compiled)."""


def _number(record: Any) -> int:
    _, (number,) = record.mangling_args
    return int(number)


def _numbered() -> tuple[Any, ...]:
    """Return the record types, their numbers one after another."""
    for k in range(_number(from_dtype(np.dtype([("first", "i1")]))), FIRST_NUMBER):
        types.Opaque(f"unused {k}")
    kinds = [kind for filters in (1, BATCH_SIZE) for kind in record_types(filters)]
    return tuple(from_dtype(kind) for kind in kinds)


RECORDS = _numbered()
"""Kept, so that their numbers are."""
NUMBERS_CHECKSUM = zlib.crc32(repr([_number(record) for record in RECORDS]).encode())
"""What is stored with the compiled filter: with other numbers it is compiled anew."""
