"""What is taken out of the stamps of a drive: the simplest clock that its motion does not refute."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.probability import fisher_beyond
from tuner.formats.customary_units import amount
from tuner.navigation.data import Steps
from tuner.navigation.drive.clock_mismatch import refuse_distant_clocks
from tuner.navigation.drive.clock_offset import (
    FALSE_OFFSET_PROBABILITY,
    MAX_CLOCK_OFFSET,
    ClockOffset,
    estimate_clock_offset,
)
from tuner.navigation.drive.clock_regression import DELAYS
from tuner.types import Coefficient, Compensation
from tuner.types.records import Drive


@dataclass(frozen=True)
class Clock:
    """What is taken out of the stamps of a drive, s.

    Attributes
    ----------
    delay, lag : float
        Delay of the fixes, and of their velocities behind their positions.
    delay_interval, lag_interval : tuple of 2 floats
        At 95 %.
    delay_sd : float
        Sd of the delay; 0 where none is taken out.
    note : str
        The same in words, empty where nothing is known.
    """

    delay: float = 0.0
    lag: float = 0.0
    delay_interval: tuple[float, float] = (0.0, 0.0)
    lag_interval: tuple[float, float] = (0.0, 0.0)
    delay_sd: float = 0.0
    note: str = ""


AGREEING = Clock()
"""Clocks that agree."""


def clock_of_drive(drive: Drive, *, lag: float = 0.0) -> Clock:
    """Return what the motion of a drive says of its clocks: nothing is taken out that is not significant.

    Parameters
    ----------
    drive : Drive
        As read.
    lag : float
        How much its velocities are known to be later than its positions, s: what is found is beside it.

    Raises
    ------
    DataError
        Where they differ by more than is searched.
    """
    dt = np.diff(drive.imu_t)
    steps = Steps(float(drive.imu_t[0]), dt, drive.rates[1:] * dt[:, None])
    arm = None if drive.lever_arm is None else np.array(drive.lever_arm)
    if arm is not None and drive.mounting is not None:
        arm = drive.mounting @ arm
    elif arm is not None and arm.any():  # in axes of a vehicle that nobody knows
        arm = None
    refuse_distant_clocks(drive)
    found = estimate_clock_offset(steps, drive.gnss, None if arm is None else arm.tolist())
    return AGREEING if found is None else chosen_clock(found.beside_lag(lag) if lag else found)


def clock_left(measured: Clock, compensation: Compensation) -> Clock | None:
    """Return what a clock that was measured before leaves beside settings made from it; None where others made them."""
    stated = compensation.value("time_offset", "delay"), compensation.value("velocity_lag", "delay")
    if not any(stated):
        return measured
    return _with_words(AGREEING, compensation) if stated == (measured.delay, measured.lag) else None


def remaining_clock(drive: Drive, compensation: Compensation) -> Clock:
    """Return what the motion says of the clocks of a drive beside a delay and a lag that its settings state.

    Parameters
    ----------
    drive : Drive
        With the compensation taken out, but for the lag of its velocities: the filter takes that out of each fix.
    compensation : Compensation
        Of the settings.

    Raises
    ------
    DataError
        Where the clocks differ by more than is searched.
    """
    lag = compensation.value("velocity_lag", "delay")
    return _with_words(clock_of_drive(drive, lag=lag), compensation)


def _with_words(clock: Clock, compensation: Compensation) -> Clock:
    """Return the clock that remains, with words for what the settings take out before."""
    applied = {
        "of the fixes": compensation.value("time_offset", "delay"),
        "of velocities behind positions": compensation.value("velocity_lag", "delay"),
    }
    parts = [f"{value:+.3f} s {whose}" for whose, value in applied.items() if value]
    if not parts:
        return clock
    left = f"; of what remains: {clock.note}" if clock.note else ""
    return replace(
        clock, note=f"a delay of {' and '.join(parts)}, stated in the settings, is taken out{left}"
    )


def chosen_clock(found: ClockOffset) -> Clock:
    """Return the simplest clock that a measurement does not refute: none, one delay, a lag of the velocities, both."""
    if found.at_bound:
        text = f"the clocks of fixes and inertial unit differ by {MAX_CLOCK_OFFSET:g} s or more, or cannot be compared"
        return Clock(note=f"{text}: nothing is taken out")
    which = np.flatnonzero(np.isfinite(found.delay))
    d, c = found.delay[which], found.covariance[np.ix_(which, which)]
    if not found.significant:
        parts = [
            f"{DELAYS[i]} stamps {_interval_text(found.delay[i], found.quantile() * found.sd[i])}"
            for i in which
        ]
        return Clock(
            note=f"no offset of the clocks is taken out, as chance may make it: {', '.join(parts)} late"
        )
    common, late_velocities = [[1.0, 1.0]], [[0.0, 1.0]]
    models = [common, late_velocities, common + late_velocities] if len(which) == 2 else [[[1.0]]]
    for rows in models:
        design = np.array(rows).T
        covariance = np.linalg.inv(design.T @ np.linalg.solve(c, design))
        value = covariance @ design.T @ np.linalg.solve(c, d)
        left, more = d - design @ value, len(d) - design.shape[1]
        statistic = float(left @ np.linalg.solve(c, left))
        if not more or fisher_beyond(statistic / more, more, found.freedom) > FALSE_OFFSET_PROBABILITY:
            break
    names = (
        ("delay",)
        if len(which) == 1 or rows == models[0]
        else ("lag",)
        if rows == models[1]
        else ("delay", "lag")
    )
    sds = np.sqrt(np.diag(covariance))
    half = found.quantile() * sds
    values = dict(zip(names, zip(value.tolist(), half.tolist(), sds.tolist(), strict=True), strict=True))
    delay, delay_half, delay_sd = values.get("delay", (0.0, 0.0, 0.0))
    lag, lag_half, _ = values.get("lag", (0.0, 0.0, 0.0))
    ends = (delay - delay_half, delay + delay_half), (lag - lag_half, lag + lag_half)
    clock = Clock(delay, lag, *ends, delay_sd)
    return replace(clock, note=f"{clock_words(clock)}, as the motion shows: taken out of this run")


def clock_words(clock: Clock) -> str:
    """Return the delay of the fixes, and that of their velocities against the positions; empty without any."""
    late = amount(Coefficient(abs(clock.delay), _sizes(clock.delay_interval), None, "s"))
    later = amount(Coefficient(abs(clock.lag), _sizes(clock.lag_interval), None, "s"))
    parts = {
        f"fixes are stamped {late} {'late' if clock.delay > 0.0 else 'early'}": clock.delay,
        f"velocities are {later} {'later' if clock.lag > 0.0 else 'earlier'} than positions": clock.lag,
    }
    return ", ".join(text for text, value in parts.items() if value)


def _sizes(interval: tuple[float, float]) -> tuple[float, float]:
    return min(map(abs, interval)), max(map(abs, interval))


def _interval_text(value: float, half: float) -> str:
    return f"{value:+.3f} ({value - half:+.3f} … {value + half:+.3f}) s"
