"""Text logs: CSV, TSV, semicolons or blanks between columns, decimal commas, gzip allowed, in bounded memory.

Lines that begin with ``#`` below the header are comments. Lines are counted first, then parsed in pieces of
`BYTES_AT_ONCE` bytes into arrays of the final size. Memory is 8 bytes a row and column that is used, 24 bytes a row for
the time base, and some ten pieces; a log that needs repair is copied once.

A ``.txt`` of seven numeric columns without a header is the increment log of KF-GINS: week seconds, three angle
increments (rad), three velocity increments (m/s), forward-right-down.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from tuner.formats.guard import input_guard
from tuner.readers.column_names import ColumnName, parse_name, role_of
from tuner.readers.columns import Listing, Part, Progress
from tuner.readers.log_format import LogFormat, format_of
from tuner.readers.text_dialect import (
    HEAD_BYTES,
    Dialect,
    even_lines,
    find_dialect,
    is_number,
    is_text,
    lone_return,
    open_bytes,
    plain_text,
    split_line,
)
from tuner.readers.text_rows import list_rows
from tuner.readers.text_stamps import STAMP, seconds_of_stamps
from tuner.types.records import DataError

BYTES_AT_ONCE = 1 << 22
"""Bytes of text that are parsed at a time: memory stays bounded, and the parser is not slowed by small pieces."""
MAX_LINE_BYTES = 1 << 16
"""Longest line of a log: some thousand columns."""
_MAX_EXPANSION, _FREE_BYTES = 200, 1 << 30
"""Unpacked ÷ packed that a text of more than `_FREE_BYTES` may have: measured samples stay below 20."""
_KF_GINS_COLUMNS = (
    "t",
    "dtheta_x [rad]",
    "dtheta_y [rad]",
    "dtheta_z [rad]",
    "dvel_x [m/s]",
    "dvel_y [m/s]",
    "dvel_z [m/s]",
)


def list_text(path: Path, progress: Progress | None = None) -> Listing:
    """Return the columns of a text log; its `load` parses the file."""
    dialect = find_dialect(path)
    if (by_rows := list_rows(path, dialect)) is not None:
        return by_rows
    names = dialect.names
    notes: tuple[str, ...] = ()
    guessed: frozenset[str] = frozenset()
    if not dialect.header and path.name.lower().removesuffix(".gz").endswith(".txt") and len(names) == 7:
        names = _KF_GINS_COLUMNS
        guessed = frozenset(names)
        notes = ("no header and seven columns in a .txt: read as t, 3 axes of gyro, 3 axes of accel",)
    duplicates = sorted({n for n in names if names.count(n) > 1})
    if duplicates:
        raise DataError(
            f"{path}:{dialect.skip}: column name '{duplicates[0]}' appears twice: rename one of them"
        )

    def load(groups: Sequence[Sequence[Part]]) -> tuple[NDArray[Any], ...]:
        columns = [[names.index(part.array) for part in group] for group in groups]
        return read_numbers(path, dialect, columns, progress=progress)

    def stream(groups: Sequence[Sequence[Part]], rows: int) -> Iterator[tuple[NDArray[Any], ...]]:
        columns = [[names.index(part.array) for part in group] for group in groups]
        return _numbers_in_pieces(path, dialect, columns, rows, progress)

    units = {names[j]: "s" for j in dialect.dates}
    for j, day in dialect.dates.items():
        since = f"since {day} 00:00 UTC" if day else "of the day"
        notes += (f"'{names[j]}' holds {'dates' if day else 'clock times'}: read as seconds {since}",)
    meta: dict[str, float] = {} if dialect.rate is None else {"rate_hz": dialect.rate}
    for role, key, lsb in (
        ("gyro", "gscale", "rad/s"),
        ("gyro", "rscale", "deg/s"),
        ("accel", "ascale", "g"),
    ):
        if key in dialect.scales:
            meta[f"{role}_lsb_{lsb}"] = dialect.scales[key]
            units |= {
                n: "count" for n in names if (found := role_of(parse_name(n))) and found[0].startswith(role)
            }
    if "tscale" in dialect.scales:
        units |= {n: f"{dialect.scales['tscale']} s" for n in names if _is_time(parse_name(n))}
    return Listing(
        path=path,
        units=units,
        shapes=dict.fromkeys(names, (0,)),
        load=load,
        meta=meta,
        notes=notes,
        guessed=guessed,
        stream=stream,
        rows=_rows_about(path, dialect.skip),
    )


def _rows_about(path: Path, skip: int) -> int:
    """Return about how many rows a text has, from the usual length of its first lines, and how they are packed."""
    with input_guard(path, "text"), path.open("rb") as raw, plain_text(path, raw) as file:
        text = file.read(BYTES_AT_ONCE)
        expansion = len(text) / max(raw.tell(), 1)
    lines = text[:HEAD_BYTES].split(b"\n")[skip:]
    lengths = sorted(len(line) for line in lines[:-1] or lines if line.strip())
    usual = lengths[len(lengths) // 2] + 1 if lengths else 1
    return int(expansion * path.stat().st_size) // usual


def named_columns(path: Path) -> tuple[str, ...]:
    """Return the names of the columns of a text file; none where a path is no text file with rows of numbers."""
    try:
        return find_dialect(path).names if path.is_file() and format_of(path) is FORMAT else ()
    except DataError:
        return ()


def read_numbers(
    path: Path, dialect: Dialect, groups: Sequence[Sequence[int]], *, progress: Progress | None = None
) -> tuple[NDArray[np.float64], ...]:
    """Return the columns of each group as a Fortran-ordered (n, len(group)) array.

    Raises
    ------
    DataError
        Text where a number is expected, or a row with too many columns, with line and column.
    """
    lines = _count_lines(path) - dialect.skip  # of a file that still grows: rows that were there at first
    nothing = tuple(np.empty((0, len(group)), order="F") for group in groups)
    return next(_numbers_in_pieces(path, dialect, groups, lines, progress), nothing)


def _numbers_in_pieces(
    path: Path, dialect: Dialect, groups: Sequence[Sequence[int]], rows: int, progress: Progress | None
) -> Iterator[tuple[NDArray[np.float64], ...]]:
    """Yield the columns of each group in pieces of `rows` rows; the last may be shorter."""
    blocks: list[NDArray[np.float64]] = []
    filled = 0
    for frame in _frames(path, dialect, sorted({j for group in groups for j in group}), progress):
        taken = 0
        while taken < len(frame):
            if not filled:
                blocks = [np.empty((rows, len(group)), order="F") for group in groups]
            count = min(rows - filled, len(frame) - taken)
            some = frame.iloc[taken : taken + count]
            for block, group in zip(blocks, groups, strict=True):
                for j, column in enumerate(group):
                    block[filled : filled + count, j] = some[column].to_numpy()
            taken, filled = taken + count, filled + count
            if filled == rows:
                yield tuple(blocks)
                filled = 0
    if filled:
        yield tuple(np.asfortranarray(block[:filled]) for block in blocks)


def _frames(path: Path, dialect: Dialect, used: Sequence[int], progress: Progress | None) -> Iterator[Any]:
    """Yield tables of the columns that are used, some ten thousand lines at a time."""
    import pandas as pd

    total = path.stat().st_size
    with path.open("rb") as raw, plain_text(path, raw) as file:
        for first, text in _pieces(path, file, dialect.skip):
            try:
                frame = pd.read_csv(
                    io.BytesIO(text),
                    sep=r"\s+" if dialect.separator is None else dialect.separator,
                    header=None,
                    names=list(range(len(dialect.names))),
                    usecols=used,
                    comment="#",
                    engine="c",
                    skipinitialspace=True,
                    decimal=dialect.decimal,
                    index_col=False,
                    low_memory=False,
                    on_bad_lines="error",
                    dtype={j: object if j in dialect.dates else np.float64 for j in used},
                )
                for j in dialect.dates.keys() & set(used):
                    frame[j] = seconds_of_stamps(frame[j], dialect.dates[j])
            except (ValueError, pd.errors.ParserError, pd.errors.EmptyDataError):
                if all(not line.strip() or line.lstrip().startswith(b"#") for line in text.splitlines()):
                    continue
                raise DataError(
                    _first_fault(path, text, first, dialect, used)
                    or f"{path}:{first}: the lines from here on cannot be parsed as rows of numbers"
                ) from None
            separators = text.count((dialect.separator or "\n").encode())
            if dialect.separator is not None and separators != len(frame) * (len(dialect.names) - 1):
                fault = _first_fault(path, text, first, dialect, used)
                if fault is not None:
                    raise DataError(fault)
            if progress is not None:
                progress(raw.tell(), total)
            yield frame


def _count_lines(path: Path) -> int:
    """Return the number of lines."""
    lines, size, last = 0, 0, b"\n"
    with open_bytes(path) as file:
        while piece := file.read(BYTES_AT_ONCE):
            lines += piece.count(b"\n")
            last = piece[-1:]
            size += len(piece)
            if size > max(_FREE_BYTES, _MAX_EXPANSION * path.stat().st_size):
                raise DataError(
                    f"{path}: expands to more than {_MAX_EXPANSION} times its size: no log does; unpack it yourself"
                )
    return lines + (last != b"\n")


def _pieces(path: Path, file: IO[bytes], skip: int) -> Iterator[tuple[int, bytes]]:
    """Yield the number of the first line and the bytes of whole lines, about `BYTES_AT_ONCE` at a time."""
    for _ in range(skip):
        file.readline(MAX_LINE_BYTES)
    line = skip + 1
    while piece := file.read(BYTES_AT_ONCE):
        piece += file.readline(MAX_LINE_BYTES)
        if b"\r" in (piece := even_lines(piece)):
            at = line + piece[: piece.index(b"\r")].count(b"\n")
            raise DataError(lone_return(path, at))
        if piece[-1:] != b"\n" and len(piece) > MAX_LINE_BYTES and b"\n" not in piece[-MAX_LINE_BYTES:]:
            raise DataError(
                f"{path}:{line + piece.count(chr(10).encode())}: expected lines of up to {MAX_LINE_BYTES} bytes"
            )
        yield line, piece
        line += piece.count(b"\n")


def _is_time(name: ColumnName) -> bool:
    role = role_of(name)
    return role is not None and role[0] == "t"


def _first_fault(path: Path, text: bytes, first: int, dialect: Dialect, used: Sequence[int]) -> str | None:
    """Return what is wrong with the first line that is: place, expected, found, what to do."""
    width = len(dialect.names)
    for number, raw in enumerate(text.split(b"\n"), start=first):
        line = raw.decode("utf-8", errors="replace").partition("#")[0].strip("\r\n")
        if not line.strip():
            continue
        cells = split_line(line, dialect.separator)
        if len(cells) > width and any(cells[width:]):
            return f"{path}:{number}: expected {width} columns, found {len(cells)}: repair or remove the line"
        for j in used:
            cell = cells[j].strip() if j < len(cells) else ""
            if dialect.decimal == ",":
                cell = cell.replace(",", ".")
            if not (STAMP.fullmatch(cell.strip('"')) if j in dialect.dates and cell else is_number(cell)):
                name = parse_name(dialect.names[j])
                cure = ", or leave the column out by --columns t=none --rate HZ" if _is_time(name) else ""
                return (
                    f"{path}:{number}:{j + 1}: expected a number in column '{name.written}', "
                    f"found '{cell[:40]}': repair or remove the line, or choose another column{cure}"
                )
    return None


FORMAT = LogFormat(
    "text",
    "text",
    (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz"),
    list_text,
    is_text,
    any_text=True,
)
