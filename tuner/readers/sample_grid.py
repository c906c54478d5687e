"""The even grid on which the samples of a file lie: by its stamps, or by a stated rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import BoolArray, FloatArray, IntArray
from tuner.formats.customary_units import stamp
from tuner.limits import MAX_RATE, MIN_RATE, WRONG_FACTOR
from tuner.readers.bad_rows import BadRows, LogRows
from tuner.readers.clock_unit import STATED_BY_RATE, time_in
from tuner.readers.column_mapping import Chosen, offered
from tuner.readers.columns import Listing
from tuner.readers.options import Options
from tuner.readers.placeholder_rows import without_placeholders
from tuner.readers.refusal import Refusal
from tuner.readers.sensor_columns import Layout
from tuner.readers.time_base import COARSE_CLOCK, Timebase, even_timebase, stamped_timebase
from tuner.readers.time_column import Clock, read_clock
from tuner.readers.timestamps import without_wrong_stamps
from tuner.readers.value_checks import without_spikes
from tuner.types.records import DataError

RATE_TOLERANCE = 0.05
"""Largest relative difference between the stated rate and that of the stamps."""
TRIED_RATE = 100.0
"""Rate, Hz, at which columns are tried while nothing states one: gravity does not depend on it, noise but little."""
SECONDS_OF_WEEK = 604800.0
"""Where the seconds of the GPS week begin anew."""


def sample_grid(
    listing: Listing,
    layout: Layout,
    groups: Mapping[str, NDArray[Any]],
    time: NDArray[Any] | None,
    week: FloatArray | None,
    valid: BoolArray | None,
    rate: float | None,
    options: Options,
    *,
    within: LogRows,
    notes: list[str],
    bad: list[BadRows],
) -> tuple[Timebase, Clock | None]:
    """Return the time base of samples by their stamps, and the clock of these.

    Where there are none, the time base is that of the stated rate.

    Parameters
    ----------
    listing, layout : Listing, Layout
        The file, and what of it is read.
    groups : mapping of str to ndarray
        Samples by sensor, shape (n, axes).
    time, week : ndarray, shape (n,), or None
        Stamps, and the GPS week beside them.
    valid : ndarray of bool, shape (n,), or None
        Rows that hold numbers; None where all do.
    rate : float or None
        Rate that the user or the file states, Hz.
    options : Options
        What the user states.
    within : LogRows
        Which rows of the log they are.
    notes, bad : list
        Notes and rows without a measurement, to which this adds.

    Raises
    ------
    DataError
        Without stamps and rate, or where one contradicts the other or what a sensor can do.
    """
    axes = tuple(axis for sensor in layout.sensors for axis in sensor.axes)
    valid = without_placeholders(groups, valid, notes, bad, within=within)
    if time is None or layout.time is None:
        if rate is None and options.tried:
            rate = TRIED_RATE
        if rate is None:
            raise DataError(
                f"no time column and no rate: pass --rate HZ, or --columns t=NAME, of {offered(listing)}"
            )
        if options.rate is None and not MIN_RATE <= rate <= MAX_RATE:
            raise DataError(
                f"the file states a rate of {rate:.4g} Hz, which no inertial sensor has: pass --rate HZ"
            )
        valid = without_spikes(groups, axes, valid, notes, bad, within=within, interval=1.0 / rate)
        count = len(next(iter(groups.values())))
        return even_timebase(count, 1.0 / rate, valid, moving=options.stamps), None

    def equal(i: IntArray, j: IntArray) -> BoolArray:
        return np.asarray(np.logical_and.reduce([(b[i] == b[j]).all(axis=1) for b in groups.values()]))

    clock = _clock(listing, layout.time, time, week, rate, options)
    notes += [*clock.assumptions, *clock.notes]
    stamps, wrong = without_wrong_stamps(
        clock.stamps if clock.on is None else np.where(clock.on, clock.stamps, np.nan)
    )
    if wrong:
        clock = replace(clock, stamps=stamps)
        notes.append(
            f"{wrong} stamps did not fit between those of their neighbours: replaced by the mean of these"
        )
    usable = valid if clock.on is None else clock.on if valid is None else valid & clock.on
    usable = without_spikes(groups, axes, usable, notes, bad, within=within, interval=clock.step)
    base = _timebase(clock, usable, equal, options, notes)
    if base.change is not None and not options.stamps:
        inside = _stated_part(clock, options)
        if inside.any() and not inside.all():
            clock = replace(clock, on=inside)
            base = _timebase(clock, usable, equal, options, notes)
        if inside.any() and (change := base.change) is not None and not options.tried:
            at = stamp(change.time + clock.origin)
            said = f"the clock changes its step from {change.before:.4g} s to {change.after:.4g} s at {at} s"
            if change.factor > WRONG_FACTOR:
                raise DataError(
                    f"{said}, and white noise goes with the root of the step: pass --end {at}, or --begin {at}, or "
                    "--columns t=none --rate HZ if the sensor kept its rate"
                )
            said += f": white noise is wrong by up to {change.factor:.3g} times"
            cure = f"--end {at} or --begin {at} uses one part"
            clock = replace(clock, assumptions=(*clock.assumptions, f"{said}; {cure}"))
    _check_rate(
        clock, base.interval, str(layout.time.parts[0]), rate, notes, explicit=options.rate is not None
    )
    return base, clock


def _clock(
    listing: Listing,
    channel: Chosen,
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
    by_user = options.rate is not None or "[" in mapped
    by_type = channel.parts[0].array in listing.units
    return read_clock(
        time, name=str(channel.parts[0]), unit=unit, rate=rate, by_user=by_user, by_type=by_type
    )


def _timebase(
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


def _stated_part(clock: Clock, options: Options) -> BoolArray:
    """Return which stamps are in the part of the log that is stated."""
    begin, end = options.part
    at = clock.stamps + clock.origin
    inside: BoolArray = (at >= begin - 0.5 * clock.step) & (at < end)
    return inside if clock.on is None else inside & clock.on


def _check_rate(
    clock: Clock, interval: float, name: str, rate: float | None, notes: list[str], *, explicit: bool
) -> None:
    """Refuse stamps whose rate is far from the stated one; note a small difference."""
    if rate is None:
        return
    measured = 1.0 / interval
    if abs(measured / rate - 1.0) > RATE_TOLERANCE:
        whose = "--rate says" if explicit else "the file's meta says"
        one = interval / clock.factor
        fitting = [u for u, f in STATED_BY_RATE.items() if abs(1.0 / (one * f * rate) - 1.0) < RATE_TOLERANCE]
        raise Refusal(
            f"the stamps give {measured:.6g} Hz, {whose} {rate:.6g} Hz",
            [time_in(unit, name) for unit in fitting],
        )
    if abs(measured / rate - 1.0) > 1e-3:
        notes.append(f"the stamps give {measured:.9g} Hz, stated were {rate:.9g} Hz: the stamps are used")
