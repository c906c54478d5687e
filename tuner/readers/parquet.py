"""Parquet logs: one numeric column a channel, names as in CSV; a field's metadata may state its ``unit``.

Needs the extra ``parquet``. Only the columns that are used are read, one at a time; stamps of a time type are
read in their unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.readers.columns import Listing, Part
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError


def list_parquet(path: Path) -> Listing:
    """Return the numeric columns of a Parquet file."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        file = parquet.ParquetFile(path)
        schema = file.schema_arrow
        rows = file.metadata.num_rows
    except (pa.ArrowException, OSError) as error:
        msg = f"{path}: cannot be read as Parquet: {error}"
        raise DataError(msg) from None
    units: dict[str, str] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    integer = set()
    for column in schema:
        kind = column.type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            units[column.name] = kind.unit
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            continue
        shapes[column.name] = (rows,)
        if not pa.types.is_floating(kind):
            integer.add(column.name)
        stated = (column.metadata or {}).get(b"unit") or (column.metadata or {}).get(b"units")
        if stated:
            units[column.name] = stated.decode("utf-8", errors="replace")

    def load(groups: Sequence[Sequence[Part]]) -> tuple[NDArray[Any], ...]:
        blocks = []
        for group in groups:
            exact = all(part.array in integer for part in group)
            block: NDArray[Any] = np.empty((rows, len(group)), np.int64 if exact else np.float64, order="F")
            for j, part in enumerate(group):
                try:
                    values = file.read(columns=[part.array]).column(0)
                except (pa.ArrowException, OSError) as error:
                    msg = f"{path}: column '{part.array}' cannot be read: {error}"
                    raise DataError(msg) from None
                if exact and values.null_count:
                    exact, block = False, block.astype(np.float64, order="F")
                if part.array in integer:
                    values = values.cast(pa.int64())
                block[:, j] = values.to_numpy()
            blocks.append(block)
        return tuple(blocks)

    meta = {
        k.decode(): v.decode("utf-8", errors="replace")
        for k, v in (schema.metadata or {}).items()
        if len(v) < 100
    }
    numbers = {key: number for key, value in meta.items() if (number := _number(value)) is not None}
    return Listing(
        path=path, shapes=shapes, load=load, units=units, integer=frozenset(integer), meta=meta | numbers
    )


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


FORMAT = LogFormat(
    "parquet",
    "Parquet",
    (".parquet", ".pq"),
    lambda path, _: list_parquet(path),
    lambda head: head.startswith(b"PAR1"),
    extra="parquet",
)
