"""How a text file is written: separator, header, decimal comma, dates, and where its numbers begin.

The header is the last line before the numbers (a leading ``#`` or ``%`` is allowed: EuRoC, TUM). Without a header the
columns are called c1, c2, ….
"""

from __future__ import annotations

import codecs
import gzip
import operator
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import IO

from tuner.formats.guard import input_guard
from tuner.readers.column_names import known_unit
from tuner.readers.text_stamps import STAMP
from tuner.types.one_line import printable
from tuner.types.records import DataError

HEAD_BYTES = 1 << 16
"""Bytes in which the header and a row of numbers must be found."""
GZIP = b"\x1f\x8b"
"""First bytes of a file packed by gzip."""
_MISSING_NUMBERS = frozenset(
    ("", "nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf", "infinity", "-infinity", "#n/a", "<na>")
)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
"""A number with a comma before its fraction, as spreadsheets of many countries write between semicolons or tabs."""
_STATED_RATE = re.compile(
    r"(?:(?:update|output|sample|sampling)[ _]?(?:rate|frequency)|\bfs)\W{0,5}(?P<hz>\d+(?:[.,]\d+)?)\s*(?:hz|$)",
    re.IGNORECASE,
)
"""A sampling rate stated above the header, such as ``// Update Rate: 100.0Hz`` or ``Fs,100``."""

_SCALE = re.compile(r"(?P<key>[tga]scale),(?P<value>\d*\.?\d+(?:[eE][+-]?\d+)?)$")
"""A scale above the header of a GCSV (Gyroflow)."""
_YAML = re.compile(r"\s*[A-Za-z_]\w*:(\s|$)")
"""A line of YAML with a key."""
YAML_LINES = 40
"""Lines by which a print of messages is known: two of them."""


@dataclass(frozen=True)
class Dialect:
    """How a text file is written.

    Attributes
    ----------
    names : tuple of str
        Of the columns.
    separator : str or None
        Between them; None for blanks.
    skip : int
        Lines before the numbers.
    header : bool
        Whether the last of them names the columns.
    dates : mapping of int to str
        Columns of dates or clock times, each with the day of its first one (empty for a clock time).
    decimal : str
        Point or comma before fractions.
    rate : float or None
        Sampling rate that is stated above the header, Hz.
    scales : mapping of str to float
        ``tscale``, ``gscale`` and ``ascale`` above the header of a GCSV: s, rad/s and g in one count; ``rscale``
        deg/s in one, and ``ascale``, above that of a blackbox log.
    """

    names: tuple[str, ...]
    separator: str | None
    skip: int
    header: bool
    dates: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    decimal: str = "."
    rate: float | None = None
    scales: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))


@contextmanager
def open_bytes(path: Path) -> Iterator[IO[bytes]]:
    """Open a file for reading, unpacked if its name ends in ``.gz``, and UTF-16 as UTF-8."""
    with path.open("rb") as raw, plain_text(path, raw) as file:
        yield file


def plain_text(path: Path, raw: IO[bytes]) -> IO[bytes]:
    """Return the text of an open file, unpacked, UTF-16 (of spreadsheets) as UTF-8."""
    if path.suffix.lower() == ".gz":
        return gzip.open(raw, "rb")  # type: ignore[return-value]
    wide = raw.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    raw.seek(0)
    return codecs.EncodedFile(raw, "utf-8", "utf-16", errors="replace") if wide else raw


def find_dialect(path: Path) -> Dialect:
    """Return how a text file is written.

    Raises
    ------
    DataError
        An empty or binary file, no line of numbers, or a header that does not fit the numbers.
    """
    with input_guard(path, "text"), open_bytes(path) as file:
        head = file.read(HEAD_BYTES)
    if not head.strip():
        raise DataError(f"{path}: the file is empty: expected a header and rows of numbers")
    if b"\0" in head:
        raise DataError(f"{path}: not a text file: expected a header and rows of numbers")
    if b"\r" in (body := even_lines(head)).rstrip(b"\r"):
        raise DataError(lone_return(path, 1 + body[: body.index(b"\r")].count(b"\n")))
    lines = re.split("\r{0,2}\n|\r", _decoded(head))
    if len(head) == HEAD_BYTES:  # its last line is cut off
        lines = lines[:-1] or lines
    keys = sum(_YAML.match(line) is not None for line in lines[:YAML_LINES])
    if 2 * keys > min(YAML_LINES, len(lines)) or path.suffix.lower() == ".json":
        from tuner.readers.stored_identification import (
            is_stored,  # loaded when used: it loads the noise models
        )

        if is_stored(path):
            raise DataError(
                f"{path}: JSON or a configuration has no samples: give the log that it was made of"
            )
        raise DataError(
            f"{path}: messages printed as YAML, such as by rostopic echo ('{lines[0].strip()[:40]}'): expected "
            "a header and rows of numbers; give the bag itself, or print rows (rostopic echo -p)"
        )
    at = next((i for i, line in enumerate(lines) if _is_data(line)), None)
    if at is None:
        found = ", then ".join(f"'{printable(line.strip()[:40])}'" for line in lines[:2] if line.strip())
        raise DataError(
            f"{path}: no row is mostly numbers: expected a header and rows of numbers, found {found}"
        )
    skip = next((i + 1 for i in range(at - 1, -1, -1) if lines[i].strip()), 0)
    dialect = _dialect(path, lines[skip - 1] if skip else None, lines[at].strip(), skip)
    for above in lines[max(skip - 3, 0) : max(skip - 1, 0)]:
        dialect = _with_units_below(dialect, above)
    rate = next((m["hz"] for line in lines[:skip] if (m := _STATED_RATE.search(line))), None)
    return replace(
        dialect,
        decimal=","
        if any(_has_decimal_comma(line, dialect.separator) for line in lines[at:-1] or lines[at:])
        else ".",
        rate=None if rate is None else float(rate.replace(",", ".")),
        scales={m["key"]: float(m["value"]) for line in lines[:skip] if (m := _SCALE.match(line.strip()))}
        | _blackbox_scales(lines[:skip]),
    )


def _blackbox_scales(lines: list[str]) -> dict[str, float]:
    """Return g and deg/s in one count above the header of a blackbox log; deg/s where its float is 1."""
    stated = dict(cells for line in lines if len(cells := [x.strip(' "') for x in line.split(",")]) == 2)
    gravity, rate = stated.get("acc_1G", ""), stated.get("gyro_scale", "")
    scales = {"ascale": 1.0 / float(gravity)} if gravity.isdecimal() and int(gravity) else {}
    return scales | ({"rscale": 1.0} if rate == "0x3f800000" else {})


def _decoded(head: bytes) -> str:
    """Return the text of bytes, the last of which may be a part of a character: UTF-8, else that of Western Windows."""
    try:
        return codecs.getincrementaldecoder("utf-8-sig")().decode(head)
    except UnicodeDecodeError:
        return head.decode("cp1252", errors="replace")


def _dialect(path: Path, above: str | None, data: str, skip: int) -> Dialect:
    """Return how a file is written whose first row is `data` and whose last line before it is `above`."""
    separator = _separator(data)
    cells = split_line(data, separator)
    found = {j: stamp for j, cell in enumerate(cells) if (stamp := STAMP.fullmatch(cell.strip(' "\t')))}
    dates = MappingProxyType({j: stamp["day"] or "" for j, stamp in found.items()})
    unnamed = tuple(f"c{j + 1}" for j in range(len(cells)))
    if above is None:
        return Dialect(unnamed, separator, skip, False, dates)
    bare = above.strip().lstrip("#%").strip()
    names_with_blanks = [bare] if len(cells) == 1 else re.split(r"\s{2,}", bare)
    headers = split_line(bare, separator), split_line(bare, _separator(bare)), names_with_blanks
    for header in headers[1:2] if len(cells) == 1 and _separator(bare) else headers:
        if len(header) == len(cells) - 1 and not cells[-1].strip():
            header.append("")
        if len(header) == len(cells):
            plain = (printable(name.strip().strip('"').strip()) for name in header)
            named = tuple(name or c for name, c in zip(plain, unnamed, strict=True))
            return Dialect(named, separator, skip, True, dates)
    if above.lstrip().startswith(("#", "%")):
        return Dialect(unnamed, separator, skip, False, dates)
    names = split_line(bare, _separator(bare))
    empty = f"; {', '.join(names[1:3])} have no values" if len(cells) == 1 else ""
    shown = {None: "blanks", "\t": "tab"}.get(separator, f"'{separator}'")
    raise DataError(
        f"{path}:{skip}: the header names {len(names)} columns, the row below it has {len(cells)} (separated by "
        f"{shown}){empty}"
    )


def _with_units_below(dialect: Dialect, above: str) -> Dialect:
    """Return the dialect with the names of the line above, where the last line of the header has their units."""
    bare = [name.strip(" []()") for name in dialect.names]
    units = [known_unit(name) or known_unit(unit) for name, unit in zip(dialect.names, bare, strict=True)]
    header = [
        printable(name.strip().strip('"').strip())
        for name in split_line(above.strip().lstrip("#%").strip(), dialect.separator)
    ]
    unnamed = [not unit or unit == "-" or unit == f"c{j + 1}" for j, unit in enumerate(bare)]
    stated = [unit is not None for unit in units]
    if len(set(header)) != len(units) or not any(stated) or not all(map(operator.or_, stated, unnamed)):
        return dialect
    names = (f"{name} [{unit}]" if unit else name for name, unit in zip(header, units, strict=True))
    return replace(dialect, names=tuple(names))


def even_lines(text: bytes) -> bytes:
    """Return text whose lines end in LF: those in CR LF, or in CR CR LF of programs that write CR LF to a text file."""
    return text.replace(b"\r\n", b"\n").replace(b"\r\n", b"\n") if b"\r" in text else text


def lone_return(path: Path, line: int) -> str:
    """Return the message that a line ends in CR alone."""
    return (
        f"{path}:{line}: expected lines that end in LF or CR LF, found a CR alone: convert the file, such as by "
        "tr '\\r' '\\n'"
    )


def _separator(line: str) -> str | None:
    """Return what separates the columns of a line; None for blanks."""
    for separator in (";", "\t"):
        if separator in line and "," in line and _commas_are_inside(line, separator):
            return separator
    return next((s for s in (",", ";", "\t") if s in line), None)


def _has_decimal_comma(line: str, separator: str | None) -> bool:
    """Return whether every comma of a line is that of a number between semicolons or tabs."""
    if separator not in (";", "\t") or separator not in line or "," not in line:
        return False
    return _commas_are_inside(line, separator) and any(
        _DECIMAL_COMMA.fullmatch(cell.strip()) for cell in line.split(separator)
    )


def _commas_are_inside(line: str, separator: str) -> bool:
    """Return whether every comma of a line is that of a number or a stamp."""
    with_comma = [cell.strip() for cell in line.split(separator) if "," in cell]
    return all(_DECIMAL_COMMA.fullmatch(cell) or STAMP.fullmatch(cell.strip('"')) for cell in with_comma)


def split_line(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line; between blanks a unit in brackets belongs to the name before it."""
    if separator is not None:
        return line.split(separator)
    return re.findall(r"[^\s\[]+(?:\s*\[[^\]]*\])?", line)


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, or is written as one that is missing."""
    text = cell.strip().strip('"')
    if text.lower() in _MISSING_NUMBERS:
        return True
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _is_data(line: str) -> bool:
    """Return whether a line is a row of data: no comment, and mostly numbers and dates."""
    bare = line.strip()
    if not bare or bare.startswith(("#", "%")):
        return False
    separator = _separator(bare)
    if _has_decimal_comma(bare, separator):
        bare = bare.replace(",", ".")
    cells = [cell.strip().lower() for cell in split_line(bare, separator)]
    numbers = sum(
        cell not in _MISSING_NUMBERS
        and (is_number(cell) or STAMP.fullmatch(cell.strip('"').upper()) is not None)
        for cell in cells
    )
    return 2 * numbers > sum(cell != "" for cell in cells)


def is_text(head: bytes) -> bool:
    """Return whether the first bytes of a file are text, or text packed by gzip."""
    return head.startswith((GZIP, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" not in head
