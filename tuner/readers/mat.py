"""MATLAB logs: arrays or structs of arrays; v4 by scipy, v5 to v7 by `tuner.readers.mat5`, v7.3 (HDF5) by h5py.

The fields of a struct are named ``imu/fb``; the names of NaveGo (``t fb wb``) are among the aliases. MATLAB's
v7.3 stores arrays turned round; they are turned back.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard
from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.hdf5 import SIGNATURE, read_hdf5
from tuner.readers.log_format import LogFormat
from tuner.readers.mat5 import HEADER_BYTES, read_mat5


def list_mat(path: Path) -> Listing:
    """Return the numeric arrays of a MAT file; single numbers and texts become meta."""
    with path.open("rb") as file:
        head = file.read(HEADER_BYTES)
    if head.startswith(
        SIGNATURE
    ):  # an HDF5 file that another program named .mat: it lacks the header of v7.3
        return read_hdf5(path, turned=False)
    if head[124:128] in (b"\x00\x02IM", b"\x02\x00MI"):
        return read_hdf5(path, turned=True)
    arrays: dict[str, NDArray[Any]] = {}
    meta: dict[str, Any] = {}
    if head[126:128] in (b"IM", b"MI"):
        for name, value in read_mat5(path.read_bytes(), source=str(path)):
            _keep(name, value, arrays, meta)
    else:
        import scipy.io

        with input_guard(path, "a MAT file"):
            for name, value in scipy.io.loadmat(path, struct_as_record=True, squeeze_me=True).items():
                if not name.startswith("__"):
                    _keep(name, value, arrays, meta)
    return listing_of_arrays(path, arrays, units={}, meta=meta)


def _keep(name: str, value: object, arrays: dict[str, NDArray[Any]], meta: dict[str, Any]) -> None:
    """Put numeric arrays into `arrays` and single values into `meta`."""
    if isinstance(value, str):
        meta[name.rsplit("/", 1)[-1]] = value
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.size > 1:
        arrays[name] = value.squeeze()
    elif isinstance(value, np.ndarray | np.generic) and value.size == 1 and value.dtype.kind in "iuf":
        meta[name.rsplit("/", 1)[-1]] = value.item()


FORMAT = LogFormat(
    "mat",
    "MAT",
    (".mat",),
    lambda path, _: list_mat(path),
    lambda head: head.startswith(b"MATLAB"),
    extra="hdf5",
)
