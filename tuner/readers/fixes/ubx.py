"""UBX logs of u-blox receivers, read with pyubx2: message NAV-PVT with position, velocity and their accuracies."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from tuner.readers.fixes.gps_time import GpsFixes, gps_seconds
from tuner.types.records import DataError

FIX_3D, FIX_WITH_DEAD_RECKONING = 3, 4
"""Fix types of a position in three dimensions."""


def _solution(message: Any) -> float:
    """Return the class of solution by its number in `SOLUTIONS`, from flags and fix type."""
    if message.carrSoln:
        return {1: 5.0, 2: 4.0}.get(message.carrSoln, math.nan)
    if message.fixType == FIX_WITH_DEAD_RECKONING:
        return 6.0
    return 2.0 if message.diffSoln else 1.0


def read_ubx(path: Path) -> GpsFixes:
    """Return the fixes of a UBX log; those without a valid date or a fix in three dimensions are left out.

    Raises
    ------
    DataError
        Where there is no NAV-PVT with a fix.
    """
    from pyubx2 import UBX_PROTOCOL, UBXReader

    t, rows = [], []
    with path.open("rb") as file:
        for _, message in UBXReader(file, protfilter=UBX_PROTOCOL, quitonerror=0):
            if getattr(message, "identity", "") != "NAV-PVT" or not (message.validDate and message.validTime):
                continue
            if message.fixType not in (FIX_3D, FIX_WITH_DEAD_RECKONING) or not message.gnssFixOk:
                continue
            when = datetime(
                message.year,
                message.month,
                message.day,
                message.hour,
                message.min,
                min(message.second, 59),
                tzinfo=UTC,
            ) + timedelta(microseconds=1e-3 * message.nano)
            t.append(gps_seconds(when))
            velocity = [1e-3 * v for v in (message.velN, message.velE, message.velD)]
            accuracy = [1e-3 * a or math.nan for a in (message.hAcc, message.vAcc, message.sAcc)]
            sds = [accuracy[0], accuracy[0], accuracy[1], *[accuracy[2]] * 3]
            place = message.lat, message.lon, 1e-3 * message.height
            rows.append([*place, *velocity, *sds, _solution(message)])
    if not rows:
        raise DataError(
            f"{path}: expected NAV-PVT messages with a fix, found none; log UBX-NAV-PVT at the receiver"
        )
    return GpsFixes(np.array(t), np.array(rows))
