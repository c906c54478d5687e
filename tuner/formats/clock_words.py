"""Delays of a drive's fixes and velocities in words."""

from __future__ import annotations

import math

from tuner.formats.customary_units import amount, digits
from tuner.types import Coefficient, Compensation
from tuner.types.clock import Clock, Delay


def clock_words(clock: Clock) -> str:
    """Return the delay of the fixes and the lag of their velocities; empty where neither is certain."""
    lag = clock.lag
    parts = {
        f"fixes are stamped {late_words(clock)}": clock.delay.certain or clock.drift.certain,
        f"velocities are {_size(lag)} {'later' if lag.value > 0.0 else 'earlier'} than positions": lag.certain,
    }
    return ", ".join(text for text, certain in parts.items() if certain)


def late_words(clock: Clock) -> str:
    """Return how late the fixes are: once, or of the first and of the last where their clock drifts."""
    said = (
        f"{_size(one)} {'late' if one.value > 0.0 else 'early'}{when}" for when, one in clock.delays.items()
    )
    return " and ".join(said)


def clock_note(clock: Clock) -> str:
    """Return what is taken out of the stamps of a drive, or that nothing is; empty where the drive does not show it."""
    if text := clock_words(clock):
        return f"{text}, as the motion shows: taken out of this run"
    if not math.isfinite(clock.delay.sd):
        return ""
    low, high = clock.delay.interval
    no = "no further" if clock.further else "no"
    return f"{no} delay of the fixes is taken out, as chance may make it: {low:+.3f} … {high:+.3f} s late"


def stated_words(compensation: Compensation) -> str:
    """Return the delays that settings state and that are taken out; empty without any."""
    stated = {
        "of the fixes": compensation.value("time_offset", "delay"),
        "of velocities behind positions": compensation.value("velocity_lag", "delay"),
    }
    parts = [f"{value:+.3f} s {whose}" for whose, value in stated.items() if value]
    return f"a delay of {' and '.join(parts)}, stated in the settings, is taken out" if parts else ""


def _size(delay: Delay) -> str:
    if not delay.sd:
        return f"{digits(abs(delay.value), 2)} s"  # of settings, which have no interval
    low, high = sorted(map(abs, delay.interval))
    return amount(Coefficient(abs(delay.value), (low, high), None, "s"))
