"""Solutions of RTKLIB (``.pos``): latitude, longitude in decimal degrees, height, sds, perhaps velocities.

The header's last line names the columns (RTKLIB manual 2.4.2, appendix B.1): time as date and clock time or as GPS week
and second, in GPST or UTC; sds of north, east, up. Solutions as baseline or ECEF are refused.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from tuner.readers.fixes.gps_time import GPS_EPOCH, SECONDS_A_WEEK, GpsFixes, leap_seconds
from tuner.readers.solutions import OF_RTKLIB, solutions
from tuner.types.records import DataError


def read_rtklib(path: Path) -> GpsFixes:
    """Return the fixes of a solution.

    Raises
    ------
    DataError
        What is no such file, or is in other coordinates.
    """
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    header = next((line for line in reversed(lines) if line.startswith("%") and "(" in line), "")
    if "latitude(deg)" not in header:
        found = header.strip("% ")[:60] or (lines[0][:60] if lines else "an empty file")
        raise DataError(
            f"{path}: expected a solution of RTKLIB with latitude(deg) and longitude(deg), found '{found}'; set the "
            "solution format to Lat/Lon/Height, degrees"
        )
    utc = " UTC " in f" {header[1:]} "
    t, rows = [], []
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("%"):
            continue
        cells = line.replace(",", " ").split()
        try:
            t.append(_gps_time(cells[0], cells[1], utc=utc))
            values = [float(cell) for cell in cells[2:]]
            if len(values) < 3:
                raise ValueError
        except (ValueError, IndexError):
            raise DataError(
                f"{path}:{number}: expected time, latitude, longitude, height, found '{line[:60]}': remove the line"
            ) from None
        rows.append(_row(values))
    if not rows:
        raise DataError(f"{path}: expected fixes below the header, found none")
    table = np.array(rows)
    table[:, -1] = solutions(table[:, -1], OF_RTKLIB)
    return GpsFixes(np.array(t), table)


def _gps_time(first: str, second: str, *, utc: bool) -> float:
    """Return GPS time, s since 1980, of a date and clock time, or of a week and its second."""
    if "/" not in first:
        return int(first) * SECONDS_A_WEEK + float(second)
    year, month, day = map(int, first.split("/"))
    hour, minute, seconds = second.split(":")
    when = datetime(year, month, day, tzinfo=UTC)
    since = (when - GPS_EPOCH).total_seconds() + 3600.0 * int(hour) + 60.0 * int(minute) + float(seconds)
    return since + (leap_seconds(when) if utc else 0)


def _row(values: list[float]) -> list[float]:
    """Return a row of `GpsFixes` of the numbers after the time.

    They are a position, Q, ns, 6 sds, age, ratio, then perhaps a velocity, up positive, and its sds.
    """
    whole = next(n for n in (19, 16, 8, 4, 3) if len(values) >= n)  # what follows a position comes in groups
    values = [*values[:whole], *[math.nan] * (19 - whole)]
    velocity = [*values[13:15], -1.0 * values[15]]
    known = [x if x > 0.0 else math.nan for x in (*values[5:8], *values[16:19])]
    return [*values[:3], *velocity, *known, values[3]]
