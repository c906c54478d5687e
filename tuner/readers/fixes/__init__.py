"""Files of a receiver alone: RTKLIB's solutions, NMEA 0183, UBX; found beside ``imu.csv`` in the folder of a drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from tuner.readers.fixes.gps_time import GpsFixes
from tuner.readers.fixes.nmea import read_nmea
from tuner.readers.fixes.rtklib import read_rtklib
from tuner.readers.fixes.ubx import read_ubx

READERS: Mapping[str, Callable[[Path], GpsFixes]] = MappingProxyType(
    {".pos": read_rtklib, ".nmea": read_nmea, ".ubx": read_ubx}
)
"""Reader of each ending of a file name."""
EXTRAS: Mapping[str, str] = MappingProxyType({".nmea": "nmea", ".ubx": "ubx"})
"""Extra of this package with the library that a reader needs."""


def fix_files(folder: Path) -> list[Path]:
    """Return the files of receivers in a folder, by name."""
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in READERS)
