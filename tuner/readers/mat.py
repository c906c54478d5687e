"""MATLAB logs: arrays or structs of arrays, up to v7.2 by scipy, v7.3 (an HDF5 file) by h5py.

The fields of a struct are named ``imu/fb``; the names of NaveGo (``t fb wb``) are among the aliases. MATLAB's
v7.3 stores arrays turned round; they are turned back.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.hdf5 import SIGNATURE, read_hdf5
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError


def list_mat(path: Path) -> Listing:
    """Return the numeric arrays of a MAT file; single numbers become meta."""
    import scipy.io

    if _begins_as_hdf5(path):
        return read_hdf5(path, turned=False)
    try:
        content = scipy.io.loadmat(path, struct_as_record=True, squeeze_me=True)
    except NotImplementedError:
        return read_hdf5(path, turned=True)
    except Exception as error:  # scipy raises many kinds for a damaged file
        msg = f"{path}: cannot be read as a MAT file: {error}"
        raise DataError(msg) from None
    arrays: dict[str, NDArray[Any]] = {}
    meta: dict[str, Any] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, np.asarray(value), arrays, meta)
    return listing_of_arrays(path, arrays, units={}, meta=meta)


def _begins_as_hdf5(path: Path) -> bool:
    """Tell an HDF5 file that another program named ``.mat``: it lacks the header of v7.3."""
    with path.open("rb") as file:
        return file.read(len(SIGNATURE)) == SIGNATURE


def _flatten(name: str, value: NDArray[Any], arrays: dict[str, NDArray[Any]], meta: dict[str, Any]) -> None:
    """Put numeric arrays into `arrays` and single values into `meta`, through structs of any depth."""
    if value.dtype.names is not None and value.ndim == 0:
        for field in value.dtype.names:
            _flatten(f"{name}/{field}", np.asarray(value[field][()]), arrays, meta)
    elif value.dtype.kind in "iuf" and value.ndim > 0:
        arrays[name] = value
    elif value.ndim == 0 and value.dtype.kind in "iufU":
        meta[name.rsplit("/", 1)[-1]] = value.item()


FORMAT = LogFormat(
    "mat",
    "MAT",
    (".mat",),
    lambda path, _: list_mat(path),
    lambda head: head.startswith(b"MATLAB"),
    extra="hdf5",
)
