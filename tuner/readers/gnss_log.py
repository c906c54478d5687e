"""A log of satellite fixes alone, as CSV: the columns of ``gnss.csv`` of a drive (`tuner.readers.drive`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tuner.readers.drive_tables import GNSS_COLUMNS, ordered, table
from tuner.readers.text import named_columns
from tuner.types.records import DataError, Gnss


def is_fixes(path: str | Path) -> bool:
    """Return whether a file is a text file with the columns t, lat, lon and height."""
    plain = {name.split("[")[0].strip().lower() for name in named_columns(Path(path))}
    return set(GNSS_COLUMNS[:4]) <= plain


def read_fixes(path: str | Path) -> Gnss:
    """Read satellite fixes; unreadable rows, doubled and disordered stamps are removed.

    Raises
    ------
    DataError
        What cannot be used, in one line.
    """
    path = Path(path)
    rows = table(path, GNSS_COLUMNS, 4)
    rows = ordered(path, "GNSS", rows, rows[:, :4], [])
    if np.abs(rows[:, 1]).max() > 90.0 or np.abs(rows[:, 2]).max() > 360.0:
        raise DataError(
            f"{path}: expected latitude and longitude in degrees, got up to {np.abs(rows[:, 1:3]).max():.5g}"
        )
    llh = np.column_stack([np.radians(rows[:, 1:3]), rows[:, 3]])
    return Gnss(rows[:, 0] - rows[0, 0], llh, rows[:, 4:7], rows[:, 7:10], rows[:, 10:13], rows[:, 13])
