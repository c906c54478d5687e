"""Logs in memory: a pandas DataFrame or arrays by name, with the names and units of a file's columns."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tuner.readers.columns import Listing, listing_of_arrays
from tuner.types.records import DataError

if TYPE_CHECKING:
    import pandas as pd

Table = Mapping[str, ArrayLike]
"""Columns by name, ``gyro_x [deg/s]`` …, or ``gyro`` (n, 3), ``accel`` (n, 3), ``t``."""


def arrays_of_frame(frame: pd.DataFrame) -> dict[str, ArrayLike]:
    """Return the columns of a frame; an index of time stands in for a column ``t``, in seconds."""
    arrays: dict[str, ArrayLike] = {str(name): frame[name].to_numpy() for name in frame.columns}
    index = frame.index.to_numpy()
    if "t" not in arrays and index.dtype.kind in "mM":
        arrays["t [s]"] = (index - index[0]) / np.timedelta64(1, "s")
    elif "t" not in arrays and frame.index.name is not None:
        arrays[str(frame.index.name)] = index
    return arrays


def list_table(source: Table | pd.DataFrame) -> tuple[Listing, str]:
    """Return the columns of a table as those of a file, and the SHA-256 of their names and values.

    Raises
    ------
    DataError
        Where a column is neither numbers nor times.
    """
    name = "arrays" if isinstance(source, Mapping) else "DataFrame"
    table = source if isinstance(source, Mapping) else arrays_of_frame(source)
    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    content = hashlib.sha256()
    for column, values in table.items():
        array = np.asarray(values)
        if array.dtype.kind in "mM":
            array, units[column] = (array - array.reshape(-1)[0]) / np.timedelta64(1, "s"), "s"
        if array.dtype.kind not in "iuf":
            msg = f"{name}: column '{column}': expected numbers or times, got {array.dtype}: leave it out"
            raise DataError(msg)
        arrays[column] = array
        content.update(column.encode())
        content.update(np.ascontiguousarray(array).tobytes())
    return listing_of_arrays(Path(name), arrays, units=units, meta={}), content.hexdigest()
