"""Parquet logs: one numeric column a channel, names as in CSV; a field's metadata may state its ``unit``.

Needs the extra ``parquet``. Only the columns that are used are read, one at a time; stamps of a time type are
read in their unit.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard
from tuner.readers.column_names import known_unit
from tuner.readers.columns import ArrayTable, Listing, Progress, StoredArray
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError

MAX_ROWS_PER_BYTE = 1000
"""Rows that a byte of a file may stand for: run-length coding of one constant column reaches some hundreds."""

BUFFER_BYTES = 1 << 20
"""Bytes that are read at a time where a file is read in pieces, instead of a whole group of rows."""


def list_parquet(path: Path, progress: Progress | None = None) -> Listing:
    """Return the numeric columns of a Parquet file."""
    from pyarrow import parquet

    with input_guard(path, "Parquet"):
        file = parquet.ParquetFile(path)
        schema = file.schema_arrow
        rows = file.metadata.num_rows
        if rows > MAX_ROWS_PER_BYTE * path.stat().st_size:
            raise DataError(
                f"{path}: expected a row or so a byte, got {rows} rows in {path.stat().st_size} bytes: damaged?"
            )
    whole, units = _numeric_columns(path, schema)
    kinds = {name: np.dtype(np.int64 if exact else np.float64) for name, exact in whole.items()}
    columns = {
        name: StoredArray(
            (rows,), kind, partial(_read, path, file, rows, name, kind), partial(_pieces, path, name, kind)
        )
        for name, kind in kinds.items()
    }
    table = ArrayTable(path, columns, progress)
    meta = {
        k.decode("utf-8", errors="replace"): v.decode("utf-8", errors="replace")
        for k, v in (schema.metadata or {}).items()
        if len(v) < 100
    }
    numbers = {key: number for key, value in meta.items() if (number := _number(value)) is not None}
    return Listing(
        path=path,
        shapes=dict.fromkeys(whole, (rows,)),
        load=table.load,
        units=units,
        integer=frozenset(name for name, exact in whole.items() if exact),
        meta=meta | numbers,
        stream=table.stream,
        rows=rows,
    )


def _numeric_columns(path: Path, schema: Any) -> tuple[dict[str, bool], dict[str, str]]:
    """Return whether each numeric column of a schema of pyarrow holds whole numbers, and units that it states."""
    import pyarrow as pa

    whole: dict[str, bool] = {}
    units: dict[str, str] = {}
    for column in schema:
        kind = column.type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            units[column.name] = kind.unit
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            continue
        whole[column.name] = not pa.types.is_floating(kind) and kind != pa.uint64()
        stated = (column.metadata or {}).get(b"unit") or (column.metadata or {}).get(b"units")
        if stated:
            unit = stated.decode("utf-8", errors="replace")
            if known_unit(units.get(column.name, unit)) != known_unit(unit):
                raise DataError(
                    f"{path}: column '{column.name}' is of type {kind}, its metadata say {unit}: take one of them out"
                )
            units[column.name] = unit
    return whole, units


def _read(path: Path, file: Any, rows: int, name: str, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return a column of an open file, shape (rows,)."""
    with input_guard(f"{path}: column '{name}'", "numbers"):
        values = file.read(columns=[name]).column(0)
        if len(values) != rows:
            raise DataError(f"{path}: column '{name}': expected {rows} rows, got {len(values)}: damaged?")
        return _numbers(values, kind)


def _pieces(path: Path, name: str, kind: np.dtype[Any], most: int, _: bool) -> Iterator[NDArray[Any]]:
    """Yield pieces of at most so many rows of a column."""
    from pyarrow import parquet

    with input_guard(path, "Parquet"), parquet.ParquetFile(path, buffer_size=BUFFER_BYTES) as file:
        for number in range(file.num_row_groups):  # over all at once, pyarrow keeps what it has read
            for batch in file.iter_batches(most, [number], [name], use_threads=False):
                yield _numbers(batch.column(0), kind)


def _numbers(values: Any, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return values of pyarrow, as whole numbers where they are and none is missing."""
    import pyarrow as pa

    if kind == np.int64 and not values.null_count:
        values = values.cast(pa.int64())
    return np.asarray(values.to_numpy(zero_copy_only=False))


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


FORMAT = LogFormat(
    "parquet",
    "Parquet",
    (".parquet", ".pq"),
    list_parquet,
    lambda head: head.startswith(b"PAR1"),
    extra="parquet",
)
