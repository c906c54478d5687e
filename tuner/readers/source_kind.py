"""What a source named by a user is: a log, a drive, a stored result, or the name of a built-in grade."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

from tuner.formats.guard import input_guard
from tuner.types.one_line import printable
from tuner.types.records import DataError

if TYPE_CHECKING:
    from tuner.readers.drive_npz import DriveArrays


UNIT = re.compile(r"\w+\.\d+")
"""Name of one inertial unit of several: a message and its instance."""


def source_name(source: str | Path) -> str:
    """Return the short name of a source: its file name without suffixes, or the name of the grade."""
    path, unit = unit_of_log(source)
    name = printable(with_name(path).name)
    return "-".join([name.split(".")[0] or name, *([unit] if unit else [])])


def with_name(path: Path) -> Path:
    """Return a path that ends in a name: of a folder given as ``.`` or ``..`` the whole path."""
    return path if path.name.strip(".") else path.resolve()


def unit_of_log(source: str | Path) -> tuple[Path, str]:
    """Return the path of a log, and the inertial unit in it that ``log.bin:IMU.1`` names, or no text."""
    path, _, unit = str(source).rpartition(":")
    named = path and UNIT.fullmatch(unit) and not Path(source).exists() and Path(path).is_file()
    return (Path(path), unit) if named else (Path(source), "")


def is_file(source: str | Path) -> bool:
    """Tell a path from the name of a built-in grade: a path exists, or looks like one."""
    return isinstance(source, Path) or Path(source).exists() or "/" in source or "." in source


def is_log(source: str | Path) -> bool:
    """Tell a log from a grade, a datasheet, a stored identification and a measured Allan curve."""
    from tuner.catalogue.datasheet import is_datasheet
    from tuner.readers.allan_curve import is_curve
    from tuner.readers.stored_identification import is_stored

    path = Path(source)
    return is_file(source) and not (is_datasheet(path) or is_stored(path) or is_curve(path))


def is_drive_by_form(path: Path) -> bool | None:
    """Tell a drive from a log by the form of a folder, NPZ or YAML; None where only reading its samples tells."""
    from tuner.readers.log_format import log_folder

    if path.is_dir():
        return True if log_folder(path) is None else None
    if path.suffix.lower() == ".npz" and zipfile.is_zipfile(path):
        try:
            with zipfile.ZipFile(path) as file:
                return "gnss_t.npy" in file.namelist()
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
            return False
    if path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        head = path.read_text(encoding="utf-8", errors="replace")
        return "imupath" in head and "gnsspath" in head
    return None if path.is_file() else False


def drive_in_messages(path: Path) -> DriveArrays | None:
    """Return the drive in a message log; None where it holds too few fixes for one, or is no message log."""
    from tuner.readers.log_format import format_of, library_of

    try:
        declared = format_of(path)
        if declared.drive is None:
            return None
        with library_of(declared, path), input_guard(path, declared.title):
            return declared.drive(path)
    except DataError:
        return None
