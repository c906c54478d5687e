"""Tables of long Fourier transforms, which SciPy keeps: those of its last sixteen lengths, for each kind of number.

Of a record of 2e7 samples the tables of one length are as large as two of its columns, and are made in a tenth of the
time of its transform.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import dct, rfft

LONG_TRANSFORM = 1 << 18
"""Samples from which the tables of a length, 4 MB, are not worth keeping."""
TABLES_KEPT = 16
"""Lengths whose tables are kept, as measured with SciPy 1.14.1 and 1.17.1: its documentation does not state it.

SciPy 1.18.1 keeps none that are long. Where the number is another one, tables stay in memory, and results are alike.
"""


def without_tables(n: int) -> None:
    """Let SciPy forget its tables if n samples have just been transformed: others take their places."""
    if n >= LONG_TRANSFORM:
        for size in range(TABLES_KEPT, 2 * TABLES_KEPT):
            rfft(np.zeros(size, np.float32))
            rfft(np.zeros(size))
            dct(np.zeros(size))
