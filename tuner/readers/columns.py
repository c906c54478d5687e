"""What a file offers before its data are read, and the small things all formats share."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.types.records import DataError

Progress = Callable[[int, int], None]
"""Called with (bytes done, bytes in total)."""


@dataclass(frozen=True)
class Part:
    """One column of a file: an array and, for an (n, k) array, the column of it."""

    array: str
    column: int | None = None

    def __str__(self) -> str:
        return self.array if self.column is None else f"{self.array}[{self.column}]"


Load = Callable[[Sequence[Sequence[Part]]], tuple[NDArray[Any], ...]]
"""Reads groups of parts as Fortran-ordered (n, len(group)) arrays: float64, or int64 if all are integers."""


@dataclass(frozen=True)
class Listing:
    """The columns of a file.

    Attributes
    ----------
    path : Path
        The file.
    shapes : mapping of str to tuple of int
        Shape of each array; (0,) of a text column whose length is not known yet.
    load : callable
        Reads groups of columns.
    units : mapping of str to str
        Units that the file states beside an array (attributes), as written.
    integer : frozenset of str
        Arrays of an integer type; `unsigned` maps the unsigned ones to their number of bits.
    meta : mapping
        What the file says about itself: ``rate_hz``, ``gyro_lsb_dps`` and the like.
    notes : tuple of str
        How the file was understood.
    guessed : frozenset of str
        Arrays whose unit the format assumes, because nothing in the file names their content.
    """

    path: Path
    shapes: Mapping[str, tuple[int, ...]]
    load: Load
    units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    integer: frozenset[str] = frozenset()
    unsigned: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    meta: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    notes: tuple[str, ...] = ()
    guessed: frozenset[str] = frozenset()


def listing_of_arrays(
    path: Path, arrays: Mapping[str, NDArray[Any]], *, units: Mapping[str, str], meta: Mapping[str, Any]
) -> Listing:
    """Make the listing of arrays in memory (NPZ, MAT, HDF5); only numbers of one or two dimensions count.

    An array of three or six rows and many columns is turned round.
    """
    numbers = {}
    notes = []
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.ndim not in (1, 2) or array.size < 2:
            continue
        if array.ndim == 2 and 1 in array.shape:
            array = array.ravel()
        elif array.ndim == 2 and array.shape[0] in (3, 6) and array.shape[1] > 6:
            array = array.T
            notes.append(f"array '{name}' was turned round to {array.shape}")
        numbers[name] = array

    def load(groups: Sequence[Sequence[Part]]) -> tuple[NDArray[Any], ...]:
        loaded = []
        for group in groups:
            parts = [numbers[p.array] if p.column is None else numbers[p.array][:, p.column] for p in group]
            lengths = {len(p) for p in parts}
            if len(lengths) > 1:
                sizes = ", ".join(f"{part} has {len(p)}" for part, p in zip(group, parts, strict=True))
                msg = f"{path}: columns of one sensor must have one length: {sizes} rows"
                raise DataError(msg)
            kinds = {p.dtype.kind for p in parts}
            dtype = np.int64 if kinds <= {"i", "u"} else np.float64
            block = np.empty((lengths.pop(), len(parts)), dtype, order="F")
            for j, part in enumerate(parts):
                block[:, j] = part
            loaded.append(block)
        return tuple(loaded)

    return Listing(
        path=path,
        shapes={name: a.shape for name, a in numbers.items()},
        load=load,
        units=units,
        integer=frozenset(name for name, a in numbers.items() if a.dtype.kind in "iu"),
        unsigned={name: 8 * a.dtype.itemsize for name, a in numbers.items() if a.dtype.kind == "u"},
        meta=meta,
        notes=tuple(notes),
    )


def digest(path: Path) -> str:
    """Return the SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
