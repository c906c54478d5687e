"""NPZ logs: ``t``, ``gyro`` (n, 3), ``accel`` (n, 3), ``temperature`` or other names; JSON in ``meta``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from tuner.formats.documents import parse_json
from tuner.readers.columns import Listing, Progress, listing_of_arrays
from tuner.readers.log_format import LogFormat
from tuner.readers.npz_members import stored_arrays

MAX_META_BYTES = 1 << 24
"""Size of a single value or text that is read as meta."""


def list_npz(path: Path, progress: Progress | None = None) -> Listing:
    """Return the arrays of an NPZ file; single numbers and the entries of ``meta`` become meta."""
    arrays, unread = stored_arrays(path)
    single = {
        name: array.read()
        for name, array in arrays.items()
        if math.prod(array.shape) == 1 and array.dtype.itemsize <= MAX_META_BYTES
    }
    meta: dict[str, Any] = {name: array.item() for name, array in single.items()}
    stated = meta.pop("meta", None)
    if isinstance(stated, str):
        content = parse_json(stated, source=f"{path}: meta")
        if isinstance(content, dict):
            meta |= content
    notes = [f"'{name}' was left out: {why}" for name, why in unread.items()]
    return listing_of_arrays(path, arrays, units={}, meta=meta, notes=notes, progress=progress)


FORMAT = LogFormat(
    "npz",
    "NPZ",
    (".npz",),
    list_npz,
    lambda head: head.startswith(b"PK") and b".npy" in head,
)
