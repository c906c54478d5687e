"""The unit of time stamps that nothing states, from the median stamp and the mean step together.

A step of 10000 is 100 Hz in microseconds and nothing an inertial sensor does in seconds; a stamp of 1.7e15 beside it is
the present in microseconds since 1970. Where two units give a usual rate, the log is refused: a step of 1 is 1 Hz in
seconds and 1 kHz in milliseconds. Which of them is left, the samples may tell (`tuner.readers.readings`).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tuner.limits import MAX_RATE, MIN_RATE
from tuner.readers.column_names import TIME_UNITS, UNITS_BY_NAME, parse_name, without_unit
from tuner.readers.refusal import EVEN, Change, Refusal

USUAL_RATES = (20.0, 4000.0)
"""Rates of inertial sensors, Hz, of which at most one unit of the table gives one: they are 1000 apart."""
POSSIBLE_RATES = (1.0, 2e4)
"""Rates, Hz, beyond which another unit of time is offered: a factor of five and more from the usual ones."""
LONGEST_SPAN = 366 * 86400.0
"""The longest span of a log, s."""
SINCE_1970 = (20 * 365.25 * 86400.0, 130 * 365.25 * 86400.0)
"""1990 to 2100, s since 1970."""
CANDIDATES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ticks of 0.1 ms": 1e-4}
"""Units of stamps, s."""
STATED_BY_RATE = CANDIDATES | {"min": 60.0, "h": 3600.0, "days": 86400.0}
"""Units that a stated rate tells apart, s."""
DAY_NUMBERS = {"Excel": (3.2e4, 7.3e4), "MATLAB": (7.26e5, 7.67e5)}
"""Numbers of days of the years 1988 to 2100 in two programs."""
RATE_TOLERANCE = 0.05
"""Relative difference between a stated rate and that of the stamps within which it tells their unit."""


def unit_of_stamps(
    time: NDArray[np.float64] | NDArray[np.int64], step: float, *, name: str, rate: float | None
) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """Return seconds in one unit of stamps with a mean step, with notes and assumptions on it.

    Raises
    ------
    Refusal
        Where two units are possible: with the rate in each.
    """
    middle = float(np.median(time))
    if step <= 0.0:
        return 1.0, (), ()
    if rate is not None:
        fitting = {
            u: f for u, f in STATED_BY_RATE.items() if abs(1.0 / (step * f * rate) - 1.0) < RATE_TOLERANCE
        }
        if fitting:
            unit, factor = next(iter(fitting.items()))
            note = f"time in {unit}, in which the stamps have the stated rate of {rate:.6g} Hz"
            return factor, () if unit == "s" else (note,), ()
        if _counts(time, step):
            counted = f"time column '{name}' counts samples: taken as {rate:.6g} Hz, as stated"
            return 1.0 / rate, (counted,), ()
        return 1.0, (), ()  # the caller compares the rates
    if makers := UNITS_BY_NAME.get(parse_name(name).plain):
        fitting = {u: TIME_UNITS[u] for u in makers if _usual(step * TIME_UNITS[u])}
        if len(fitting) == 1:
            ((unit, factor),) = fitting.items()
            return factor, (), (f"time in {unit}, as its maker counts: {1.0 / (step * factor):.6g} Hz",)
    for program, (low, high) in DAY_NUMBERS.items():
        if low < middle < high and _usual(86400.0 * step):
            return 86400.0, (f"time in days, as {program} numbers them",), ()
    usual = [unit for unit, factor in CANDIDATES.items() if _usual(step * factor)]
    possible = [unit for unit, factor in CANDIDATES.items() if MIN_RATE <= 1.0 / (step * factor) <= MAX_RATE]
    present = [u for u in possible if SINCE_1970[0] < abs(middle) * CANDIDATES[u] < SINCE_1970[1]]
    present = [u for u in present if u != "ticks of 0.1 ms"]
    if present and (present[0] in usual or not usual):
        unit = present[0]
        return CANDIDATES[unit], () if unit == "s" else (f"time in {unit} (stamps since 1970)",), ()
    if not present and "s" in possible and ("s" in usual or (not usual and 1.0 / step < USUAL_RATES[1])):
        if "s" in usual and _usual(60.0 * step):
            return 1.0, (), (f"time in s assumed: {1.0 / step:.6g} Hz; in min it would be 60 times slower",)
        return 1.0, (), ()
    if not present and len(usual) == 1 and "s" not in possible:
        unit = usual[0]
        text = f"time in {unit} assumed, as nothing states it: {1.0 / (step * CANDIDATES[unit]):.6g} Hz"
        return CANDIDATES[unit], (), (text,)
    longer = [u for u in ("min", "h") if _usual(step * STATED_BY_RATE[u])]
    rates = {u: 1.0 / (step * STATED_BY_RATE[u]) for u in dict.fromkeys([*usual, *longer, *possible])}
    shown = ", ".join(f"{hz:.4g} Hz in {u}" for u, hz in rates.items()) or f"a mean step of {step:.4g}"
    by_one = _counts(time, step)
    known = other_units(name, step, middle, rates)
    counts = "it counts by one, as a counter of samples does; " if by_one else ""
    raise Refusal(
        f"time column '{name}': nothing states its unit, and it stays open: {counts}{shown}",
        [Change(requested="rate"), *known] if by_one else [*known, EVEN],
    )


def other_units(name: str, step: float, middle: float, among: Iterable[str] = CANDIDATES) -> list[Change]:
    """Return the readings of stamps, of a mean step and a median, in units in which sensors and the calendar go on."""
    fitting = [
        unit
        for unit in among
        if POSSIBLE_RATES[0] <= 1.0 / (step * STATED_BY_RATE.get(unit, 1e-4)) <= POSSIBLE_RATES[1]
        and abs(middle) * STATED_BY_RATE.get(unit, 1e-4) < SINCE_1970[1]
    ]
    usual = [unit for unit in fitting if _usual(step * STATED_BY_RATE.get(unit, 1e-4))]
    return [time_in(unit, name) for unit in usual or fitting]


def time_in(unit: str, name: str) -> Change:
    """Return the reading of a time column in a unit."""
    return Change(columns={"t": f"{without_unit(name)} [{unit.removeprefix('ticks of ')}]"})


def is_unusual(unit: str, step: float) -> bool:
    """Return whether a stated unit gives a rate few logs have, where another gives a usual one."""
    rate = 1.0 / (step * STATED_BY_RATE.get(unit, CANDIDATES["ticks of 0.1 ms"])) if step > 0.0 else 1.0
    unusual = not POSSIBLE_RATES[0] <= rate <= POSSIBLE_RATES[1]
    return unusual and any(_usual(step * factor) for factor in CANDIDATES.values())


def about_rare_rate(unit: str, interval: float) -> list[str]:
    """Return what is said of a stated unit whose rate is not a usual one, where that of another unit is."""
    if interval <= 0.0 or _usual(interval):
        return []
    usual = {u: interval / STATED_BY_RATE[unit] * f for u, f in STATED_BY_RATE.items() if u != unit}
    shown = " or ".join(f"{1.0 / step:.4g} Hz in {u}" for u, step in usual.items() if _usual(step))
    rate = 1.0 / interval
    return [f"time in {unit}, as the file states: {rate:.4g} Hz, where {shown} is usual"] if shown else []


def _counts(time: NDArray[np.float64] | NDArray[np.int64], step: float) -> bool:
    """Return whether stamps count samples: whole numbers, one after the other but for lost ones."""
    return float(np.median(np.diff(time))) == 1.0 and step < 1.1 and bool(np.all(np.mod(time, 1) == 0))


def _usual(step: float) -> bool:
    return USUAL_RATES[0] <= 1.0 / step <= USUAL_RATES[1]
