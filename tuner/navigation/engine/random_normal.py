"""Standard normal numbers in compiled code: a stream of its own for each filter, all streams advanced side by side.

xoshiro256+ [1]_ keeps a state of 256 bits; the upper 52 bits of each output are a uniform number u in [0, 1). Two of
them give two normal numbers (Box and Muller)::

    z = √(−2 ln(1 − u)) (cos 2πv, sin 2πv)

References
----------
.. [1] D. Blackman and S. Vigna, Scrambled linear pseudorandom number generators, ACM Transactions on
       Mathematical Software 47 (2021): the generator for floating-point numbers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.taylor import sine_cosine
from tuner.navigation.engine.compilation import count, inlined, prefer_wide_vectors

WordArray = NDArray[np.uint64]

FRACTION_BITS = np.uint64(52)
"""Bits of the fraction of a double."""
ONE_BITS = np.uint64(0x3FF0000000000000)
"""Bits of 1.0."""
ROOT_HALF = np.uint64(0x3FE6A09E667F3BCD)
"""Bits of √½."""
LOGARITHM = tuple(2.0 / odd for odd in range(1, 21, 2))
"""Coefficients of ln((1 + y)/(1 − y))/y in y²; the first omitted term is below 1e-16 for |y| ≤ (√2 − 1)/(√2 + 1)."""
RANDOM_ROWS = 12
"""Rows of scratch that `normal_numbers` needs."""
_A, _B, _C, _D, _SHIFT_OUT = (np.uint64(k) for k in (17, 45, 19, 52, 12))


def stream(rng: np.random.Generator) -> WordArray:
    """Return the state of a new stream, shape (4,)."""
    return rng.integers(0, 2**64, 4, dtype=np.uint64)


@inlined
def _logarithm_of_fraction(m: float) -> float:
    """Return ln m for m in [√½, √2)."""
    y = (m - 1.0) / (m + 1.0)
    s = y * y
    c = LOGARITHM
    high = c[6] + s * (c[7] + s * (c[8] + s * c[9]))
    return y * (c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * (c[5] + s * high))))))


@inlined
def normal_numbers(m: Any) -> None:
    """Set rows 0–5 of the `numbers` of the record to independent standard normal numbers.

    `words` are the same memory as `numbers`, as whole numbers.
    """
    prefer_wide_vectors()
    state, words, numbers, filters = m.stream, m.words, m.numbers, count(m)
    for k in range(6):
        for w in range(filters):
            a, b, c, d = state[0, w], state[1, w], state[2, w], state[3, w]
            words[k, w] = ((a + d) >> _SHIFT_OUT) | ONE_BITS
            c ^= a
            d ^= b
            state[0, w] = a ^ d
            state[1, w] = b ^ c
            state[2, w] = c ^ (b << _A)
            state[3, w] = (d << _B) | (d >> _C)
    for k in range(3):
        for w in range(filters):
            numbers[6 + k, w] = 2.0 - numbers[2 * k, w]
    for k in range(3):
        for w in range(filters):
            above = (words[6 + k, w] + (ONE_BITS - ROOT_HALF)) >> FRACTION_BITS  # 1023 + the power of two
            numbers[9 + k, w] = np.int32(above) - 1023
            words[6 + k, w] = words[6 + k, w] - (above << FRACTION_BITS) + ONE_BITS
    for k in range(3):
        for w in range(filters):
            logarithm = numbers[9 + k, w] * math.log(2.0) + _logarithm_of_fraction(numbers[6 + k, w])
            radius = np.sqrt(-2.0 * logarithm)
            # Half of the angle is within π/2, where the series holds.
            sine, cosine = sine_cosine((numbers[2 * k + 1, w] - 1.5) * math.pi)
            numbers[2 * k, w] = radius * (cosine * cosine - sine * sine)
            numbers[2 * k + 1, w] = radius * (2.0 * sine * cosine)
