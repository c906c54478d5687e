"""What the compiled kernels share: the decorator, a filter as plain numbers, the arrays of a run.

The equations of motion and of the error coupling are those of `models`, compiled from the same lines.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, TypeVar, cast

import numba
import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from models import earth, errorstate, strapdown, triples

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., object])

for _function in (*triples.KERNELS, *earth.KERNELS, *strapdown.KERNELS, *errorstate.KERNELS):
    register_jitable(forceinline=True)(_function)


def compiled(function: Function) -> Function:
    """Compile a kernel when it is first called; it runs without the interpreter's lock."""
    return cast(
        Function, numba.njit(nogil=True, error_model="numpy", fastmath=True, forceinline=True)(function)
    )


def checksum(*sources: ModuleType) -> int:
    """Return a number that changes with the code of modules."""
    total = 1
    for source in sources:
        total = zlib.crc32(Path(str(source.__file__)).read_bytes(), total)
    return total


class Layout(NamedTuple):
    """A filter as plain numbers.

    Attributes
    ----------
    size : int
        n.
    rate : ndarray, shape (n,)
        1/T of each state, 1/s.
    drive : ndarray, shape (n,)
        Square of its driving density.
    white : ndarray, shape (6,)
        Squares of the white densities of gyros and accelerometers.
    row, source : ndarray of int, shape (n,)
        Column j of S has its one element in row `row[j]` (−1: none): the true rate `source[j]`, or 1 for −1.
    slope : ndarray of int, shape (n,)
        Index of the state that is the slope of state j, −1 for none.
    gravity, lever, delay, gnss : int
        First index of these blocks, −1 where absent.
    processes : int
        Gauss–Markov processes in the GNSS position.
    ideal : bool
        No scale factors, misalignments or g-sensitivity.
    arm : ndarray, shape (3,)
        Nominal lever arm, m.
    gate : float
        χ² limit of three components.
    covariance_step : float
        Longest step of the covariance, s.
    patience : float
        Time with nothing but refused fixes after which one is used, s.
    """

    size: int
    rate: FloatArray
    drive: FloatArray
    white: FloatArray
    row: IntArray
    source: IntArray
    slope: IntArray
    gravity: int
    lever: int
    delay: int
    gnss: int
    processes: int
    ideal: bool
    arm: FloatArray
    gate: float
    covariance_step: float
    patience: float


class Workspace(NamedTuple):
    """Arrays that live as long as a run."""

    wide: FloatArray  # (9, n + 6)
    answer: FloatArray  # (6, n + 6)
    small: FloatArray  # (9, 6)
    decay: FloatArray  # (n,)
    driven: FloatArray  # (n,)
    matrix: FloatArray  # (6, 6), A
    inverse: FloatArray  # (6, 6)
    bias: FloatArray  # (6,)


@compiled
def unmix(inverse: FloatArray, rows: FloatArray, j: int) -> None:
    """Replace column j of rows (6, …) by A⁻¹ times it."""
    a, b, c, d, e, f = rows[0, j], rows[1, j], rows[2, j], rows[3, j], rows[4, j], rows[5, j]
    for r in range(6):
        rows[r, j] = (
            inverse[r, 0] * a
            + inverse[r, 1] * b
            + inverse[r, 2] * c
            + inverse[r, 3] * d
            + inverse[r, 4] * e
            + inverse[r, 5] * f
        )
