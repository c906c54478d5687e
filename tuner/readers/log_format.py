"""What a log format is, and the registry of all formats, open to other packages.

A format is one file that ends with one declaration::

    FORMAT = LogFormat("json-lines", "JSON lines", (".jsonl",), read)

Another package names it in its ``pyproject.toml``::

    [project.entry-points."tuner.readers"]
    json-lines = "my_package.json_lines:FORMAT"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from models.registry import Registry
from tuner.formats.guard import guarded, input_guard
from tuner.formats.packages import lacking
from tuner.readers.columns import Listing, Progress
from tuner.readers.drive_npz import DriveArrays
from tuner.types.records import DataError

HEAD_BYTES = 4096
"""Bytes at the beginning of a file by which its format is recognized: headers of all formats are shorter."""


@dataclass(frozen=True)
class LogFormat:
    """A file format of logs: how it is recognized, and how its columns are listed.

    Attributes
    ----------
    name : str
        Lower-case letters, digits and hyphens.
    title : str
        Name of the format in messages.
    suffixes : tuple of str
        Endings of file names, with the dot, in lower case; a file with one of them is read by this format.
    read : callable
        Returns the columns of a file; the second argument, where it is not None, wants (bytes done, bytes in total).
    recognizes : callable, optional
        Tells from the first `HEAD_BYTES` bytes whether a file of another ending is of this format.
    extra : str, optional
        Extra of this package with the library that `read` imports.
    drive : callable, optional
        Returns the arrays of a drive, of a format that can hold fixes beside inertial samples.
    folder : callable, optional
        Tells whether a folder is a log of this format.
    any_text : bool, optional
        Whether it reads any table in text: its endings and first bytes then leave others the first choice.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, Progress | None], Listing]
    recognizes: Callable[[bytes], bool] = lambda _: False
    extra: str | None = None
    any_text: bool = False
    drive: Callable[[Path], DriveArrays] | None = None
    folder: Callable[[Path], bool] = lambda _: False


def _check(declared: object) -> None:
    if not isinstance(declared, LogFormat):
        raise TypeError(f"expected a LogFormat, got {type(declared).__name__}")
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", declared.name):
        raise ValueError("expected a name of lower-case letters, digits and hyphens")
    if not declared.suffixes or any(not re.fullmatch(r"(\.[a-z0-9]+)+", s) for s in declared.suffixes):
        raise ValueError("expected endings of file names such as .csv, in lower case")
    if not (declared.title and callable(declared.read)):
        raise ValueError("expected a title and a function 'read'")


FORMATS: Registry[LogFormat] = Registry(
    "log format",
    "tuner.readers",
    name_of=lambda declared: str(getattr(declared, "name", declared)),
    check=_check,
)
"""Every log format by name; `tuner.readers` adds the built-in ones."""


OF_A_RECEIVER = re.compile(rb"\$?(G[ABILNPQ]|BD)[A-Z]{3},|\xb5b")
"""How logs of NMEA and UBX begin."""
LFS_POINTER = b"version https://git-lfs.github.com/spec/"
"""How a file begins that stands for one which Git LFS keeps elsewhere."""
EUROC_FILES = ("imu0/data.csv", "mav0/imu0/data.csv", "data.csv")
"""Where data sets in the form of EuRoC keep the samples of the IMU."""


def file_of(path: Path) -> Path:
    """Return the file that stands for a folder: of a ROS 2 bag the first with its messages, of EuRoC the IMU's."""
    if (path / "metadata.yaml").is_file():
        return min((f for kind in ("*.db3", "*.mcap") for f in path.glob(kind)), default=path)
    return next((f for f in (path / name for name in EUROC_FILES) if f.is_file()), path)


def log_folder(path: Path) -> LogFormat | None:
    """Return the format of a folder that is a log, or None."""
    return next((one for one in FORMATS.values() if one.folder(path)), None)


def format_of(path: Path) -> LogFormat:
    """Return the format of a file, by the ending of its name, else by its first bytes.

    An ending such as ``.txt`` says only that it is text: a format that recognizes the first bytes goes before.

    Raises
    ------
    DataError
        Where no format fits: one line that says which there are.
    """
    if path.is_dir() and (whole := log_folder(path)) is not None:
        return whole
    name = path.name.lower()
    fitting = [(len(s), one) for one in FORMATS.values() for s in one.suffixes if name.endswith(s)]
    declared = max(fitting, key=lambda pair: pair[0])[1] if fitting else None
    by_name = declared if declared is not None and not declared.any_text else None
    if by_name is not None and not path.is_file():  # what reads it says so
        return by_name
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if head.startswith(LFS_POINTER):
        raise DataError(f"{path}: a pointer of Git LFS, not the log itself: fetch it with 'git lfs pull'")
    if by_name is not None:
        return by_name
    if OF_A_RECEIVER.match(head):
        raise DataError(
            f"{path}: sentences or messages of a receiver hold no inertial samples: put the file, named .nmea or .ubx, "
            "into a folder with imu.csv, and give the folder as the drive"
        )
    found = next((one for one in FORMATS.values() if not one.any_text and one.recognizes(head)), declared)
    if found is None:
        found = next((one for one in FORMATS.values() if one.any_text and one.recognizes(head)), None)
    if found is None:
        known = ", ".join(f"{one.title} ({' '.join(one.suffixes)})" for one in FORMATS.values())
        raise DataError(f"{path}: expected a log as {known}, got none of these; convert it to one of them")
    return found


def columns_of(path: Path, progress: Progress | None, unit: str = "") -> Listing:
    """Return the columns of a log, or of one inertial unit in it where `unit` names one.

    Raises
    ------
    DataError
        Where no format fits, a library is missing, the file is damaged, or it holds no such unit.
    """
    declared = format_of(path)
    with library_of(declared, path), input_guard(path, declared.title):
        listing = declared.read(path, progress)
        if unit and listing.of_unit is None:
            raise DataError(f"{path}:{unit}: {declared.title} names no inertial units: leave ':{unit}' out")
        if unit and listing.of_unit is not None:
            listing = listing.of_unit(unit)
        return replace(listing, load=guarded(path, declared.title, listing.load))


@contextmanager
def library_of(declared: LogFormat, path: Path) -> Iterator[None]:
    """Say in one line what to install where the library of a format is missing."""
    try:
        yield
    except ImportError as error:
        if declared.extra is None:
            raise
        raise DataError(f"{path}: {declared.title} {lacking(error, declared.extra)}") from None
