"""HDF5 logs: datasets in any group (``imu/gyro``), tables with named fields, units and rate as attributes.

Needs the extra ``hdf5``. A dataset's unit is its attribute ``unit`` or ``units``; attributes of the file and
of its groups and single-valued datasets become meta.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard, reason
from tuner.readers.child_process import array_from_child, check_in_child
from tuner.readers.columns import (
    FREE_BYTES,
    MAX_EXPANSION,
    Listing,
    Progress,
    StoredArray,
    listing_of_arrays,
)
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file."""


def read_hdf5(path: Path, progress: Progress | None = None, *, turned: bool = False) -> Listing:
    """Return the numeric datasets of an HDF5 file; `turned` ones are transposed.

    Datasets whose samples lie in other files, or whose type is unknown, are left out with a note; links to other
    files are not followed.
    """
    import h5py

    arrays: dict[str, StoredArray] = {}
    units: dict[str, str] = {}
    meta: dict[str, Any] = {}
    notes: list[str] = []

    def visit(name: str, node: Any) -> None:
        try:
            if isinstance(node, h5py.Group):
                meta.update({str(key): _plain(value) for key, value in node.attrs.items()})
            elif isinstance(node, h5py.Dataset):
                _list_dataset(path, name, node, turned, arrays, units, meta)
        except DataError:
            raise
        except Exception as error:  # one bad dataset does not spoil the others
            notes.append(f"'{name}' was left out: {reason(error)}")

    def walk() -> None:
        with h5py.File(path, "r") as file:
            visit("", file)
            file.visititems(visit)

    with input_guard(path, "HDF5"):
        check_in_child(f"{path}: as HDF5", walk)
        walk()
    return listing_of_arrays(path, arrays, units=units, meta=meta, notes=notes, progress=progress)


def _list_dataset(
    path: Path,
    name: str,
    node: Any,
    turned: bool,
    arrays: dict[str, StoredArray],
    units: dict[str, str],
    meta: dict[str, Any],
) -> None:
    """List a dataset, or each field of a table."""
    if node.dtype.kind not in "iufV" or node.shape is None:
        return
    if node.external or node.is_virtual:
        raise ValueError("its samples lie in other files, which are not opened")
    size = node.size * node.dtype.itemsize
    if size > max(FREE_BYTES, MAX_EXPANSION * node.id.get_storage_size()):
        raise ValueError(f"{size} bytes packed into {node.id.get_storage_size()}")
    unit = _plain(node.attrs.get("unit", node.attrs.get("units")))
    for field in node.dtype.names or (None,):
        dtype = node.dtype if field is None else node.dtype[field]
        column = name if field is None else f"{name}/{field}"
        if dtype.kind not in "iuf" or dtype.itemsize > 8:
            continue
        if node.size == 1:
            meta[column.rsplit("/", 1)[-1]] = _read(path, name, field, (), turned=False).item()
            continue
        shape = node.shape[::-1] if turned else node.shape
        read = partial(_read, path, name, field, (), turned=turned)
        arrays[column] = StoredArray(
            shape,
            dtype,
            partial(array_from_child, f"{path}: {name}", shape, dtype, read),
            partial(_pieces, path, name, field, node.shape, dtype, turned),
        )
        if isinstance(unit, str):
            units[column] = unit


def _read(
    path: Path, name: str, field: str | None, where: tuple[slice, ...], *, turned: bool
) -> NDArray[Any]:
    """Return the samples of a dataset, or of a field of it, at some places; turned ones are transposed."""
    import h5py

    with input_guard(f"{path}: {name}", "a dataset of numbers"):
        with h5py.File(path, "r") as file:
            found = np.asarray(file[name][where if field is None else (field, *where)])
        return found.T if turned else found


def _pieces(
    path: Path,
    name: str,
    field: str | None,
    stored: tuple[int, ...],
    dtype: np.dtype[Any],
    turned: bool,
    count: int,
    last: bool,
) -> Iterator[NDArray[Any]]:
    """Yield the entries of a dataset, or of a field of it, along one axis of its shape (turned as it is listed)."""
    along_first = last == turned or len(stored) == 1
    whole = stored[0 if along_first else -1]
    rest = stored[1:] if along_first else stored[:-1]
    for start in range(0, whole, count):
        stop = min(start + count, whole)
        where = (slice(start, stop),) if along_first else (slice(None), slice(start, stop))
        read = partial(_read, path, name, field, where, turned=not along_first)
        yield array_from_child(f"{path}: {name}", (stop - start, *rest), dtype, read)


def _plain(value: Any) -> Any:
    """Return an attribute as a Python value."""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return value.item() if isinstance(value, np.ndarray | np.generic) and np.size(value) == 1 else value


FORMAT = LogFormat(
    "hdf5",
    "HDF5",
    (".h5", ".hdf5", ".hdf"),
    read_hdf5,
    lambda head: head.startswith(SIGNATURE),
    extra="hdf5",
)
