"""Files of a receiver alone, beside ``imu.csv`` of a drive: RTKLIB's solutions, NMEA 0183, UBX, Waypoint's text."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from tuner.formats.guard import input_guard
from tuner.formats.packages import lacking
from tuner.readers.fixes.gps_time import GpsFixes
from tuner.readers.fixes.nmea import read_nmea
from tuner.readers.fixes.rtklib import read_rtklib
from tuner.readers.fixes.ubx import read_ubx
from tuner.readers.waypoint import COLUMNS, read_waypoint, waypoint_header
from tuner.types.records import DataError

READERS: Mapping[str, Callable[[Path], GpsFixes]] = MappingProxyType(
    {".pos": read_rtklib, ".nmea": read_nmea, ".ubx": read_ubx}
)
"""Reader of each ending of a file name."""
EXTRAS: Mapping[str, str] = MappingProxyType({".nmea": "nmea", ".ubx": "ubx"})
"""Extra of this package with the library that a reader needs."""
TEXT_ENDINGS = (".txt", ".pos", ".csv", ".asc")
"""Endings that an export of Waypoint may have."""
OF_THE_FORM = ("imu.csv", "gnss.csv", "truth.csv")
"""Files of a drive's folder that are read by their names."""


def fix_files(folder: Path) -> list[Path]:
    """Return the files of receivers in a folder, by name; of Waypoint those without attitude."""
    files = (path for path in sorted(folder.iterdir()) if path.name not in OF_THE_FORM)
    return [path for path in files if _kind(path) in (*READERS, "waypoint")]


def reference_files(folder: Path) -> list[Path]:
    """Return the exports of Inertial Explorer in a folder with attitude: references."""
    files = (path for path in sorted(folder.iterdir()) if path.name not in OF_THE_FORM)
    return [path for path in files if _kind(path) == "reference"]


def _kind(path: Path) -> str:
    """Return the ending by which a file is read, "waypoint" or "reference" for Waypoint's text, else ""."""
    ending = path.suffix.lower()
    if not path.is_file():
        return ""
    header = waypoint_header(path) if ending in TEXT_ENDINGS else None
    if header is not None:
        return "reference" if header.integrated else "waypoint"
    return ending if ending in READERS else ""


def read_fix_file(path: Path) -> GpsFixes:
    """Return the fixes of one of `fix_files`.

    Raises
    ------
    DataError
        What is damaged, or holds no fixes.
    """
    kind = _kind(path)
    with input_guard(path, "a file of a receiver"):
        try:
            return _of_waypoint(path) if kind == "waypoint" else READERS[kind](path)
        except ImportError as error:
            raise DataError(f"{path}: {lacking(error, EXTRAS[kind])}") from None


def _of_waypoint(path: Path) -> GpsFixes:
    found = read_waypoint(path)
    columns = [COLUMNS.index(name) for name in COLUMNS if name not in ("roll", "pitch", "yaw")][:12]
    return replace(found, rows=found.rows[:, columns])
