"""The even grid on which the samples of a file lie: by its stamps, or by a stated rate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tuner.readers.column_choice import Channel
from tuner.readers.columns import Listing
from tuner.readers.options import Options
from tuner.readers.time_base import COARSE_CLOCK, Timebase, even_timebase, stamped_timebase
from tuner.readers.time_column import Clock, read_clock
from tuner.types.records import DataError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

RATE_TOLERANCE = 0.05
"""Largest relative difference between the stated rate and that of the stamps."""
SECONDS_OF_WEEK = 604800.0
"""Where the seconds of the GPS week begin anew."""


def clock_of_columns(
    listing: Listing,
    channel: Channel,
    time: NDArray[Any],
    week: FloatArray | None,
    rate: float | None,
    options: Options,
) -> Clock:
    """Return the clock of a file: its time column and, where there is one, the GPS week beside it."""
    unit = channel.unit
    if week is not None and np.isfinite(week).all():
        milliseconds = (unit or ("ms" if np.nanmedian(time) > SECONDS_OF_WEEK else "s")) == "ms"
        unit = "ms" if milliseconds else "s"
        time = time + (week - week[0]) * SECONDS_OF_WEEK * (1000.0 if milliseconds else 1.0)
    mapped = (options.columns or {}).get("t", "")
    by_user = options.rate is not None or ("[" in mapped and mapped not in listing.shapes)
    by_type = channel.part.array in listing.units
    return read_clock(time, name=str(channel.part), unit=unit, rate=rate, by_user=by_user, by_type=by_type)


def timebase_of_clock(
    clock: Clock,
    usable: BoolArray | None,
    equal: Callable[[IntArray, IntArray], BoolArray],
    options: Options,
    notes: list[str],
) -> Timebase:
    """Return the time base of a clock, or that of the stated rate where the clock is too coarse to give one."""
    rate = options.rate
    try:
        return stamped_timebase(
            clock.stamps,
            valid=usable,
            timed=clock.on,
            equal=equal,
            resolution=clock.resolution,
            moving=options.stamps,
        )
    except DataError as error:
        if rate is None or not str(error).startswith(COARSE_CLOCK):
            raise
        notes.append(f"{COARSE_CLOCK} to give a rate: samples are taken as even at the {rate:.6g} Hz stated")
        return even_timebase(len(clock.stamps), 1.0 / rate, usable, moving=options.stamps)


def check_rate(interval: float, rate: float | None, notes: list[str], *, explicit: bool) -> None:
    """Refuse stamps whose rate is far from the stated one; note a small difference."""
    if rate is None:
        return
    measured = 1.0 / interval
    if abs(measured / rate - 1.0) > RATE_TOLERANCE:
        whose = "--rate says" if explicit else "the file's meta says"
        msg = (
            f"the stamps give {measured:.6g} Hz, {whose} {rate:.6g} Hz: correct the rate, or state the unit "
            "of the time column, such as --columns 't=NAME [ms]'"
        )
        raise DataError(msg)
    if abs(measured / rate - 1.0) > 1e-3:
        notes.append(f"the stamps give {measured:.9g} Hz, stated were {rate:.9g} Hz: the stamps are used")
