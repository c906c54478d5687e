"""The columns of a log file, listed before their data are read; and what the readers of all formats share."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.types.records import DataError

BYTES_AT_ONCE = 1 << 20
"""Bytes of a file that are read at a time for its digest."""
MAX_EXPANSION, FREE_BYTES = 200, 1 << 28
"""Unpacked ÷ packed that an array or file of more than `FREE_BYTES` may have: measured samples stay below 20."""
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
Stream = Callable[[Sequence[Sequence[Part]], int], Iterator[tuple[NDArray[Any], ...]]]
"""Reads the same in pieces of at most so many rows, one after the other, in bounded memory."""


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
    stream : callable or None
        Reads groups of columns piece by piece; None where the format cannot.
    rows : int
        Number of rows, of a text an estimate; 0 where `stream` is None.
    of_unit : callable or None
        Returns the columns of one inertial unit, by its name; None where the format names none.
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
    stream: Stream | None = None
    rows: int = 0
    of_unit: Callable[[str], Listing] | None = None


@dataclass(frozen=True)
class StoredArray:
    """An array before it is read: shape, type, how to read it, and the same in pieces of so many entries.

    The pieces follow the first axis, or the last where the second argument is true.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    read: Callable[[], NDArray[Any]]
    pieces: Callable[[int, bool], Iterator[NDArray[Any]]]


def listing_of_arrays(
    path: Path,
    arrays: Mapping[str, NDArray[Any] | StoredArray],
    *,
    units: Mapping[str, str],
    meta: Mapping[str, Any],
    notes: Sequence[str] = (),
    progress: Progress | None = None,
) -> Listing:
    """Make the listing of arrays (NPZ, MAT, HDF5); only numbers of one or two dimensions count.

    An array of three or six rows and many columns is turned round. Stored arrays are read when they are used.
    """
    numbers: dict[str, StoredArray] = {}
    said = list(notes)
    for name, array in arrays.items():
        shape, size = tuple(array.shape), math.prod(array.shape)
        if array.dtype.kind not in "iuf" or len(shape) not in (1, 2) or size < 2:
            if size != 1:
                said.append(
                    f"array '{name}' of {array.dtype} and shape {shape} was left out: no columns of numbers"
                )
            continue
        turned = False
        if len(shape) == 2 and 1 in shape:
            shape = (size,)
        elif len(shape) == 2 and shape[0] in (3, 6) and shape[1] > 6:
            shape, turned = shape[::-1], True
            said.append(f"array '{name}' was turned round to {shape}")
        stored = array if isinstance(array, StoredArray) else _in_memory(array)
        numbers[name] = _by_samples(stored, shape, turned=turned)
    table = ArrayTable(path, numbers, progress)
    return Listing(
        path=path,
        shapes={name: one.shape for name, one in numbers.items()},
        load=table.load,
        units=units,
        integer=frozenset(name for name, one in numbers.items() if one.dtype.kind in "iu"),
        unsigned={n: 8 * one.dtype.itemsize for n, one in numbers.items() if one.dtype.kind == "u"},
        meta=meta,
        notes=tuple(said),
        stream=table.stream,
        rows=max((one.shape[0] for one in numbers.values()), default=0),
    )


def _in_memory(array: NDArray[Any]) -> StoredArray:
    """Return an array at hand as one that is read."""

    def pieces(count: int, last: bool) -> Iterator[NDArray[Any]]:
        lined = array.T if last else array
        return (lined[start : start + count] for start in range(0, len(lined), count))

    return StoredArray(array.shape, array.dtype, lambda: array, pieces)


def _by_samples(array: StoredArray, shape: tuple[int, ...], *, turned: bool) -> StoredArray:
    """Return an array of numbers in the shape in which a row is one sample."""
    along_last = turned or (len(shape) == 1 and len(array.shape) == 2 and array.shape[0] == 1)

    def read() -> NDArray[Any]:
        return array.read().T if turned else array.read().reshape(shape)

    def pieces(rows: int, _: bool) -> Iterator[NDArray[Any]]:
        return (part.reshape(-1, *shape[1:]) for part in array.pieces(rows, along_last))

    return StoredArray(shape, array.dtype, read, pieces)


@dataclass(frozen=True)
class ArrayTable:
    """Arrays of a file by name, read whole or in pieces."""

    path: Path
    numbers: Mapping[str, StoredArray]
    progress: Progress | None

    def load(self, groups: Sequence[Sequence[Part]]) -> tuple[NDArray[Any], ...]:
        """Return whole columns, an array for each group."""
        used = [list(dict.fromkeys(part.array for part in group)) for group in groups]
        count = len({name for names in used for name in names})
        read: dict[str, NDArray[Any]] = {}
        loaded: list[NDArray[Any]] = []
        done = 0
        for number, (group, names) in enumerate(zip(groups, used, strict=True)):
            for name in names:
                if name in read:
                    continue
                read[name] = self.numbers[name].read()
                done += 1
                if self.progress is not None:
                    self.progress(done, count)
            loaded += self._grouped([group], read)
            later = {name for others in used[number + 1 :] for name in others}
            read = {
                name: array for name, array in read.items() if name in later
            }  # the others are in their block
        return tuple(loaded)

    def stream(self, groups: Sequence[Sequence[Part]], rows: int) -> Iterator[tuple[NDArray[Any], ...]]:
        """Yield pieces of at most so many rows, an array for each group."""
        used = list(dict.fromkeys(p.array for group in groups for p in group))
        done, count = 0, max(self.numbers[name].shape[0] for name in used)
        for pieces in zip(*(self.numbers[name].pieces(rows, False) for name in used), strict=True):
            yield self._grouped(groups, dict(zip(used, pieces, strict=True)))
            done += len(pieces[0])
            if self.progress is not None:
                self.progress(done, count)
        if done != count:
            raise DataError(f"{self.path}: expected {count} rows, found {done}: save it anew")

    def _grouped(
        self, groups: Sequence[Sequence[Part]], read: Mapping[str, NDArray[Any]]
    ) -> tuple[NDArray[Any], ...]:
        loaded = []
        for group in groups:
            parts = [read[p.array] if p.column is None else read[p.array][:, p.column] for p in group]
            lengths = {len(p) for p in parts}
            if len(lengths) > 1:
                sizes = ", ".join(f"{part} has {len(p)}" for part, p in zip(group, parts, strict=True))
                raise DataError(f"{self.path}: columns of one sensor must have one length: {sizes} rows")
            exact = all(p.dtype.kind == "i" or (p.dtype.kind == "u" and p.dtype.itemsize < 8) for p in parts)
            block = np.empty((lengths.pop(), len(parts)), np.int64 if exact else np.float64, order="F")
            with np.errstate(over="ignore", invalid="ignore"):
                for j, part in enumerate(parts):
                    block[:, j] = part
            loaded.append(block)
        return tuple(loaded)


def digest(path: Path) -> str:
    """Return the SHA-256 of the bytes of a file, or of all files of a folder in the order of their names."""
    found = hashlib.sha256()
    for part in [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file()):
        with part.open("rb") as file:
            while piece := file.read(BYTES_AT_ONCE):
                found.update(piece)
    return found.hexdigest()
