"""Copies between arrays in compiled code, number by number.

Numba compiles ``to[:] = source`` with a message for shapes that differ, in 2 s the first time.
"""

from __future__ import annotations

from numba.extending import register_jitable
from numpy.typing import NDArray


@register_jitable  # type: ignore[misc, unused-ignore]
def copy_row(to: NDArray, source: NDArray) -> None:  # type: ignore[type-arg]
    """Set the first numbers of a row to those of another, shape (n,)."""
    for j in range(source.shape[0]):
        to[j] = source[j]


@register_jitable  # type: ignore[misc, unused-ignore]
def copy_matrix(to: NDArray, source: NDArray) -> None:  # type: ignore[type-arg]
    """Set the upper left corner of a matrix to another, shape (n, m)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            to[i, j] = source[i, j]
