"""The time column of a log as seconds: which stamps are on the clock, in which format and unit they are.

A clock is read in four steps, each with a note: stamps from before the clock was set are left out; a counter or a
week that wrapped around is continued; clock times such as HHMMSSmmm become seconds; and the unit, where nothing states
it, follows from the median stamp and the mean step together (`tuner.readers.clock_unit`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import BoolArray, FloatArray
from tuner.limits import MAX_RATE, MIN_RATE
from tuner.readers import column_names as names
from tuner.readers.clock_unit import (
    CANDIDATES,
    LONGEST_SPAN,
    USUAL_RATES,
    about_rare_rate,
    is_unusual,
    other_units,
    time_in,
    unit_of_stamps,
)
from tuner.readers.refusal import EVEN, Refusal
from tuner.readers.timestamps import MAX_DISORDERED_SHARE
from tuner.types.records import DataError

Stamps = NDArray[np.float64] | NDArray[np.int64]

UNSET = (0.0, -1.0, float(2**31 - 1), float(2**32 - 1), float(2**63), -float(2**63), float(2**64))
"""Stamps that loggers write before they know the time: zero, minus one, the largest numbers of integer types."""
MAX_STAMP = 1e25
"""Stamp, in any unit, that is no time: nanoseconds of the age of the universe."""
NEAR_STEPS = 1000.0
"""Steps up to which a stamp of zero or minus one belongs to a clock that begins there."""
MAX_STRAY_SHARE = 0.1
"""Share of stamps a year or more from the others up to which they are left out: more is another clock."""
WRAPS = (
    *(2.0**bits for bits in (16, 24, 31, 32)),
    *(span * unit for span in (3600.0, 86400.0, 604800.0) for unit in (1.0, 1e3, 1e6, 1e9)),
)
"""Where clocks begin anew: counters of few bits, the hour, the day and the GPS week, in s, ms, µs and ns."""
SINGLE_STAMPS = 2048
"""Stamps at both ends in which single precision is looked for."""
MIN_SINGLE_SHARE = 0.01
"""Rounding ÷ step, and share of uneven steps, from which single precision shows."""
WRAP_STEPS = 100.0
"""Steps that may be lost where a clock begins anew."""
CLOCK_SCALES = (1.0, 1e3, 1e6)
"""Units of the last digit of a clock time HHMMSS…, in 1 s: 1, ms, µs."""


@dataclass(frozen=True)
class Clock:
    """The stamps of a log.

    Attributes
    ----------
    origin : float
        Time of the first stamp, s, on the clock of the file.
    stamps : ndarray, shape (n,)
        Seconds since the origin; no meaning where `on` is False.
    on : ndarray of bool, shape (n,), or None
        Which stamps are on the clock; None where all are.
    step : float
        Mean step of the stamps, s, gaps apart.
    resolution : float
        To which stamps of single precision are rounded, s; 0 where that does not show.
    notes, assumptions : tuple of str
        What was done, and what nobody states.
    factor : float
        Seconds in one unit of the stamps in the file.
    """

    origin: float
    stamps: FloatArray
    on: BoolArray | None
    step: float
    resolution: float
    notes: tuple[str, ...]
    assumptions: tuple[str, ...]
    factor: float = 1.0


def read_clock(
    time: Stamps,
    *,
    name: str,
    unit: str | None,
    rate: float | None,
    by_user: bool = False,
    by_type: bool = False,
) -> Clock:
    """Return the clock of a time column.

    Parameters
    ----------
    time : ndarray, shape (n,)
        As the file has it.
    name : str
        Of the column, for messages.
    unit : str, optional
        As the file or the user states it.
    rate : float, optional
        Sampling rate that is stated, Hz.
    by_user : bool, optional
        Whether the user states the unit or the rate: then any rate and span is possible.
    by_type : bool, optional
        Whether the file states the unit otherwise than by the name of the column.

    Raises
    ------
    DataError
        No stamps, a unit that stays open, a rate or a span that no log has.
    """
    finite = np.isfinite(time)
    if not finite.any():
        raise DataError(f"time column '{name}' holds no number")
    notes: list[str] = []
    assumptions: list[str] = []
    on = finite & _set(time, finite)
    if (unset := int(np.count_nonzero(finite & ~on))) > 0:
        notes.append(
            f"{unset} rows with stamps from before the clock was set (0, -1 or no time) were left out"
        )
    usual = _usual_step(np.diff(_only(time, on)))
    time = _continued(time, on, usual, notes)
    factor = _stated_factor(unit, name)
    if factor is None or factor == 1.0:
        decoded = _clock_time(time, on, usual)
        if decoded is not None:
            time, how = decoded
            time = _continued(time, on, _usual_step(np.diff(_only(time, on))), notes)
            factor = 1.0
            notes.append(f"time column '{name}': clock times {how} were read as seconds of the day")
    clock = _only(time, on)
    back = np.count_nonzero(np.diff(clock) < 0.0) / len(clock)
    if back > MAX_DISORDERED_SHARE:
        raise DataError(
            f"time column '{name}': {100.0 * back:.0f} % of its steps go back: sort the rows by time, or choose "
            "another column"
        )
    step = _mean_step(clock)
    if factor is None:
        factor, said, taken = unit_of_stamps(clock, step, name=name, rate=rate)
        notes += said
        assumptions += taken
    elif unit is not None and rate is None and not (by_user or by_type):
        stated = names.unit_of(unit, names.TIME_UNITS, what=name)
        changes = other_units(name, step, float(np.median(clock))) if is_unusual(stated, step) else []
        if changes:
            rare = MIN_RATE <= 1.0 / (step * factor) < USUAL_RATES[0]  # means over seconds
            judged = "a rate that few inertial sensors have" if rare else "no rate of an inertial sensor"
            raise Refusal(
                f"time column '{name}': {1.0 / (step * factor):.4g} Hz in {stated}, as the file states, is {judged}",
                [*changes, *([time_in(stated, name), EVEN] if rare else [])],
            )
        assumptions += about_rare_rate(stated, step * factor)
    first = clock[0]
    resolution = factor * _single_precision(clock, step, name, notes, factor)
    relative: FloatArray = np.subtract(time, first).astype(float, copy=False)
    if factor != 1.0:
        relative *= factor
    on = _without_strays(relative, on, notes)
    start = float(_only(relative, on)[0])
    relative -= start
    origin = float(first) * factor + start
    clock = _only(relative, on)
    step = _mean_step(clock)
    if not by_user:
        _check(clock, step, name, factor, origin)
    return Clock(
        origin,
        relative,
        None if on.all() else on,
        step,
        resolution,
        tuple(notes),
        tuple(assumptions),
        factor,
    )


def _only(time: Stamps, on: BoolArray) -> Stamps:
    """Return the stamps on the clock: the array itself where all are."""
    return time if on.all() else time[on]


def _stated_factor(unit: str | None, name: str) -> float | None:
    if unit is None:
        return None
    number, _, of = unit.partition(" ")
    if of in names.TIME_UNITS and names.known_unit(unit) is None:  # the size of a tick: 0.0018 s
        with suppress(ValueError):
            return float(number) * names.TIME_UNITS[of]
    return names.TIME_UNITS[names.unit_of(unit, names.TIME_UNITS, what=f"time column '{name}'")]


def _set(time: Stamps, finite: BoolArray) -> BoolArray:
    """Return which stamps are not those of a clock before it is set."""
    huge = np.abs(time) > MAX_STAMP
    marked: BoolArray = huge | np.isin(time, UNSET)
    if not marked.any():
        return ~marked
    others = time[finite & ~marked]
    if len(others) < 3:
        return ~huge
    near = NEAR_STEPS * _usual_step(np.diff(others))
    for value in np.unique(time[marked & ~huge]):
        if float(np.abs(others - value).min()) <= near:
            marked &= time != value
    return ~marked


def _usual_step(step: Stamps) -> float:
    """Return the median of the steps forward; 0 where there are none."""
    forward = step[step > 0]
    return float(np.median(forward)) if len(forward) else 0.0


def _mean_step(time: Stamps) -> float:
    """Return the mean step without gaps and steps back; stamps that repeat count as steps of nothing."""
    step = np.diff(time)
    usual = _usual_step(step)
    inner = step[(step >= 0) & (step <= 10.0 * usual)].astype(float)
    return float(np.mean(inner)) if len(inner) else usual


def _continued(time: Stamps, on: BoolArray, usual: float, notes: list[str]) -> Stamps:
    """Return stamps whose clock wrapped around, continued."""
    rows = np.flatnonzero(on)
    step = np.diff(time[rows]).astype(float)
    back = np.flatnonzero(step < -WRAP_STEPS * usual)
    if not len(back) or usual <= 0.0:
        return time
    for wrap in WRAPS:
        if np.all((step[back] + wrap >= 0.0) & (step[back] + wrap <= WRAP_STEPS * usual)):
            break
    else:
        return time
    whole = time.dtype.kind == "i" and wrap == int(wrap)
    turns = np.zeros(len(time), np.int64)
    turns[rows[back + 1]] = 1
    notes.append(
        f"the clock began anew {len(back)} times, each {wrap:.10g} of its units later, and was continued"
    )
    turned = np.cumsum(turns)
    return time + turned * int(wrap) if whole else time + turned * wrap


def _clock_time(time: Stamps, on: BoolArray, usual: float) -> tuple[FloatArray, str] | None:
    """Return clock times such as 123459.99 (HHMMSS) as seconds of the day; None where the stamps are none.

    Only at the end of a minute do they differ from plain numbers: there they jump by 40 more, of an hour by 4040.
    """
    rows = np.flatnonzero(on)
    some = time[rows]
    low, high = float(some.min()), float(some.max())
    for scale in CLOCK_SCALES:
        if low < 0.0 or high >= 240000.0 * scale or low // (100.0 * scale) == high // (100.0 * scale):
            continue
        if np.remainder(some, 100 * int(scale)).max() >= 60.0 * scale:
            continue
        minutes = np.floor_divide(some, 100 * int(scale))
        if np.remainder(minutes, 100).max() >= 60:
            continue
        hours = np.floor_divide(minutes, 100)
        turn = np.flatnonzero(np.diff(60 * hours + np.remainder(minutes, 100)) == 1)
        more = np.diff(some)[turn] - scale * np.where(np.diff(hours)[turn] == 1, 4040.0, 40.0)
        if not len(turn) or np.any(more < 0.0) or np.any(more > WRAP_STEPS * usual):
            continue
        minute = np.floor_divide(time, 100 * int(scale))
        hour = np.floor_divide(minute, 100)
        day = 3600.0 * hour + 60.0 * (minute - 100 * hour) + np.remainder(time, 100 * int(scale)) / scale
        return np.asarray(day, float), {1.0: "HHMMSS", 1e3: "HHMMSSmmm", 1e6: "HHMMSSuuuuuu"}[scale]
    return None


def _single_precision(time: Stamps, mean_step: float, name: str, notes: list[str], factor: float) -> float:
    """Return to what stamps of single precision are rounded, in their unit; 0 where it is fine or they are none.

    A text has them with their shortest digits. Stamps on a decimal grid coarser than that rounding are exact: where
    their steps are uneven, samples are missing.
    """
    if time.dtype.kind != "f" or len(time) < 3:
        return 0.0
    last = float(np.spacing(np.float32(np.abs(time).max())))
    some = np.concatenate([time[:SINGLE_STAMPS], time[-SINGLE_STAMPS:]])
    single = some.astype(np.float32)
    if not np.array_equal(single, some) and not np.array_equal(single.astype(str).astype(float), some):
        return 0.0
    if last < MIN_SINGLE_SHARE * mean_step:
        return 0.0
    unit = 10.0 ** np.ceil(np.log10(2.0 * last))
    if np.abs(some / unit - np.rint(some / unit)).max() < 1e-3:
        return 0.0
    step = np.diff(time)
    if np.mean(np.abs(step - np.median(step)) > 0.25 * last) < MIN_SINGLE_SHARE:
        return 0.0
    notes.append(
        f"time column '{name}' has single precision: its stamps are rounded to {last * factor:.4g} s"
    )
    return last


def _without_strays(relative: FloatArray, on: BoolArray, notes: list[str]) -> BoolArray:
    """Return which stamps are within a year of the others, where few are not."""
    off = on & (np.abs(relative - np.median(relative[on])) > LONGEST_SPAN)
    count = int(np.count_nonzero(off))
    if not count or count > MAX_STRAY_SHARE * np.count_nonzero(on):
        return on
    notes.append(f"{count} rows with stamps more than a year from the others were left out")
    return on & ~off


def _check(relative: Stamps, step: float, name: str, factor: float, origin: float) -> None:
    """Refuse a rate and a span that no log of an inertial sensor has."""
    others = [u for u in CANDIDATES if CANDIDATES[u] != factor]
    changes = other_units(name, step / factor, origin / factor, others) if step > 0.0 else []
    if step > 0.0 and not MIN_RATE <= 1.0 / step <= MAX_RATE:
        raise Refusal(f"time column '{name}': {1.0 / step:.4g} Hz is no rate of an inertial sensor", changes)
    span = float(relative.max() - relative.min())
    if span > LONGEST_SPAN:
        years = f"{span / LONGEST_SPAN:.3g} years"
        raise Refusal(
            f"time column '{name}': the log spans {years}: a jump of the clock, or another unit", changes
        )
