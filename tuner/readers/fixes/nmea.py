"""NMEA 0183 logs, read with pynmeagps: GGA for positions, RMC for date and velocity, GST for sds.

Sentences of one clock time are one fix. Heights are those above mean sea level plus the stated separation of the geoid;
there is no vertical velocity.
"""

from __future__ import annotations

import math
from datetime import UTC, date, datetime, time
from pathlib import Path
from typing import Any

import numpy as np

from tuner.readers.fixes.gps_time import GpsFixes, gps_seconds
from tuner.types.records import DataError

KNOT = 1852.0 / 3600.0
"""m/s."""


def read_nmea(path: Path) -> GpsFixes:
    """Return the fixes of an NMEA log.

    Raises
    ------
    DataError
        Where there is no GGA with a fix, or no RMC that states the date.
    """
    from pynmeagps import NMEAReader

    found: dict[tuple[date, time], list[float]] = {}
    day: date | None = None
    latest: time | None = None
    pending: list[tuple[time, list[float]]] = []
    with path.open("rb") as file:
        for _, message in NMEAReader(file, quitonerror=0):
            kind = getattr(message, "msgID", None)
            if kind not in ("GGA", "RMC", "GST") or not isinstance(message.time, time):
                continue
            clock = message.time
            if kind == "RMC" and isinstance(message.date, date):
                day = message.date
                for early, row in pending:
                    found[day, early] = row
                pending = []
            if kind == "GGA" and message.quality:
                row = _position(message)
                if day is None:
                    pending.append((clock, row))
                elif latest is not None and clock < latest and latest.hour - clock.hour > 12:
                    day = date.fromordinal(
                        day.toordinal() + 1
                    )  # midnight; the RMC of this epoch is yet to come
                    found[day, clock] = row
                else:
                    found.setdefault((day, clock), row)
                latest = clock
            elif day is not None and (day, clock) in found:
                _complete(found[day, clock], message, kind)
    if not found:
        lacking = "no date" if pending else "none"
        raise DataError(f"{path}: expected GGA sentences with a fix and RMC with the date, found {lacking}")
    keys = sorted(found)
    t = [gps_seconds(datetime.combine(day, clock, tzinfo=UTC)) for day, clock in keys]
    return GpsFixes(np.array(t), np.array([found[key] for key in keys]))


def _position(message: Any) -> list[float]:
    height = float(message.alt or 0.0) + float(message.sep or 0.0)
    return [float(message.lat), float(message.lon), height, *[math.nan] * 9, float(message.quality)]


def _complete(row: list[float], message: Any, kind: str | None) -> None:
    """Add velocity or sds of the same epoch to a row."""
    if kind == "RMC" and message.spd not in ("", None):
        speed, course = KNOT * float(message.spd), math.radians(float(message.cog or 0.0))
        row[3:5] = [speed * math.cos(course), speed * math.sin(course)]
    elif kind == "GST":
        sds = [
            float(x) if x not in ("", None) else 0.0
            for x in (message.stdLat, message.stdLong, message.stdAlt)
        ]
        row[6:9] = [x if x > 0.0 else math.nan for x in sds]
