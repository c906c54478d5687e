"""NPZ logs: ``t``, ``gyro`` (n, 3), ``accel`` (n, 3), ``temperature`` or other names; JSON in ``meta``."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from tuner.formats.documents import parse_json
from tuner.readers.columns import Listing, listing_of_arrays
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError


def list_npz(path: Path) -> Listing:
    """Return the arrays of an NPZ file; single numbers and the entries of ``meta`` become meta."""
    if not zipfile.is_zipfile(path):
        msg = f"{path}: cannot be read as NPZ: not an archive of arrays"
        raise DataError(msg)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        msg = f"{path}: cannot be read as NPZ (plain numeric arrays and a JSON string 'meta'): {error}"
        raise DataError(msg) from None
    meta: dict[str, Any] = {name: a.item() for name, a in arrays.items() if a.ndim == 0}
    stated = meta.pop("meta", None)
    if isinstance(stated, str):
        content = parse_json(stated, source=f"{path}: meta")
        if isinstance(content, dict):
            meta |= content
    return listing_of_arrays(path, arrays, units={}, meta=meta)


FORMAT = LogFormat(
    "npz",
    "NPZ",
    (".npz",),
    lambda path, _: list_npz(path),
    lambda head: head.startswith(b"PK") and b".npy" in head,
)
