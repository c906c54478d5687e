"""A datasheet stands wherever a log does: its values become an identification without intervals.

The form of the file is that of `tuner.catalogue.datasheet_format`; the built-in grades have the same.
"""

from __future__ import annotations

from pathlib import Path

from tuner.catalogue.datasheet_format import FORMAT, parse_sheet
from tuner.catalogue.grades import grade_identification
from tuner.formats.documents import read_text
from tuner.types import Identification
from tuner.types.records import DataError


def is_datasheet(path: Path) -> bool:
    """Return whether a file begins as a datasheet does."""
    try:
        with path.open(encoding="utf-8") as file:
            head = file.read(4096)
    except (OSError, UnicodeDecodeError):
        return False
    return any(line.partition("#")[0].strip() == f"format: {FORMAT}" for line in head.splitlines())


def read_datasheet(path: Path) -> Identification:
    """Read a datasheet file.

    Raises
    ------
    DataError
        One line: file, place, expected, found.
    """
    text = read_text(path, expected=f"a readable YAML file of format {FORMAT}")
    sheet = parse_sheet(text, source=str(path))
    try:
        return grade_identification(sheet)
    except OverflowError:
        raise DataError(
            f"{path}: expected figures of a sensor, found one whose square no number holds: check its unit"
        ) from None
