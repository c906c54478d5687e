"""The array types of the project, by what they hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
"""Counts and codes."""
IndexArray = NDArray[np.intp]
"""Positions in other arrays."""
SignedArray = NDArray[np.signedinteger[Any]]
"""Whole numbers of any width, as a file may hold them."""

LEAST_DIVISOR = 1e-300
"""Least divisor and argument of a logarithm: below all that is measured, above where numbers end."""
SAMPLES_AT_ONCE = 1 << 16
"""Samples for which an intermediate column is made at a time, so that it stays in the cache."""
