"""Standard normal numbers in compiled code: a stream of its own for each filter, eight streams at once.

xoshiro256+ [1]_ stirs a state of 256 bits; the upper 52 bits of each answer are a uniform number u. Two of them
are two normal numbers (Box and Muller)::

    z = √(−2 ln u) (cos 2πv, sin 2πv)

Bits lie in the place of numbers: so arrays of lanes hold them, too.

References
----------
.. [1] D. Blackman and S. Vigna, Scrambled linear pseudorandom number generators, ACM Transactions on
       Mathematical Software 47 (2021): the generator for floating-point numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numpy.typing import NDArray

from models.earth import sine_cosine
from tuner.navigation.engine.simd import VECTOR, WIDTH
from tuner.navigation.engine.tracing import Value, straight

FloatArray = NDArray[np.float64]

_WORD = ir.IntType(64)
_WORDS = ir.VectorType(_WORD, WIDTH)
_ONE, _FRACTION = 0x3FF0000000000000, 52
_ROOT_HALF = 0x3FE6A09E667F3BCD


def stream(rng: np.random.Generator) -> FloatArray:
    """Return the state of a new stream, shape (4,): bits that are no numbers."""
    return rng.integers(0, 2**64, 4, dtype=np.uint64).view(np.float64)


class _Bits:
    """The 64 bits of a value, or of each of its lanes."""

    def __init__(self, value: Value, code: Any = None) -> None:
        self.value = value
        kind = _WORDS if value.code.type == VECTOR else _WORD
        self.code = value.writer.builder.bitcast(value.code, kind) if code is None else code

    def _with(self, other: Any, instruction: str) -> _Bits:
        kind = self.code.type
        code = other.code if isinstance(other, _Bits) else kind([other] * WIDTH if kind == _WORDS else other)
        return _Bits(self.value, getattr(self.value.writer.builder, instruction)(self.code, code))

    def __add__(self, other: Any) -> _Bits:
        return self._with(other, "add")

    def __sub__(self, other: Any) -> _Bits:
        return self._with(other, "sub")

    def __xor__(self, other: Any) -> _Bits:
        return self._with(other, "xor")

    def __or__(self, other: Any) -> _Bits:
        return self._with(other, "or_")

    def __lshift__(self, other: int) -> _Bits:
        return self._with(other, "shl")

    def __rshift__(self, other: int) -> _Bits:
        return self._with(other, "lshr")

    def number(self) -> Value:
        """Return what these bits are as a number."""
        return Value(self.value.writer, self.value.writer.builder.bitcast(self.code, self.value.code.type))

    def count(self) -> Value:
        """Return the whole number that these bits are."""
        return Value(self.value.writer, self.value.writer.builder.uitofp(self.code, self.value.code.type))


def _uniform(s: list[_Bits]) -> Value:
    """Return a number in [1, 2), and stir the state."""
    answer = ((s[0] + s[3]) >> (64 - _FRACTION)) | _ONE
    late = s[1] << 17
    s[2] = s[2] ^ s[0]
    s[3] = s[3] ^ s[1]
    s[1] = s[1] ^ s[2]
    s[0] = s[0] ^ s[3]
    s[2] = s[2] ^ late
    s[3] = (s[3] << 45) | (s[3] >> 19)
    return answer.number()


def _logarithm(x: Any) -> Any:
    """Return ln x of a positive number, x = 2ᵏ m with m in [√½, √2): the first omitted term is below 1e-16."""
    bits = _Bits(x)
    above = (bits + (_ONE - _ROOT_HALF)) >> _FRACTION  # 1023 + k
    m = (bits - (above << _FRACTION) + _ONE).number()
    k = above.count() - 1023.0
    y = (m - 1.0) / (m + 1.0)
    s = y * y
    series = 1.0 / 19.0
    for odd in (17, 15, 13, 11, 9, 7, 5, 3, 1):
        series = 1.0 / odd + s * series
    return k * np.log(2.0) + 2.0 * y * series


@straight
def normal_numbers(stream: Any) -> Any:
    """Return six independent standard normal numbers; the stream, shape (4,), goes on."""
    s = [_Bits(stream[i]) for i in range(4)]
    drawn: tuple[Any, ...] = ()
    for _ in range(3):
        radius = np.sqrt(-2.0 * _logarithm(2.0 - _uniform(s)))
        # Half of the angle is within π/2, where the series holds.
        sine, cosine = sine_cosine((_uniform(s) - 1.5) * np.pi)
        drawn += radius * (cosine * cosine - sine * sine), radius * (2.0 * sine * cosine)
    for i in range(4):
        stream[i] = s[i].number()
    return drawn
