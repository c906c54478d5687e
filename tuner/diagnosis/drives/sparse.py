"""Matrices of a record that have zeros at the same places at every fix, kept without them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Sparse:
    """The m places of (k, n, n) matrices that are not 0 throughout, row by row.

    Attributes
    ----------
    of : ndarray, shape (k, n, n)
        The matrices.
    start : ndarray of int, shape (n + 1,)
        First place of every row.
    row, column : ndarray of int, shape (m,)
        Of every place.
    values : ndarray, shape (k, m)
        What stands there.
    """

    of: FloatArray
    start: IntArray
    row: IntArray
    column: IntArray
    values: FloatArray


def sparse(matrices: FloatArray, *, lower: bool = False) -> Sparse:
    """Return matrices (k, n, n) without their zeros; of symmetric ones, if wished, the lower half only."""
    n = matrices.shape[-1]
    place = np.any(matrices != 0.0, axis=0) if len(matrices) else np.zeros((n, n), dtype=bool)
    row, column = np.nonzero(np.tril(place | place.T) if lower else place)
    start = np.searchsorted(row, np.arange(n + 1))
    values = np.ascontiguousarray(matrices[:, row, column])
    return Sparse(matrices, start.astype(np.int64), row.astype(np.int64), column.astype(np.int64), values)
