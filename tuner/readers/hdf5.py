"""HDF5 logs: datasets in any group (``imu/gyro``), tables with named fields, units and rate as attributes.

Needs the extra ``hdf5``. A dataset's unit is its attribute ``unit`` or ``units``; attributes of the file and
of its groups and single-valued datasets become meta.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file."""


def list_hdf5(path: Path) -> Listing:
    """Return the numeric datasets of an HDF5 file."""
    return read_hdf5(path, turned=False)


def read_hdf5(path: Path, *, turned: bool) -> Listing:
    """Return the numeric datasets of an HDF5 file; `turned` ones are transposed."""
    import h5py

    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    meta: dict[str, Any] = {}

    def visit(name: str, node: Any) -> None:
        meta.update({key: _plain(value) for key, value in node.attrs.items() if isinstance(node, h5py.Group)})
        if not isinstance(node, h5py.Dataset) or node.dtype.kind not in "iufV":
            return
        unit = _plain(node.attrs.get("unit", node.attrs.get("units")))
        columns = (
            {f"{name}/{field}": node[field] for field in node.dtype.names}
            if node.dtype.names
            else {name: node[()]}
        )
        for column, value in columns.items():
            array = np.asarray(value)
            if array.size == 1:
                meta[column.rsplit("/", 1)[-1]] = array.item()
                continue
            arrays[column] = array.T if turned else array
            if isinstance(unit, str):
                units[column] = unit

    try:
        with h5py.File(path, "r") as file:
            visit("", file)
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError) as error:
        msg = f"{path}: cannot be read as HDF5: {error}"
        raise DataError(msg) from None
    return listing_of_arrays(path, arrays, units=units, meta=meta)


def _plain(value: Any) -> Any:
    """Return an attribute as a Python value."""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return value.item() if isinstance(value, np.ndarray | np.generic) and np.size(value) == 1 else value


FORMAT = LogFormat(
    "hdf5",
    "HDF5",
    (".h5", ".hdf5", ".hdf"),
    lambda path, _: list_hdf5(path),
    lambda head: head.startswith(SIGNATURE),
    extra="hdf5",
)
