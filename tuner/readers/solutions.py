"""Classes of solution as receivers and programs number them, by their numbers in `SOLUTIONS`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import FloatArray

OF_RTKLIB: Mapping[int, int] = MappingProxyType({1: 4, 2: 5, 3: 2, 4: 2, 5: 1, 6: 3, 7: 6})
"""Q of RTKLIB (manual 2.4.2, appendix B.1): fixed, float, SBAS, differential, single, precise point, dead reckoning."""
OF_AUTOPILOTS: Mapping[int, int] = MappingProxyType({3: 1, 4: 2, 5: 5, 6: 4})
"""Fix type of MAVLink, PX4 and ArduPilot: in three dimensions, differential, float, fixed."""


def solutions(numbers: ArrayLike, meaning: Mapping[int, int]) -> FloatArray:
    """Return classes of solution, (k,), NaN for numbers (k,) without a meaning."""
    given = np.nan_to_num(np.asarray(numbers, dtype=float), nan=-1.0).astype(int)
    return np.array([meaning.get(one, math.nan) for one in given.tolist()], dtype=float)
