"""Logs in memory: a pandas DataFrame or arrays by name, with the names and units of a file's columns."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tuner.readers.columns import Listing, listing_of_arrays
from tuner.types.arguments import described
from tuner.types.records import DataError, Record

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
        Where a column is neither numbers nor times, or the source is no table.
    """
    _refuse_other(source)
    name = "arrays" if isinstance(source, Mapping) else "DataFrame"
    table = source if isinstance(source, Mapping) else arrays_of_frame(source)
    arrays: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    content = hashlib.sha256()
    for column, values in table.items():
        try:
            array = np.asarray(values)
            content.update(column.encode())
        except (AttributeError, ValueError):
            raise DataError(
                f"{name}: column {column!r}: expected a text as its name and an array, found {described(values)}"
            ) from None
        if array.dtype.kind in "mM":
            array, units[column] = (array - array.reshape(-1)[0]) / np.timedelta64(1, "s"), "s"
        if array.dtype.kind not in "iuf":
            raise DataError(
                f"{name}: column '{column}': expected numbers or times, got {array.dtype}: leave it out"
            )
        arrays[column] = array
        content.update(np.ascontiguousarray(array).tobytes())
    return listing_of_arrays(Path(name), arrays, units=units, meta={}), content.hexdigest()


def _refuse_other(source: object) -> None:
    """Raise a DataError that says what to pass where a source is neither arrays by name nor a pandas DataFrame."""
    if isinstance(source, Mapping) or all(hasattr(source, name) for name in ("columns", "index", "iloc")):
        return
    kind = f"{type(source).__module__.partition('.')[0]}.{type(source).__name__}".removeprefix("builtins.")
    if isinstance(source, list | tuple) and any(_is_log(one) for one in source):
        raise DataError(
            f"expected one log, found a {kind} of {len(source)}: for logs of one sensor, "
            "from tuner.identification.several_logs import pool; pool([tuner.identify(log) for log in logs])"
        )
    shape = getattr(source, "shape", ())
    found = f"{kind} of shape {shape}" if shape else kind
    six = "'gyro': array[:, :3], 'accel': array[:, 3:]"
    cure = six if shape[1:] == (6,) else "'gyro_x': array" if len(shape) == 1 else "'gyro': array"
    raise DataError(
        f"expected the path of a log, a pandas DataFrame or a dict of arrays, found {found}: "
        f"name the sensor of an array, such as {{{cure}}}"
    )


def _is_log(one: object) -> bool:
    """Whether something is a log of its own: a path, a table or the records that `tuner.read` returned."""
    records = isinstance(one, list | tuple) and any(isinstance(each, Record) for each in one)
    return records or isinstance(one, str | Path | Mapping | Record) or hasattr(one, "iloc")


def in_python(message: str) -> str:
    """Return a message with the options of the command line as the arguments of `tuner.read`."""
    text = re.sub(r"--columns '(\w+)=([^']*)'", r'columns={"\1": "\2"}', message)
    text = re.sub(r"--columns (\w+)=([^\s,;:]+)", r'columns={"\1": "\2"}', text)
    text = re.sub(r"--(rate|gyro-scale|accel-scale|memory) ([A-Z\d][\w.+]*)", r"--\1=\2", text)
    text = re.sub(r"--(gyro-unit|accel-unit|assume) ([\w/^]+)", r'--\1="\2"', text)
    text = re.sub(r'(?<=[}"\d]) (?=--)', ", ", text)
    return re.sub(
        r"--(rate|(?:gyro|accel)-(?:unit|scale)|assume|columns|memory|begin|end)\b",
        lambda found: found[1].replace("-", "_"),
        text,
    )
