"""NPZ logs: ``t``, ``gyro`` (n, 3), ``accel`` (n, 3), ``temperature`` or other names; JSON in ``meta``."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tuner.formats.documents import parse_json
from tuner.readers.column_names import TIME_UNITS
from tuner.readers.columns import Listing, Progress, StoredArray, listing_of_arrays
from tuner.readers.log_format import LogFormat
from tuner.readers.npz_members import stored_arrays

MAX_META_BYTES = 1 << 24
"""Size of a single value or text that is read as meta."""


def list_npz(path: Path, progress: Progress | None = None) -> Listing:
    """Return the arrays of an NPZ file; single numbers and the entries of ``meta`` become meta."""
    arrays, unread = stored_arrays(path)
    times = {n: np.datetime_data(a.dtype) for n, a in arrays.items() if a.dtype.kind in "mM"}
    units = {n: unit for n, (unit, count) in times.items() if unit in TIME_UNITS and count == 1}
    arrays = {n: _whole_numbers(a) if n in units else a for n, a in arrays.items()}
    single = {
        name: array.read()
        for name, array in arrays.items()
        if math.prod(array.shape) == 1 and array.dtype.itemsize <= MAX_META_BYTES
    }
    items = {name: array.item() for name, array in single.items()}
    meta: dict[str, Any] = {
        name: item.decode("utf-8", errors="replace") if isinstance(item, bytes) else item
        for name, item in items.items()
    }
    stated = meta.pop("meta", None)
    if isinstance(stated, str):
        content = parse_json(stated, source=f"{path}: meta")
        if isinstance(content, dict):
            meta |= content
    notes = [f"'{name}' was left out: {why}" for name, why in unread.items()]
    return listing_of_arrays(path, arrays, units=units, meta=meta, notes=notes, progress=progress)


def _whole_numbers(array: StoredArray) -> StoredArray:
    """Return the numbers behind an array of a time type of numpy."""
    kind = np.dtype(np.int64).newbyteorder(array.dtype.byteorder)
    return replace(
        array,
        dtype=kind,
        read=lambda: array.read().view(kind),
        pieces=lambda count, last: (part.view(kind) for part in array.pieces(count, last)),
    )


FORMAT = LogFormat(
    "npz",
    "NPZ",
    (".npz",),
    list_npz,
    lambda head: head.startswith(b"PK") and b".npy" in head,
)
