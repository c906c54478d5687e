"""MATLAB logs: arrays or structs of arrays; v4 to v7 by scipy, v7.3 (HDF5) by h5py.

The fields of a struct are named ``imu/fb``; the names of NaveGo (``t fb wb``) are among the aliases. MATLAB's
v7.3 stores arrays turned round; they are turned back.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard
from tuner.readers.child_process import BYTES_A_SECOND, LONGEST_LISTING, check_in_child
from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.hdf5 import SIGNATURE, read_hdf5
from tuner.readers.log_format import LogFormat

HEADER_BYTES = 128
"""Length of the header of v5 and later: its last bytes are version and byte order."""


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
    import scipy.io

    def load() -> dict[str, Any]:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", scipy.io.matlab.MatReadWarning
            )  # of objects, which share one name
            return dict(scipy.io.loadmat(path, simplify_cells=True))

    # The library ends the process on some damaged files.
    check_in_child(str(path), load, seconds=LONGEST_LISTING + path.stat().st_size / BYTES_A_SECOND)
    arrays: dict[str, NDArray[Any]] = {}
    meta: dict[str, Any] = {}
    notes: list[str] = []
    with input_guard(path, "a MAT file"):
        for name, value in load().items():
            if isinstance(value, scipy.io.matlab.MatlabOpaque):
                kind = str(value["s2"][0], "ascii", "replace")
                notes.append(
                    f"objects of MATLAB ({kind}) are left out: MATLAB's writetimetable or save writes their numbers"
                )
            elif not name.startswith("__"):
                _keep(name, value, arrays, meta)
    return listing_of_arrays(path, arrays, units={}, meta=meta, notes=notes)


def _keep(name: str, value: object, arrays: dict[str, NDArray[Any]], meta: dict[str, Any]) -> None:
    """Put numeric arrays into `arrays` and single values and texts into `meta`; fields of structs by their path."""
    if isinstance(value, dict):
        for key, field in value.items():
            _keep(f"{name}/{key}", field, arrays, meta)
    elif isinstance(value, str):
        meta[name.rsplit("/", 1)[-1]] = value
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.size > 1:
        arrays[name] = value.astype(value.dtype.newbyteorder("="), copy=False)
    elif np.isscalar(value) and np.asarray(value).dtype.kind in "iuf":
        meta[name.rsplit("/", 1)[-1]] = value


FORMAT = LogFormat(
    "mat",
    "MAT",
    (".mat",),
    lambda path, _: list_mat(path),
    lambda head: head.startswith(b"MATLAB"),
    extra="hdf5",
)
