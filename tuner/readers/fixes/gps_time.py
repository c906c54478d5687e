"""Fixes on GPS time, and the clock of an inertial record that they are put on.

An inertial record may count GPS seconds of the week, UNIX time, GPS time since 1970 or 1980, or seconds of the day.
Which it is follows from where the fixes fall into it: the clock on which both cover most of the time in common.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from tuner.types.records import DataError

SECONDS_A_WEEK, SECONDS_A_DAY = 604800.0, 86400.0
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
UNIX_OF_GPS_EPOCH = GPS_EPOCH.timestamp()
LEAP_SECONDS = (
    (datetime(2017, 1, 1, tzinfo=UTC), 18),
    (datetime(2015, 7, 1, tzinfo=UTC), 17),
    (datetime(2012, 7, 1, tzinfo=UTC), 16),
    (datetime(2009, 1, 1, tzinfo=UTC), 15),
    (datetime(2006, 1, 1, tzinfo=UTC), 14),
    (datetime(1999, 1, 1, tzinfo=UTC), 13),
)
"""GPS time minus UTC, s, since a day (IERS Bulletin C)."""
MIN_COMMON_SHARE = 0.5
"""Share of the shorter of record and fixes that both must cover on the right clock."""


@dataclass(frozen=True)
class GpsFixes:
    """Fixes of one file.

    Attributes
    ----------
    t : ndarray, shape (k,)
        GPS time since 6 January 1980, s; where the file names neither week nor date, since the beginning of the week.
    rows : ndarray, shape (k, 12) or (k, 13)
        Latitude, longitude, deg, height above the ellipsoid, m; velocity north, east, down, m/s; sds of both; class of
        solution by its number in `SOLUTIONS`; NaN where there is none. Those of text of Waypoint have its columns.
    notes : tuple of str
        How the file was understood.
    dated : bool
        Whether `t` counts from 1980; else from the beginning of an unknown week.
    """

    t: FloatArray
    rows: FloatArray
    notes: tuple[str, ...] = ()
    dated: bool = True


def leap_seconds(when: datetime) -> int:
    """Return GPS time minus UTC, s; 13 before 1999."""
    return next((seconds for since, seconds in LEAP_SECONDS if when >= since), 13)


def gps_seconds(when: datetime) -> float:
    """Return the GPS time of an instant in UTC, s since 6 January 1980."""
    return (when - GPS_EPOCH).total_seconds() + leap_seconds(when)


def common_share(t: FloatArray, begin: float, end: float) -> float:
    """Return the share of the shorter of fixes and record that both cover."""
    first, last = float(np.nanmin(t)), float(np.nanmax(t))
    both = min(last, end) - max(first, begin)
    return max(both, 0.0) / max(min(last - first, end - begin), 1e-9)


def on_clock_of(path: Path, fixes: GpsFixes, begin: float, end: float) -> tuple[FloatArray, str]:
    """Return the fixes on the clock of an inertial record that lasts from `begin` to `end`, s, and a note which it is.

    Returns
    -------
    rows : ndarray, shape (k, 1 + columns)
        t and the columns of `GpsFixes.rows`.
    note : str
        The clock.

    Raises
    ------
    DataError
        Where the fixes fall into the record on none of the clocks.
    """
    first = float(np.nanmin(fixes.t))
    unix = fixes.t + UNIX_OF_GPS_EPOCH
    leap = leap_seconds(datetime.fromtimestamp(first + UNIX_OF_GPS_EPOCH, tz=UTC))
    of_week = fixes.t - SECONDS_A_WEEK * math.floor(first / SECONDS_A_WEEK)
    of_day = (fixes.t - leap) - SECONDS_A_DAY * math.floor((first - leap) / SECONDS_A_DAY)
    clocks = {
        "GPS seconds of the week": of_week,
        f"UNIX time (UTC, {leap} s behind GPS time)": unix - leap,
        "GPS time since 1970, as RTKLIB does": unix,
        "GPS time since 1980": fixes.t,
        "seconds of the day in UTC": of_day,
    }
    if not fixes.dated:
        clocks = {"GPS seconds of the week": fixes.t}
    inside = {name: common_share(t, begin, end) for name, t in clocks.items()}
    best = max(inside, key=lambda name: inside[name])
    if inside[best] >= MIN_COMMON_SHARE:
        # On a Sunday GPS seconds of the week and of the day are 18 s apart: a longer record fits both.
        also = [name for name, share in inside.items() if share == inside[best] and name != best]
        alternative = f" (or {also[0]}: the fixes fall into it as well)" if also else ""
        return np.column_stack([clocks[best], fixes.rows]), (
            f"{path.name}: the inertial record counts {best}{alternative}"
        )
    spans = "; ".join(f"{t[0]:.1f} … {t[-1]:.1f} in {name}" for name, t in clocks.items())
    raise DataError(
        f"{path}: expected fixes of the time of the inertial record, {begin:.1f} … {end:.1f} s, found {spans}; stamp "
        "the inertial record on one of these clocks"
    )
