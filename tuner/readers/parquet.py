"""Parquet logs: one numeric column a channel, names as in CSV; a field's metadata may state its ``unit``.

Needs the extra ``parquet``. Only the columns that are used are read, one at a time; stamps of a time type are
read in their unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard
from tuner.readers.column_names import known_unit
from tuner.readers.columns import Listing, Part, Progress
from tuner.readers.log_format import LogFormat
from tuner.types.records import DataError

MAX_ROWS_PER_BYTE = 1000
"""Rows that a byte of a file may stand for: run-length coding of one constant column reaches some hundreds."""

BUFFER_BYTES = 1 << 20
"""Bytes that are read at a time where a file is read in pieces, instead of a whole group of rows."""


@dataclass(frozen=True)
class _Columns:
    """Numeric columns of a Parquet file: units that types or metadata state, and which hold whole numbers."""

    names: tuple[str, ...]
    units: Mapping[str, str]
    integer: frozenset[str]


@dataclass(frozen=True)
class _Table:
    """A Parquet file whose columns are read as arrays."""

    path: Path
    file: Any
    rows: int
    integer: frozenset[str]
    progress: Progress | None

    def load(self, groups: Sequence[Sequence[Part]]) -> tuple[NDArray[Any], ...]:
        """Return whole columns, an array for each group."""
        done, count = 0, sum(map(len, groups))

        def column(name: str) -> Any:
            nonlocal done
            values = self.file.read(columns=[name]).column(0)
            if len(values) != self.rows:
                raise DataError(
                    f"{self.path}: column '{name}': expected {self.rows} rows, got {len(values)}: damaged?"
                )
            done += 1
            if self.progress is not None:
                self.progress(done, count)
            return values

        return tuple(self._block(group, self.rows, column) for group in groups)

    def stream(self, groups: Sequence[Sequence[Part]], most: int) -> Iterator[tuple[NDArray[Any], ...]]:
        """Yield pieces of at most so many rows, an array for each group."""
        from pyarrow import parquet

        names = list(dict.fromkeys(part.array for group in groups for part in group))
        with (
            input_guard(self.path, "Parquet"),
            parquet.ParquetFile(self.path, buffer_size=BUFFER_BYTES) as some,
        ):
            done = 0
            for number in range(some.num_row_groups):  # over all at once, pyarrow keeps what it has read
                for batch in some.iter_batches(most, [number], names, use_threads=False):
                    yield tuple(self._block(group, len(batch), batch.column) for group in groups)
                    done += len(batch)
                    if self.progress is not None:
                        self.progress(done, self.rows)

    def _block(self, group: Sequence[Part], count: int, column: Callable[[str], Any]) -> NDArray[Any]:
        """Return columns side by side: whole numbers where all of them are and none is missing."""
        import pyarrow as pa

        exact = all(part.array in self.integer for part in group)
        block: NDArray[Any] = np.empty((count, len(group)), np.int64 if exact else np.float64, order="F")
        for j, part in enumerate(group):
            with input_guard(f"{self.path}: column '{part.array}'", "numbers"):
                values = column(part.array)
                if exact and values.null_count:
                    exact, block = False, block.astype(np.float64, order="F")
                if part.array in self.integer and not values.null_count:
                    values = values.cast(pa.int64())
                block[:, j] = values.to_numpy(zero_copy_only=False)
        return block


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
    columns = _numeric_columns(path, schema)
    table = _Table(path, file, rows, columns.integer, progress)
    meta = {
        k.decode("utf-8", errors="replace"): v.decode("utf-8", errors="replace")
        for k, v in (schema.metadata or {}).items()
        if len(v) < 100
    }
    numbers = {key: number for key, value in meta.items() if (number := _number(value)) is not None}
    return Listing(
        path=path,
        shapes=dict.fromkeys(columns.names, (rows,)),
        load=table.load,
        units=columns.units,
        integer=columns.integer,
        meta=meta | numbers,
        stream=table.stream,
        rows=rows,
    )


def _numeric_columns(path: Path, schema: Any) -> _Columns:
    """Return the numeric columns of a schema of pyarrow."""
    import pyarrow as pa

    names: list[str] = []
    units: dict[str, str] = {}
    integer = set()
    for column in schema:
        kind = column.type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            units[column.name] = kind.unit
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            continue
        names.append(column.name)
        if not pa.types.is_floating(kind) and kind != pa.uint64():
            integer.add(column.name)
        stated = (column.metadata or {}).get(b"unit") or (column.metadata or {}).get(b"units")
        if stated:
            unit = stated.decode("utf-8", errors="replace")
            if known_unit(units.get(column.name, unit)) != known_unit(unit):
                raise DataError(
                    f"{path}: column '{column.name}' is of type {kind}, its metadata say {unit}: take one of them out"
                )
            units[column.name] = unit
    return _Columns(tuple(names), units, frozenset(integer))


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
