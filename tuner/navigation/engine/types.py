"""What the compiled kernels share: a filter as plain numbers.

The equations of motion and of the error coupling are those of `models`, compiled from the same lines.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import earth, strapdown
from models import error_state as errorstate
from models import vector3 as triples
from tuner.navigation.engine.simd import WIDTH, aligned
from tuner.navigation.engine.tracing import straight

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.uint64]

SMALLEST = 15
"""States of every filter: position, velocity, attitude, biases of gyros and accelerometers."""
NEVER = 1e300
"""Later than any time, s."""

for _function in (*triples.KERNELS, *earth.KERNELS, *strapdown.KERNELS, *errorstate.KERNELS):
    straight(_function)


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
    ramps : ndarray of int, shape (r,)
        The states that have one.
    gravity, lever, delay, gnss : int
        First index of these blocks, −1 where absent.
    processes : int
        Gauss–Markov processes in the GNSS position.
    total : ndarray of int, shape (n,)
        Which of nine navigation errors and six total biases a state is a part of, −1 for none.
    ideal : bool
        No scale factors, misalignments or g-sensitivity.
    feed, first : ndarray of int, shapes (s,), (7,)
        The states that sensor r feels, beside its bias, are `feed[first[r]:first[r + 1]]`; unsigned, which saves
        a look for indices from the end.
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
    ramps: IntArray
    gravity: int
    lever: int
    delay: int
    gnss: int
    processes: int
    total: IntArray
    ideal: bool
    feed: IndexArray
    first: IntArray
    arm: FloatArray
    gate: float
    covariance_step: float
    patience: float


class Own(NamedTuple):
    """One filter among eight, as the updates see it, and their scratch."""

    P: FloatArray  # (n, columns); more columns than states, what is behind them is nothing
    x: FloatArray  # (n,)
    true: FloatArray  # (6,), calibrated rates and forces
    inverse: FloatArray  # (6, 6), of A
    z: FloatArray  # (6,), innovations
    H: FloatArray  # (6, n)
    dx: FloatArray  # (n,), estimated errors
    limits: FloatArray  # (2,), χ² limits of position and velocity
    sensors: FloatArray  # (6, columns), answer of rates and forces to the states
    rows: FloatArray  # (6, columns), H P and what is made of it, behind it z
    block: FloatArray  # (6, 6), a part of S
    root: FloatArray  # (6, 6), its factor
    part: FloatArray  # (6, 1), a part of z
    felt: FloatArray  # (6,), rates and forces without biases


def own_of(n: int) -> Own:
    """Return the memory of updates of n states."""
    columns = (n // WIDTH + 1) * WIDTH
    shapes = (
        (n, columns),
        (n,),
        (6,),
        (6, 6),
        (6,),
        (6, n),
        (n,),
        (2,),
        (6, columns),
        (6, columns),
        (6, 6),
        (6, 6),
        (6, 1),
        (6,),
    )
    return Own(*(aligned(*shape) for shape in shapes))


def sensed_states(row: IntArray) -> tuple[IndexArray, IntArray]:
    """Return `feed` and `first` of a layout."""
    others = np.arange(SMALLEST, len(row))
    felt = others[row[SMALLEST:] >= 0]
    feed = felt[np.argsort(row[felt], kind="stable")]
    return feed.astype(np.uint64), np.searchsorted(row[feed], np.arange(7))


def total_rows(row: IntArray, source: IntArray) -> IntArray:
    """Return `total` of a layout."""
    state = np.arange(len(row))
    return np.where(state < 9, state, np.where((row >= 0) & (source < 0), 9 + row, -1))


@straight
def set_true(true: Any, rate: Any, force: Any) -> None:
    """Set calibrated rates and forces in b."""
    for c in range(3):
        true[c], true[3 + c] = rate[c], force[c]


@straight
def transposed(m: Any) -> Any:
    """Return the transposed matrix."""
    return (m[0][0], m[1][0], m[2][0]), (m[0][1], m[1][1], m[2][1]), (m[0][2], m[1][2], m[2][2])


@straight
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
