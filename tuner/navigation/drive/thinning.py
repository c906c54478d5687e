"""Fewer fixes of a drive at irregular distances, so that no pattern of the receiver is picked out.

A receiver may alternate between kinds of solutions; every n-th of its fixes then are all of one kind. Row i of k is
drawn from the i-th of k equal parts at the fractional part of i φ, φ the golden ratio: of all sequences the one whose
points repeat any period least.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GOLDEN_RATIO = 0.5 * (1.0 + 5.0**0.5)


def irregular_rows(count: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` of the row numbers 0 … count − 1, one of each of so many equal parts, rising."""
    if count <= most:
        return np.arange(count)
    i = np.arange(most)
    # Neighbouring parts of less than two rows may draw the same row.
    return np.unique(np.minimum(((i + i * GOLDEN_RATIO % 1.0) * count / most).astype(np.intp), count - 1))
